# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A belief of an ensemble is what plain loops over its particles give, and is calibrated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from looking import looks_at
from numpy.typing import NDArray

from dsse_ros.search.belief.ensemble_belief import EnsembleBelief, EnsembleForecast
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.belief.protocol import LooksToCome, TargetBelief, TargetForecast
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.looks import Looked
from dsse_ros.world.scenario.rules import Rules, profile
from dsse_ros.world.scenario.scenario import Scenario

G = 7
cells = st.tuples(st.integers(-1, G), st.integers(-1, G))
looks = st.lists(st.lists(st.tuples(cells, st.floats(0.0, 1.0)), max_size=4), max_size=8)


def rules_of(name: str = "v2") -> Rules:
    return profile(name, person_motion="constant_drift")


def belief_of(name: str = "v2", **fields: Any) -> EnsembleBelief:
    given: dict[str, Any] = {
        "grid_size": G, "person_initial_position": (3, 2), "vector": (0.5, 0.4), "particles": 300,
        "timestep_limit": 20, "sigma": 1.0,
    }  # fmt: skip
    scenario = Scenario(**(given | fields))
    belief = forecast_for(scenario, rules_of(name), horizon=5).belief()
    assert isinstance(belief, EnsembleBelief)
    return belief


def test_it_is_a_target_belief() -> None:
    # Checked by mypy.
    belief: TargetBelief = belief_of()
    forecast: TargetForecast = belief.forecast
    assert belief.step == 0 and belief.pos == 0.0 and forecast.padded == (G + 6, G + 6)


@pytest.mark.slow
@given(looks)
@settings(deadline=None)
def test_a_belief_of_one_person_is_bayes_rule_on_the_particles(
    steps: list[list[tuple[tuple[int, int], float]]],
) -> None:
    belief = belief_of()
    forecast = belief.forecast
    weights, missed = forecast.weights.copy(), 1.0
    for t, of_step in enumerate(steps):
        belief.update([Looked(cell, np.array([pod])) for cell, pod in of_step])
        left = weights.copy()
        for cell, pod in of_step:
            on_grid = 0 <= cell[0] < G and 0 <= cell[1] < G
            for k, (x, y) in enumerate(forecast.cells[forecast.first_step + t].tolist()):
                if on_grid and (x, y) == cell:
                    left[k] *= 1.0 - pod
        missed *= left.sum()
        if left.sum() < 1e-9:
            # It starts again.
            left = forecast.weights.copy()
        weights = left / left.sum()
        assert belief.density[0] == pytest.approx(weights, abs=1e-12)
        assert belief.pos == pytest.approx(1.0 - missed, abs=1e-12)
        assert belief.poc().sum() + belief.outside == pytest.approx(1.0)
        belief.advance()


@pytest.mark.slow
@given(looks, st.lists(st.booleans(), min_size=40, max_size=40))
@settings(deadline=None)
def test_shares_of_several_persons_stay_probabilities(
    steps: list[list[tuple[tuple[int, int], float]]], found: list[bool]
) -> None:
    belief = belief_of(
        person_amount=3, person_pod_multipliers=(1.0, 0.5, 1.0), probability_of_detection=0.8
    )
    outcomes = iter(found)
    for of_step in steps:
        for cell, pod in of_step:
            look, before = Looked(cell, np.full(3, pod)), belief.pos
            if next(outcomes):
                belief.observe_find(look)
            else:
                belief.update([look])
            assert belief.pos >= before - 1e-12
        assert (belief.density >= 0.0).all()
        assert belief.density.sum() == pytest.approx(1.0)
        assert belief.of_missing().sum() == pytest.approx(1.0)
        assert ((belief.missing >= 0.0) & (belief.missing <= 1.0)).all()
        assert belief.poc().sum() + belief.outside == pytest.approx(1.0)
        belief.advance()


cells = st.tuples(st.integers(0, G - 1), st.integers(0, G - 1))


@pytest.mark.slow
@given(st.lists(st.lists(cells, max_size=3), min_size=1, max_size=5), st.floats(0.3, 1.0))
@settings(deadline=None)
def test_expected_finds_are_those_of_the_searches_one_after_the_other(
    searches: list[list[tuple[int, int]]], gamma: float
) -> None:
    belief = belief_of(probability_of_detection=0.6)
    forecast, horizon = belief.forecast, len(searches)
    done = [(h, look) for h, of_step in enumerate(searches) for look in looks_at(belief, of_step)]
    to_come = LooksToCome(
        np.array([0, len(done)], np.int64),
        np.array([h for h, _ in done], np.int64),
        np.array([forecast.column(look.cell) for _, look in done], np.int64),
        np.array([look.pods for _, look in done]).reshape(-1, 1),
    )
    expected = belief.outlook(horizon, gamma)(to_come)
    finds, worth, ahead = 0.0, 1.0, belief.copy()
    for of_step in searches:
        for cell in of_step:
            before = ahead.pos
            ahead.update(looks_at(belief, [cell]))
            finds += worth * (ahead.pos - before)
        ahead.advance()
        worth *= gamma
    assert expected.finds[0] == pytest.approx(finds, abs=1e-12)
    assert expected.left.sum() == pytest.approx(1.0 - ahead.pos)
    left = expected.left.reshape(forecast.padded.matrix)[3:-3, 3:-3]
    assert left == pytest.approx((1.0 - ahead.pos) * ahead.poc(), abs=1e-12)
    assert belief.pos == 0.0


