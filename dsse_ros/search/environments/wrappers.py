# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Encodings of observations, with their spaces, for PettingZoo's and the batch interface.

An encoding is two functions. `encode` takes the cells of all drones (..., N, 2) as (x, y) and the
map (..., R, C) as [y, x]. It returns each drone's observation (..., N, ...), or a tuple of that and
the map, which all drones share. The leading axes are B in a batch and none in one mission. `space`
returns the space of one drone; if the rules let drones fly on outside, cells can be off the grid by
a margin. Shapes and values equal those of the wrappers of DSSE 1.1.9, whose drones stay on the
grid.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv
from pettingzoo.utils.wrappers import BaseParallelWrapper

from dsse_ros.base.fields import FieldError, Spec, shown
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.env_options import check_mapping

Array = NDArray[Any]


class Encoding(NamedTuple):
    """An encoding of observations.

    Attributes:
        encode: encode(positions, probability), see the module.
        space: space(num_drones, grid, margin) of one drone's observation, for a `GridShape` and
            cells up to `Rules.margin` off the grid.
    """

    encode: Callable[[Array, Array], Any]
    space: Callable[[int, GridShape, int], spaces.Space[Any]]


def own_first(positions: Array) -> Array:
    """Return the cells of all drones for each drone (..., N, N, 2), its own swapped to first."""
    return positions[..., _order(positions.shape[-2]), :]


@cache
def _order(count: int) -> Array:
    """Return (N, N): row i is 0 to N - 1 with 0 and i swapped."""
    order = np.tile(np.arange(count), (count, 1))
    order[:, 0] = np.arange(count)
    order[np.arange(count), np.arange(count)] = 0
    return order


def _own_first_flat(positions: Array) -> Array:
    cells = own_first(positions)
    return cells.reshape(*cells.shape[:-2], -1)


def _for_each(drones: int, values: Array, axes: int) -> Array:
    """Return values (..., *rest), with `axes` axes in the rest, as (..., N, *rest)."""
    at = values.ndim - axes
    shape = (*values.shape[:at], drones, *values.shape[at:])
    return np.broadcast_to(np.expand_dims(values, at), shape)


def with_all_positions(positions: Array, probability: Array) -> tuple[Array, Array]:
    """Return (..., N, 2N) int64, the cells of `own_first`, and the shared map float32."""
    return _own_first_flat(positions.astype(np.int64)), probability.astype(np.float32, copy=False)


def flattened(positions: Array, probability: Array) -> Array:
    """Return (..., N, 2N + R * C) float64: the cells of `own_first` as shares, and the map.

    They are shares of the last column and the last row.
    """
    count, grid = positions.shape[-2], GridShape.of(probability)
    flat = probability.reshape(*probability.shape[:-2], grid.cells)
    shares = _own_first_flat(positions / _edges(grid))
    return np.concatenate([shares, _for_each(count, flat, 1)], axis=-1)


