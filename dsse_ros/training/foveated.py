# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The input of a drone's network: belief and drones around it, coarser further away."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from dsse_ros.world.scenario.actions import ACTION_VECTORS

WINDOWS = ((1, 15), (3, 11), (9, 9))
"""Of each window: cells along a block, and blocks along the window. Both are odd, so that the drone
is in the middle of the middle block. The widest reaches 40 cells in each direction."""
CASE = 6
"""Numbers that describe the search, see `Foveated`."""
SCALARS = 2 + 4 + 1 + len(WINDOWS) + CASE
FEATURES = 8 * -(-(3 * sum(blocks**2 for _, blocks in WINDOWS) + SCALARS) // 8)
"""The last ones are 0: tensor cores want a multiple of 8."""
NOTHING = 1e-9
"""Highest probability in a window that counts as none."""
TURNS = 4
"""Quarter turns of a square."""


class Drones(NamedTuple):
    """N drones of each of B searches, and all M drones of the search.

    Attributes:
        own: (B, N, 2) float32, cells (x, y).
        all: (B, M, 2) float32, cells; those far off the grid are in no window.
        ranks: (B or 1, N, 2, M) bool, whether the others have a lower, and a higher number.
    """

    own: Tensor
    all: Tensor
    ranks: Tensor


def of_all(cells: Tensor) -> Drones:
    """Return all the drones of searches, with cells (B, N, 2)."""
    places, order = cells.float(), torch.arange(cells.shape[1], device=cells.device)
    number = order[:, None]
    return Drones(places, places, torch.stack([order < number, order > number], dim=1)[None])


class Foveated(nn.Module):
    """Turns what drones know into features; it has no weights.

    Windows of blocks surround the drone. Features of a block are the root of its probability over
    the highest in the window, and the numbers of drones in it with a lower and with a higher number
    than this one. Without this distinction, drones in the same cell would act alike forever. The
    grid and the swarm may have any size.
    """

    def forward(self, drones: Drones, belief: Tensor, case: Tensor) -> Tensor:
        """Return features (B, N, `FEATURES`) float32.

        Args:
            drones: The drones.
            belief: (B, G, G) as [y, x], of sum 1.
            case: (B, `CASE`) drift of the map (x, y) in cells per step, steps done over the time
                limit, standard deviation of the map along x and y in cells, and its growth per
                step.
        """
        own, others, ranks = drones
        edge = belief.shape[-1] - 1
        line = torch.arange(edge + 1, dtype=belief.dtype, device=belief.device)
        away = (others[:, None] - own[:, :, None]).mT
        planes, scales = [], []
        for level, blocks in WINDOWS:
            columns, rows = _blocks(line - own[..., None], level, blocks).unbind(2)
            # Of all drones at once: the belief is not copied for each.
            of_rows = (rows.flatten(1, 2) @ belief).unflatten(1, (-1, blocks))
            mass = of_rows @ columns.mT
            most = mass.amax(dim=(2, 3))
            planes.append((mass / most.clamp(min=NOTHING)[..., None, None]).sqrt())
            scales.append(most.sqrt())
            in_column, in_row = _blocks(away, level, blocks).unbind(2)
            # First those with lower numbers, then those with higher ones.
            ranked = ranks[:, :, :, None] * in_row[:, :, None]
            planes.append(ranked.flatten(2, 3) @ in_column.mT)
        middle = torch.stack([belief.sum(1) @ line, belief.sum(2) @ line], dim=1)[:, None] - own
        highest = belief.amax(dim=(1, 2)).clamp(min=1e-6).log()
        drift, time, spread, growth = case.split([2, 1, 2, 1], dim=1)
        known = torch.cat([5 * drift, time, spread / 5, 10 * growth, highest[:, None] / -7], dim=1)
        features = torch.cat(
            [
                *(plane.flatten(2) for plane in planes),
                own / edge * 2 - 1, middle / 20, torch.tanh(middle / 5),
                torch.stack(scales, dim=2),
                known[:, None].expand(-1, own.shape[1], -1),
            ],
            dim=2,
        )  # fmt: skip
        return functional.pad(features, (0, FEATURES - features.shape[2]))


def _blocks(offsets: Tensor, level: int, blocks: int) -> Tensor:
    """Return (..., blocks, L): 1 where one of the offsets (..., L) in cells lies in a block."""
    index = (offsets + (level * blocks - 1) // 2) // level
    numbers = torch.arange(blocks, dtype=offsets.dtype, device=offsets.device)
    return (index[..., None, :] == numbers[:, None]).to(offsets.dtype)


def turn_of(drift: Tensor) -> Tensor:
    """Return the quarter turns (K,) that make drifts (K, 2) point between right and down."""
    left, up = (drift < 0).unbind(1)
    return torch.where(left, torch.where(up, 2, 3), torch.where(up, 1, 0))


def turned_cells(cells: Tensor, turn: Tensor, edge: int) -> Tensor:
    """Return cells (K, M, 2) after quarter turns (K,) to the right of a grid, with G - 1."""
    x, y = cells.unbind(-1)
    ways = [(x, y), (edge - y, x), (edge - x, edge - y), (y, edge - x)]
    return _by_turn([torch.stack(way, dim=-1) for way in ways], turn)


def turned_map(belief: Tensor, turn: Tensor) -> Tensor:
    """Return maps (K, G, G) after quarter turns (K,) to the right."""
    ways = [belief, belief.mT.flip(2), belief.flip(1).flip(2), belief.mT.flip(1)]
    return _by_turn(ways, turn)


def turned_case(case: Tensor, turn: Tensor) -> Tensor:
    """Return what describes searches, (K, `CASE`), after quarter turns (K,) to the right."""
    drift, time, spread, growth = case.split([2, 1, 2, 1], dim=-1)
    across = spread.flip(1)
    return torch.cat(
        [
            turned_cells(drift[:, None], turn, 0)[:, 0], time,
            _by_turn([spread, across, spread, across], turn), growth,
        ],
        dim=1,
    )  # fmt: skip


def _by_turn(ways: Sequence[Tensor], turn: Tensor) -> Tensor:
    """Return of each row the way with the number of its turn."""
    turn = turn.reshape(-1, *(1,) * (ways[0].dim() - 1))
    chosen = ways[0]
    for number, way in enumerate(ways):
        chosen = torch.where(turn == number, way, chosen)
    return chosen


def order_of_actions(names: Sequence[str]) -> Tensor:
    """Return (`TURNS`, A) int64: by turn, the number of each action in the turned search.

    Args:
        names: Names of the actions by number; with each move, its turned ones too.
    """
    moves = [ACTION_VECTORS[name] for name in names]
    order, turned = [], moves
    for _ in range(TURNS):
        order.append([moves.index(move) for move in turned])
        turned = [(-y, x) for x, y in turned]
    return torch.tensor(order)
