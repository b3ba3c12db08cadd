# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The input of a drone's network: the map and the other drones around it, coarser further away."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor, nn

from dsse_ros.scenario.actions import ACTION_VECTORS
from dsse_ros.search.wrappers import Encoding, own_first

LEVELS = (1, 3, 9)
"""Cells along a block of each level; odd, so that the drone is in the middle of a block."""
BLOCKS = 9
"""Blocks along the window of each level: with these levels it sees 40 cells in each direction."""
FEATURES = (3 * BLOCKS**2 + 1) * len(LEVELS) + 3
FAR = 8.0
"""Cells; distances to the middle of the map saturate beyond a few times this."""
NOTHING = 1e-9
"""Highest probability in a window that counts as none."""
TURNS = 8
"""The symmetries of a square."""


class Foveated(nn.Module):
    """Turns the inputs of the planner `onnx` into features; it has no weights.

    Windows of `BLOCKS` x `BLOCKS` blocks surround the drone; a block has 1, 3 or 9 cells along a
    side. Features of a block are its probability over the highest in the window, and the numbers of
    drones in it with a lower and with a higher number than this one. Without this distinction,
    drones in the same cell would act alike forever. The grid and the swarm may have any size. The
    windows are mirrored so that the middle of the map lies between right and down, nearer to right.
    So a policy learned in one direction holds in all eight.
    """

    def forward(
        self, positions: Tensor, probability: Tensor, number: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return features (K, `FEATURES`), and how they were turned (K,), see `order_of_actions`.

        Args:
            positions: (K, 2M), cells (x, y) of M drones over G - 1, its own swapped with the first.
            probability: (K, G, G) as [y, x], of any scale.
            number: (K, 1), the drone's number, from 0.
        """
        edge = probability.shape[-1] - 1
        cells = torch.round(positions * edge).unflatten(1, (-1, 2))
        away = cells - cells[:, 0, None]
        # Of the others those with lower numbers come first.
        order = torch.arange(cells.shape[1], dtype=probability.dtype, device=probability.device)
        lower, higher = (order > 0) & (order <= number), order > number
        line = torch.arange(edge + 1, dtype=probability.dtype, device=probability.device)
        columns, rows = line - cells[:, 0, :1], line - cells[:, 0, 1:]
        total = probability.sum(dim=(1, 2), keepdim=True).clamp(min=1e-30)
        highest = probability.amax(dim=(1, 2), keepdim=True).clamp(min=1e-30)
        share = probability / total
        middle_x = (share.sum(dim=1) * columns).sum(dim=1)
        middle_y = (share.sum(dim=2) * rows).sum(dim=1)
        turn = torch.stack(
            [middle_x < 0, middle_y < 0, middle_y.abs() > middle_x.abs()], dim=1
        )  # fmt: skip
        planes, scales = [], []
        for level in LEVELS:
            over_rows, over_columns = _blocks(rows, level), _blocks(columns, level)
            mass = over_rows @ share @ over_columns.mT
            most = mass.amax(dim=(1, 2), keepdim=True)
            planes.append(mass / most.clamp(min=NOTHING))
            scales.append(most[:, :, 0].sqrt())
            of_rows, of_columns = _blocks(away[..., 1], level), _blocks(away[..., 0], level).mT
            planes += [(of_rows * some[:, None]) @ of_columns for some in (lower, higher)]
        windows = torch.stack(planes, dim=1)
        mirror_x, mirror_y, swap = (one[:, None, None, None] for one in turn.unbind(1))
        windows = torch.where(mirror_x, windows.flip(3), windows)
        windows = torch.where(mirror_y, windows.flip(2), windows)
        windows = torch.where(swap, windows.mT, windows)
        ahead = torch.stack([middle_x, middle_y], dim=1).abs().sort(dim=1, descending=True).values
        spread = torch.log(total / highest)[:, :, 0]
        features = torch.cat([windows.flatten(1), *scales, torch.tanh(ahead / FAR), spread], dim=1)
        return features, (turn * torch.tensor([4, 2, 1])).sum(dim=1)


def _blocks(offsets: Tensor, level: int) -> Tensor:
    """Return (K, `BLOCKS`, L): 1 where one of the offsets (K, L) in cells lies in a block."""
    index = (offsets + (level * BLOCKS - 1) // 2) // level
    numbers = torch.arange(BLOCKS, dtype=offsets.dtype, device=offsets.device)
    return (index[:, None, :] == numbers[:, None]).to(offsets.dtype)


def order_of_actions(names: Sequence[str]) -> NDArray[np.int64]:
    """Return (`TURNS`, A): by turn, the action that each number stands for in turned windows.

    Args:
        names: Names of the actions by number; with each move, its mirror images too.
    """
    moves = [ACTION_VECTORS[name] for name in names]
    order = np.zeros((TURNS, len(moves)), np.int64)
    for turn in range(TURNS):
        for number, (x, y) in enumerate(moves):
            if turn & 1:
                x, y = y, x
            order[turn, number] = moves.index((-x if turn & 4 else x, -y if turn & 2 else y))
    return order


_FOVEATED = Foveated()


def _seen(
    positions: NDArray[Any], probability: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    *batch, drones, _ = positions.shape
    grid = probability.shape[-1]
    places = own_first(positions).reshape(-1, 2 * drones) / max(grid - 1, 1)
    maps = np.repeat(probability.reshape(-1, grid, grid), drones, axis=0)
    numbers = np.tile(np.arange(drones), len(places) // drones)[:, None]
    with torch.no_grad():
        features, turns = _FOVEATED(
            *(torch.from_numpy(one).float() for one in (places, maps, numbers))
        )
    return features.numpy().reshape(*batch, drones, -1), turns.numpy().reshape(*batch, drones)


def foveated(names: Sequence[str]) -> Encoding:
    """Return the encoding `Foveated`, with the numbers of the actions turned likewise.

    Args:
        names: Names of the actions.
    """
    order = order_of_actions(names)

    def encode(positions: NDArray[Any], probability: NDArray[np.float32]) -> Any:
        features, turns = _seen(positions, probability)
        return features, order[turns]

    space = spaces.Box(-1.0, np.inf, (FEATURES,), np.float32)
    return Encoding(encode, lambda drones, grid, margin: space)