def most_probable_cells(positions: Array, probability: Array, *, count: int) -> Array:
    """Return (..., N, 2N + 2 count) int64: the cells of `own_first`, then the most probable ones.

    The most probable cell is first; among equal ones, the one further south, then further east. A
    grid with fewer cells returns all of them.
    """
    drones, grid = positions.shape[-2], GridShape.of(probability)
    flat = probability.reshape(*probability.shape[:-2], grid.cells)
    best = np.argsort(flat, axis=-1, kind="stable")[..., : -count - 1 : -1]
    cells = np.stack([best % grid.columns, best // grid.columns], axis=-1)
    cells = cells.reshape(*cells.shape[:-2], -1)
    own = _own_first_flat(positions.astype(np.int64))
    return np.concatenate([own, _for_each(drones, cells, 1)], axis=-1)


def encoded_in_matrix(positions: Array, probability: Array) -> Array:
    """Return (..., N, R, C) float32: the map with -1 in others' cells, and 2 added in its own.

    Drones are written in order, so a later drone in the same cell hides the drone itself. Drones
    off the grid are left out.
    """
    drones, grid = positions.shape[-2], GridShape.of(probability)
    out = _for_each(drones, probability, 2).astype(np.float32)
    flat = out.reshape(-1, drones, *grid.matrix)
    for world, cells in zip(flat, positions.reshape(-1, drones, 2).tolist(), strict=True):
        for i, (x, y) in enumerate(cells):
            if grid.holds(x, y):
                own = world[i, y, x] + 2
                world[:, y, x] = -1
                world[i, y, x] = own
    return out


def _edges(grid: GridShape) -> Array:
    """Return the last column and row, (2,), at least 1."""
    return np.maximum(np.array(grid) - 1, 1)


def _cells_space(count: int, grid: GridShape, margin: int) -> spaces.Box:
    high = np.tile(np.array(grid), count)
    return spaces.Box(np.full_like(high, -margin), high, dtype=np.int64)


def _flattened_space(drones: int, grid: GridShape, margin: int) -> spaces.Box:
    edges, size = _edges(grid), 2 * drones + grid.cells
    low, high = np.zeros(size), np.ones(size)
    low[: 2 * drones] = np.tile(-margin / edges, drones)
    high[: 2 * drones] = np.tile(np.maximum((np.array(grid) - 1 + margin) / edges, 1.0), drones)
    return spaces.Box(low, high, dtype=np.float64)


ALL_POSITIONS = Encoding(
    with_all_positions,
    lambda drones, grid, margin: spaces.Tuple(
        (_cells_space(drones, grid, margin), spaces.Box(0, 1, grid.matrix, np.float32))
    ),
)
"""The cells of all drones, and the map."""

FLATTENED = Encoding(flattened, _flattened_space)
"""One vector: the cells of all drones from 0 to 1, and the map."""

IN_MATRIX = Encoding(
    encoded_in_matrix, lambda _, grid, margin: spaces.Box(-1, 3, grid.matrix, np.float32)
)
"""The map alone, with the drones drawn into it."""


def top_cells(count: int = 10) -> Encoding:
    """Return the encoding of the cells of all drones and the `count` most probable ones.

    A grid with fewer cells than `count` returns all of them, and its space is as small.

    Raises:
        FieldError: If the count is not an integer >= 1.
    """
    count = Spec("int", "", low=1).check("count", count)
    return Encoding(
        partial(most_probable_cells, count=count),
        lambda drones, grid, margin: _cells_space(drones + min(count, grid.cells), grid, margin),
    )


class SeenDiscount:
    """Lowers the probability of cells that any drone has just flown over.

    A cell flown over k steps ago keeps min(k / n_steps, 1) of its probability.

    Args:
        n_steps: Steps until a cell counts in full again.
        all_seen: Whether a mission starts as if all cells had just been flown over (DSSE 1.1.9).

    Raises:
        FieldError: If n_steps is not an integer >= 1.
    """

    def __init__(self, n_steps: int = 20, *, all_seen: bool = False) -> None:
        self.n_steps = Spec("int", "", low=1).check("n_steps", n_steps)
        self._never = 0.0 if all_seen else -np.inf
        self._last_seen = np.zeros(0)

    @property
    def last_seen(self) -> Array:
        """(..., R, C) float64, the step in which each cell was flown over last, -inf for never."""
        return self._last_seen[..., 1:-1, 1:-1]

    def reset(self, probability: Array) -> None:
        """Forget all visits; later maps (..., R, C) have the shape of this one."""
        *batch, rows, columns = probability.shape
        # The table has a margin for drones just outside the grid.
        self._last_seen = np.full((*batch, rows + 2, columns + 2), self._never)

    def see(self, positions: Array, steps: Array | int) -> None:
        """Record the cells (..., N, 2) after that many steps.

        Forget the visits recorded at this step or later, which belong to an earlier mission; at
        step 0 these are all.
        """
        seen = self._last_seen.reshape(-1, *self._last_seen.shape[-2:])
        cells = positions.reshape(len(seen), -1, 2) + 1
        step = np.broadcast_to(steps, len(seen))
        seen[seen >= step[:, None, None]] = self._never
        seen[np.arange(len(seen))[:, None], cells[..., 1], cells[..., 0]] = step[:, None]

    def discount(self, probability: Array, steps: Array | int) -> Array:
        """Return the lowered maps (..., R, C) after that many steps; unchanged at step 0."""
        now = np.asarray(steps)
        factor = now[..., None, None] - self.last_seen
        factor /= self.n_steps
        np.minimum(factor, 1.0, out=factor)
        factor[now == 0] = 1.0
        return np.multiply(probability, factor, out=factor).astype(probability.dtype)


class RetainedPositions(BaseParallelWrapper[str, Any, int]):
    """Puts the drones into the same cells at every reset.

    Args:
        env: A search.
        drones_positions: Their cells (x, y).

    Raises:
        FieldError: If there is not one cell for each drone.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], drones_positions: Any) -> None:
        super().__init__(env)
        if len(drones_positions) != len(env.possible_agents):
            raise FieldError(
                f"drones_positions must be {len(env.possible_agents)} cells, one per drone, got "
                f"{shown(drones_positions)}"
            )
        self.drones_positions = drones_positions

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start a new mission; see the environment's own."""
        options = {**check_mapping(options), "drones_positions": self.drones_positions}
        return self.env.reset(seed=seed, options=options)


class _ChangedObservations(BaseParallelWrapper[str, Any, int]):
    """Returns the environment's observations changed by `_change`."""

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start a new mission; see the environment's own."""
        observations, infos = self.env.reset(seed=seed, options=dict(check_mapping(options)))
        return self._begin(observations), infos

    def step(self, actions: Mapping[str, int]) -> tuple[dict[str, Any], Any, Any, Any, Any]:
        """Advance the mission by one step; see the environment's own."""
        observations, *rest = self.env.step(dict(actions))
        return (self._change(observations) if observations else observations, *rest)

    def _begin(self, observations: dict[str, Any]) -> dict[str, Any]:
        return self._change(observations)

    def _change(self, observations: dict[str, Any]) -> dict[str, Any]:
        raise NotImplementedError


class EncodedObservations(_ChangedObservations):
    """A search whose agents observe an encoding.

    Args:
        env: A search, or a wrapper whose observations are tuples of a cell, or cells, and the map.
        encoding: Encoding that replaces the observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], encoding: Encoding) -> None:
        super().__init__(env)
        self.encoding = encoding
        self._search: Any = env.unwrapped
        self._number = {agent: i for i, agent in enumerate(env.possible_agents)}
        space = encoding.space(
            len(env.possible_agents),
            GridShape.of(self._search.probability),
            self._search.rules.margin,
        )
        self.observation_spaces = dict.fromkeys(env.possible_agents, space)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the agent's observation space, always the same object."""
        return self.observation_spaces[agent]

    def _change(self, observations: dict[str, Any]) -> dict[str, Any]:
        _, probability = next(iter(observations.values()))
        encoded = self.encoding.encode(self._search.positions, probability)
        if isinstance(encoded, tuple):
            own, shared = encoded
            return {agent: (own[self._number[agent]], shared) for agent in observations}
        return {agent: encoded[self._number[agent]] for agent in observations}


class DiscountedObservations(_ChangedObservations):
    """A search whose agents observe the map lowered by `SeenDiscount`.

    Args:
        env: A search, or a wrapper whose observations are tuples that end in the map.
        n_steps: Steps until a cell counts in full again.
        all_seen: See `SeenDiscount`.
    """

    def __init__(
        self, env: ParallelEnv[str, Any, int], n_steps: int = 20, *, all_seen: bool = False
    ) -> None:
        super().__init__(env)
        self._search: Any = env.unwrapped
        self._seen = SeenDiscount(n_steps, all_seen=all_seen)

    def _begin(self, observations: dict[str, Any]) -> dict[str, Any]:
        *_, probability = next(iter(observations.values()))
        self._seen.reset(probability)
        self._seen.see(self._search.positions, 0)
        return observations

    def _change(self, observations: dict[str, Any]) -> dict[str, Any]:
        *_, probability = next(iter(observations.values()))
        steps = self._search.steps_done
        self._seen.see(self._search.positions, steps)
        lowered = self._seen.discount(probability, steps)
        return {agent: (*first, lowered) for agent, (*first, _) in observations.items()}
