# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A file of recorded missions on the command line: which mission of it, and its maps."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from dsse_ros.base.fields import FieldError
from dsse_ros.cli.command_line import Parser, search_of
from dsse_ros.picture.mission_view import MissionView
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import follow_belief, views
from dsse_ros.results.report.record import RecordedMission, is_bag
from dsse_ros.search.belief.protocol import TargetForecast
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.limits import LARGEST_GRID_CELLS

FILE_HELP = "CSV of record_file, or bag of the recorder"


def add_mission_file(parser: Parser) -> None:
    """Add the options for `read`, `choose` and maps, without the file, scenario and rules."""
    add_choice(parser)
    parser.add("--steps", type=int, nargs="+", metavar="STEP",
               help="steps of the maps, by default some from start to end")  # fmt: skip


def add_choice(parser: Parser) -> None:
    """Add the options for `read` and `choose`, without the file, scenario and rules."""
    parser.add("--mission", type=int, help="mission to use, by default the last complete one")
    parser.add("--namespace", help="namespace of the simulation, if a bag has several")
    parser.add("--max-cells", type=int, default=LARGEST_GRID_CELLS,
               help="number of cells of the largest grid")  # fmt: skip


def choose(missions: Sequence[RecordedMission], number: int | None) -> RecordedMission:
    """Return the mission of this number, or the last complete one; else the last one.

    Raises:
        FieldError: If no mission has this number.
    """
    if number is None:
        return next((mission for mission in reversed(missions) if mission.complete), missions[-1])
    of_number = [mission for mission in missions if mission.number == number]
    if not of_number:
        numbers = sorted({mission.number for mission in missions})
        shown = ", ".join(map(str, numbers[:10])) + (", ..." if len(numbers) > 10 else "")
        raise FieldError(f"mission must be one of the file ({shown}), got {number}")
    return of_number[-1]


def pictures(
    record: RecordedMission, wanted: Sequence[int], forecast: TargetForecast | None, bag: Any
) -> dict[int, MissionView]:
    """Return the maps of recorded steps: the belief, or what the drones observed.

    Args:
        forecast: For its belief, None if that is not to be computed.
        bag: Its `MissionBag`, None if it is of a CSV.

    Raises:
        FieldError: If the record is of another search.
    """
    if forecast is not None:
        _, beliefs = follow_belief(record, forecast, wanted)
    else:
        beliefs = {} if bag is None else bag.beliefs(record, wanted)
    return {
        k: replace(view, probability=beliefs[k], belief=True) if k in beliefs else view
        for k, view in views(record, wanted).items()
    }


def read(arguments: argparse.Namespace) -> tuple[list[RecordedMission], Any]:
    """Return the missions of a file, and the `MissionBag` if it is one.

    Raises:
        FieldError: If it is neither a log nor a bag, is of a grid of more cells, or of another
            search than that of the command line.
        ImportError: If it is a bag, and ROS or the extra `record` is not installed.
    """

    def search(drones: int) -> SearchDefinition:
        arguments.num_drones = drones
        _, scenario, rules = search_of(arguments)
        return SearchDefinition(rules, scenario)

    definition_of = search if arguments.scenario else None
    if not is_bag(arguments.file):
        return read_csv(arguments.file, definition_of, arguments.max_cells), None
    # A log is read without them.
    from dsse_ros.results.report.bags import MissionBag

    bag = MissionBag(arguments.file, arguments.namespace, definition_of, arguments.max_cells)
    return bag.missions, bag
