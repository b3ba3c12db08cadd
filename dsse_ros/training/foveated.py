# SPDX-License-Identifier: Apache-2.0
"""What a drone's network sees: the map and the other drones around it, coarser further away."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor, nn

from dsse_ros.search.wrappers import Encoding, own_first

LEVELS = (1, 3, 9)
"""Cells along a block of each level; odd, so that the drone is in the middle of a block."""
BLOCKS = 9
"""Blocks along the window of each level: with these levels it sees 40 cells in each direction."""
FEATURES = BLOCKS**2 * (2 * len(LEVELS) + 1) + 3
FAR = 8.0
"""Cells: distances to the middle of the map are told apart up to a few times this."""


class Foveated(nn.Module):
    """Turns the inputs of the planner `onnx` into features; it has no weights.

    Around the drone lie windows of `BLOCKS` x `BLOCKS` blocks, a block of 1, 3 or 9 cells along a
    side: of each its probability and the number of other drones in it, and of cells their
    probability over the highest, too. Grids of any size and any number of drones fit.
    """

    def forward(self, positions: Tensor, probability: Tensor) -> Tensor:
        """Return features (K, `FEATURES`).

        Args:
            positions: (K, 2M), cells (x, y) of M drones over G - 1, the drone's own first.
            probability: (K, G, G) as [y, x], of any scale.
        """
        edge = probability.shape[-1] - 1
        cells = torch.round(positions * edge).unflatten(1, (-1, 2))
        away = cells[:, 1:] - cells[:, :1]
        line = torch.arange(edge + 1, dtype=probability.dtype, device=probability.device)
        columns, rows = line - cells[:, 0, :1], line - cells[:, 0, 1:]
        total = probability.sum(dim=(1, 2), keepdim=True).clamp(min=1e-30)
        highest = probability.amax(dim=(1, 2), keepdim=True).clamp(min=1e-30)
        share = probability / total
        features = []
        for level in LEVELS:
            over_rows, over_columns = _blocks(rows, level), _blocks(columns, level)
            mass = over_rows @ share @ over_columns.transpose(1, 2)
            if level == 1:
                features.append((mass * total / highest).flatten(1))
            features.append(mass.sqrt().flatten(1))
            others = _blocks(away[..., 1], level) @ _blocks(away[..., 0], level).transpose(1, 2)
            features.append(others.flatten(1))
        to_middle = torch.stack(
            [(share.sum(dim=1) * columns).sum(dim=1), (share.sum(dim=2) * rows).sum(dim=1)], dim=1
        )
        spread = torch.log(total / highest)[:, :, 0]
        return torch.cat([*features, torch.tanh(to_middle / FAR), spread], dim=1)


def _blocks(offsets: Tensor, level: int) -> Tensor:
    """Return (K, `BLOCKS`, L): 1 where one of the offsets (K, L) in cells lies in a block."""
    index = torch.floor((offsets + (level * BLOCKS - 1) // 2) / level)
    numbers = torch.arange(BLOCKS, dtype=offsets.dtype, device=offsets.device)
    return (index[:, None, :] == numbers[:, None]).to(offsets.dtype)


_FOVEATED = Foveated()


def foveated(positions: NDArray[Any], probability: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what each drone sees, (..., N, `FEATURES`); see `dsse_ros.search.wrappers`."""
    *batch, drones, _ = positions.shape
    grid = probability.shape[-1]
    places = own_first(positions).reshape(-1, 2 * drones) / max(grid - 1, 1)
    maps = np.repeat(probability.reshape(-1, grid, grid), drones, axis=0)
    with torch.no_grad():
        features = _FOVEATED(torch.from_numpy(places).float(), torch.from_numpy(maps))
    return features.numpy().reshape(*batch, drones, FEATURES)


FOVEATED = Encoding(
    foveated, lambda drones, grid: spaces.Box(-1.0, np.inf, (FEATURES,), np.float32)
)
"""What `Foveated` makes of an observation."""
