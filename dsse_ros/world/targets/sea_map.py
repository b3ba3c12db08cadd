# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The map of the sea, compiled: drift of the datum, and probability of each cell.

The map is a closed form of (datum, circle, spread): two tables of exponentials, one per axis, and
a normaliser from their tail sums. A cell costs two look-ups, a whole map one streaming write.

Arguments with the same names mean the same everywhere: `constants` is an element of
`constants.CONSTANTS`, `world` one of `entities.WORLDS`, `sea` the `Sea` of one world; the others
are fields of `Sea` and of `world_state.Scratch`. The compiler removes a branch on a field that is
None only where the field is an argument of its own.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, kernel, part
from dsse_ros.base.compiled.streaming import LANES, stream_product
from dsse_ros.base.grid_shape import GridShape


class Sea(NamedTuple):
    """The sea of B worlds, or of one: then there is no first axis B.

    Attributes:
        gauss: (1 or B, 2, 2 L + 1) float64, exponentials along x and y, L cells along the longer
            side of the grid.
        tails: (1 or B, 2, L + 2) float64, their tail sums.
        area: (R, C) bool [row, col], the searched cells; None for all.
        runs: (R, 3) int64, the same by row, first and last column; None for all.
        data: The `person_kernels.MotionData`.
    """

    gauss: NDArray[np.float64]
    tails: NDArray[np.float64]
    area: NDArray[np.bool_] | None
    runs: NDArray[np.int64] | None
    data: Any


@inlined
def grid_of(constants):
    """Return the `GridShape` of the grid."""
    return GridShape(constants.columns, constants.rows)


@inlined
def middle_of(constants):
    """Return the index of the centre in the exponentials of an axis: the longer side, L."""
    return max(constants.columns, constants.rows)


@part
def fill_axis(gauss, tails, middle, sigma):
    """Write exp(-d^2 / (2 sigma^2)) at gauss[L + d] and its sums over d' >= d at tails[d]."""
    for d in range(middle + 1):
        e = math.exp(-(d * d) / (2.0 * sigma * sigma))
        gauss[middle + d] = e
        gauss[middle - d] = e
    tails[middle + 1] = 0.0
    for d in range(middle, -1, -1):
        tails[d] = tails[d + 1] + gauss[middle + d]


@part
def span_sum(tails, lo, hi):
    """Return the sum of the Gaussian over the offsets lo..hi from its centre.

    Differences of tail sums stay precise where the Gaussian is small.
    """
    if lo > 0:
        return tails[lo] - tails[hi + 1]
    if hi < 0:
        return tails[-hi] - tails[1 - lo]
    return (tails[0] - tails[hi + 1]) + (tails[1] - tails[1 - lo])


@part
def diameter(world):
    """Return the diameter of the circle in cells: 2, 2, 3, 4, ... from the first map step on."""
    return 2 + max(world.map_steps - 2, 0)


@kernel
def radius(world):
    """Return the radius of the circle in cells."""
    return diameter(world) / 2.0


@part
def inside_circle(adx, ady, d2):
    """Return whether the cell at this distance lies in the circle with this squared diameter.

    Its outer edges must be inside: (adx + 1/2)^2 + ady^2 <= r^2 and adx^2 + (ady + 1/2)^2 <= r^2.
    """
    x, y = 2 * adx, 2 * ady
    return (x + 1) * (x + 1) + y * y <= d2 and x * x + (y + 1) * (y + 1) <= d2


@part
def is_inside(grid, x, y):
    """Return whether a cell is on the grid."""
    # Cast to unsigned: negative numbers become larger than any grid.
    return (np.uint64(x) < np.uint64(grid.columns)) & (np.uint64(y) < np.uint64(grid.rows))


@part
def is_masked(area, grid, x, y):
    """Return whether a cell is on the grid but not in the area."""
    if area is None:
        return False
    return is_inside(grid, x, y) and not area[y, x]


@part
def is_open(area, grid, x, y):
    """Return whether a cell is on the grid and in the area."""
    if area is None:
        return is_inside(grid, x, y)
    return is_inside(grid, x, y) and area[y, x]


