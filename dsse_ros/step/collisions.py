# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""Cells that drones share, compiled: cells are marked, as comparing all pairs would be slow."""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.jit import part
from dsse_ros.targets.sea_map import is_inside


@part
def next_stamp(occupied):
    """Return a number with which no cell is marked; see `occupy`."""
    last = len(occupied) - 1
    if occupied[last] > 65532:
        for cell in range(last + 1):
            occupied[cell] = 0
    occupied[last] += 2
    return occupied[last]


@part
def occupy(grid_size, drone, occupied, stamp):
    """Mark the cell of a drone; return whether the drone may share it.

    The last element of `occupied` (G * G + 1,) uint16 is the stamp of this world's step, an even
    number. A cell with one drone is marked with the stamp, a cell with more drones with the next
    number. Smaller numbers are from earlier steps.
    """
    if not is_inside(grid_size, drone.x, drone.y):
        return True
    # Numba does not check an unsigned index for negative values.
    cell = np.uint64(drone.y * grid_size + drone.x)
    shared = occupied[cell] >= stamp
    occupied[cell] = stamp + shared
    return shared


@part
def has_collided(grid_size, drones, n, occupied):
    """Return whether drone n shares its cell; only those on the grid are in `occupied`."""
    drone = drones[n]
    if is_inside(grid_size, drone.x, drone.y):
        return occupied[drone.y * grid_size + drone.x] > occupied[grid_size * grid_size]
    crashed = False
    for m in range(len(drones)):
        crashed = crashed or (m != n and drones[m].x == drone.x and drones[m].y == drone.y)
    return crashed


@part
def can_collide(constants, drone):
    """Return whether a drone can collide; if drones end together, flags do not matter."""
    return drone.alive and not drone.clear and (constants.ends_together or not drone.terminated)
