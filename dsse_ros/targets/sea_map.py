# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The map of the sea, compiled: drift of the datum, and probability of each cell.

The map is a closed form of (datum, circle, spread): two tables of exponentials, one per axis, and
a normaliser from their tail sums. A cell costs two look-ups, a whole map one streaming write.

Arguments with the same names mean the same everywhere: `c` is an element of `constants.CONSTANTS`,
`w` one of `kernels.WORLDS`, the others are the fields of `kernels.Sea` and `kernels.Scratch` for
one world.
"""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.compiled.streaming import LANES, stream_product


@part
def fill_axis(gauss, tails, grid_size, sigma):
    """Write exp(-d^2 / (2 sigma^2)) at gauss[G + d] and its sums over d' >= d at tails[d]."""
    for d in range(grid_size + 1):
        e = np.exp(-(d * d) / (2.0 * sigma * sigma))
        gauss[grid_size + d] = e
        gauss[grid_size - d] = e
    tails[grid_size + 1] = 0.0
    for d in range(grid_size, -1, -1):
        tails[d] = tails[d + 1] + gauss[grid_size + d]


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
def diameter(w):
    """Return the diameter of the circle in cells: 2, 2, 3, 4, ... from the first map step on."""
    return 2 + max(w.map_steps - 2, 0)


@kernel
def radius(w):
    """Return the radius of the circle in cells."""
    return diameter(w) / 2.0


@part
def inside_circle(adx, ady, d2):
    """Return whether the cell at this distance lies in the circle with this squared diameter.

    Its outer edges must be inside: (adx + 1/2)^2 + ady^2 <= r^2 and adx^2 + (ady + 1/2)^2 <= r^2.
    """
    x, y = 2 * adx, 2 * ady
    return (x + 1) * (x + 1) + y * y <= d2 and x * x + (y + 1) * (y + 1) <= d2


@part
def is_inside(g, x, y):
    """Return whether a cell is on the grid."""
    # Cast to unsigned: negative numbers become larger than any grid.
    return (np.uint64(x) < np.uint64(g)) & (np.uint64(y) < np.uint64(g))


@part
def is_masked(area, g, x, y):
    """Return whether a cell is on the grid but not in the area."""
    if area is None:
        return False
    return is_inside(g, x, y) and not area[y, x]


@part
def is_open(area, g, x, y):
    """Return whether a cell is on the grid and in the area."""
    if area is None:
        return is_inside(g, x, y)
    return is_inside(g, x, y) and area[y, x]


@part
def step_within(area, g, x, y, dx, dy):
    """Return the cell that a step leads to; only an axis that would leave does not move.

    If each axis alone would stay in the area but both together would not, x moves.
    """
    if area is None:
        return x + dx if 0 <= x + dx < g else x, y + dy if 0 <= y + dy < g else y
    if is_open(area, g, x + dx, y + dy):
        return x + dx, y + dy
    if is_open(area, g, x + dx, y):
        return x + dx, y
    if is_open(area, g, x, y + dy):
        return x, y + dy
    return x, y


@part
def cell_probability(c, w, gauss, area, x, y):
    """Return the probability of the cell (x, y), 0 outside the grid and the area."""
    g = c.grid_size
    if x < 0 or y < 0 or x >= g or y >= g or is_masked(area, g, x, y):
        return 0.0
    adx, ady = abs(x - w.circle_x), abs(y - w.circle_y)
    if w.scale == 0.0:
        return 1.0 if adx == 0 and ady == 0 else 0.0
    if c.circle and not inside_circle(adx, ady, diameter(w) ** 2):
        return 0.0
    return (w.scale * gauss[1, g + y - w.datum_y]) * gauss[0, g + x - w.datum_x]


@part
def rows_covered(w, g, d2):
    """Return the number of rows fully covered on each side of the circle's centre, -1 for none."""
    far = max(w.circle_x, g - 1 - w.circle_x)
    rest = d2 - (2 * far + 1) * (2 * far + 1)
    if rest < 0:
        return -1
    rows = min(np.int64(np.sqrt(rest) / 2), max(w.circle_y, g - 1 - w.circle_y))
    while rows >= 0 and not inside_circle(far, rows, d2):
        rows -= 1
    return rows


