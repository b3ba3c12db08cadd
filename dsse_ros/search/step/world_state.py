# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""All that the steps of B worlds read and write, compiled; shapes as in `entities`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.step.constants import Constants
from dsse_ros.search.step.coverage_kernels import CoverageTask
from dsse_ros.search.step.ensemble_kernels import SeaEnsemble
from dsse_ros.search.step.entities import Entities, Masks, Records, WorldRecord
from dsse_ros.search.step.metres_kernels import MetresArrays
from dsse_ros.world.targets.sea_map import Sea


class Extensions(NamedTuple):
    """What only some searches of B worlds have.

    Attributes:
        coverage: The cells to cover; None in a search for persons.
        ensemble: The tracks that the persons follow; None if they move step by step.
        metres: The drones in metres; None if drones move from cell to cell.
        viewpoints: (B, N) of `viewpoints.VIEWPOINTS`; None if drones look in their own cells.
    """

    coverage: CoverageTask | None
    ensemble: SeaEnsemble | None
    metres: MetresArrays | None
    viewpoints: Records | None


class Scratch(NamedTuple):
    """Memory of a thread.

    Attributes:
        occupied: (R C + 1,) uint16, see `recipe.apply_collisions`.
        circle: (L + 1,) int64, see `update_circle`.
        cells: (K,) int64, the cells over which persons are scattered.
        span: (C,) float64.
    """

    occupied: NDArray[np.uint16]
    circle: NDArray[np.int64]
    cells: NDArray[np.int64]
    span: NDArray[np.float64]


class Batch(NamedTuple):
    """B worlds: all that their steps read and write.

    Attributes:
        constants: (1,) of `constants.CONSTANTS`, never written.
        worlds: (B,) of `WORLDS`.
        sea: Their sea.
        entities: Their drones and persons.
        extensions: What only some searches have.
    """

    constants: Records
    worlds: Records
    sea: Sea
    entities: Entities
    extensions: Extensions


class WorldState(NamedTuple):
    """One world of a `Batch`, without an axis B."""

    constants: Constants
    world: WorldRecord
    sea: Sea
    entities: Entities
    extensions: Extensions


class Report(NamedTuple):
    """What a step reports of the drones of B worlds.

    Attributes:
        positions: (B, N, 2) int64, as (x, y).
        rewards: (B, N) float64.
        terminated: (B, N) bool.
        truncated: (B, N) bool.
        action_masks: (B, N, A) int8, 0 for moves out of the grid or the area.
    """

    positions: NDArray[np.int64]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    action_masks: Masks
