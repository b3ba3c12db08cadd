# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Incidents at sea, drawn from seeds: POS and share found over time, and what a wrong drift costs.

With one person a plan does not depend on the person, because drones only learn that they have found
nobody. A planner therefore plans once, in a search that finds nobody. The belief gives the POS of
its searches, and missions repeat them.

Missions of an incident share its place, its particles and the plan, so an incident is a cluster.
The intervals are for the mean of other incidents of this kind, not only of these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import islice
from math import ceil, cos, radians, sin
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.intervals import LEVEL
from dsse_ros.base.progress_bar import progress, say
from dsse_ros.planners import registry
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.planner import Search, cells_of
from dsse_ros.planners.play import PlayedStep, play
from dsse_ros.planners.registry import load_planner
from dsse_ros.results.campaign.estimates import of_mean, of_share
from dsse_ros.search.belief.ensemble_belief import PathsFlown
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.step.looks import looks_of
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.drift.tracks import displaced
from dsse_ros.world.scenario.actions import STRAIGHT
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.rules import Rules, profile
from dsse_ros.world.scenario.scenario import ResolvedScenario, Scenario
from dsse_ros.world.scenario.swarm import number_of
from dsse_ros.world.searchers.registry import SEARCHERS
from dsse_ros.world.searchers.searcher import Searcher
from dsse_ros.world.sensors.sensor import SEARCH

SEED = 30_000_000
COUNT, MISSIONS = 20, 500
"""Incidents; missions of each plan."""
PARTICLES, TRACKS = 20_000, 4_000
"""Particles of each incident; tracks that persons follow who drift otherwise."""
MINUTES = (15, 30, 60)
BASELINE = "belief"
"""The planner that others are compared with, and that is shown with a wrong drift."""
START_S = 1_772_366_400
"""Start of every search, seconds since 1970-01-01 UTC: 2026-03-01T12:00:00Z."""
SEA = profile("sea")
STOPPING = SEA.override(actions=(*STRAIGHT, SEARCH), sensor="own_cell")
"""Rules by which drones stop to search."""
STOPS = f"{BASELINE}, stopping"
"""Key of the `BASELINE` by these rules."""
FLIGHT = profile("flight")
TURN_RADIUS_M = 80.0
IN_METRES = ", in metres"
"""Added to the key of a planner by the rules `FLIGHT`."""
ROUND = f"{BASELINE}{IN_METRES}, radius {TURN_RADIUS_M:g} m"
"""Key of the `BASELINE` with drones that have this turn radius."""
SEARCHERS["round"] = Searcher(doc="turns on an arc", turn_radius=TURN_RADIUS_M)

ERRORS = {
    "none": "nothing",
    "turned_10": "wind direction 10° off",
    "turned_30": "wind direction 30° off",
    "turned_90": "wind direction 90° off",
    "stronger": "wind stronger by half",
    "weaker": "wind weaker by half",
    "class": "another class of leeway",
}
"""What is wrong about the drift of the persons, by the field `truth` of the incident."""

CLASSES = (
    "PIW-1", "PIW-2", "PIW-3", "PIW-4", "PIW-5", "PIW-6", "LIFE-RAFT-NB-1",
    "LIFE-RAFT-NB-2", "LIFE-RAFT-NB-3", "LIFE-RAFT-NB-4", "LIFE-RAFT-NB-5",
    "LIFE-RAFT-SB-6", "LIFE-RAFT-DB-10", "LIFE-RAFT-DB-12", "LIFE-RAFT-DB-15",
    "PERSON-POWERED-VESSEL-1", "PERSON-POWERED-VESSEL-2", "PERSON-POWERED-VESSEL-3",
    "SKIFF-1", "SKIFF-2", "SKIFF-3", "SPORT-BOAT", "FISHING-VESSEL-1", "LIFE-RAFT-DB-11",
    "REFUGEE-RAFT-1", "SLDMB",
)  # fmt: skip
"""Classes of leeway that the objects are of. Another order or number draws other incidents."""

Floats = NDArray[np.float64]
Update = Callable[[Any], None]
"""Updates a belief with the looks of a step."""