@part
def update_circle(w, circle):
    """Write the half width of the world's circle in the rows at distance 0, 1, ... of its centre.

    Args:
        w: The world.
        circle: (G + 1,) int64 out, -1 for none and at most G, as no cell is farther; the last
            element is the diameter, so that consecutive worlds with equal circles share the work.
    """
    d = diameter(w)
    rows = len(circle) - 1
    if circle[rows] == d:
        return
    circle[rows] = d
    d2 = d * d
    for ady in range(rows):
        # The largest adx of `inside_circle`; the truncated root of such an integer is exact.
        by_column, by_row = d2 - 4 * ady * ady, d2 - (2 * ady + 1) * (2 * ady + 1)
        across = (np.int64(np.sqrt(np.float64(max(by_column, 0)))) - 1) >> 1
        down = np.int64(np.sqrt(np.float64(max(by_row, 0)))) >> 1
        circle[ady] = min(across, down, rows) if by_row >= 0 else -1


@part
def circle_sum(w, gauss, tails, circle, g):
    """Return the sum of the Gaussian over the cells of the circle."""
    x, y, d2 = w.circle_x, w.circle_y, diameter(w) ** 2
    along_x = span_sum(tails[0], -w.datum_x, g - 1 - w.datum_x)
    rows = rows_covered(w, g, d2)
    total = 0.0
    if rows >= 0:
        low, high = max(y - rows, 0), min(y + rows, g - 1)
        total = along_x * span_sum(tails[1], low - w.datum_y, high - w.datum_y)
    for ady in range(rows + 1, max(y, g - 1 - y) + 1):
        half_width = circle[ady]
        if half_width < 0:
            break
        low, high = max(x - half_width, 0), min(x + half_width, g - 1)
        along_y = 0.0
        if y - ady >= 0:
            along_y += gauss[1, g + y - ady - w.datum_y]
        if ady > 0 and y + ady < g:
            along_y += gauss[1, g + y + ady - w.datum_y]
        total += along_y * span_sum(tails[0], low - w.datum_x, high - w.datum_x)
    return total


@part
def area_sum(c, w, gauss, tails, runs, circle, g):
    """Return the sum of the Gaussian over the cells of the area, and of the circle if any."""
    total = 0.0
    for r in range(len(runs)):
        row, low, high = runs[r, 0], runs[r, 1], runs[r, 2]
        if c.circle:
            half_width = circle[abs(row - w.circle_y)]
            low, high = max(low, w.circle_x - half_width), min(high, w.circle_x + half_width)
        if low <= high:
            along_x = span_sum(tails[0], low - w.datum_x, high - w.datum_x)
            total += gauss[1, g + row - w.datum_y] * along_x
    return total


@part
def normalise(c, w, gauss, tails, runs, circle):
    """Set the scale that makes the probabilities sum to 1."""
    g = c.grid_size
    if c.circle:
        update_circle(w, circle)
    if runs is not None:
        total = area_sum(c, w, gauss, tails, runs, circle, g)
    elif c.circle:
        total = circle_sum(w, gauss, tails, circle, g)
    else:
        total = span_sum(tails[0], -w.datum_x, g - 1 - w.datum_x) * span_sum(
            tails[1], -w.datum_y, g - 1 - w.datum_y
        )
    # If the Gaussian underflows in the circle, the circle's centre has all the probability.
    w.scale = 1.0 / total if total > 1e-300 else 0.0


# Without inlining, writing large maps takes a third longer.
@inlined
def write_map(c, w, gauss, area, circle, span, stream, out):
    """Write the map (G, G) float32, out[y, x], row by row in memory order.

    `circle` and `span` (G,) float64 are scratch; `stream` is whether to write past the caches.
    """
    g = c.grid_size
    if w.scale == 0.0:
        out[:] = 0
        out[w.circle_y, w.circle_x] = 1
        return
    x, y = w.circle_x, w.circle_y
    # Slices that start at 0 compile to vector code.
    weights = gauss[0, g - w.datum_x : 2 * g - w.datum_x]
    rows = gauss[1, g - w.datum_y : 2 * g - w.datum_y]
    for i in range(g):
        span[i] = 0.0 if c.circle else weights[i]
    if c.circle:
        update_circle(w, circle)
    half_width = -1
    for j in range(g):
        # Between rows, only the ends of the circle's span of weights change.
        wanted = circle[abs(j - y)] if c.circle else -1
        while half_width < wanted:
            half_width += 1
            if half_width <= x:
                span[x - half_width] = weights[x - half_width]
            if half_width < g - x:
                span[x + half_width] = weights[x + half_width]
        while half_width > wanted:
            if half_width <= x:
                span[x - half_width] = 0.0
            if half_width < g - x:
                span[x + half_width] = 0.0
            half_width -= 1
        row, k = out[j], w.scale * rows[j]
        if stream:
            for i in range(0, g, LANES):
                stream_product(row, i, k, span)
        else:
            for i in range(g):
                row[i] = k * span[i]
    if area is not None:
        cut_map(area, out)


