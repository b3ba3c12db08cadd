# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""Drones that share a cell after a step, compiled; arguments as in `kernels`."""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.jit import part
from dsse_ros.targets.sea_map import is_inside


@part
def collide(c, drones, occupied):
    """Reward and terminate the active drones that share a cell, as recorded by `occupy`."""
    for n in range(len(drones)):
        d = drones[n]
        if can_collide(c, d) and has_collided(c.grid_size, drones, n, occupied):
            d.reward = c.collision
            d.terminated = True


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
def occupy(g, d, occupied, stamp):
    """Mark the cell of a drone; return whether the drone may share it.

    The last element of `occupied` (G * G + 1,) uint16 is the stamp of this world's step, an even
    number. A cell with one drone is marked with the stamp, a cell with more drones with the next
    number. Smaller numbers are from earlier steps.
    """
    if not is_inside(g, d.x, d.y):
        return True
    # Numba does not check an unsigned index for negative values.
    cell = np.uint64(d.y * g + d.x)
    shared = occupied[cell] >= stamp
    occupied[cell] = stamp + shared
    return shared


@part
def has_collided(g, drones, n, occupied):
    """Return whether drone n shares its cell; only those on the grid are in `occupied`."""
    d = drones[n]
    if is_inside(g, d.x, d.y):
        return occupied[d.y * g + d.x] > occupied[g * g]
    crashed = False
    for m in range(len(drones)):
        crashed = crashed or (m != n and drones[m].x == d.x and drones[m].y == d.y)
    return crashed


@part
def can_collide(c, d):
    """Return whether a drone can collide; if drones end together, flags do not matter."""
    return d.alive and not d.clear and (c.ends_together or not d.terminated)
