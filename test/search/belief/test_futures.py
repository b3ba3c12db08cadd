# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a belief expects of the steps to come is what follows once they are done."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from looking import looks_at, search_in_vain

from dsse_ros.search.belief.belief import Belief, Forecast, LooksToCome
from dsse_ros.search.belief.component_motion import predict_plainly
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

HORIZON, COUNT = 6, 20_000
SEARCHES: dict[str, tuple[str, dict[str, Any]]] = {
    "paper": ("paper", {"vector": (0.4, -0.3)}),
    "v1": ("v1", {"vector": (0.1, 0.1)}),
    "v2": ("v2", {}),
    "imperfect": ("paper", {"probability_of_detection": 0.6}),
    "persons": ("v2", {"person_amount": 3, "person_pod_multipliers": (1.0, 0.5, 0.2)}),
}


def belief_of(name: str) -> Belief:
    rules, fields = SEARCHES[name]
    scenario = Scenario(grid_size=12, timestep_limit=40, **fields)
    belief = Belief(Forecast(scenario, profile(rules), horizon=HORIZON, drift_samples=8))
    for _ in range(5):
        belief.advance()
    search_in_vain(belief, [belief.forecast.cell(int(belief.density[0].argmax()))])
    return belief


def to_come(belief: Belief, steps: list[int], cells: list[Cell]) -> LooksToCome:
    columns = np.array([belief.forecast.column(cell) for cell in cells])
    pods = np.array([look.pods for look in looks_at(belief, cells)])
    return LooksToCome(np.array([0, len(steps)]), np.array(steps), columns, pods)


@pytest.mark.parametrize("name", SEARCHES)
def test_futures_begin_as_the_belief_does(name: str) -> None:
    belief = belief_of(name)
    futures = belief.futures(COUNT, HORIZON, np.random.default_rng(3))
    assert futures.cells.shape == (HORIZON + 1, COUNT)
    assert set(np.unique(futures.persons)) <= set(belief.examples)
    later = belief.copy()
    for cells in futures.cells[:2]:
        shares = np.bincount(cells, minlength=later.density.shape[1]) / COUNT
        assert np.abs(shares - later.of_missing().sum(axis=0)).max() < 0.002
        later.advance()


def test_the_same_generator_draws_the_same_futures_and_leaves_the_belief_as_it_is() -> None:
    belief = belief_of("v2")
    before = belief.density.copy()
    drawn = [belief.futures(500, 3, np.random.default_rng(4)) for _ in range(2)]
    assert (drawn[0].cells == drawn[1].cells).all()
    assert (belief.density == before).all()


@pytest.mark.parametrize("name", ["paper", "v1", "imperfect"])
def test_expected_finds_are_the_rise_of_the_pos_once_the_searches_are_done(name: str) -> None:
    belief = belief_of(name)
    cell = belief.forecast.cell(int(belief.density.sum(axis=0).argmax()))
    steps = [0, 0, 1, 1, *range(2, HORIZON)]
    expected = belief.outlook(HORIZON, 1.0)(to_come(belief, steps, [cell] * len(steps)))
    later, pos = belief.copy(), belief.pos
    for step in range(HORIZON):
        search_in_vain(later, [cell] * (2 if step < 2 else 1))
        later.advance()
    finds = (later.pos - pos) / (1.0 - pos)
    assert expected.finds[0] == pytest.approx(finds, abs=1e-12)
    assert expected.left[0] == pytest.approx((1.0 - finds) * later.density.sum(axis=0), abs=1e-12)


def test_a_find_counts_for_less_the_later_it_comes() -> None:
    belief = belief_of("paper")
    cell = belief.forecast.cell(int(belief.density.sum(axis=0).argmax()))
    now = belief.outlook(1, 0.5)(to_come(belief, [0], [cell])).finds[0]
    belief.advance()
    assert now > 0.0
    assert belief.outlook(2, 0.5)(to_come(belief, [1], [cell])).finds[0] < now


@pytest.mark.parametrize("name", SEARCHES)
def test_the_motion_in_boxes_is_the_plain_motion(name: str) -> None:
    rules, fields = SEARCHES[name]
    scenario = Scenario(grid_size=9, timestep_limit=30, **fields)
    forecast = Forecast(scenario, profile(rules), drift_samples=6)
    belief = Belief(forecast)
    rng = np.random.default_rng(5)
    for _ in range(12):
        search_in_vain(belief, [(int(rng.integers(9)), int(rng.integers(9)))])
        before, after = belief.density, np.empty_like(belief.density)
        slot = forecast.prepare(forecast.first_step + belief.step)
        predict_plainly(forecast.constants, forecast.sea, before, forecast.moves.at(slot), after)
        belief.advance()
        np.testing.assert_allclose(belief.density, after, rtol=0, atol=1e-12)
