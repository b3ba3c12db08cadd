# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios to draw and small ways of playing them, for the tests of the search."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st

from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv

Cell = tuple[int, int]


def cells(size: tuple[int, int]) -> st.SearchStrategy[Cell]:
    """Cells (col, row) of a grid of some columns and rows."""
    return st.tuples(*(st.integers(0, count - 1) for count in size))


def drifts() -> st.SearchStrategy[float]:
    """One axis of a drift: none, the awkward tenths, several cells at once, anything."""
    return st.sampled_from([0.0, 0.1, -0.1, 0.3, -0.5, 1.0, -1.0, 5.0, -5.0]) | st.floats(-2, 2)


def spreads() -> st.SearchStrategy[float]:
    """A spread from far below a cell to far beyond any grid."""
    return st.floats(0.3, 20) | st.floats(-3, 6).map(lambda power: 10**power)


@st.composite
def missions(
    draw: st.DrawFn, max_grid: int = 10, max_drones: int = 6, max_persons: int = 3
) -> dict[str, Any]:
    """Keyword arguments of `parallel_env`, everything stated."""
    size = draw(st.tuples(st.integers(1, max_grid), st.integers(1, max_grid)))
    count = draw(st.integers(1, min(max_drones, size[0] * size[1])))
    starts = draw(st.lists(cells(size), min_size=count, max_size=count, unique=True))
    return {
        "grid_size": size,
        "num_drones": count,
        "drones_positions": starts,
        "person_initial_position": draw(cells(size) | st.sampled_from(starts)),
        "person_amount": draw(st.integers(1, max_persons)),
        "vector": (draw(drifts()), draw(drifts())),
        "sigma_x": draw(spreads()),
        "sigma_y": draw(spreads()),
        "timestep_limit": draw(st.integers(1, 60)),
    }


def person_cells(env: SearchEnv) -> list[Cell]:
    """Where the persons are; part of the hidden state."""
    persons = env.world.persons[0]
    return list(zip(persons["x"].tolist(), persons["y"].tolist(), strict=True))


def persons_found(env: SearchEnv) -> set[int]:
    """Numbers of the persons found."""
    return set(np.flatnonzero(env.world.persons["found"][0]).tolist())


def put_person(env: SearchEnv, cell: Cell, person: int = 0) -> None:
    """Put a person into a cell."""
    env.world.persons["x"][0, person], env.world.persons["y"][0, person] = cell


def put_drones(env: SearchEnv, *positions: Cell) -> None:
    """Put the drones into cells."""
    env.world.drones["x"][0] = [x for x, _ in positions]
    env.world.drones["y"][0] = [y for _, y in positions]


def started(seed: int = 0, **fields: Any) -> SearchEnv:
    """An environment that was reset."""
    env = parallel_env(**fields)
    env.reset(seed=seed)
    return env


def step(env: SearchEnv, *actions: int) -> tuple[Any, ...]:
    """Step with the actions of the drones in flight, in their order."""
    return env.step(dict(zip(env.agents, actions, strict=True)))


def some_actions(
    env: SearchEnv, generator: np.random.Generator, *, careful: bool = False
) -> dict[str, Any]:
    """Random actions of the drones in flight; careful ones stay on the grid."""
    if env.rules.in_metres:
        return {agent: generator.uniform(-1.0, 1.0, 2) for agent in env.agents}
    weights = generator.random(env.action_masks().shape)
    if careful:
        weights *= env.action_masks()
    choices = weights.argmax(axis=1).tolist()
    return {agent: choices[int(agent.removeprefix("drone"))] for agent in env.agents}


class Draws:
    """The draws that a world will make, from its state (SplitMix64)."""

    def __init__(self, env: SearchEnv) -> None:
        self._state = int(env.world.worlds["rng"][0])

    def __call__(self) -> float:
        """Return the next float in [0, 1)."""
        self._state = (self._state + 0x9E3779B97F4A7C15) % 2**64
        z = self._state
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
        return ((z ^ (z >> 31)) >> 11) * 2.0**-53
