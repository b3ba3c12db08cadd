# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The exact filter: what it predicts is what happens, and it knows no more than is public."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from looking import search_in_vain
from numpy.typing import NDArray

from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.scenario import scenario_and_rules
from dsse_ros.world.targets.registry import MOTIONS

MISSIONS = 2000
Z = 3.89
"""Of a 99.99 % interval."""

EDGES = [(10, 0), (10, 19), (0, 10), (19, 10)]
CASES: dict[str, dict[str, Any]] = {
    "v2": {
        "rules": "v2", "grid_size": 20, "drones_positions": EDGES, "dispersion_inc": 0.05,
        "person_initial_position": (10, 10), "timestep_limit": 40,
    },
    "v2 after a drift, POD below 1": {
        "rules": "v2", "grid_size": 20, "drones_positions": EDGES, "vector": (0.4, 0.3),
        "person_initial_position": (5, 5), "pre_search_minutes": 5, "timestep_limit": 40,
        "probability_of_detection": 0.7, "person_pod_multipliers": [0.8],
    },
    "v2, several persons": {
        "rules": "v2", "grid_size": 20, "drones_positions": EDGES, "vector": (0.6, 0.3),
        "person_initial_position": (8, 8), "person_amount": 3, "timestep_limit": 40,
        "person_pod_multipliers": [1.0, 0.5, 0.7],
    },
    "v1": {
        "rules": "v1", "grid_size": 12, "sigma": 3, "vector": (0.1, -0.1), "timestep_limit": 40,
        "person_initial_position": (6, 6),
    },
    "v1, persons that walk off the circle": {
        "rules": "v1", "grid_size": 12, "sigma": 0.6, "vector": (1.7, -1.6), "timestep_limit": 40,
        "person_initial_position": (2, 9),
    },
    "paper after a drift, POD below 1": {
        "rules": "paper", "grid_size": 12, "num_drones": 2, "vector": (0.2, 0.1), "sigma": 3,
        "person_initial_position": (4, 6), "probability_of_detection": 0.6,
        "pre_search_minutes": 3, "timestep_limit": 40,
    },
    **{
        f"motion {name}": {"num_drones": 2, "timestep_limit": 40, "person_motion": name}
        for name in MOTIONS
    },
}  # fmt: skip


def world_and_belief(
    num_worlds: int, drift_samples: int = 256, **case: Any
) -> tuple[World, Belief]:
    scenario, rules = scenario_and_rules(rules=case.pop("rules", "paper"), **case)
    world = World(scenario, rules, num_worlds, write_maps=False)
    world.seed(20_000)
    world.reset()
    return world, Belief(Forecast(scenario, rules, drift_samples=drift_samples))


def search_greedily(belief: Belief, present: list[tuple[int, int]]) -> NDArray[np.int8]:
    """Send each drone to a cell that is likely yet and note its search; returns the actions."""
    actions, searched, likely = [], [], belief.poc()
    action_set = belief.forecast.rules.action_set
    for drone, cell in enumerate(present):
        row, col = divmod(int(np.argmax(likely)), len(likely))
        likely[row, col] = 0
        end = action_set.towards(cell, (col, row))
        if end in present:
            end = cell
        if end == cell:
            searched.append(cell)
        present[drone] = end
        actions.append(action_set.action(cell, end))
    search_in_vain(belief, searched)
    return np.array(actions, np.int8)


@pytest.mark.parametrize("case", CASES)
def test_the_predicted_share_of_finds_is_what_happens_at_every_step(case: str) -> None:
    world, belief = world_and_belief(MISSIONS, **CASES[case])
    present = list(world.scenario.drones_positions)
    found = np.zeros(MISSIONS)
    for _ in range(world.scenario.timestep_limit):
        actions = search_greedily(belief, present)
        belief.advance()
        world.step(np.tile(actions, (MISSIONS, 1)))
        found = np.maximum(found, world.persons["found"].mean(axis=1))
        deviation = np.sqrt(belief.pos * (1 - belief.pos))
        # The normal interval, and where hardly any are or are not found what Poisson's has.
        reach = Z * deviation / np.sqrt(MISSIONS) + Z**2 / MISSIONS
        assert abs(found.mean() - belief.pos) < reach, belief.step
    assert belief.pos > 0.1


@pytest.mark.parametrize("case", CASES)
def test_a_belief_that_hears_of_no_search_is_how_persons_spread(case: str) -> None:
    world, belief = world_and_belief(MISSIONS, **CASES[case])
    grid = world.grid_size
    hold = np.full(world.drones.shape, -1, np.int8)
    for _ in range(20):
        belief.advance()
        # A flag ends a mission of v1, but nobody gets one here.
        world.step(hold)
    x, y = world.persons["x"].ravel(), world.persons["y"].ravel()
    inside = (x >= 0) & (y >= 0) & (x < grid.columns) & (y < grid.rows)
    counts = np.zeros(grid.matrix)
    np.add.at(counts, (y[inside], x[inside]), 1)
    wanted = belief.poc() * world.persons.size
    likely = wanted >= 5
    rest = wanted[~likely].sum() + world.persons.size - wanted.sum()
    chi_square = ((counts - wanted)[likely] ** 2 / wanted[likely]).sum()
    chi_square += (x.size - counts[likely].sum() - rest) ** 2 / max(rest, 5.0)
    freedom = likely.sum()
    assert chi_square < freedom + Z * np.sqrt(2 * freedom) + Z**2


def test_a_belief_sums_to_one_and_a_failed_search_takes_its_pod_off_a_cell() -> None:
    _, belief = world_and_belief(1, **CASES["v2 after a drift, POD below 1"])
    for _ in range(10):
        belief.advance()
    before = belief.poc()
    row, col = divmod(int(np.argmax(before)), len(before))
    search_in_vain(belief, [(col, row)])
    after = belief.poc()
    pod = 0.7 * 0.8
    assert before.sum() == pytest.approx(1)
    assert after.sum() == pytest.approx(1)
    assert belief.pos == pytest.approx(pod * before[row, col])
    wanted = before.copy()
    wanted[row, col] *= 1 - pod
    assert after == pytest.approx(wanted / wanted.sum())


def test_a_belief_that_cannot_be_true_starts_again_from_the_map() -> None:
    _, belief = world_and_belief(1, **CASES["motion window"])
    search_in_vain(belief, [belief.forecast.scenario.person_initial_position])
    assert belief.pos == 1
    assert belief.poc().sum() == pytest.approx(1)


def test_a_forecast_that_keeps_little_gives_the_same_belief(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, updated = world_and_belief(1, **CASES["v1"])
    monkeypatch.setattr("dsse_ros.search.belief.belief.KEPT_BYTES", 0)
    _, passing = world_and_belief(1, **CASES["v1"])
    for _ in range(2):
        for belief in (updated, passing):
            belief.reset()
            for _ in range(30):
                search_in_vain(belief, [(6, 5)])
                belief.advance()
        assert np.array_equal(updated.poc(), passing.poc())