@part
def step_within(area, grid, x, y, dx, dy):
    """Return the cell that a step leads to; an axis along which it would leave does not change.

    If each axis alone would stay in the area but both together would not, x moves.
    """
    if area is None:
        to_x = x + dx if 0 <= x + dx < grid.columns else x
        return to_x, y + dy if 0 <= y + dy < grid.rows else y
    if is_open(area, grid, x + dx, y + dy):
        return x + dx, y + dy
    if is_open(area, grid, x + dx, y):
        return x + dx, y
    if is_open(area, grid, x, y + dy):
        return x, y + dy
    return x, y


@part
def cell_probability(constants, world, gauss, area, x, y):
    """Return the probability of the cell (x, y), 0 outside the grid and the area."""
    if x < 0 or y < 0 or x >= constants.columns or y >= constants.rows:
        return 0.0
    middle = middle_of(constants)
    across, along = gauss[0, middle + x - world.datum_x], gauss[1, middle + y - world.datum_y]
    return weighted_probability(constants, world, area, x, y, across, along)


@part
def weighted_probability(constants, world, area, x, y, across, along):
    """Return the probability of a cell of the grid from the two exponentials of `Sea.gauss`."""
    if is_masked(area, grid_of(constants), x, y):
        return 0.0
    adx, ady = abs(x - world.circle_x), abs(y - world.circle_y)
    if world.scale == 0.0:
        return 1.0 if adx == 0 and ady == 0 else 0.0
    if constants.circle and not inside_circle(adx, ady, diameter(world) ** 2):
        return 0.0
    return (world.scale * along) * across


@part
def rows_covered(world, grid, d2):
    """Return the number of rows fully covered on each side of the circle's centre, -1 for none."""
    far = max(world.circle_x, grid.columns - 1 - world.circle_x)
    rest = d2 - (2 * far + 1) * (2 * far + 1)
    if rest < 0:
        return -1
    rows = min(np.int64(math.sqrt(rest) / 2), max(world.circle_y, grid.rows - 1 - world.circle_y))
    while rows >= 0 and not inside_circle(far, rows, d2):
        rows -= 1
    return rows


@part
def update_circle(world, circle):
    """Write the half width of the world's circle in the rows at distance 0, 1, ... of its centre.

    Args:
        world: The world.
        circle: (L + 1,) int64 out, -1 for none and at most L, as no cell is farther; the last
            element is the diameter, so that consecutive worlds with equal circles share the work.
    """
    d = diameter(world)
    rows = len(circle) - 1
    if circle[rows] == d:
        return
    circle[rows] = d
    d2 = d * d
    for ady in range(rows):
        # The largest adx of `inside_circle`; the truncated root of such an integer is exact.
        by_column, by_row = d2 - 4 * ady * ady, d2 - (2 * ady + 1) * (2 * ady + 1)
        across = (np.int64(math.sqrt(np.float64(max(by_column, 0)))) - 1) >> 1
        down = np.int64(math.sqrt(np.float64(max(by_row, 0)))) >> 1
        circle[ady] = min(across, down, rows) if by_row >= 0 else -1


@part
def circle_sum(constants, world, sea, circle):
    """Return the sum of the Gaussian over the cells of the circle."""
    gauss, tails, middle = sea.gauss, sea.tails, middle_of(constants)
    last_x, last_y = constants.columns - 1, constants.rows - 1
    x, y, d2 = world.circle_x, world.circle_y, diameter(world) ** 2
    along_x = span_sum(tails[0], -world.datum_x, last_x - world.datum_x)
    rows = rows_covered(world, grid_of(constants), d2)
    total = 0.0
    if rows >= 0:
        low, high = max(y - rows, 0), min(y + rows, last_y)
        total = along_x * span_sum(tails[1], low - world.datum_y, high - world.datum_y)
    for ady in range(rows + 1, max(y, last_y - y) + 1):
        half_width = circle[ady]
        if half_width < 0:
            break
        low, high = max(x - half_width, 0), min(x + half_width, last_x)
        along_y = 0.0
        if y - ady >= 0:
            along_y += gauss[1, middle + y - ady - world.datum_y]
        if ady > 0 and y + ady <= last_y:
            along_y += gauss[1, middle + y + ady - world.datum_y]
        total += along_y * span_sum(tails[0], low - world.datum_x, high - world.datum_x)
    return total


