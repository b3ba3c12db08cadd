# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`export_gis`: a mission as files for geographic information systems, without ROS."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dsse_ros.base.fields import FieldError
from dsse_ros.base.whole_files import whole_file, write_whole
from dsse_ros.cli.command_line import Parser, make_folder, options_of, search_of
from dsse_ros.cli.mission_file import FILE_HELP, add_mission_file, choose, pictures, read
from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.run.mission import Mission
from dsse_ros.planners.play import play
from dsse_ros.planners.registry import planner_for
from dsse_ros.results.report.geotiff import write_geotiff
from dsse_ros.results.report.gis import GisMission, gis_mission
from dsse_ros.results.report.gpx import gpx_text
from dsse_ros.results.report.kml import kml_text
from dsse_ros.results.report.recomputed import forecast_for
from dsse_ros.results.report.record import chosen_steps
from dsse_ros.ros.runtime.exit_codes import fail
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.scenario import scenario_frame

MAPS = 2
"""The start and the end of the mission."""


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the command line's arguments."""
    parser = Parser(
        prog="export_gis",
        description="Write a mission as GeoTIFF, KML and GPX: a recorded one or, without a file, "
        "a search by a planner.",
    )
    parser.add("file", type=Path, nargs="?", help=FILE_HELP)
    add_mission_file(parser)
    parser.add_search(None)
    parser.add("--out", type=Path, default=Path("gis"), help="folder of the files")
    return parser.parse_with_ros(argv, {})


def record_search(arguments: argparse.Namespace, path: Path) -> None:
    """Search until the end, and log each step like `sim_node`.

    Raises:
        FieldError: If scenario, rules or planner are not allowed, or the file cannot be written.
    """
    _, scenario, rules = search_of(arguments)
    env, seed = SearchEnv(scenario, rules), arguments.seed
    # The mission repeats the actions: the same seed gives the same search.
    mission = Mission(SearchEnv(scenario, rules), seed, belief=False)
    policy = planner_for(env, arguments.planner, seed=seed, **options_of(arguments))
    log = MissionLog(
        path, scenario_frame(env.scenario), covers=rules.covers,
        faults=mission.result.conditions is not None, metres=rules.in_metres,
    )  # fmt: skip
    log.write(mission, mission.result)
    for step in play(env, policy, seed=seed):
        none: Any = None if rules.in_metres else NO_ACTION
        actions: Mapping[str, Any] = step.actions
        mission.command_all([actions.get(name, none) for name in env.possible_agents])
        log.write(mission, mission.advance("hold"))
    log.close()


def write_files(folder: Path, mission: GisMission) -> list[Path]:
    """Write all files of a mission; returns their paths.

    Raises:
        OSError: If a file cannot be written.
    """
    kml, gpx = folder / "mission.kml", folder / "tracks.gpx"
    pods = {f"POD after step {m.step}": m.pod for m in mission.maps if m.pod is not None}
    rasters = {
        folder / "poc.tif": {f"POC after step {m.step}": m.poc for m in mission.maps},
        **({folder / "pod.tif": pods} if pods else {}),
    }
    for path, bands in rasters.items():
        with whole_file(path) as part:
            write_geotiff(part, mission.frame, bands)
    write_whole(kml, kml_text(mission).encode())
    write_whole(gpx, gpx_text(mission.tracks, mission.places).encode())
    return [*rasters, kml, gpx]


def main(argv: list[str] | None = None) -> int:
    """Write the files; returns the exit code, 2 for bad input."""
    arguments = parse(argv)
    try:
        make_folder("out", arguments.out)
        if arguments.file is None:
            arguments.file = arguments.out / "mission.csv"
            record_search(arguments, arguments.file)
            arguments.scenario = None
        missions, bag = read(arguments)
        record = choose(missions, arguments.mission)
        wanted = chosen_steps(record, arguments.steps or (), MAPS)
        shown = pictures(record, wanted, forecast_for(record, None), bag)
    except FieldError as error:
        return fail("export_gis", error)
    try:
        written = write_files(arguments.out, gis_mission(record, shown))
    except OSError as error:
        name = error.filename or str(arguments.out)
        return fail("export_gis", f"out: {name!r}: {error.strerror}")
    print("\n".join(map(str, written)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
