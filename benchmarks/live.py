# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a live search states true probabilities, measured with truths that are drawn beside it.

`python -m benchmarks.live --missions 500` prints the tables of docs/live.md: that a simulated
search through the live door has the same finds and POS, and for each kind of input the POS, or the
probability of a contact, against the share that came true, in bins.

Drones fly between random cells around the datum, whatever is reported. A truth is drawn from the
law that all inputs of its mission state together, and counts as found if a look or a search by
others has detected it at any time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.intervals import LEVEL, contains
from dsse_ros.base.progress_bar import say
from dsse_ros.base.result import Accepted
from dsse_ros.mission.live.admission import Admission, Clocks
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.inputs import read
from dsse_ros.mission.live.live_search import Forecasts, LiveSearch
from dsse_ros.mission.live.places import inside
from dsse_ros.results.campaign.estimates import wilson
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.world_beliefs import WorldBeliefs
from dsse_ros.world.scenario.actions import ACTION_VECTORS
from dsse_ros.world.scenario.frames import cell_centre, flip_y
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.incident_grid import positions

STEPS, LATE = 110, 93
"""Steps of a mission; the step after which late inputs come, 20 minutes into it."""
AROUND = 5
"""Cells from the datum within which drones fly."""
RADIUS_M = 40.0
"""Standard deviation of a detector's positions."""
INCIDENT: dict[str, Any] = {
    "object": "PIW-1", "search_start": "2026-01-17T14:00Z",
    "wind": {"speed": 8, "from": 90, "error": 1.5}, "current": {"speed": 0.2, "toward": 30},
    "seen": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:40Z", "radius": 500},
}  # fmt: skip
TRUE_WIND = {"speed": 10, "from": 30, "error": 1.5}
SIGHTING = {"radius": 400, "weight": 2.0}
POD_OF_OTHERS = 0.6
WIDTH = 0.1
"""Of a bin."""

Place = tuple[float, float]


@cache
def env_of(false_alarms: float, truth: str = "none") -> SearchEnv:
    """Return the environment of all missions with this rate of false alarms."""
    fields = {
        "incident": INCIDENT, "particles": 2000, "num_drones": 2, "timestep_limit": STEPS,
        "probability_of_detection": 0.7, "false_alarm_rate": false_alarms, "grid_size": 21,
    }  # fmt: skip
    return parallel_env(fields, rules="sea", truth=truth)


@cache
def forecasts_of(env: SearchEnv) -> Forecasts:
    """Return what makes forecasts of live searches; that of the environment's scenario is kept."""
    first = forecast_for(env.scenario, env.rules)
    return lambda scenario: first if scenario is env.scenario else forecast_for(scenario, env.rules)


def new_live_search(env: SearchEnv) -> LiveSearch:
    """Return a live search of the environment's scenario."""
    return LiveSearch(env.scenario, env.rules, forecasts_of(env))


class Plan:
    """Drones that fly between random cells around the datum, searching each cell that they enter.

    Args:
        env: The environment, which is reset.
        rng: Generator of the cells.
        seed: Seed of the environment.
    """

    def __init__(self, env: SearchEnv, rng: np.random.Generator, seed: int) -> None:
        self._env, self._rng = env, rng
        self._goals = [self._cell() for _ in range(env.world.num_drones)]
        starts: list[tuple[int, int]] = []
        while len(starts) < len(self._goals):
            starts += {self._cell()} - {*starts}
        env.reset(seed=seed, options={"drones_positions": starts})
        self._numbers = {vector: env.rules.actions.index(name)
                         for name, vector in ACTION_VECTORS.items()
                         if name in env.rules.actions}  # fmt: skip

    def _cell(self) -> tuple[int, int]:
        col, row = self._env.scenario.person_initial_position
        dx, dy = self._rng.integers(-AROUND, AROUND + 1, 2).tolist()
        columns, rows = self._env.scenario.grid_size
        return min(max(col + dx, 0), columns - 1), min(max(row + dy, 0), rows - 1)

    def actions(self) -> NDArray[np.int8]:
        """Return the next joint action, (N,)."""
        joint = np.zeros(len(self._goals), np.int8)
        for drone, (col, row) in enumerate(self._env.positions.tolist()):
            if (col, row) == self._goals[drone]:
                joint[drone] = self._env.rules.action_set.search
                self._goals[drone] = self._cell()
            else:
                dx, dy = np.sign([self._goals[drone][0] - col, self._goals[drone][1] - row])
                joint[drone] = self._numbers[int(dx), int(dy)]
        return joint


