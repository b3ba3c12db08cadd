# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`export_mission`: a search or a search pattern as mission files, without ROS."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, Spec, specs
from dsse_ros.base.whole_files import write_whole
from dsse_ros.cli.command_line import Parser, options_of, place, search_of
from dsse_ros.cli.mission_file import FILE_HELP, add_choice, choose, read
from dsse_ros.cli.pattern_mission import PatternMission, add_pattern, check_no_pattern
from dsse_ros.planners.play import play
from dsse_ros.planners.registry import planner_for
from dsse_ros.ros.runtime.exit_codes import fail
from dsse_ros.search.environments.compiler import prepared_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.vehicles.fleet.vehicle_missions import (
    FlightSettings,
    layers,
    search_missions,
    write_missions,
)
from dsse_ros.vehicles.mission_items.items import Home
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import map_to_geodetic
from dsse_ros.world.scenario.place_checks import LAT, LON, check_near
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame

LENGTHS = ("acceptance_radius", "search_altitude", "search_hold", "altitude_step")
MAX_ALT_M = 100_000.0
"""Highest home."""
OPTIONS = ("autopilot", "merge_legs", *LENGTHS)
"""Parameters of the flight that are options of the same name."""


def search(
    env: SearchEnv, planner: str, seed: int, options: Mapping[str, Any]
) -> tuple[NDArray[np.int64], NDArray[np.bool_], bool]:
    """Search until the end.

    Returns:
        (K, N, 2) cells after each step and before the first, (K, N) flags of their searches,
        and whether everybody was found.
    """
    env.reset(seed=seed)
    policy = planner_for(env, planner, seed=seed, **options)
    numbers = {name: i for i, name in enumerate(env.possible_agents)}
    cells = [env.positions]
    searched = [np.zeros(len(numbers), bool)]
    found = False
    for step in play(env, policy, seed=seed):
        flags = np.zeros(len(numbers), bool)
        for name, action in step.actions.items():
            flags[numbers[name]] = action == env.rules.action_set.search
        cells.append(env.positions)
        searched.append(flags)
        found = any(info["Found"] for info in step.infos.values())
    return np.array(cells), np.array(searched), found


def searched_cells(
    arguments: argparse.Namespace,
) -> tuple[ResolvedScenario, NDArray[np.int64], NDArray[np.bool_], bool]:
    """Return the scenario and what `search` returns, of the recorded mission if there is one.

    Raises:
        FieldError: If the file, the scenario or the planner is not allowed.
        ImportError: If the file is a bag, and the extra `record` is not installed.
    """
    if arguments.file is not None:
        missions, _ = read(arguments)
        record = choose(missions, arguments.mission)
        found = bool(record.found.any())
        return record.scenario, record.cells, record.searched, found
    _, scenario, rules = search_of(arguments)
    env = prepared_env(scenario, rules)
    played = search(env, arguments.planner, arguments.seed, options_of(arguments))
    return env.scenario, *played


def _home(text: str) -> Home:
    """Return the home of an option LAT,LON,ALT.

    Raises:
        FieldError: If the value is not LAT,LON,ALT.
    """
    lat_lon, _, alt = text.rpartition(",")
    try:
        lat_deg, lon_deg = place("home", lat_lon)
        alt_m = Spec("float", "", low=-MAX_ALT_M, high=MAX_ALT_M).check("home", float(alt))
    except ValueError:
        raise FieldError(
            f"home must be LAT,LON,ALT up to {LAT.high:g} and {LON.high:g} degrees and "
            f"{MAX_ALT_M:g} m, got {text!r}"
        ) from None
    # Autopilots have no longitudes beyond the antimeridian.
    return Home(lat_deg, lon_deg - 360 * round(lon_deg / 360), alt_m)


def _check_home(home: Home | None, frame: GridFrame) -> None:
    """Check that a home, if there is one, is near the grid."""
    if home is not None:
        width_m, height_m = frame.extent
        middle = map_to_geodetic(frame, width_m / 2, height_m / 2, 0.0)[:2]
        check_near("home", (home.lat_deg, home.lon_deg), middle, within_m=max(frame.extent) / 2)


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the command line's arguments."""
    parser = Parser(
        prog="export_mission",
        description="Write each drone's track as mission files: of a recorded mission or, without "
        "a file, of a search by a planner; or write a search pattern for one vehicle.",
    )
    of_flight = specs(FlightSettings)
    defaults = FlightSettings()
    parser.add("file", type=Path, nargs="?", help=FILE_HELP)
    add_choice(parser)
    parser.add_search(None)
    add = parser.add
    add("--out", type=Path, default=Path("missions"), help="folder of the files")
    add(
        "--home",
        metavar="LAT,LON,ALT",
        help="where all take off, by default where each starts",
    )
    add("--autopilot", default=defaults.autopilot, choices=of_flight["autopilot"].choices,
        help="autopilot that the missions are for")  # fmt: skip
    add("--gpx", action="store_true", help="also write missions.gpx, the missions as routes")
    add("--every-cell", dest="merge_legs", action="store_false",
        help="put a waypoint in each cell of a straight leg")  # fmt: skip
    for name in LENGTHS:
        spec = of_flight[name]
        add(f"--{name.replace('_', '-')}", type=float, default=getattr(defaults, name),
            help=f"{spec.doc.rstrip('.')}, {spec.unit}")  # fmt: skip
    add_pattern(parser)
    return parser.parse_with_ros(argv, {name: (name, of_flight[name]) for name in OPTIONS})


def main(argv: list[str] | None = None) -> int:
    """Write the files; returns the exit code, 2 for bad input."""
    arguments = parse(argv)
    try:
        if arguments.gpx:
            # It needs an extra.
            from dsse_ros.results.report.gpx import gpx_text
        settings = FlightSettings(**{name: getattr(arguments, name) for name in OPTIONS})
        home = _home(arguments.home) if arguments.home else None
        if arguments.pattern is not None:
            if arguments.file is not None:
                raise FieldError(f"file must not be given with pattern, got {arguments.file}")
            _, scenario, _ = search_of(arguments)
            of_pattern = PatternMission(arguments, scenario)
            _check_home(home, of_pattern.frame)
            mission = of_pattern.mission(settings, home)
            missions, result = {"drone0": mission}, "\n".join(of_pattern.summary(mission)) + "\n"
        else:
            check_no_pattern(arguments)
            scenario, cells, searched, found = searched_cells(arguments)
            frame = scenario_frame(scenario)
            _check_home(home, frame)
            drones = cells.shape[1]
            tracks = [(cells[:, i], searched[:, i]) for i in range(drones)]
            frames = layers(frame, settings, drones)
            speeds_mps = [scenario.speeds[kind] for kind in scenario.kind_of]
            flown = search_missions(frames, tracks, settings, [home] * drones, speeds_mps)
            missions = {f"drone{i}": mission for i, mission in enumerate(flown)}
            result = f"{'found' if found else 'not found'} after {len(cells) - 1} steps; "
    except FieldError as error:
        return fail("export_mission", error)
    try:
        written = write_missions(arguments.out, missions, arguments.autopilot)
        if arguments.gpx:
            written.append(arguments.out / "missions.gpx")
            write_whole(written[-1], gpx_text(routes=missions).encode())
    except OSError as error:
        return fail("export_mission", f"out: {str(arguments.out)!r}: {error.strerror}")
    print(f"{result}{len(written)} files in {arguments.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
