# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`report`: a recorded mission as one HTML page, with its figures and numbers as files."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from tqdm import tqdm

from dsse_ros.base.fields import FieldError
from dsse_ros.base.progress_bar import progress
from dsse_ros.cli.command_line import Parser, make_folder
from dsse_ros.cli.mission_file import FILE_HELP, add_mission_file, choose, pictures, read
from dsse_ros.picture.rendering import MissionView
from dsse_ros.results.report.recomputed import (
    LARGEST_BELIEF_GRID,
    follow_belief,
    forecast_for,
    object_shares,
    pos_alive,
    with_coverage,
    with_waits,
)
from dsse_ros.results.report.record import RecordedMission, chosen_steps
from dsse_ros.results.report.report import MissionReport
from dsse_ros.ros.runtime.exit_codes import fail
from dsse_ros.search.belief.protocol import TargetForecast
from dsse_ros.world.scenario.rules import AUTO, PROFILES


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the command line's arguments."""
    parser = Parser(
        prog="report",
        description="Make a page, figures and tables of a recorded mission.",
    )
    parser.add("file", type=Path, help=FILE_HELP)
    add_mission_file(parser)
    parser.add("--scenario", help="scenario, if the file does not have it: YAML file or name")
    usual = "profile, with --scenario; auto is sea with an incident, else paper"
    parser.add("--rules", default=AUTO, choices=(AUTO, *PROFILES), help=usual)
    parser.add("--out", type=Path, default=Path("report"), help="folder of the files")
    parser.set_defaults(seed=0)
    return parser.parse_with_ros(argv, {})


def notices(record: RecordedMission, shown: Mapping[int, MissionView]) -> Iterator[str]:
    """Yield notes on what is missing."""
    if not record.complete:
        left = int((~(record.terminated | record.truncated)[-1]).sum())
        yield (
            f"The mission was cut off: the record ends after step {record.steps[-1]} with {left} "
            f"drone{'s' if left != 1 else ''} in flight."
        )
    if record.missing_steps:
        yield (
            f"{record.missing_steps} of {record.steps[-1] + 1} steps are missing in the file: "
            "what happened in them is not counted, and tracks are straight there."
        )
    if not record.covers and not all(view.belief for view in shown.values()):
        yield "The maps are those that drones observed; a belief was not recorded."
    if record.pos is None:
        large = record.grid_size.longer > LARGEST_BELIEF_GRID
        why = f"; it is not computed on grids of more than {LARGEST_BELIEF_GRID} cells a side"
        yield f"The probability of success (POS) was not recorded{why if large else ''}."


def main(argv: list[str] | None = None) -> int:
    """Write the report; returns the exit code, 2 for bad input."""
    arguments = parse(argv)
    try:
        missions, bag = read(arguments)
        at = missions.index(choose(missions, arguments.mission))
        wanted = chosen_steps(missions[at], arguments.steps or ())
        forecast: TargetForecast | None = None
        missions = [with_coverage(mission) for mission in missions]
        for i, mission in enumerate(progress(missions, "POS")):
            if mission.pos is None and (forecast := forecast_for(mission, forecast)) is not None:
                missions[i] = replace(mission, pos=follow_belief(mission, forecast)[0])
        record = missions[at] = with_waits(missions[at])
        forecast = forecast_for(record, forecast)
        if forecast is not None:
            record = missions[at] = replace(
                record, object_shares=object_shares(record, forecast),
                pos_alive=pos_alive(record, forecast),
            )  # fmt: skip
        shown = pictures(record, wanted, forecast, bag)
        make_folder("out", arguments.out)
    except FieldError as error:
        return fail("report", error)
    source = arguments.file.resolve().name
    report = MissionReport(record, shown, missions, source, tuple(notices(record, shown)))
    try:
        with tqdm(total=report.num_figures, unit="figure", disable=None) as drawn:
            path = report.write(arguments.out, drawn.update)
    except OSError as error:
        name = error.filename or str(arguments.out)
        return fail("report", f"out: {name!r}: {error.strerror}")
    print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