@dataclass
class Outcome:
    """What came of a mission.

    Attributes:
        pos: POS at its end.
        found: Whether a look or a search by others detected the person.
        chances: Probability of each contact, at the end or when it was verified, and whether it is
            the person.
    """

    pos: float
    found: bool
    chances: list[tuple[float, bool]] = field(default_factory=list)


@dataclass
class Report:
    """An input, and the step after which it comes."""

    step: int
    kind: str
    values: dict[str, Any]


@dataclass(frozen=True)
class Case:
    """A kind of missions.

    Attributes:
        name: What is reported.
        inputs: Returns the inputs of a mission, and the incident whose drift its truth follows.
        false_alarms: Rate of false alarms of the drones' detectors.
        detects: Whether detections are reported.
        verified: Whether contacts are looked at after five steps, and false ones dismissed.
    """

    name: str
    inputs: Callable[[np.random.Generator, Incident], tuple[list[Report], Incident]]
    false_alarms: float = 0.0
    detects: bool = False
    verified: bool = False


def nothing(_: np.random.Generator, incident: Incident) -> tuple[list[Report], Incident]:
    """Report nothing."""
    return [], incident


def sighting(rng: np.random.Generator, incident: Incident) -> tuple[list[Report], Incident]:
    """Report a sighting at half time, with twice the weight of the first."""
    north, east = rng.normal(0.0, 0.003, 2)
    seen = {
        "time": "2026-01-17T14:12Z", "lat": -23.997 + north, "lon": -46.303 + east, **SIGHTING
    }  # fmt: skip
    both = incident.informed([seen], {})
    weights = np.array([seen.weight for seen in both.sightings])
    true = both.sightings[int(rng.choice(len(weights), p=weights / weights.sum()))]
    return [Report(60, "sighting", seen)], replace(both, sightings=(true,))


def searched(rng: np.random.Generator, incident: Incident) -> tuple[list[Report], Incident]:
    """Report an area that others have searched, half an hour late."""
    north, east = rng.uniform(-0.006, 0.006, 2)
    south, west = -24.004 + north, -46.305 + east
    corners = [(west, south), (west + 0.012, south), (west + 0.012, south + 0.01),
               (west, south + 0.01), (west, south)]  # fmt: skip
    values = {
        "time": 300.0, "pod": POD_OF_OTHERS,
        "geometry": {"type": "Polygon", "coordinates": [[list(corner) for corner in corners]]},
    }  # fmt: skip
    return [Report(LATE, "searched", values)], incident


def wind(_: np.random.Generator, incident: Incident) -> tuple[list[Report], Incident]:
    """Report the true wind after 20 minutes."""
    true = incident.informed([], {"wind": TRUE_WIND})
    return [Report(LATE, "weather", {"wind": TRUE_WIND})], true


CASES = (
    Case("looks only", nothing),
    Case("detections, false alarms 0 %", nothing, 0.0, detects=True),
    Case("detections, false alarms 5 %", nothing, 0.05, detects=True),
    Case("the same, verified", nothing, 0.05, detects=True, verified=True),
    Case("detections, false alarms 20 %", nothing, 0.2, detects=True),
    Case("the same, verified", nothing, 0.2, detects=True, verified=True),
    Case("a sighting in mid-search", sighting),
    Case("an area searched by others", searched),
    Case("the wind, 20 minutes late", wind),
)


def take(live_search: LiveSearch, kind: str, values: Mapping[str, Any]) -> str:
    """Have a live search take an input now; return the contact that it is of, "" for none."""
    parsed = read(kind, values)
    assert isinstance(parsed, Accepted), parsed
    now_s = len(live_search.steps) * live_search.scenario.step_duration_s
    checked = Admission(live_search).check(parsed.value, Clocks(now_s, now_s, float))
    if not isinstance(checked, Accepted) or checked.value is None:
        # Too many contacts are open.
        return ""
    live_search.apply(checked.value)
    return str(checked.value.derived.get("contact", ""))