def incident(number: int) -> dict[str, Any]:
    """Return the fields of a scenario of one incident, and the truth of each error.

    Classes, winds, currents and places between 60 degrees south and north are uniform. Three of
    five incidents have several sightings, two of five a shore, and every other one a base outside.

    Returns:
        `fields` of a `Scenario`, and `truths`, fields of the incident by key of `ERRORS`.
    """
    rng = np.random.default_rng([SEED, number])

    def drawn(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 3)

    at = drawn(-60, 60), drawn(-178, 178)
    key, other = rng.choice(CLASSES, 2, replace=False).tolist()
    wind = {"speed": drawn(1, 12), "from": drawn(0, 360), "error": drawn(0.5, 2)}
    current = {"speed": drawn(0, 0.8), "toward": drawn(0, 360), "error": drawn(0.05, 0.2)}
    # The coast is to leeward.
    coast_deg = wind["from"] + 180 + drawn(-60, 60)
    seen: list[dict[str, Any]] = []
    for _ in range(1 + max(number % 5 - 1, 0)):
        away = _moved(at, coast_deg + 180 + drawn(-90, 90), drawn(0, 1500) if seen else 0.0)
        seen.append(
            {
                "lat": away[0], "lon": away[1], "time": utc(START_S - 60 * drawn(20, 120)),
                "radius": drawn(100, 1000), "weight": drawn(0.5, 2), "time_error": drawn(0, 10),
            }
        )  # fmt: skip
    base = _moved(at, coast_deg + drawn(-90, 90), drawn(5e3, 2e4)) if number % 2 else None
    turn = float(rng.choice([-1, 1]))
    winds = {
        f"turned_{angle}": {**wind, "from": (wind["from"] + turn * angle) % 360}
        for angle in (10, 30, 90)
    }
    winds |= {
        name: {**wind, "speed": factor * wind["speed"]}
        for name, factor in (("stronger", 1.5), ("weaker", 0.5))
    }
    return {
        "fields": {
            "incident": {
                "object": key, "seen": seen, "search_start": utc(START_S), "wind": wind,
                "current": current, "base": base,
                "shore": _coast(at, coast_deg, rng) if number % 5 in (0, 2) else None,
            },
            "num_drones": int(rng.integers(2, 7)), "particles": PARTICLES,
            "probability_of_detection": drawn(0.7, 1), "ensemble_seed": number,
        },
        "truths": {name: {"wind": value} for name, value in winds.items()}
        | {"class": {"object": other}},
    }  # fmt: skip


def _moved(at: Sequence[float], bearing_deg: float, distance_m: float) -> list[float]:
    """Return the latitude and longitude at a distance."""
    north_m, east_m = distance_m * cos(radians(bearing_deg)), distance_m * sin(radians(bearing_deg))
    return [float(degrees) for degrees in displaced(at[0], at[1], east_m, north_m)]


def _coast(at: Sequence[float], bearing_deg: float, rng: np.random.Generator) -> dict[str, Any]:
    """Return a GeoJSON polygon of land with a rough coast, 40 km long, 1 to 3 km away."""
    nearest = _moved(at, bearing_deg, float(rng.uniform(1000, 3000)))
    ring = [
        _moved(_moved(nearest, bearing_deg + 90, along), bearing_deg, float(rng.uniform(0, 500)))
        for along in np.arange(-20e3, 20.1e3, 500)
    ]
    ring += [_moved(point, bearing_deg, 20e3) for point in (ring[-1], ring[0])]
    return {"type": "Polygon", "coordinates": [[[lon, lat] for lat, lon in [*ring, ring[0]]]]}


class Plan:
    """What the drones of a planner that finds nobody do.

    Args:
        planner: Name of the planner.
        scenario: The search.
        rules: Its rules.
        seed: Seed of the planner.

    Attributes:
        actions: Actions of the live drones by name, step by step.
    """

    def __init__(self, planner: str, scenario: Scenario, rules: Rules, seed: int) -> None:
        resolved = scenario.resolve(rules)
        # Drones see as in the search but find nobody.
        env = parallel_env(scenario.override(person_pod_multipliers=(0.0,)), rules=rules)
        decide = load_planner(planner)(SearchDefinition(rules, resolved), seed=seed)
        looked_in = _looks_on_paths(env) if rules.in_metres else _looks_at_cells(resolved, rules)
        self.actions: list[Mapping[str, Any]] = []
        self._looked: list[Update] = []
        count = rules.last_acting_step(resolved.timestep_limit)
        for step in islice(play(env, decide, seed=seed), count):
            self.actions.append(step.actions)
            self._looked.append(looked_in(step))

    def pos(self, scenario: Scenario, rules: Rules) -> Floats:
        """Return the POS after each step, (L,)."""
        belief = forecast_for(scenario, rules).of_pos.belief()
        pos = np.empty(len(self._looked))
        for step, update in enumerate(self._looked):
            update(belief)
            belief.advance()
            pos[step] = belief.pos
        return pos

    def found(self, scenario: Scenario, rules: Rules, missions: int) -> Floats:
        """Return the share of missions that have found the person after each step, (L,)."""

        def repeated(search: Search, *, seed: int) -> Any:
            return lambda observations, infos: self.actions[infos[next(iter(infos))]["step"]]

        played = play_missions(missions, repeated, scenario, rules=rules, planner_seeds=[0])
        at = np.bincount(played.steps[played.found], minlength=len(self.actions) + 1)
        return np.cumsum(at)[1:] / missions


def _looks_at_cells(scenario: ResolvedScenario, rules: Rules) -> Callable[[PlayedStep], Update]:
    """Return what updates a belief with the looks of a step, on cells."""
    looks = looks_of(scenario, rules)

    def looked_in(step: PlayedStep) -> Update:
        done = (step.infos[drone].get("action", action) for drone, action in step.actions.items())
        flown = zip(step.actions, done, cells_of(step.observations), strict=True)
        looked = [
            look
            for drone, action, cell in flown
            for look in looks.done(number_of(drone), int(action), cell)
        ]
        return lambda belief: belief.update(looked)

    return looked_in