def test_futures_are_tracks_by_their_weights() -> None:
    belief = belief_of(particles=2000)
    belief.update([Looked((3, 2), np.array([0.9]))])
    futures = belief.futures(40_000, 5, np.random.default_rng(0))
    ahead = belief.copy()
    for h in range(6):
        counted = np.bincount(futures.cells[h], minlength=ahead.forecast.padded.cells) / 40_000
        inner = counted.reshape(ahead.forecast.padded.matrix)[3:-3, 3:-3]
        assert inner == pytest.approx(ahead.poc(), abs=1e-2)
        assert 1.0 - inner.sum() == pytest.approx(ahead.outside, abs=1e-2)
        ahead.advance()


def test_the_belief_of_no_searches_is_the_observed_map() -> None:
    fields: dict[str, Any] = {
        "grid_size": G, "person_initial_position": (3, 2), "vector": (0.5, 0.4), "particles": 300,
        "timestep_limit": 20, "sigma": 1.0,
    }  # fmt: skip
    world, belief = World(Scenario(**fields), rules_of()), belief_of()
    world.reset()
    for step in range(25):
        assert world.maps[0] == pytest.approx(belief.poc(), abs=1e-6)
        assert belief.forecast.most_probable(step + belief.forecast.first_step) == tuple(
            np.unravel_index(G * G - 1 - np.argmax(world.maps[0].ravel()[::-1]), (G, G))[::-1]
        )
        world.step(np.full((1, 1), -1, np.int8))
        belief.advance()


def greedy_plan(belief: EnsembleBelief, start: tuple[int, int]) -> NDArray[np.int8]:
    """Return the actions of a drone that goes to the most probable cell and searches it."""
    actions, forecast = [], belief.forecast
    cell, action_set = start, forecast.rules.action_set
    for _ in range(forecast.scenario.timestep_limit):
        row, col = divmod(int(belief.poc().argmax()), forecast.scenario.grid_size.columns)
        end = action_set.towards(cell, (col, row))
        actions.append(action_set.action(cell, end))
        if end == cell:
            belief.update(looks_at(belief, [cell]))
        cell = end
        belief.advance()
    return np.array(actions, np.int8)


@pytest.mark.slow
@pytest.mark.parametrize("pod", [1.0, 0.4])
def test_as_many_are_found_as_the_pos_says(pod: float) -> None:
    missions = 4000
    scenario = Scenario(
        grid_size=12, person_initial_position=(3, 3), timestep_limit=40, particles=40_000,
        drones_positions=((2, 2),), probability_of_detection=pod,
    ).resolve(rules_of())  # fmt: skip
    belief = EnsembleBelief(EnsembleForecast(scenario, rules_of()))
    plan = greedy_plan(belief, (2, 2))
    world = World(scenario, rules_of(), missions, write_maps=False)
    world.seed(1)
    world.reset()
    for action in plan:
        world.step(np.full((missions, 1), action, np.int8))
    found = float(world.persons["found"].mean())
    assert 0.3 < belief.pos < 0.99
    # That of the missions, and of the tracks that truth and belief are drawn as.
    error = np.sqrt(belief.pos * (1.0 - belief.pos) * (1 / missions + 2 / 40_000))
    assert abs(found - belief.pos) < 3.0 * error
    wrong = EnsembleBelief(EnsembleForecast(scenario.override(vector=(0.0, 0.0)), rules_of()))
    assert abs(found - _pos_of(wrong, plan)) > 3.0 * error


def _pos_of(belief: EnsembleBelief, plan: NDArray[np.int8]) -> float:
    """Return the POS that a belief gives to a plan that starts in (2, 2)."""
    action_set = belief.forecast.rules.action_set
    x, y = 2, 2
    for action in plan.tolist():
        if action == action_set.search:
            belief.update(looks_at(belief, [(x, y)]))
        x, y = x + action_set.moves[action][0], y + action_set.moves[action][1]
        belief.advance()
    return belief.pos