class LiveMission:
    """A mission with a truth beside it.

    Args:
        case: Its kind.
        seed: Seed of its plan, truth and reports.
    """

    def __init__(self, case: Case, seed: int) -> None:
        self._case, self._rng = case, np.random.default_rng([20260117, seed])
        self._env = env_of(case.false_alarms)
        self._plan = Plan(self._env, self._rng, seed)
        self._scenario = self._env.scenario
        incident = self._scenario.incident
        assert incident is not None
        self._inputs, law = case.inputs(self._rng, incident)
        self._truth = self._track(law)
        self._live_search = new_live_search(self._env)
        self._real: set[str] = set()
        self._checked: dict[str, float] = {}
        self._found = False
        self._number = 0

    def _track(self, law: Incident) -> NDArray[np.float64]:
        """Return a track of the law, (T, 2) metres to the east and north in the map frame."""
        s = self._scenario
        origin, height_m = (
            (s.origin_lat, s.origin_lon, s.origin_alt),
            s.grid_size.rows * s.cell_size,
        )
        times_s = s.step_duration_s * np.arange(STEPS + 1, dtype=np.float64)
        tracks, *_ = positions(law, origin, height_m, times_s, self._rng, 1)
        track = np.array([at_step[0] for at_step in tracks])
        return np.stack([track[:, 0], flip_y(height_m, track[:, 1])], axis=1)

    def _cell_at(self, step: int) -> tuple[int, int]:
        x, y = (self._truth[step] / self._scenario.cell_size).tolist()
        return int(np.floor(x)), self._scenario.grid_size.rows - 1 - int(np.floor(y))

    def fly(self) -> Outcome:
        """Fly it to its end."""
        world, beliefs, live_search = (
            self._env.world,
            LiveBeliefs(self._env.world),
            self._live_search,
        )
        for step in range(STEPS):
            joint = self._plan.actions()
            beliefs.before_step(joint[None])
            self._env.advance(joint)
            done = beliefs.looks()
            live_search.step(done)
            here = self._cell_at(step)
            detected = set()
            for drone, number, cell in zip(done.drones, done.numbers, done.cells, strict=True):
                pod = world.looks.pods[number, 0]
                if tuple(cell.tolist()) == here and self._rng.random() < pod:
                    detected.add(int(drone))
            self._found |= bool(detected)
            if self._case.detects:
                self._report(step, done.drones, done.cells, detected)
            for report in self._inputs:
                if report.step == step:
                    self._take(report.kind, **report.values)
            if self._case.verified:
                self._verify(step)
        return self._outcome()

    def _report(
        self, step: int, drones: NDArray[np.int64], cells: NDArray[np.int64], real: set[int]
    ) -> None:
        """Report detections and false alarms of a step."""
        time_s = (step + 1) * self._scenario.step_duration_s
        for drone in np.unique(drones).tolist():
            name = f"d{step}-{drone}"
            if drone in real:
                x, y = (self._truth[step] + self._rng.normal(0.0, RADIUS_M, 2)).tolist()
            elif self._rng.random() < self._case.false_alarms:
                col, row = self._rng.choice(cells[drones == drone]).tolist()
                across = self._rng.uniform(-0.5, 0.5, 2).tolist()
                x, y = cell_centre(
                    self._scenario.grid_size, self._scenario.cell_size,
                    col + across[0], row + across[1],
                )  # fmt: skip
                x, y = ((x, y) + self._rng.normal(0.0, RADIUS_M, 2)).tolist()
            else:
                continue
            taken = self._take("detection", name, time=time_s, x=x, y=y, radius=RADIUS_M,
                               drone=drone)  # fmt: skip
            if drone in real and taken:
                self._real.add(taken)

    def _take(self, kind: str, name: str = "", **values: Any) -> str:
        """Have the live search take an input, see `take`."""
        self._number += 1
        return take(self._live_search, kind, {"id": name or f"i{self._number}", **values})

    def _verify(self, step: int) -> None:
        """Note the probability of contacts that are five steps old, and dismiss false ones.

        Once one is the person, the search is over.
        """
        if self._real & self._checked.keys():
            return
        old_s = (step - 4) * self._scenario.step_duration_s
        for contact in self._live_search.contacts.of_state("open"):
            last = self._live_search.contacts.last(contact.name)
            if contact.name in self._checked or last.time_s > old_s:
                continue
            self._checked[contact.name] = self._live_search.probability(contact) or 0.0
            if contact.name not in self._real:
                self._take("dismiss", contact=contact.name)
            else:
                return

    def _outcome(self) -> Outcome:
        live_search, case = self._live_search, self._case
        for report in self._inputs:
            if report.kind == "searched":
                step = round(report.values["time"] / self._scenario.step_duration_s)
                ring = [live_search.place({"lat": lat, "lon": lon})
                        for lon, lat in report.values["geometry"]["coordinates"][0]]  # fmt: skip
                there = inside(self._truth[step : step + 1], [np.array(ring)])[0]
                self._found |= bool(there) and self._rng.random() < POD_OF_OTHERS
        stated = self._checked
        if not case.verified:
            stated = {contact.name: live_search.probability(contact) or 0.0
                      for contact in live_search.contacts.of_state("open")}  # fmt: skip
        chances = [(chance, name in self._real) for name, chance in stated.items()]
        return Outcome(live_search.pos, self._found, chances)


