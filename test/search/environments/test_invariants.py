# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What holds in every step of every mission, however it is played and however extreme it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from play import missions, person_cells, persons_found, put_person, some_actions, started, step

from dsse_ros.search.environments.parallel_env import SearchEnv

MOVES_AND_PENALTIES = {1.0, -100.0, -100000.0}


class Watch:
    """Checks after every step what must never break, given what was there before."""

    def __init__(self, env: SearchEnv) -> None:
        self.env = env
        self.begin()

    def begin(self) -> None:
        """Forget the last mission."""
        self.agents = set(self.env.agents)
        self.found = persons_found(self.env)
        self.persons = person_cells(self.env)
        self.check_map()

    def check_map(self) -> None:
        probability = self.env.probability
        assert np.isfinite(probability).all()
        assert probability.min() >= 0
        assert abs(float(probability.sum(dtype=np.float64)) - 1) <= 1e-6

    def check(self, rewards: dict[str, float]) -> None:
        env = self.env
        grid = env.world.grid_size
        self.check_map()
        assert set(rewards) == self.agents
        assert set(env.agents) <= self.agents
        self.agents = set(env.agents)
        found = persons_found(env)
        assert found >= self.found
        self.found = found
        assert env.positions.min() >= 0 and (env.positions < grid).all()
        cells = [tuple(env.positions[env.possible_agents.index(a)]) for a in env.agents]
        assert len(set(cells)) == len(cells)
        persons = person_cells(env)
        for i, (old, new) in enumerate(zip(self.persons, persons, strict=True)):
            assert grid.holds(*new)
            assert max(abs(new[0] - old[0]), abs(new[1] - old[1])) <= (i not in found)
        self.persons = persons
        count = len(persons)
        for reward in rewards.values():
            searched = 100 - 1e-3 <= reward <= 10000 + 1e-3
            found_some = 10000 < reward <= 20000 * count
            assert reward in MOVES_AND_PENALTIES or searched or found_some


def play(env: SearchEnv, steps: int, generator: np.random.Generator, *, careful: bool) -> int:
    """Play at random and watch; return the number of missions begun."""
    watch = Watch(env)
    missions_begun = 1
    for _ in range(steps):
        if not env.agents:
            env.reset()
            watch.begin()
            missions_begun += 1
        _, rewards, terminated, truncated, _ = env.step(
            some_actions(env, generator, careful=careful)
        )
        watch.check(rewards)
        ended = {agent for agent in rewards if terminated[agent] or truncated[agent]}
        assert set(env.agents) == set(rewards) - ended
    return missions_begun


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(missions(max_grid=14, max_drones=20), st.integers(0, 999), st.booleans())
def test_no_play_breaks_the_world(fields: dict[str, Any], seed: int, careful: bool) -> None:
    play(started(seed, **fields), 40, np.random.default_rng(seed), careful=careful)


@pytest.mark.slow
def test_twenty_thousand_steps_of_play_leave_the_world_sound() -> None:
    env = started(1, grid_size=12, num_drones=2, person_amount=2, vector=(0.13, -0.07), sigma=2.5)
    assert play(env, 20000, np.random.default_rng(1), careful=True) > 100


@pytest.mark.slow
def test_one_mission_of_twenty_thousand_steps_stays_sound() -> None:
    env = started(
        2, grid_size=9, drones_positions=[(1, 0)], vector=(0.013, -0.007), timestep_limit=10**6
    )
    watch = Watch(env)
    for number in range(20000):
        if number % 4 == 0:
            put_person(env, (8, 8))
            watch.begin()
        watch.check(step(env, number % 2)[1])
    assert env.agents == ["drone0"]
    assert env.state()[3, 0, 0] == np.float32(0.02)


@pytest.mark.parametrize("sigma_x", [1e-3, 0.03, 1.0, 1e6])
@pytest.mark.parametrize("sigma_y", [1e-3, 1e6])
@pytest.mark.parametrize("vector", [(0, 0), (5, -5), (-0.3, 5)])
def test_extreme_spreads_and_currents_leave_a_map(
    sigma_x: float, sigma_y: float, vector: tuple[float, float]
) -> None:
    fields: dict[str, Any] = {"grid_size": 11, "num_drones": 2, "vector": vector}
    env = started(sigma_x=sigma_x, sigma_y=sigma_y, **fields)
    play(env, 60, np.random.default_rng(0), careful=True)


@pytest.mark.parametrize("size", [1, 2, 3, 5])
@pytest.mark.parametrize("careful", [True, False])
def test_a_grid_full_of_drones_is_a_world_too(size: int, careful: bool) -> None:
    env = started(grid_size=size, num_drones=size * size, sigma=1)
    assert len({tuple(cell) for cell in env.positions.tolist()}) == size * size
    assert play(env, 50, np.random.default_rng(0), careful=careful) > 1


def test_on_a_grid_of_one_cell_there_is_nothing_but_to_search() -> None:
    env = started(grid_size=1, vector=(0.9, -0.9), sigma=0.1)
    assert env.action_masks().tolist() == [[0, 0, 0, 0, 1]]
    _, rewards, terminated, _, infos = step(env, 4)
    assert rewards == {"drone0": 20000}
    assert terminated["drone0"] and infos["drone0"]["Found"]


def test_a_current_of_any_strength_leaves_datum_and_person_on_the_grid() -> None:
    for vector in [(1e6, -1e6), (-1e6, 1e-6), (7.999, 7.999)]:
        env = started(vector=vector, sigma=2)
        play(env, 30, np.random.default_rng(0), careful=True)
