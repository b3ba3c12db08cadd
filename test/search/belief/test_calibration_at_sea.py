# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""POS of a search at sea is the share of persons that missions find."""

from __future__ import annotations

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from dsse_ros.planners.belief import GreedyOnBelief
from dsse_ros.planners.planner import DecisionPoint
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.cell_tracks import Draw, tracks_of
from dsse_ros.search.step.looks import looks_of, searches_of
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

LAND = {
    "type": "Polygon",
    "coordinates": [[[-45.997, -25], [-45, -25], [-45, -23], [-45.997, -23], [-45.997, -25]]],
}
SEA = profile("sea")
DRONES, STEPS = 3, 120
CASES = [
    (key, pod, shore)
    for key in ("PIW-1", "PERSON-POWERED-VESSEL-1", "SKIFF-2")
    for pod, shore in ((1.0, True), (0.8, False))
]
MISSIONS = 30
"""Of each ensemble."""


def search(
    key: str, pod: float, shore: bool, persons: int, seed: int, until: float
) -> tuple[float, int]:
    """Play missions with one plan until it has this POS; return its POS and the persons found."""
    scenario = Scenario(
        incident={
            "object": key, "search_start": "2026-01-17T14:00Z", "wind": {"from": 270, "speed": 5.0},
            "seen": [{"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 300}],
            "shore": LAND if shore else None,
        },
        particles=4000, num_drones=DRONES, person_amount=persons, timestep_limit=STEPS,
        person_pod_multipliers=(pod,) * persons, ensemble_seed=seed,
    ).resolve(SEA)  # fmt: skip
    world = World(scenario, SEA, MISSIONS, write_maps=False)
    world.seed(seed * MISSIONS)
    world.reset()
    # The plan goes on as if nobody were found, so its POS is that of every mission.
    blind = World(scenario.override(probability_of_detection=0.0).resolve(SEA), SEA, 1)
    blind.reset()
    assert blind.faults is not None
    looks = looks_of(scenario, SEA)
    planned, belief = (
        forecast_for(scenario, SEA, draw=draw).belief() for draw in (Draw.PLANNING, Draw.POS)
    )
    tactic = GreedyOnBelief(planned.forecast)
    cells = list(scenario.drones_positions)
    for _ in range(STEPS):
        ends = tactic(DecisionPoint(planned, range(DRONES), cells))
        going = zip(cells, ends, strict=True)
        actions = np.array([SEA.action_set.action(*leg) for leg in going], np.int8)
        world.step(np.tile(actions, (MISSIONS, 1)))
        blind.step(actions[None])
        cells = list(zip(*(blind.drones[axis][0].tolist() for axis in "xy"), strict=True))
        done = zip(blind.faults.applied[0].tolist(), cells, strict=True)
        looked = [look for n, (a, cell) in enumerate(done) for look in looks.done(n, a, cell)]
        for each in (planned, belief):
            each.update(looked)
            each.advance()
        if belief.pos >= until:
            break
    return belief.pos, int(world.persons["found"].sum())


@pytest.mark.slow
@pytest.mark.parametrize(("persons", "ensembles"), [(1, 4), (4, 2)])
def test_pos_is_the_share_of_persons_found(persons: int, ensembles: int) -> None:
    # Each ensemble of a case has its own particles, so that their sampling errors average out.
    rng = np.random.default_rng(1)
    searches = []
    for number, case in enumerate(CASES):
        for k in range(ensembles):
            searches.append(search(*case, persons, 100 * number + k, rng.uniform(0.02, 0.98)))
    pos, found = np.array(searches).T
    bins = np.minimum((10 * pos).astype(int), 9)
    count = MISSIONS * persons
    for number in np.unique(bins):
        chosen = bins == number
        expected = count * pos[chosen].sum()
        spread = np.sqrt(count * (pos[chosen] * (1 - pos[chosen])).sum())
        # 99 % for all bins together; half a person for the discrete counts.
        most = NormalDist().inv_cdf(1 - 0.005 / 10) * spread + 0.5
        assert found[chosen].sum() == pytest.approx(expected, abs=most)


@pytest.mark.slow
@pytest.mark.parametrize("seen", [Draw.BELIEF, Draw.PLANNING])
def test_pos_does_not_count_what_a_planner_has_chosen_by_chance(seen: Draw) -> None:
    too_high: dict[Draw, list[float]] = {seen: [], Draw.POS: []}
    for seed in range(12):
        scenario = Scenario(
            incident={
                "object": "PIW-1", "search_start": "2026-01-17T14:00Z",
                "wind": {"from": 270, "speed": 5.0},
                "seen": [{"lat": 0.0, "lon": 0.0, "time": "2026-01-17T13:00Z", "radius": 300}],
            },
            particles=1000, num_drones=DRONES, timestep_limit=STEPS, ensemble_seed=seed,
        ).resolve(SEA)  # fmt: skip
        forecast = EnsembleForecast(scenario, SEA, draw=seen)
        of_persons, tracks = EnsembleForecast(scenario, SEA), tracks_of(scenario, SEA)
        assert tracks is not None
        weights = np.diff(tracks.cumulative, prepend=0)
        of_persons.tracks = replace(tracks, particles=tracks.truth, weights=weights)
        beliefs = {seen: forecast.belief(), Draw.POS: forecast.of_pos.belief()}
        exact = of_persons.belief()
        tactic = GreedyOnBelief(forecast)
        cells = list(scenario.drones_positions)
        for _ in range(STEPS):
            ends = tactic(DecisionPoint(beliefs[seen], range(DRONES), cells))
            searched = [a for a, b in zip(cells, ends, strict=True) if a == b]
            for belief in (*beliefs.values(), exact):
                belief.update(searches_of(scenario, SEA, searched))
                belief.advance()
            cells = ends
        for draw, belief in beliefs.items():
            too_high[draw].append(belief.pos - exact.pos)

    def deviation(values: list[float]) -> float:
        return float(np.mean(values) / np.std(values, ddof=1) * len(values) ** 0.5)

    assert abs(deviation(too_high[Draw.POS])) < 3 < deviation(too_high[seen])