def bins(pairs: Sequence[tuple[float, bool]]) -> list[tuple[int, float, float, bool]]:
    """Return count, mean probability and share that came true of each bin, and if they agree.

    They agree if the mean lies in the 99 % interval of the share.
    """
    rows = []
    stated, true = (
        np.array([probability for probability, _ in pairs]),
        np.array([came_true for _, came_true in pairs]),
    )
    for low in np.arange(0.0, 1.0, WIDTH):
        of_bin = (stated >= low) & (stated < low + WIDTH + (low + WIDTH > 1.0 - 1e-9))
        count = int(of_bin.sum())
        if count:
            mean, share = float(stated[of_bin].mean()), float(true[of_bin].mean())
            rows.append((count, mean, share, contains(wilson(share, count, LEVEL), mean)))
    return rows


def through_the_door(missions: int) -> tuple[int, int, float]:
    """Play missions with a truth, and again without one and with a detector that sees the same.

    Returns:
        Number of missions with a find; those whose find or number of steps differs; the largest
        difference of the POS at the end.
    """
    finds = differ = 0
    largest = 0.0
    for seed in range(missions):
        simulated, live = env_of(0.0, "simulated"), env_of(0.0)
        plans = [Plan(env, np.random.default_rng([7, seed]), seed) for env in (simulated, live)]
        known, beliefs = WorldBeliefs(simulated.world), LiveBeliefs(live.world)
        live_search, found = beliefs.live_search, False
        for step in range(STEPS):
            joint = [plan.actions() for plan in plans]
            known.before_step(joint[0][None])
            simulated.advance(joint[0])
            known.after_step()
            beliefs.before_step(joint[1][None])
            live.advance(joint[1])
            beliefs.after_step()
            finders = np.flatnonzero(simulated.world.found[0]).tolist()
            if finders:
                # What a detector sees: the person in the cell of the drone's look.
                person = simulated.world.persons[0, 0]
                before = simulated.world.ensemble
                assert before is not None
                col, row = before.tracks.truth[step, before.track[0, 0]].tolist()
                x, y = cell_centre(live.scenario.grid_size, live.scenario.cell_size, col, row)
                place = {"x": x, "y": y, "radius": RADIUS_M, "drone": finders[0]}
                assert take(live_search, "detection", {"id": "detection", **place}) == "c1"
                take(live_search, "confirm", {"id": "confirm", "contact": "c1"})
                found = bool(person["found"])
                break
        finds += found
        differ += found != live_search.over
        largest = max(largest, abs(float(known.pos[0]) - live_search.pos))
    return finds, differ, largest


def main(argv: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--missions", type=int, default=500, help="missions of each case")
    parser.add_argument("--only", default="", help="part of the names of cases to measure")
    arguments = parser.parse_args(argv)
    if not arguments.only:
        finds, differ, largest = through_the_door(arguments.missions)
        print(f"{arguments.missions} missions with a truth: {finds} finds, {differ} differ through "
              f"the live door, POS differs by at most {largest:.1e}\n")  # fmt: skip
    print("| Case | Stated | Bins, in their interval | Mean | Share, 99 % |")
    print("| --- | --- | --- | --- | --- |")
    for number, case in enumerate(CASES):
        if arguments.only not in case.name:
            continue
        say(case.name)
        flown = [LiveMission(case, 10**6 * number + i).fly() for i in range(arguments.missions)]
        measured = {"POS": [(mission.pos, mission.found) for mission in flown]}
        if case.detects:
            measured["contact"] = [pair for mission in flown for pair in mission.chances]
        for stated, pairs in measured.items():
            rows = bins(pairs)
            mean = np.array(pairs, np.float64).mean(axis=0)
            low, high = wilson(float(mean[1]), len(pairs), LEVEL)
            came_true = f"{mean[1]:.1%} ({low:.1%} to {high:.1%})"
            print(f"| {case.name} | {stated} | {sum(row[3] for row in rows)} of {len(rows)} "
                  f"| {mean[0]:.1%} | {came_true} |", flush=True)  # fmt: skip
            for count, stated_mean, share, fits in rows:
                say(f"  {stated} {stated_mean:.3f} {share:.3f} of {count} {'' if fits else '!'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
