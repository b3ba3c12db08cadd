# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Worlds, drones and persons, for compiled functions.

In the shapes B is the number of worlds, N of drones, P of persons, A of actions, R of rows and C of
columns of the grid, K of kinds of drones, L of looks. x is the column and grows to the east, y is
the row and grows to the south. A function of one world gets its element of each array with an
axis B.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.records import UInt64, dtype_of

Records: TypeAlias = NDArray[np.void]
Actions: TypeAlias = NDArray[np.int8]  # (N,) or (B, N); a number that is not an action does nothing
Masks: TypeAlias = NDArray[np.int8]  # (B, N, A), 0 for moves out of the grid or the area
Maps: TypeAlias = NDArray[np.float32]  # (B, R, C) as [y, x]
Map: TypeAlias = NDArray[np.float32]  # (R, C) as [y, x]
Area: TypeAlias = NDArray[np.bool_] | None  # (R, C) as [y, x], the searched cells; None for all


class WorldRecord:
    """A world, apart from its drones and persons."""

    rng: UInt64  # state of the world's own generator
    t: int  # steps done
    map_steps: int
    datum_x: int
    datum_y: int
    circle_x: int
    circle_y: int
    remainder_x: float  # drift not yet applied, cells
    remainder_y: float
    vector_x: float  # the scenario's drift
    vector_y: float
    drift_x: float  # drift per step, cells
    drift_y: float
    scale: float  # 1 / sum of the Gaussian over the possible cells; 0: all in one cell
    start_x: int  # cell of the person at reset
    start_y: int
    num_active: int  # drones still in the search
    num_missing: int  # persons not found, or cells not covered
    done: bool  # the search has ended: none missing, time limit, or no drone left


WORLDS = dtype_of(WorldRecord)


class Drone:
    """A drone in the search."""

    x: int
    y: int
    episode_return: float  # sum of rewards without the replacements by collisions
    reward: float  # of the last step
    alive: bool  # in the search; a drone neither alive nor flagged was withdrawn
    terminated: bool  # since the last reset
    truncated: bool
    found: bool  # found a person in the last step
    cannot_collide: bool  # it is above the others, or on the ground


DRONES = dtype_of(Drone)


class Person:
    """A person, one of `motion.PERSONS`."""

    x: int
    y: int
    pod_multiplier: float
    remainder_x: float  # own drift not yet applied, cells
    remainder_y: float
    drift_x: float  # own drift per step, cells
    drift_y: float
    found: bool


class Entities(NamedTuple):
    """The drones of B worlds, their looks, and the persons.

    The looks of action a of drone n are look_starts[kinds[n], a] .. look_starts[kinds[n], a + 1]
    - 1.

    Attributes:
        start_cells: (B, N, 2) int64, cells of the drones at reset.
        drones: (B, N) of `DRONES`.
        finds: (B, N) uint64, one bit per successful look of a drone that found a person in the last
            step; undefined for other drones.
        persons: (B, P) of `PERSONS`.
        kinds: (N,) of `looks.Looks.kind`.
        look_starts: (K, A + 1) of `looks.Looks.starts`.
        look_offsets: (L, 2) of `looks.Looks.offsets`.
        look_pods: (L, P) of `looks.Looks.pods`.
    """

    start_cells: NDArray[np.int64]
    drones: Records
    finds: NDArray[np.uint64]
    persons: Records
    kinds: NDArray[np.int64]
    look_starts: NDArray[np.int64]
    look_offsets: NDArray[np.int64]
    look_pods: NDArray[np.float64]
