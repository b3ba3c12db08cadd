# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled world does what the plain search does, step for step and draw for draw."""

from __future__ import annotations

import copy
import math
from itertools import cycle, islice
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from play import Draws, missions, person_cells, persons_found

from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.plain import (
    DOWN,
    LEFT,
    RIGHT,
    SEARCH,
    UP,
    Cell,
    Map,
    PlainOutcome,
    PlainSearch,
    moved,
    on_grid,
    person_factors,
    window,
)

HUNT, RETREAT = 5, 6
"""Not actions of the rules: search a person's cell or fly towards it; fly to the north-west."""


def decide(choice: int, drone: Cell, persons: list[Cell]) -> int:
    """Action that a choice of the script means for a drone here."""
    if choice == RETREAT:
        return LEFT if drone[0] > 0 else UP if drone[1] > 0 else SEARCH
    if choice != HUNT or not persons:
        return min(choice, SEARCH)
    col, row = persons[0]
    if (col, row) == drone:
        return SEARCH
    if col != drone[0]:
        return LEFT if col < drone[0] else RIGHT
    return UP if row < drone[1] else DOWN


def may_move(probability: Map, old: Cell, new: Cell) -> bool:
    """Whether a person may go from one cell to another: to a possible one, or stay if none is."""
    around = [(old[0] + dx, old[1] + dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    if new not in around:
        return False
    possible = [c for c in around if on_grid(c, probability.shape[::-1])]
    values = {(col, row): float(probability[row, col]) for col, row in possible}
    # A number too small for a product with 1 / 100 may count as nothing.
    if max(values.values(), default=0.0) < 1e-300:
        return new == old or values.get(new, 0.0) > 0
    return values.get(new, 0.0) > 0


def assert_goes_on(
    probability: Map, old: Cell, expected: Cell, new: Cell, factors: list[int]
) -> None:
    """Assert that a person went where expected, or to a cell where rounding decides which it is."""
    products = np.sort(window(probability, old) * factors)
    if products[-1] > 1e-290 and products[-2] < (1 - 1e-9) * products[-1]:
        assert new == expected
    else:
        assert may_move(probability, old, new)


def reference_of(fields: dict[str, Any]) -> PlainSearch:
    return PlainSearch(
        size=fields["grid_size"],
        starts=fields["drones_positions"],
        lkp=fields["person_initial_position"],
        vector=fields["vector"],
        sigma=(fields["sigma_x"], fields["sigma_y"]),
        limit=fields["timestep_limit"],
        person_amount=fields["person_amount"],
        pod=fields.get("probability_of_detection", 1.0),
    )


def assert_same_map(env: SearchEnv, reference: PlainSearch) -> None:
    np.testing.assert_allclose(env.probability, reference.probability, rtol=0, atol=1e-6)
    assert not env.probability[reference.probability == 0].any()
    assert env.probability[reference.probability > 1e-30].all()


def assert_same_rewards(rewards: dict[str, float], expected: PlainOutcome) -> None:
    assert set(rewards) == {f"drone{i}" for i in expected.rewards}
    for drone, reward in expected.rewards.items():
        actual = rewards[f"drone{drone}"]
        if drone not in expected.searched:
            assert actual == reward
        elif abs(expected.searched[drone] - 0.01) > 1e-9:
            assert math.isclose(actual, reward, rel_tol=1e-9)
        else:
            # Rounding decides on which side of 1 % this cell lies.
            assert actual == -100 or math.isclose(actual, 100, rel_tol=1e-6)


def flags(numbers: set[int], expected: PlainOutcome) -> dict[str, bool]:
    return {f"drone{i}": i in numbers for i in expected.rewards}


def assert_same_step(env: SearchEnv, reference: PlainSearch, choices: tuple[int, ...]) -> None:
    """Step both; fail on any difference. The reference's persons go where the world's go."""
    hidden = [p for i, p in enumerate(reference.persons) if i not in reference.found]
    actions = {
        drone: decide(choices[drone % len(choices)], reference.drones[drone], hidden)
        for drone in sorted(reference.active)
    }
    active_before = sorted(reference.active)
    found_before, draw = set(reference.found), Draws(env)
    expected = reference.step(actions, draw)
    observations, rewards, terminated, truncated, infos = env.step(
        {f"drone{drone}": action for drone, action in actions.items()}
    )

    assert_same_rewards(rewards, expected)
    assert terminated == flags(expected.terminated, expected)
    assert truncated == flags(expected.truncated, expected)
    assert env.agents == [f"drone{i}" for i in sorted(reference.active)]
    assert env.positions.tolist() == [list(cell) for cell in reference.drones]
    assert np.flatnonzero(env.world.found[0]).tolist() == sorted(expected.finders)
    assert persons_found(env) == reference.found >= found_before
    assert_same_map(env, reference)
    olds, same_draw, news = list(reference.persons), copy.copy(draw), person_cells(env)
    reference.move_persons(draw)
    for person, (old, new) in enumerate(zip(olds, news, strict=True)):
        if person in reference.found:
            assert new == old
        else:
            assert on_grid(new, reference.size)
            where, factors = reference.persons[person], person_factors(same_draw)
            assert_goes_on(reference.probability, old, where, new, factors)
    reference.persons = news

    assert list(observations) == list(infos) == [f"drone{i}" for i in active_before]
    for drone in active_before:
        cell = reference.drones[drone]
        position, probability = observations[f"drone{drone}"]
        assert tuple(position.tolist()) == cell
        assert probability is observations[f"drone{active_before[0]}"][1]
        info = infos[f"drone{drone}"]
        assert info["Found"] is reference.all_found
        assert info["action_mask"].tolist() == [
            on_grid(moved(cell, action), reference.size) for action in range(5)
        ]
    if observations:
        np.testing.assert_array_equal(probability, env.probability)


CHOICES = st.tuples(*[st.sampled_from([LEFT, RIGHT, UP, DOWN, SEARCH, HUNT, HUNT, RETREAT])] * 3)
SCRIPTS = st.lists(CHOICES, min_size=1, max_size=10)
"""What drones 0, 1, 2, 3, ... do step by step; drone 3 does as drone 0, and so on."""
PODS = st.just(1.0) | st.floats(0.05, 1.0)


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(missions(), SCRIPTS, st.integers(20, 60), st.integers(0, 2**32 - 1), PODS)
@example(
    # A whole mission of a drone that never finds anybody: to the limit and past it.
    {
        "grid_size": (9, 9),
        "num_drones": 1,
        "drones_positions": [(0, 8)],
        "person_initial_position": (8, 0),
        "person_amount": 1,
        "vector": (-0.1, 0.1),
        "sigma_x": 2.0,
        "sigma_y": 3.0,
        "timestep_limit": 30,
    },
    [(SEARCH,)],
    33,
    1,
    1.0,
)
@example(
    # A full grid: a drone that moves inside it collides.
    {
        "grid_size": (3, 3),
        "num_drones": 9,
        "drones_positions": [(i % 3, i // 3) for i in range(9)],
        "person_initial_position": (1, 1),
        "person_amount": 2,
        "vector": (0.3, 0.0),
        "sigma_x": 1.0,
        "sigma_y": 1.0,
        "timestep_limit": 30,
    },
    [(SEARCH, LEFT, RIGHT), (SEARCH, SEARCH, UP), (DOWN, LEFT, SEARCH)],
    20,
    2,
    0.4,
)
def test_every_step_is_that_of_the_reference(
    fields: dict[str, Any], script: list[tuple[int, ...]], steps: int, seed: int, pod: float
) -> None:
    fields = fields | {"probability_of_detection": pod}
    env = parallel_env(**fields)
    env.reset(seed=seed)
    reference = reference_of(fields)
    assert_same_map(env, reference)
    assert person_cells(env) == reference.persons
    for choices in islice(cycle(script), steps):
        assert_same_step(env, reference, choices)
        if not env.agents:
            env.reset()
            reference = reference_of(fields)
            assert_same_map(env, reference)
            assert person_cells(env) == reference.persons
            assert env.positions.tolist() == [list(cell) for cell in reference.drones]


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(missions(max_drones=3), missions(max_drones=3), st.lists(CHOICES, max_size=12))
def test_reset_options_state_the_next_mission_and_only_that(
    usual: dict[str, Any], other: dict[str, Any], script: list[tuple[int, ...]]
) -> None:
    env = parallel_env(**usual)
    size = usual["grid_size"]
    start = tuple(
        c % count for c, count in zip(other["person_initial_position"], size, strict=True)
    )
    options = {"vector": other["vector"], "person_initial_position": start}
    if other["num_drones"] == usual["num_drones"] and all(
        count <= most for count, most in zip(other["grid_size"], size, strict=True)
    ):
        options["drones_positions"] = other["drones_positions"]
    for given_options in (options, None, options):
        env.reset(seed=1, options=given_options)
        reference = reference_of(usual | (given_options or {}))
        assert_same_map(env, reference)
        for choices in script:
            if env.agents:
                assert_same_step(env, reference, choices)


@settings(deadline=None, max_examples=15)
@given(missions(), st.floats(0, 8))
def test_pre_search_drift_is_that_many_steps_of_the_sea_before_the_first(
    fields: dict[str, Any], minutes: float
) -> None:
    env = parallel_env(**fields, pre_search_minutes=minutes)
    env.reset(seed=0)
    reference = reference_of(fields)
    for _ in range(round(minutes * 60 / 13)):
        reference.drift()
    assert_same_map(env, reference)
    assert env.positions.tolist() == [list(cell) for cell in reference.drones]
    # Where nothing is possible a person is only left behind by a current that outran it.
    assert all(on_grid(cell, reference.size) for cell in person_cells(env))
    reference.persons = person_cells(env)
    # None of it counts as a step of the drones: a find now earns the whole bonus.
    assert_same_step(env, reference, (HUNT, SEARCH, HUNT))