def _looks_on_paths(env: SearchEnv) -> Callable[[PlayedStep], Update]:
    """Return what updates a belief with the looks of a step, in metres."""
    metres, kinds = env.world.metres, env.world.looks.kind
    assert metres is not None
    everybody = np.ones(len(kinds), np.bool_)

    def looked_in(_: PlayedStep) -> Update:
        paths = PathsFlown(metres.detectors, kinds, metres.paths[0].copy(), everybody, ~everybody)
        return lambda belief: belief.update_in_passing(paths)

    return looked_in


class Row(NamedTuple):
    """A planner and the search that it flies.

    Attributes:
        planner: The planner.
        rules: The rules of the search.
        fields: Fields of the scenario that differ from those of the incident.
    """

    planner: str
    rules: Rules
    fields: dict[str, Any] = {}


def rows_of(planners: Sequence[str]) -> dict[str, Row]:
    """Return what flies in each incident, by key."""
    rows = {name: Row(name, SEA) for name in planners} | {STOPS: Row(BASELINE, STOPPING)}
    in_metres = [name for name in planners if name in registry.IN_METRES]
    rows |= {f"{name}{IN_METRES}": Row(name, FLIGHT) for name in in_metres}
    return rows | {ROUND: Row(BASELINE, FLIGHT, {"searchers": ("round",)})}


def fly(number: int, planners: Sequence[str]) -> dict[str, Floats]:
    """Search an incident with each planner, `BASELINE` among them.

    Returns:
        (2, 3) by key of `rows_of`, POS and share found after each of `MINUTES`; by key of `ERRORS`
        the same of `BASELINE` if the persons drift otherwise.
    """
    drawn = incident(number)
    step_s = Scenario(**drawn["fields"]).resolve(SEA).step_duration_s
    limit = ceil(60 * MINUTES[-1] / step_s)
    scenario = Scenario(**drawn["fields"], timestep_limit=limit)
    last = [int(60 * minutes / step_s) - 1 for minutes in MINUTES[:-1]] + [limit - 1]
    flown, plans = {}, {}
    for name, row in rows_of(planners).items():
        of_row = scenario.override(**row.fields)
        plan = plans[name] = Plan(row.planner, of_row, row.rules, seed=number)
        pos, found = plan.pos(of_row, row.rules), plan.found(of_row, row.rules, MISSIONS)
        flown[name] = np.stack([pos[last], found[last]])
    flown["none"] = flown[BASELINE]
    for error, truth in drawn["truths"].items():
        misled = {**drawn["fields"]["incident"], "truth": truth}
        wrong = scenario.override(incident=misled, particles=TRACKS)
        found = plans[BASELINE].found(wrong, SEA, MISSIONS)
        flown[error] = np.stack([flown[BASELINE][0], found[last]])
    return flown


def figures(flown: Floats, beside: Floats) -> dict[str, Any]:
    """Return means over the incidents with their intervals.

    Args:
        flown: (I, 2, 3), see `fly`.
        beside: The same of the planner to compare with.
    """
    each = np.arange(len(flown))
    of_missions = np.repeat(each, MISSIONS)
    found = np.round(MISSIONS * flown[:, 1, :, None]) > np.arange(MISSIONS)
    estimates = {
        "pos": [of_mean(pos, LEVEL, each) for pos in flown[:, 0].T],
        "found": [
            of_share(found[:, column].ravel(), LEVEL, of_missions) for column in range(len(MINUTES))
        ],
    }
    for name, other in (("found_over_pos", flown[:, 0]), ("difference", beside[:, 1])):
        estimates[name] = [of_mean(more, LEVEL, each) for more in (flown[:, 1] - other).T]
    row: dict[str, Any] = {}
    for name, columns in estimates.items():
        row[name] = [estimate.value for estimate in columns]
        row[f"{name}_interval"] = [(estimate.low, estimate.high) for estimate in columns]
    return row


def run(planners: Sequence[str], workers: int, count: int = COUNT) -> dict[str, Any]:
    """Search the incidents; returns the figures by planner and by error."""
    flown: dict[int, dict[str, Floats]] = {}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        jobs = {pool.submit(fly, number, planners): number for number in range(count)}
        for job in progress(as_completed(jobs), "compare, incidents", total=len(jobs)):
            number = jobs[job]
            flown[number] = job.result()
            found = (f"{name} {flown[number][name][1, -1]:.1%}" for name in rows_of(planners))
            say(f"incident {number}: {', '.join(found)}")
    stacked = {
        name: np.stack([flown[number][name] for number in range(count)]) for name in flown[0]
    }
    return {
        "incidents": {
            name: figures(stacked[name], stacked[BASELINE]) for name in rows_of(planners)
        },
        "wrong_drift": {name: figures(stacked[name], stacked["none"]) for name in ERRORS},
    }
