# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a live search gains from each kind of input, if its planner is informed of it.

`python -m benchmarks.live_gains --missions 200` prints the table of docs/live.md. Each mission is
flown twice by the planner `belief`, from the same cells and with the same seed: once its belief has
the input, once not. What counts are the looks flown, by a belief that knows all inputs.

Of detections, a person counts as found who was detected in two steps: once, and again as a drone
came back.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.intervals import of_mean
from benchmarks.live import (
    INCIDENT,
    RADIUS_M,
    Case,
    Report,
    new_live_search,
    nothing,
    sighting,
    take,
    wind,
)
from dsse_ros.base.progress_bar import say
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.live_search import LiveSearch
from dsse_ros.mission.live.step_looks import StepLooks
from dsse_ros.planners.belief import BeliefPlanner
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.frames import cell_centre, flip_y
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.incident_grid import positions

STEPS = 185
"""Steps of a mission: 40 minutes."""
BEAM = {"samples": 1000, "width": 8}
"""Options of the planner: a quarter of the default takes half the time."""
SPREAD_M = 1000.0
"""Radius of the first sighting."""
BACK_STEPS = 3
"""Steps after a detection from which on a look at its place is another one."""


def searched(_: np.random.Generator, incident: Incident) -> tuple[list[Report], Incident]:
    """Report at once that others have searched around the last known position."""
    seen = incident.sightings[0]
    lat_deg, lon_deg = seen.place
    west, east, south, north = (lon_deg - 0.008, lon_deg + 0.008, lat_deg - 0.008,
                                lat_deg + 0.008)  # fmt: skip
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    values = {"time": 300.0, "pod": 0.6, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    return [Report(24, "searched", values)], incident


CASES = (
    Case("a sighting after 13 minutes", sighting),
    Case("an area searched by others in minute 5", searched),
    Case("the true wind after 20 minutes", wind),
    Case("detections, false alarms 5 %", nothing, 0.05, detects=True),
    Case(
        "detections, false alarms 5 %, dismissed on the second look",
        nothing,
        0.05,
        detects=True,
        verified=True,
    ),
)


@cache
def env_of(false_alarms: float) -> SearchEnv:
    """Return the environment of all missions with this rate of false alarms."""
    seen = {**INCIDENT["seen"], "radius": SPREAD_M}
    fields = {
        "incident": {**INCIDENT, "seen": seen}, "particles": 2000, "num_drones": 1,
        "timestep_limit": STEPS, "probability_of_detection": 0.7,
        "false_alarm_rate": false_alarms, "grid_size": 31,
    }  # fmt: skip
    return parallel_env(fields, rules="sea", truth="none")


@cache
def planner_of(env: SearchEnv) -> BeliefPlanner:
    """Return the planner whose copies fly all missions, with one forecast."""
    planner = planner_for(env, "belief", **BEAM)
    assert isinstance(planner, BeliefPlanner)
    return planner


class Arm:
    """A mission, with a planner that is informed of the inputs or not.

    Args:
        case: What is reported.
        seed: Seed of the mission.
        informed: Whether the planner is informed.
    """

    def __init__(self, case: Case, seed: int, *, informed: bool) -> None:
        self._case, self._informed = case, informed
        self._env = env_of(case.false_alarms)
        rng = np.random.default_rng([20260118, seed])
        scenario = self._env.scenario
        assert scenario.incident is not None
        self._inputs, _ = case.inputs(rng, scenario.incident)
        origin = scenario.origin_lat, scenario.origin_lon, scenario.origin_alt
        self._height_m = scenario.grid_size.rows * scenario.cell_size
        times_s = scenario.step_duration_s * np.arange(STEPS + 1, dtype=np.float64)
        tracks, *_ = positions(scenario.incident, origin, self._height_m, times_s, rng, 1)
        self._truth: NDArray[np.float64] = np.array([at_step[0] for at_step in tracks])
        self._starts = rng.permutation(scenario.grid_size.cells)[: scenario.num_drones]
        # Both arms have their own chance of what drones detect, from the same seed.
        self._rng = np.random.default_rng([7, seed])
        self._planner = planner_of(self._env).with_seed(seed)
        self._known = LiveSearch(scenario, self._env.rules, self._planner.forecasts)
        self._detected: list[int] = []
        self._real: set[str] = set()

    def fly(self) -> float:
        """Return the POS at its end, or with detections whether the person was found."""
        env, size = self._env, self._env.scenario.grid_size.columns
        starts = [(int(start) % size, int(start) // size) for start in self._starts]
        observations, infos = env.reset(seed=0, options={"drones_positions": starts})
        looks, judge = LiveBeliefs(env.world), new_live_search(env)
        for step in range(STEPS):
            known = {"step": step, "belief": self._known.belief}
            joint: Any = self._planner(
                observations, {name: {**info, **known} for name, info in infos.items()}
            )
            looks.before_step(np.array([list(joint.values())], np.int8))
            observations, _, _, _, infos = env.step(joint)
            done = looks.looks()
            self._known.step(done)
            judge.step(done)
            if self._case.detects:
                self._detect(step, done)
            for number, report in enumerate(self._inputs):
                if report.step == step and self._informed:
                    take(self._known, report.kind, {"id": f"i{number}", **report.values})
        for number, report in enumerate(self._inputs):
            take(judge, report.kind, {"id": f"i{number}", **report.values})
        if not self._case.detects:
            return judge.pos
        return float(len(self._detected) > 1)

    def _detect(self, step: int, done: StepLooks) -> None:
        """Draw what the drones detect in a step, and report it."""
        scenario, looks = self._env.scenario, self._env.world.looks
        east, south = (self._truth[step] / scenario.cell_size).tolist()
        here = int(np.floor(east)), int(np.floor(south))
        cells = list(map(tuple, done.cells.tolist()))
        if self._case.verified:
            self._dismiss(step, cells)
        for drone, number, cell in zip(done.drones.tolist(), done.numbers, cells, strict=True):
            real = cell == here and self._rng.random() < looks.pods[number, 0]
            if not real and self._rng.random() >= self._case.false_alarms:
                continue
            if real:
                x, y = self._truth[step, 0], flip_y(self._height_m, self._truth[step, 1])
                self._detected.append(step)
            else:
                col, row = cell + self._rng.uniform(-0.5, 0.5, 2)
                x, y = cell_centre(scenario.grid_size, scenario.cell_size, col, row)
            x, y = ((x, y) + self._rng.normal(0.0, RADIUS_M, 2)).tolist()
            values = {
                "id": f"d{step}-{drone}-{cell}", "time": (step + 1) * scenario.step_duration_s,
                "x": x, "y": y, "radius": RADIUS_M, "drone": drone,
            }  # fmt: skip
            if self._informed:
                contact = take(self._known, "detection", values)
                self._real |= {contact} if real else set()

    def _dismiss(self, step: int, cells: Sequence[tuple[int, ...]]) -> None:
        """Dismiss false contacts at which a drone has looked again."""
        scenario, live_search = self._env.scenario, self._known
        now_s = (step + 1) * scenario.step_duration_s
        for contact in live_search.contacts.of_state("open"):
            last, x, y = live_search.contact_now(contact, now_s)
            cell = (
                int(x // scenario.cell_size),
                int(flip_y(self._height_m, y) // scenario.cell_size),
            )
            old = now_s - last.time_s >= BACK_STEPS * scenario.step_duration_s
            if old and cell in cells and contact.name not in self._real:
                take(
                    live_search,
                    "dismiss",
                    {"id": f"no{step}{contact.name}", "contact": contact.name},
                )


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--missions", type=int, default=200, help="missions of each case")
    parser.add_argument("--only", default="", help="part of the names of cases to measure")
    arguments = parser.parse_args(argv)
    print("| Input | Counts | Not informed | Informed | Difference, 99 % |")
    print("| --- | --- | --- | --- | --- |")
    for number, case in enumerate(CASES):
        if arguments.only not in case.name:
            continue
        say(case.name)
        pairs = np.array(
            [
                [
                    Arm(case, 10**6 * number + i, informed=informed).fly()
                    for informed in (False, True)
                ]
                for i in range(arguments.missions)
            ]
        )
        gained = pairs[:, 1] - pairs[:, 0]
        low, high = of_mean(float(gained.mean()), float(gained.std(ddof=1)), len(gained))
        counts = "found" if case.detects else "POS"
        without, informed = pairs.mean(axis=0)
        print(f"| {case.name} | {counts} | {without:.1%} | {informed:.1%} | {gained.mean():+.1%} "
              f"({low:+.1%} to {high:+.1%}) |", flush=True)  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
