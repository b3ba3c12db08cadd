# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""Which drones share a cell after a step, compiled; arguments as in `kernels`."""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.jit import part
from dsse_ros.targets.sea_map import is_inside


@part
def collide(c, drones, occupied):
    """Reward and terminate the active drones that share a cell, as `occupy` noted them."""
    for n in range(len(drones)):
        d = drones[n]
        if can_collide(c, d) and has_collided(c.grid_size, drones, n, occupied):
            d.reward = c.collision
            d.terminated = True


@part
def next_stamp(occupied):
    """Return a number that no cell is marked with; see `occupy`."""
    last = len(occupied) - 1
    if occupied[last] > 65532:
        for cell in range(last + 1):
            occupied[cell] = 0
    occupied[last] += 2
    return occupied[last]


@part
def occupy(g, d, occupied, stamp):
    """Mark the cell of a drone; returns whether it may share it.

    Of `occupied` (G * G + 1,) uint16, the last element is the stamp of this world's step, an even
    number. A cell with a drone is marked with it, one with more drones with the next number, and
    what is less is of a step before.
    """
    if not is_inside(g, d.x, d.y):
        return True
    # An unsigned index is not checked for being below 0.
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
    """Return whether a drone can collide; where drones end together, flags do not matter."""
    return d.alive and not d.aloft and (c.ends_together or not d.terminated)
