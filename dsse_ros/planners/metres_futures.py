# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Futures of persons in metres, and what plans of drones find in them, compiled.

The value of the plans of all drones is the expected discounted finds: a person whom the first look
that detects him finds in step h counts gamma^h. Let S_h be the probability that nobody has found a
person after step h. The value of the person is

    sum over h of gamma^h (S_(h-1) - S_h) = 1 - sum over h of (gamma^h - gamma^(h+1)) S_h,

with gamma^H = 0. S_h is a product over the drones. So the drone that detects a person with the
probability p in step h, after S' of its own earlier looks, adds S' p W_h if it does not look again,
where W_h, the worth of the person, depends on the others alone:

    W_h = sum over k >= h of (gamma^k - gamma^(k+1)) (product of the others' S_k).

Positions are metres to the east and to the south of the grid's north-west corner.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, inlined, kernel, part
from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.search.belief.motion_kernels import Flags, Floats
from dsse_ros.search.step.metres_detection import farthest_reach, missed
from dsse_ros.search.step.metres_paths import Wind

MOST_BINS = 128
"""Bins along a side."""


class BinnedFutures(NamedTuple):
    """Where M persons are in H steps, sorted by square bins in each step.

    A person who is off the grid or in a cell that is not searched before a step is in no bin.

    Attributes:
        weights: (M,) float64, probability of each person.
        appearances: (M,) int8, number of each person's appearance.
        ways: (H, M, 4) float32, position before and after each step, (x, y, x, y), bin by bin.
        members: (H, M) int32, the numbers of the persons, bin by bin.
        starts: (H, B + 1) int32: bin i has the persons starts[i] .. starts[i + 1] - 1.
        west: Of the first column of bins.
        north: Of the first row of bins.
        size: Side of a bin.
        columns: Number of bins in a row.
        rows: Number of rows.
        drift: Longest way in a step.
    """

    weights: NDArray[np.float64]
    appearances: NDArray[np.int8]
    ways: NDArray[np.float32]
    members: NDArray[np.int32]
    starts: NDArray[np.int32]
    west: float
    north: float
    size: float
    columns: int
    rows: int
    drift: float


class Seen(NamedTuple):
    """The persons whom a drone may detect in a step.

    Attributes:
        places: (M,) int64, their places in `BinnedFutures.ways`.
        missed: (M,) float64, the probability of missing each.
    """

    places: NDArray[np.int64]
    missed: NDArray[np.float64]


@compiled()
def futures_of(
    positions: NDArray[np.float32],
    weights: Floats,
    appearances: NDArray[np.int8],
    area: Flags,
    extent: GridExtent,
    size: float,
) -> BinnedFutures:
    """Return the futures of persons.

    Args:
        positions: (H + 1, M, 2) float32.
        weights: (M,) float64.
        appearances: (M,) int8.
        area: (R, C) bool [row, col], the cells that are searched.
        extent: Of the grid.
        size: Least side of a bin.
    """
    horizon, count = len(positions) - 1, len(weights)
    west, north, east, south = extent_of(positions)
    size = max(size, max(east - west, south - north) / MOST_BINS)
    columns, rows = int((east - west) / size) + 1, int((south - north) / size) + 1
    starts = np.zeros((horizon, columns * rows + 1), np.int32)
    members = np.empty((horizon, count), np.int32)
    ways = np.empty((horizon, count, 4), np.float32)
    bins = np.empty(count, np.int64)
    drift = 0.0
    for h in range(horizon):
        start = starts[h]
        for s in range(count):
            x, y = positions[h, s, 0], positions[h, s, 1]
            bins[s] = -1
            if is_searched(area, extent, x, y):
                bins[s] = int((y - north) / size) * columns + int((x - west) / size)
                start[bins[s] + 1] += 1
        for i in range(1, len(start)):
            start[i] += start[i - 1]
        place = start[:-1].copy()
        for s in range(count):
            if bins[s] < 0:
                continue
            at = place[bins[s]]
            place[bins[s]] += 1
            members[h, at] = s
            for axis in range(2):
                ways[h, at, axis] = positions[h, s, axis]
                ways[h, at, 2 + axis] = positions[h + 1, s, axis]
            dx, dy = ways[h, at, 2] - ways[h, at, 0], ways[h, at, 3] - ways[h, at, 1]
            drift = max(drift, dx * dx + dy * dy)
    return BinnedFutures(
        weights,
        appearances,
        ways,
        members,
        starts,
        west,
        north,
        size,
        columns,
        rows,
        math.sqrt(drift),
    )


@inlined
def is_searched(area: Flags, extent: GridExtent, x: float, y: float) -> bool:
    """Return whether a position is on the grid and in a cell that is searched."""
    if not (0.0 <= x < extent.width and 0.0 <= y < extent.height):
        return False
    across, down = extent.width / area.shape[1], extent.height / len(area)
    return area[int(y / down), int(x / across)]


@part
def extent_of(positions: NDArray[np.float32]) -> tuple[float, float, float, float]:
    """Return the least and the greatest coordinates: west, north, east, south."""
    west, north, east, south = np.inf, np.inf, -np.inf, -np.inf
    for h in range(positions.shape[0]):
        for s in range(positions.shape[1]):
            west, east = min(west, positions[h, s, 0]), max(east, positions[h, s, 0])
            north, south = min(north, positions[h, s, 1]), max(south, positions[h, s, 1])
    return (west, north, east, south) if west <= east else (0.0, 0.0, 0.0, 0.0)


@inlined
def bins_along(low: float, high: float, first: float, size: float, count: int) -> tuple[int, int]:
    """Return the first bin that an interval touches and the one after the last."""
    return (
        max(int(math.floor((low - first) / size)), 0),
        min(int(math.floor((high - first) / size)) + 1, count),
    )


class Strip(NamedTuple):
    """What is near the straight line from the start to the end of a path.

    Attributes:
        x: Of the start.
        y: The same.
        dx: To the end.
        dy: The same.
        per_squared: 1 over the square of its length.
        reach: Greatest distance from it.
    """

    x: float
    y: float
    dx: float
    dy: float
    per_squared: float
    reach: float


@part
def strip_of(path: Floats, margin: float) -> Strip:
    """Return the strip that holds all positions within a margin of a path."""
    last = len(path) - 1
    x, y = path[0, 0], path[0, 1]
    dx, dy = path[last, 0] - x, path[last, 1] - y
    per_squared, bow = 1.0 / max(dx * dx + dy * dy, 1e-9), 0.0
    for k in range(1, last):
        bow = max(bow, off(path[k, 0] - x, path[k, 1] - y, dx, dy, per_squared))
    return Strip(x, y, dx, dy, per_squared, math.sqrt(bow) + margin)


@inlined
def off(x: float, y: float, dx: float, dy: float, per_squared: float) -> float:
    """Return the square of the distance of (x, y) from the line from the origin to (dx, dy)."""
    share = min(max((x * dx + y * dy) * per_squared, 0.0), 1.0)
    x, y = x - share * dx, y - share * dy
    return x * x + y * y


@part
def write_near(futures: BinnedFutures, h: int, strip: Strip, seen: Seen) -> int:
    """Write the places of the persons in a strip before a step, and return their number."""
    west, east = min(strip.x, strip.x + strip.dx), max(strip.x, strip.x + strip.dx)
    north, south = min(strip.y, strip.y + strip.dy), max(strip.y, strip.y + strip.dy)
    first, end = bins_along(
        west - strip.reach, east + strip.reach, futures.west, futures.size, futures.columns
    )
    top, bottom = bins_along(
        north - strip.reach, south + strip.reach, futures.north, futures.size, futures.rows
    )
    found, squared = 0, strip.reach * strip.reach
    if first >= end:
        return found
    for row in range(top, bottom):
        low = futures.starts[h, row * futures.columns + first]
        high = futures.starts[h, row * futures.columns + end]
        for place in range(low, high):
            x, y = futures.ways[h, place, 0] - strip.x, futures.ways[h, place, 1] - strip.y
            seen.places[found] = place
            # Without a branch, which nobody could predict.
            found += off(x, y, strip.dx, strip.dy, strip.per_squared) <= squared
    return found


@part
def write_seen(
    detectors: NDArray[np.void],
    futures: BinnedFutures,
    h: int,
    path: Floats,
    wind: Wind,
    seen: Seen,
) -> int:
    """Write the persons whom a drone may detect on a path, and return their number.

    Args:
        detectors: (A,) of `DETECTORS`, whose POD or rate has the multiplier of the persons.
        path: (K + 1, 2) float64, see `missed`.
        seen: `Seen` out, one longer than there are persons.
    """
    strip = strip_of(path, farthest_reach(detectors) + futures.drift)
    near, found = write_near(futures, h, strip, seen), 0
    for j in range(near):
        place = seen.places[j]
        detector = detectors[futures.appearances[futures.members[h, place]]]
        chance = missed(detector, path, None, wind.step_s, futures.ways[h, place], 1.0)
        seen.places[found], seen.missed[found] = place, chance
        found += chance < 1.0
    return found


@kernel
def write_survival(
    detectors: NDArray[np.void],
    futures: BinnedFutures,
    wind: Wind,
    legs: Floats,
    length: int,
    seen: Seen,
    survival: Floats,
) -> None:
    """Write how likely a drone has missed each person after each step of a plan.

    Args:
        detectors: (A,) of `DETECTORS`, see `write_seen`.
        legs: (H, K + 1, 2) float64, the path of each step.
        seen: `Seen`, scratch.
        survival: (H, M) float64 out.
    """
    for h in range(len(survival)):
        for s in range(survival.shape[1]):
            survival[h, s] = survival[h - 1, s] if h else 1.0
        if h < length:
            for j in range(write_seen(detectors, futures, h, legs[h], wind, seen)):
                survival[h, futures.members[h, seen.places[j]]] *= seen.missed[j]


@kernel
def write_worth(
    futures: BinnedFutures, survivals: Floats, drone: int, gamma: float, worth: Floats, left: Floats
) -> None:
    """Write what it is worth to detect a person, given the plans of the other drones.

    Args:
        survivals: (N, H, M) float64, see `write_survival`.
        worth: (H, M) float64 out, weight times W, bin by bin.
        left: (M,) float64 out, the weight that the others leave at the end.
    """
    drones, horizon, count = survivals.shape
    for s in range(count):
        left[s] = 0.0
    for h in range(horizon - 1, -1, -1):
        lost = gamma**h * (1.0 - gamma if h + 1 < horizon else 1.0)
        for s in range(count):
            others = futures.weights[s]
            for n in range(drones):
                if n != drone:
                    others *= survivals[n, h, s]
            left[s] += lost * others
        for place in range(futures.starts[h, -1]):
            worth[h, place] = left[futures.members[h, place]]
    for s in range(count):
        left[s] = futures.weights[s]
        for n in range(drones):
            if n != drone:
                left[s] *= survivals[n, horizon - 1, s]


@kernel
def value_of(futures: BinnedFutures, survivals: Floats, gamma: float) -> float:
    """Return the expected discounted finds of the plans of all drones.

    Args:
        survivals: (N, H, M) float64, see `write_survival`.
    """
    drones, horizon, count = survivals.shape
    value = 0.0
    for s in range(count):
        before, discount = 1.0, 1.0
        for h in range(horizon):
            after = 1.0
            for n in range(drones):
                after *= survivals[n, h, s]
            value += futures.weights[s] * discount * (before - after)
            before, discount = after, discount * gamma
    return value