@part
def area_sum(constants, world, sea, circle):
    """Return the sum of the Gaussian over the cells of the area, and of the circle if any."""
    gauss, tails, runs, middle = sea.gauss, sea.tails, sea.runs, middle_of(constants)
    total = 0.0
    for r in range(len(runs)):
        row, low, high = runs[r, 0], runs[r, 1], runs[r, 2]
        if constants.circle:
            half_width = circle[abs(row - world.circle_y)]
            low, high = (
                max(low, world.circle_x - half_width),
                min(high, world.circle_x + half_width),
            )
        if low <= high:
            along_x = span_sum(tails[0], low - world.datum_x, high - world.datum_x)
            total += gauss[1, middle + row - world.datum_y] * along_x
    return total


@part
def gaussian_sum(constants, world, sea, runs, circle):
    """Return the sum of the Gaussian over the possible cells; `runs` are those of the sea."""
    if runs is not None:
        return area_sum(constants, world, sea, circle)
    if constants.circle:
        return circle_sum(constants, world, sea, circle)
    last_x, last_y = constants.columns - 1, constants.rows - 1
    along_x = span_sum(sea.tails[0], -world.datum_x, last_x - world.datum_x)
    return along_x * span_sum(sea.tails[1], -world.datum_y, last_y - world.datum_y)


@part
def normalise(constants, world, sea, circle):
    """Set the scale that makes the probabilities sum to 1."""
    if constants.circle:
        update_circle(world, circle)
    total = gaussian_sum(constants, world, sea, sea.runs, circle)
    # If the Gaussian underflows in the circle, the circle's centre has all the probability.
    world.scale = 1.0 / total if total > 1e-300 else 0.0


# Without inlining, writing large maps takes a third longer.
@inlined
def write_map(constants, world, sea, scratch, stream, out):
    """Write the map (R, C) float32, out[y, x], row by row in memory order.

    `stream` is whether to write past the caches.
    """
    gauss, circle, span = sea.gauss, scratch.circle, scratch.span
    columns, rows, middle = constants.columns, constants.rows, middle_of(constants)
    if world.scale == 0.0:
        out[:] = 0
        out[world.circle_y, world.circle_x] = 1
        return
    x, y = world.circle_x, world.circle_y
    # Slices that start at 0 compile to vector code.
    weights = gauss[0, middle - world.datum_x : middle + columns - world.datum_x]
    of_rows = gauss[1, middle - world.datum_y : middle + rows - world.datum_y]
    for i in range(columns):
        span[i] = 0.0 if constants.circle else weights[i]
    if constants.circle:
        update_circle(world, circle)
    half_width = -1
    for j in range(rows):
        # Between rows, only the ends of the circle's span of weights change.
        wanted = circle[abs(j - y)] if constants.circle else -1
        while half_width < wanted:
            half_width += 1
            if half_width <= x:
                span[x - half_width] = weights[x - half_width]
            if half_width < columns - x:
                span[x + half_width] = weights[x + half_width]
        while half_width > wanted:
            if half_width <= x:
                span[x - half_width] = 0.0
            if half_width < columns - x:
                span[x + half_width] = 0.0
            half_width -= 1
        row, k = out[j], world.scale * of_rows[j]
        if stream:
            for i in range(0, columns, LANES):
                stream_product(row, i, k, span)
        else:
            for i in range(columns):
                row[i] = k * span[i]
    cut_map(sea.area, out)


@part
def cut_map(area, out):
    """Set the cells of a map outside the area to 0."""
    if area is None:
        return
    for j in range(len(area)):
        for i in range(area.shape[1]):
            out[j, i] = out[j, i] if area[j, i] else 0.0


