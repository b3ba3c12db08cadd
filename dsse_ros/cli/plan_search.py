# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`plan_search`: which unit searches which area, how and when, without ROS."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from dsse_ros.base.fields import FieldError
from dsse_ros.base.progress_bar import progress
from dsse_ros.base.whole_files import write_whole
from dsse_ros.cli.command_line import SEED, Parser, make_folder
from dsse_ros.mission.files.scenario_files import scenario_with_incident
from dsse_ros.planners.search_plan.assignments import SearchUnit
from dsse_ros.planners.search_plan.next_sortie import missed_persons
from dsse_ros.planners.search_plan.optimiser import NoPlanError, best_plan, generations
from dsse_ros.planners.search_plan.plan_file import plan_text, read_plan
from dsse_ros.planners.search_plan.units_file import read_units
from dsse_ros.results.report.gpx import gpx_text
from dsse_ros.results.report.kml import kml_text
from dsse_ros.results.search_plan.action_plan import action_plan
from dsse_ros.results.search_plan.plan import SearchPlan, stated_plan
from dsse_ros.results.search_plan.plan_files import (
    geojson_text,
    gis_plan,
    missions_of,
    save_plan_picture,
)
from dsse_ros.ros.runtime.exit_codes import fail
from dsse_ros.ros.runtime.interrupts import Stop, on_signals
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.vehicles.autopilots import AUTOPILOTS
from dsse_ros.vehicles.fleet.vehicle_missions import write_missions
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.sighting_fields import time_of

RULES = "flight"


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the command line's arguments."""
    parser = Parser(
        prog="plan_search",
        description="Plan a search: an area, a pattern and times for every unit, by the POS of "
        "all of them together.",
    )
    add = parser.add
    add("units", type=Path, help="YAML file of the units")
    add("--scenario", default="kayak", help="YAML file or name, with an incident")
    add("--minutes", type=float, help="time of the search, min, by default the scenario's")
    add("--begins", help="time at which the search begins, by default the incident's")
    add("--after", type=Path, nargs="+", default=[], metavar="PLAN",
        help="plan.json of each earlier search of this incident, which found nobody")  # fmt: skip
    add("--seed", type=int, default=0, help="random seed of the optimiser")
    add("--out", type=Path, default=Path("plan"), help="folder of the files")
    add("--autopilot", default="ardupilot", choices=tuple(AUTOPILOTS),
        help="autopilot that the .plan files are for")  # fmt: skip
    return parser.parse_args(argv)


class Planned(NamedTuple):
    """What is planned.

    Attributes:
        forecast: The persons.
        units: The units.
        planned: Particles by which plans are compared; None if they are to be drawn.
        pos_before: The POS of the earlier searches.
    """

    forecast: EnsembleForecast
    units: list[SearchUnit]
    planned: EnsembleForecast | None = None
    pos_before: float = 0.0


def search_of(arguments: argparse.Namespace) -> Planned:
    """Return the persons and the units of a command line.

    Raises:
        FieldError: If the scenario, a unit or an earlier plan is not allowed.
    """
    SEED.check("seed", arguments.seed)
    stated, incident = scenario_with_incident(arguments.scenario)
    units = read_units(arguments.units)
    begins_s = incident.search_start_s
    if arguments.begins is not None:
        begins_s = time_of("begins", arguments.begins)
        if begins_s < incident.search_start_s:
            raise FieldError(
                f"begins must be at least {utc(incident.search_start_s)}, the search_start of the "
                f"incident, got {arguments.begins!r}"
            )
    # The search begins at this time, wherever the units are.
    stated = stated.override(incident=replace(incident, base=None, search_start_s=begins_s))
    if arguments.minutes is not None:
        if not 0 < arguments.minutes <= 1440:
            raise FieldError(f"minutes must be > 0 and <= 1440, got {arguments.minutes:g}")
        step_s = stated.cell_m / max(stated.speeds)
        stated = stated.override(timestep_limit=math.ceil(arguments.minutes * 60 / step_s - 1e-9))
    rules = profile(RULES)
    scenario = stated.resolve(rules)
    if len(scenario.seen_as) > 1:
        raise FieldError(
            "incident: object must be one, or several that the sensor sees alike, in a search plan"
        )
    found = []
    for unit in units:
        try:
            found.append(unit.unit(scenario, incident.base))
        except FieldError as error:
            raise FieldError(f"{arguments.units}: {unit.name}: {error}") from None
    if not arguments.after:
        return Planned(EnsembleForecast(scenario, rules), found)
    earlier = [unit.search for path in arguments.after for unit in read_plan(path, scenario)]
    missed = missed_persons(scenario, rules, earlier)
    return Planned(missed.forecast, found, missed.planned, missed.pos)


def write_plan(folder: Path, plan: SearchPlan, text: str, autopilot: str) -> list[Path]:
    """Write all files of a plan; returns their paths.

    Raises:
        OSError: If a file cannot be written.
    """
    mission, missions = gis_plan(plan), missions_of(plan, autopilot)
    texts = {
        "plan.txt": text,
        "plan.json": plan_text(plan.scenario, plan.assignments),
        "plan.geojson": geojson_text(plan, mission),
        "plan.kml": kml_text(mission),
        "plan.gpx": gpx_text(mission.tracks, mission.places, missions),
    }
    for name, content in texts.items():
        write_whole(folder / name, content.encode())
    picture = folder / "plan.png"
    save_plan_picture(plan, picture)
    return [
        *(folder / name for name in texts),
        picture,
        *write_missions(folder, missions, autopilot),
    ]


def main(argv: list[str] | None = None) -> int:
    """Plan, print and write the plan; returns the exit code, 2 for bad input.

    Ctrl-C ends the optimisation, and the best plan so far is written.
    """
    arguments = parse(argv)
    try:
        forecast, units, planned, pos_before = search_of(arguments)
        make_folder("out", arguments.out)
        stop = Stop()
        on_signals(stop)
        bar = _bar(generations(len(units)))

        def watch(pos: float) -> bool:
            next(bar, None)
            return not stop.wanted

        found = best_plan(units, forecast, seed=arguments.seed, watch=watch, planned=planned)
    except NoPlanError as error:
        return fail("plan_search", f"{arguments.units}: {error}")
    except FieldError as error:
        return fail("plan_search", error)
    bar.close()
    plan = stated_plan(forecast, found, pos_before)
    text = action_plan(plan)
    try:
        written = write_plan(arguments.out, plan, text, arguments.autopilot)
    except OSError as error:
        name = error.filename or str(arguments.out)
        return fail("plan_search", f"out: {name!r}: {error.strerror}")
    print(text)
    print(f"{len(written)} files in {arguments.out}")
    return 0


def _bar(total: int) -> Generator[int]:
    yield from progress(range(total), "plan_search")


if __name__ == "__main__":
    sys.exit(main())