@part
def cut_map(area, out):
    """Set the cells of a map outside the area to 0."""
    for j in range(len(area)):
        for i in range(len(area)):
            out[j, i] = out[j, i] if area[j, i] else 0.0


@part
def less_one(remainder):
    """Return the remainder, reduced by one cell if it has reached one."""
    return remainder - np.sign(remainder) if abs(remainder) >= 1 else remainder


@part
def drift(c, w, area):
    """Move the datum by the drift of one step; it stays in the area."""
    g = c.grid_size
    if c.drift_remainder_dropped:
        if abs(w.remainder_x) >= 1:
            w.remainder_x = 0.0
        if abs(w.remainder_y) >= 1:
            w.remainder_y = 0.0
    w.remainder_x += w.drift_x
    w.remainder_y += w.drift_y
    dx, dy = np.int64(w.remainder_x), np.int64(w.remainder_y)
    if c.drift_remainder_less_one:
        w.remainder_x, w.remainder_y = less_one(w.remainder_x), less_one(w.remainder_y)
    elif not c.drift_remainder_dropped:
        w.remainder_x -= dx
        w.remainder_y -= dy
    if c.drift_axes_independent:
        w.datum_x, w.datum_y = step_within(area, g, w.datum_x, w.datum_y, dx, dy)
    elif is_open(area, g, w.datum_x + dx, w.datum_y + dy):
        w.datum_x += dx
        w.datum_y += dy


@part
def disperse(c, w, gauss, tails):
    """Write the tables for the map's present spread; the first map has the initial spread."""
    grown = max(w.map_steps - 1, 0) * c.dispersion_inc
    fill_axis(gauss[0], tails[0], c.grid_size, c.sigma_x + grown)
    if c.sigma_x == c.sigma_y:
        # Assign element by element: a slice costs three seconds of compilation.
        for d in range(gauss.shape[1]):
            gauss[1, d] = gauss[0, d]
        for d in range(tails.shape[1]):
            tails[1, d] = tails[0, d]
    else:
        fill_axis(gauss[1], tails[1], c.grid_size, c.sigma_y + grown)


@part
def map_step(c, w, gauss, tails, area, runs, circle):
    """Advance the map by one step: drift, dispersion, circle, normaliser."""
    previous_x, previous_y = w.datum_x, w.datum_y
    drift(c, w, area)
    w.map_steps += 1
    if c.dispersion_inc > 0:
        disperse(c, w, gauss, tails)
    w.circle_x, w.circle_y = w.datum_x, w.datum_y
    if c.circle_on_previous_datum:
        w.circle_x, w.circle_y = previous_x, previous_y
    normalise(c, w, gauss, tails, runs, circle)


@kernel
def drift_per_step(c, x, y):
    """Return the drift (x, y) in cells per step of a vector."""
    norm = np.sqrt(x * x + y * y)
    if not c.drift_by_speed or norm == 0.0:
        return x, y
    # Keep the order of operations of DSSE 1.1.9: the last bit can decide when a cell is reached.
    steps = c.cell_size / norm / c.step_duration_s
    return x / steps, y / steps


@kernel
def read_cells(constants, worlds, gauss, area, x, y, out):
    """Write the probabilities of cells of B worlds, 0 outside the grid and the area.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        worlds: (B,) of `kernels.WORLDS`.
        gauss: (1 or B, 2, 2 G + 1) float64.
        area: Of `kernels.Sea`.
        x: (B, K) int64.
        y: (B, K) int64.
        out: (B, K) float32 out.
    """
    c = constants[0]
    for b in range(len(worlds)):
        table = gauss[min(b, len(gauss) - 1)]
        for k in range(x.shape[1]):
            out[b, k] = cell_probability(c, worlds[b], table, area, x[b, k], y[b, k])