@part
def less_one(remainder):
    """Return the remainder, reduced by one cell if it has reached one."""
    return remainder - math.copysign(1.0, remainder) if abs(remainder) >= 1 else remainder


@part
def drift(constants, world, area):
    """Move the datum by the drift of one step; it stays in the area."""
    grid = grid_of(constants)
    if constants.drift_remainder_dropped:
        if abs(world.remainder_x) >= 1:
            world.remainder_x = 0.0
        if abs(world.remainder_y) >= 1:
            world.remainder_y = 0.0
    world.remainder_x += world.drift_x
    world.remainder_y += world.drift_y
    dx, dy = np.int64(world.remainder_x), np.int64(world.remainder_y)
    if constants.drift_remainder_less_one:
        world.remainder_x, world.remainder_y = (
            less_one(world.remainder_x),
            less_one(world.remainder_y),
        )
    elif not constants.drift_remainder_dropped:
        world.remainder_x -= dx
        world.remainder_y -= dy
    if constants.drift_axes_independent:
        world.datum_x, world.datum_y = step_within(area, grid, world.datum_x, world.datum_y, dx, dy)
    elif is_open(area, grid, world.datum_x + dx, world.datum_y + dy):
        world.datum_x += dx
        world.datum_y += dy


@kernel
def disperse(constants, world, sea):
    """Write the tables for the map's present spread; the first map has the initial spread."""
    gauss, tails = sea.gauss, sea.tails
    grown = max(world.map_steps - 1, 0) * constants.dispersion_inc
    middle = middle_of(constants)
    fill_axis(gauss[0], tails[0], middle, constants.sigma_x + grown)
    if constants.sigma_x == constants.sigma_y:
        # Assign element by element: a slice costs three seconds of compilation.
        for d in range(gauss.shape[1]):
            gauss[1, d] = gauss[0, d]
        for d in range(tails.shape[1]):
            tails[1, d] = tails[0, d]
    else:
        fill_axis(gauss[1], tails[1], middle, constants.sigma_y + grown)


@part
def map_step(constants, world, sea, circle):
    """Advance the map by one step: drift, dispersion, circle, normaliser."""
    previous_x, previous_y = world.datum_x, world.datum_y
    drift(constants, world, sea.area)
    world.map_steps += 1
    if constants.dispersion_inc > 0:
        disperse(constants, world, sea)
    world.circle_x, world.circle_y = world.datum_x, world.datum_y
    if constants.circle_on_previous_datum:
        world.circle_x, world.circle_y = previous_x, previous_y
    normalise(constants, world, sea, circle)


@kernel
def drift_per_step(constants, x, y):
    """Return the drift (x, y) in cells per step of a vector."""
    norm = math.sqrt(x * x + y * y)
    if not constants.drift_by_speed or norm == 0.0:
        return x, y
    # Keep the order of operations of DSSE 1.1.9: the last bit can decide when a cell is reached.
    steps = constants.cell_size / norm / constants.step_duration_s
    return x / steps, y / steps


@part
def start_map(constants, world):
    """Set the map of a world to its start: the start cell has all the probability."""
    world.t = world.map_steps = 0
    world.datum_x = world.circle_x = world.start_x
    world.datum_y = world.circle_y = world.start_y
    world.remainder_x = world.remainder_y = 0.0
    world.drift_x, world.drift_y = drift_per_step(constants, world.vector_x, world.vector_y)
    world.scale = 0.0


@kernel
def read_cells(constants, worlds, gauss, area, x, y, out):
    """Write the probabilities of cells of B worlds, 0 outside the grid and the area.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        worlds: (B,) of `entities.WORLDS`.
        gauss: Of `Sea`.
        area: Of `Sea`.
        x: (B, K) int64.
        y: (B, K) int64.
        out: (B, K) float32 out.
    """
    for b in range(len(worlds)):
        table = gauss[min(b, len(gauss) - 1)]
        for k in range(x.shape[1]):
            out[b, k] = cell_probability(constants[0], worlds[b], table, area, x[b, k], y[b, k])
