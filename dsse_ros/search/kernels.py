# SPDX-License-Identifier: Apache-2.0
"""The compiled step of B worlds at once: drones, map, persons and rewards.

The map is a closed form of (datum, circle, spread): two tables of exponentials, one per axis, and
a normaliser from their tail sums. A cell costs two look-ups, a whole map one streaming write.

The state of the worlds is in three structured arrays, `worlds` (B,), `drones` (B, N) and `persons`
(B, P); `constants` (1,) is shared and never written. x is the column and
grows to the east, y is the row and grows to the south.

Where only a part of the grid is searched, `area` (G, G) bool is true in its cells, and `runs`
(R, 3) int64 has them as (row, first column, last column). Both are None where all of it is: then
what they would cost is compiled away.

The module is longer than others: Numba's cache is renewed when the file of a function changes, not
when that of a function it calls does, so that all that is compiled into the step is in one file.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from dsse_ros.search.streaming import ALIGNMENT, LANES, stream_product

MAX_ACTIONS = 16

# Without Numba's own memory (NRT) a function cannot make arrays, and counts no references to them:
# that took a third of the time of a small world.
_KERNEL: dict[str, Any] = {"cache": True, "nogil": True, "_nrt": False}
_PART: dict[str, Any] = {**_KERNEL, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

kernel = njit(**_KERNEL)
"""Compiles what Python calls."""
part = njit(**_PART)
"""Compiles what only kernels call, without the wrappers that the compiler would take long over."""
inlined = njit(**_PART, forceinline=True)
"""Compiles a part into its callers, where the call itself would take long."""

CONSTANTS = np.dtype(
    [
        ("grid_size", "i8"),
        ("timestep_limit", "i8"),
        ("pre_search_steps", "i8"),
        ("probability_of_detection", "f8"),
        ("sigma_x", "f8"),
        ("sigma_y", "f8"),
        ("dispersion_inc", "f8"),
        ("num_actions", "i8"),
        ("search_action", "i8"),
        ("dx", "i8", (MAX_ACTIONS,)),
        ("dy", "i8", (MAX_ACTIONS,)),
        ("move", "f8"),
        ("leave_grid", "f8"),
        ("leave_terminates", "?"),
        ("leave_flies_on", "?"),
        ("collisions", "?"),
        ("collision", "f8"),
        ("search_min_probability", "f8"),
        ("search_min_inclusive", "?"),
        ("search_below", "f8"),
        ("search_scale", "f8"),
        ("find", "f8"),
        ("find_bonus", "f8"),
        ("one_find_per_search", "?"),
        ("found_persons_stay", "?"),
        ("time_out", "f8"),
        ("time_out_grace", "i8"),
        ("time_out_acts", "?"),
        ("time_out_total", "?"),
        ("both_flags", "?"),
        ("ends_together", "?"),
        ("drift_remainder_dropped", "?"),
        ("drift_remainder_less_one", "?"),
        ("drift_axes_independent", "?"),
        ("drift_by_speed", "?"),
        ("cell_size", "f8"),
        ("step_duration_s", "f8"),
        ("reset_sea_steps", "i8"),
        ("circle", "?"),
        ("circle_on_previous_datum", "?"),
        ("person_drifts", "?"),
        ("person_first", "?"),
        ("person_walks_blind", "?"),
        ("person_scatter", "i8"),
        ("auto_reset", "?"),  # a step resets a world that is done, whatever its actions
    ],
    align=True,
)
"""The scenario, the rules and the options of the batch, as the kernels read them."""

WORLDS = np.dtype(
    [
        ("rng", "u8"),  # state of the world's own generator
        ("t", "i8"),  # steps done
        ("map_steps", "i8"),
        ("datum_x", "i8"),
        ("datum_y", "i8"),
        ("circle_x", "i8"),
        ("circle_y", "i8"),
        ("remainder_x", "f8"),  # drift not yet moved, cells
        ("remainder_y", "f8"),
        ("vector_x", "f8"),  # the scenario's drift
        ("vector_y", "f8"),
        ("drift_x", "f8"),  # drift per step, cells
        ("drift_y", "f8"),
        ("scale", "f8"),  # 1 / sum of the Gaussian over the possible cells; 0: one cell has it all
        ("start_x", "i8"),  # cell of the person at reset
        ("start_y", "i8"),
        ("num_active", "i8"),  # drones still in the search
        ("num_missing", "i8"),  # persons not found
        ("done", "?"),  # the search has ended: all found, time out, or no drone left
    ],
    align=True,
)

DRONES = np.dtype(
    [
        ("x", "i8"),
        ("y", "i8"),
        ("episode_return", "f8"),  # sum of rewards, before collisions replaced any
        ("reward", "f8"),  # of the last step
        ("alive", "?"),  # in the search; without a flag and not alive: withdrawn
        ("terminated", "?"),  # since the last reset
        ("truncated", "?"),
        ("found", "?"),  # found a person in the last step
    ],
    align=True,
)

PERSONS = np.dtype(
    [
        ("x", "i8"),
        ("y", "i8"),
        ("pod_multiplier", "f8"),
        ("remainder_x", "f8"),  # own drift not yet moved, cells
        ("remainder_y", "f8"),
        ("drift_x", "f8"),  # own drift per step, cells
        ("drift_y", "f8"),
        ("found", "?"),
    ],
    align=True,
)


@part
def draw_bits(w):
    """Return the next 64 random bits of a world (SplitMix64, Steele et al. 2014)."""
    w.rng += np.uint64(0x9E3779B97F4A7C15)
    z = w.rng
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@part
def draw_below(w, n):
    """Return a random integer from 0 to n - 1, n < 2^32."""
    return np.int64(((draw_bits(w) >> np.uint64(32)) * np.uint64(n)) >> np.uint64(32))


@part
def draw_unit(w):
    """Return a random float in [0, 1)."""
    return np.float64(draw_bits(w) >> np.uint64(11)) * 2.0**-53


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
    """Return the sum of the Gaussian over the offsets lo..hi of its centre.

    Differences of tails keep their precision where the Gaussian is small.
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
    """Return whether the cell at this distance lies in the circle of this squared diameter.

    Its outer edges must: (adx + 1/2)^2 + ady^2 <= r^2 and adx^2 + (ady + 1/2)^2 <= r^2.
    """
    x, y = 2 * adx, 2 * ady
    return (x + 1) * (x + 1) + y * y <= d2 and x * x + (y + 1) * (y + 1) <= d2


@part
def is_inside(g, x, y):
    """Return whether a cell is on the grid."""
    # As an unsigned number, one below 0 is greater than any other.
    return (np.uint64(x) < np.uint64(g)) & (np.uint64(y) < np.uint64(g))


@part
def is_masked(area, g, x, y):
    """Return whether a cell is on the grid and not in the area."""
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
    """Return the cell that a step leads to; an axis that would leave stays alone.

    Where either of both would lead to a cell of the area and both together would not, x moves.
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
    """Return how many rows on each side of the circle's centre it covers whole, -1 for none."""
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
        circle: (G + 1,) int64 out, -1 for none; behind the rows stands the diameter, so that worlds
            side by side with equal circles share the work.
    """
    d = diameter(w)
    rows = len(circle) - 1
    if circle[rows] == d:
        return
    circle[rows] = d
    d2 = d * d
    for ady in range(rows):
        # The largest adx of `inside_circle`; the root of such an integer is exact when cut off.
        by_column, by_row = d2 - 4 * ady * ady, d2 - (2 * ady + 1) * (2 * ady + 1)
        across = (np.int64(np.sqrt(np.float64(max(by_column, 0)))) - 1) >> 1
        down = np.int64(np.sqrt(np.float64(max(by_row, 0)))) >> 1
        circle[ady] = min(across, down) if by_row >= 0 else -1


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
    """Return the sum of the Gaussian over the cells of the area, with a circle those in it."""
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
    # A Gaussian too far from the circle to be represented leaves all in the circle's centre.
    w.scale = 1.0 / total if total > 1e-300 else 0.0


# As a call of its own it takes a third longer to write large maps.
@inlined
def write_map(c, w, gauss, area, circle, span, stream, out):
    """Write the map (G, G) float32, out[y, x], row after row as memory likes it.

    `circle` and `span` (G,) float64 are scratch; `stream` says whether to write past the caches.
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
        # From row to row the circle's part of the weights changes only at its ends.
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
    """Return the remainder with one cell taken off once it has reached one."""
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
    """Write the tables for the spread that the map has now: the first map has the first one."""
    grown = max(w.map_steps - 1, 0) * c.dispersion_inc
    fill_axis(gauss[0], tails[0], c.grid_size, c.sigma_x + grown)
    if c.sigma_x == c.sigma_y:
        # Element by element: assigning a slice takes the compiler three seconds.
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


FACTORS = 100
"""A cell of a person's window is weighted by U{1..100} / 100."""


@part
def person_to_best_cell(c, w, gauss, area, person):
    """Move a person to the best of the 3 x 3 window, each cell weighted by U{1..100} / 100."""
    best, best_dx, best_dy = 0.0, 0, 0
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            factor = (1 + draw_below(w, FACTORS)) / np.float64(FACTORS)
            weight = cell_probability(c, w, gauss, area, person.x + dx, person.y + dy) * factor
            if weight > best:
                best, best_dx, best_dy = weight, dx, dy
    blind = best == 0.0 and c.person_walks_blind
    if blind and not is_masked(area, c.grid_size, person.x - 1, person.y - 1):
        best_dx = best_dy = -1
    person.x += best_dx
    person.y += best_dy


DRIFT_RANGES = 4
"""Ranges of angles that a person's own drift is drawn from; see `own_drift`."""

DRIFT_WEIGHT = 0.05
"""Added to the probability of the cell that a person drifts to (DSSE 1.1.9)."""


@part
def gather_drift(person):
    """Add a step to a person's remainder; returns whether it had reached a cell before."""
    reached = abs(person.remainder_x) >= 1 or abs(person.remainder_y) >= 1
    person.remainder_x += person.drift_x
    person.remainder_y += person.drift_y
    return reached


@part
def drift_direction(person):
    """Return the step (dx, dy) that a person's drift has gathered."""
    # np.round rounds halves to even.
    return np.sign(np.round(person.remainder_x)), np.sign(np.round(person.remainder_y))


@part
def spend_drift(person):
    """Take the cell that a person's drift has gathered off its remainder."""
    person.remainder_x = less_one(person.remainder_x)
    person.remainder_y = less_one(person.remainder_y)


@part
def person_with_drift(c, w, gauss, area, person):
    """Draw a person's step from the 3 x 3 window when its own drift has gathered a cell."""
    if not gather_drift(person):
        return
    drift_dx, drift_dy = drift_direction(person)
    total = DRIFT_WEIGHT
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            total += cell_probability(c, w, gauss, area, person.x + dx, person.y + dy)
    left = draw_unit(w) * total
    step_x, step_y = int(drift_dx), int(drift_dy)
    for k in range(9):
        dx, dy = k % 3 - 1, k // 3 - 1
        left -= cell_probability(c, w, gauss, area, person.x + dx, person.y + dy)
        if dx == drift_dx and dy == drift_dy:
            left -= DRIFT_WEIGHT
        if left < 0:
            step_x, step_y = dx, dy
            break
    person.x, person.y = step_within(area, c.grid_size, person.x, person.y, step_x, step_y)
    spend_drift(person)


@kernel
def persons_step(c, w, gauss, area, persons):
    """Move every person that is not found yet."""
    for p in range(len(persons)):
        if persons[p].found and not c.found_persons_stay:
            continue
        if c.person_drifts:
            person_with_drift(c, w, gauss, area, persons[p])
        else:
            person_to_best_cell(c, w, gauss, area, persons[p])


@part
def drift_per_step(c, x, y):
    """Return the drift (x, y) in cells per step of a vector."""
    norm = np.sqrt(x * x + y * y)
    if not c.drift_by_speed or norm == 0.0:
        return x, y
    # In the order of operations of DSSE 1.1.9: the last bit can decide when a cell is reached.
    steps = c.cell_size / norm / c.step_duration_s
    return x / steps, y / steps


@part
def own_drift(c, w, k, share):
    """Return the drift (x, y) of a person whose angle is `share` of the way along range k of 4.

    The mean of the vector and of a turned and scaled copy of it: the scale falls with the angle's
    distance from a right angle (measured on DSSE 1.1.9).
    """
    low = (0.0, 20.0, 300.0, 315.0)[k]
    high = (45.0, 55.0, 360.0, 360.0)[k]
    angle = np.radians(low + share * (high - low))
    scale = 0.5 + np.exp(-abs(angle - np.pi / 2) / np.pi)
    turned_x = scale * (np.cos(angle) * w.vector_x - np.sin(angle) * w.vector_y)
    turned_y = scale * (np.sin(angle) * w.vector_x + np.cos(angle) * w.vector_y)
    return drift_per_step(c, (w.vector_x + turned_x) / 2, (w.vector_y + turned_y) / 2)


@part
def draw_own_drift(c, w, person):
    """Draw a person's drift: each range of angles, and each angle in it, is as likely."""
    k = draw_below(w, DRIFT_RANGES)
    person.drift_x, person.drift_y = own_drift(c, w, k, draw_unit(w))


@part
def scatter_persons(c, w, area, persons, cells):
    """Put all but the first person in different cells within `person_scatter` of the start."""
    g, s = c.grid_size, c.person_scatter
    x0, y0 = max(w.start_x - s, 0), max(w.start_y - s, 0)
    width = min(w.start_x + s, g - 1) - x0 + 1
    height = min(w.start_y + s, g - 1) - y0 + 1
    count = start = 0
    for k in range(width * height):
        x, y = x0 + k % width, y0 + k // width
        if is_masked(area, g, x, y):
            continue
        if x == w.start_x and y == w.start_y:
            start = count
        cells[count] = k
        count += 1
    cells[0], cells[start] = cells[start], cells[0]
    for p in range(1, len(persons)):
        k = p + draw_below(w, count - p)
        cells[p], cells[k] = cells[k], cells[p]
        persons[p].x, persons[p].y = x0 + cells[p] % width, y0 + cells[p] // width


@part
def sea_step(c, w, persons, gauss, tails, area, runs, circle):
    """Advance the map and the persons by one step."""
    if c.person_first:
        persons_step(c, w, gauss, area, persons)
    map_step(c, w, gauss, tails, area, runs, circle)
    if not c.person_first:
        persons_step(c, w, gauss, area, persons)


@part
def reset_world(c, w, starts, drones, persons, gauss, tails, area, runs, circle, cells):
    """Set a world to its start: persons at the start cell, which has all the probability."""
    w.t = w.map_steps = 0
    w.datum_x = w.circle_x = w.start_x
    w.datum_y = w.circle_y = w.start_y
    w.remainder_x = w.remainder_y = 0.0
    w.drift_x, w.drift_y = drift_per_step(c, w.vector_x, w.vector_y)
    w.scale = 0.0
    w.done = False
    w.num_active = len(drones)
    w.num_missing = len(persons)
    for n in range(len(drones)):
        d = drones[n]
        d.x, d.y = starts[n, 0], starts[n, 1]
        d.episode_return = d.reward = 0.0
        d.alive = True
        d.terminated = d.truncated = d.found = False
    for p in range(len(persons)):
        person = persons[p]
        person.x, person.y = w.start_x, w.start_y
        person.remainder_x = person.remainder_y = 0.0
        person.found = False
        if c.person_drifts:
            draw_own_drift(c, w, person)
    if c.person_scatter > 0:
        scatter_persons(c, w, area, persons, cells)
    for _ in range(c.pre_search_steps + c.reset_sea_steps):
        sea_step(c, w, persons, gauss, tails, area, runs, circle)


@inlined
def search_cell(c, w, gauss, area, d, persons):
    """Return (reward, found) of a search by a drone where it is."""
    finds = 0
    for p in range(len(persons)):
        person = persons[p]
        gone = person.found and not c.found_persons_stay
        if gone or person.x != d.x or person.y != d.y:
            continue
        chance = min(person.pod_multiplier * c.probability_of_detection, 1.0)
        if chance >= 1.0 or draw_unit(w) < chance:
            person.found = True
            finds += 1
        if c.one_find_per_search:
            break
    if finds > 0:
        return finds * (c.find + c.find_bonus * (1.0 - w.t / c.timestep_limit)), True
    x, y = d.x, d.y
    if c.leave_flies_on:
        # A drone outside to the west or north sees the cell that a negative index names.
        x, y = (x + c.grid_size if x < 0 else x), (y + c.grid_size if y < 0 else y)
    probability = cell_probability(c, w, gauss, area, x, y)
    enough = probability > c.search_min_probability or (
        c.search_min_inclusive and probability == c.search_min_probability
    )
    return (probability * c.search_scale if enough else c.search_below), False


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
    return d.alive and (c.ends_together or not d.terminated)


@part
def step_drones(c, w, drones, persons, gauss, area, occupied, actions):
    """Do the actions in index order against the map of the last observation.

    Returns:
        Whether active drones may share a cell, and whether any has found a person or got a
        flag.
    """
    # Read once: the compiler must expect that what is written to the drones changes them.
    grid_size, move_reward, leave_reward = c.grid_size, c.move, c.leave_grid
    search_action, num_actions, leave_flies_on = c.search_action, c.num_actions, c.leave_flies_on
    leave_flags = c.leave_terminates or leave_flies_on
    ends_together, collisions = c.ends_together, c.collisions
    out_of_time = w.t >= c.timestep_limit + c.time_out_grace
    idle = out_of_time and not c.time_out_acts
    moves_x, moves_y = c.dx, c.dy
    stamp = next_stamp(occupied)
    shared = eventful = False
    for n in range(len(drones)):
        d, action = drones[n], actions[n]
        if not d.alive:
            d.reward = 0.0
            d.found = False
            # One that was withdrawn has no flag yet.
            eventful |= not (d.terminated or d.truncated)
            continue
        reward, found, terminated = move_reward, False, d.terminated
        if idle:
            pass
        elif action == search_action:
            reward, found = search_cell(c, w, gauss, area, d, persons)
            if found and ends_together:
                for m in range(len(drones)):
                    drones[m].terminated = True
                terminated = True
        elif 0 <= action < num_actions:
            x, y = d.x + moves_x[action], d.y + moves_y[action]
            inside = is_open(area, grid_size, x, y)
            # Outside the grid is water, outside the area is not.
            if inside or (leave_flies_on and not is_inside(grid_size, x, y)):
                d.x, d.y = x, y
            if not inside:
                reward = leave_reward
            terminated = leave_flags and not inside
        if out_of_time:
            reward = c.time_out - (d.episode_return if c.time_out_total else 0.0)
            d.truncated = True
        d.reward = reward
        d.episode_return += reward
        d.found = found
        d.terminated = terminated
        eventful |= found or terminated or d.truncated
        if collisions and (ends_together or not terminated):
            shared |= occupy(grid_size, d, occupied, stamp)
    return shared, eventful


@part
def update_flags(c, w, drones, persons):
    """Flag the drones whose search has ended, and the world when all have."""
    w.num_missing = 0
    for p in range(len(persons)):
        w.num_missing += not persons[p].found
    all_found = w.num_missing == 0 and not c.ends_together
    any_flag = False
    num_active = 0
    for n in range(len(drones)):
        d = drones[n]
        if not d.alive:
            # One without a flag was withdrawn since the last step.
            d.terminated = d.terminated or not d.truncated
            continue
        d.terminated = d.terminated or all_found
        if d.terminated or d.truncated:
            any_flag = True
            d.terminated = d.terminated or c.both_flags
            d.truncated = d.truncated or c.both_flags
            d.alive = c.ends_together
        num_active += d.alive
    w.num_active = num_active
    w.done = num_active == 0 or (c.ends_together and any_flag)
    if c.ends_together and w.done:
        # A drone that ends only because the search has ended is truncated.
        for n in range(len(drones)):
            drones[n].truncated = drones[n].truncated or not drones[n].terminated


@part
def step_world(c, w, drones, persons, gauss, tails, area, runs, occupied, circle, actions):
    """Advance one world: drones in index order, then the sea, then collisions."""
    if c.ends_together:
        for n in range(len(drones)):
            if drones[n].alive:
                drones[n].terminated = drones[n].truncated = False
    if c.found_persons_stay:
        for p in range(len(persons)):
            persons[p].found = False
    unchanged = not w.done and w.num_missing == len(persons)
    shared, eventful = step_drones(c, w, drones, persons, gauss, area, occupied, actions)
    w.t += 1
    sea_step(c, w, persons, gauss, tails, area, runs, circle)
    if shared:
        collide(c, drones, occupied)
    if shared or eventful or not unchanged:
        update_flags(c, w, drones, persons)


STREAMED_BYTES = 1 << 25
"""Maps that take more than this are written past the caches, which they would not stay in."""


@part
def is_streamed(maps):
    """Return whether maps (B, G, G) are to be written past the caches, and can be."""
    large = maps.size * maps.itemsize > STREAMED_BYTES
    return large and maps.shape[1] % LANES == 0 and maps.ctypes.data % ALIGNMENT == 0


@kernel
def step_worlds(
    constants, worlds, starts, drones, persons, gauss, tails, area, runs,
    occupied, circle, cells, span, actions, maps, first, last,
):  # fmt: skip
    """Advance the worlds first..last - 1 by one step and write their maps.

    Args:
        constants: (1,) of `CONSTANTS`.
        worlds: (B,) of `WORLDS`.
        starts: (B, N, 2) int64, cells of the drones at reset.
        drones: (B, N) of `DRONES`.
        persons: (B, P) of `PERSONS`.
        gauss: (1 or B, 2, 2 G + 1) float64, exponentials along x and y.
        tails: (1 or B, 2, G + 2) float64, their tail sums.
        area: (G, G) bool, the cells that are searched; None for all.
        runs: (R, 3) int64, the same by row, first and last column; None for all.
        occupied: (G * G + 1,) uint16 scratch, see `occupy`.
        circle: (G + 1,) int64 scratch, see `update_circle`.
        cells: (K,) int64 scratch, the cells that persons are scattered over.
        span: (G,) float64 scratch.
        actions: (B, N) int8; a number without an action does nothing.
        maps: (B, G, G) float32 out, [y, x], C-contiguous; (B, 0, 0) to write none.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    c = constants[0]
    stream = is_streamed(maps)
    for b in range(first, last):
        w = worlds[b]
        table = min(b, len(gauss) - 1)
        if c.auto_reset and w.done:
            reset_world(
                c, w, starts[b], drones[b], persons[b], gauss[table], tails[table], area, runs,
                circle, cells,
            )  # fmt: skip
        else:
            step_world(
                c, w, drones[b], persons[b], gauss[table], tails[table], area, runs,
                occupied, circle, actions[b],
            )  # fmt: skip
        if maps.shape[1] > 0:
            write_map(c, w, gauss[table], area, circle, span, stream, maps[b])


@kernel
def reset_worlds(
    constants, worlds, starts, drones, persons, gauss, tails, area, runs, circle, cells, span, maps,
    which,
):  # fmt: skip
    """Reset the worlds with which[b] and write their maps; arguments as in `step_worlds`."""
    c = constants[0]
    stream = is_streamed(maps)
    for b in range(len(worlds)):
        if which[b]:
            table = min(b, len(gauss) - 1)
            reset_world(
                c, worlds[b], starts[b], drones[b], persons[b], gauss[table], tails[table], area,
                runs, circle, cells,
            )  # fmt: skip
            if maps.shape[1] > 0:
                write_map(c, worlds[b], gauss[table], area, circle, span, stream, maps[b])


@kernel
def refresh_worlds(constants, worlds, gauss, tails, area, circle, span, maps):
    """Write the tables and the maps that the state asks for; arguments as in `step_worlds`."""
    c = constants[0]
    stream = is_streamed(maps)
    for b in range(len(gauss)):
        disperse(c, worlds[b], gauss[b], tails[b])
    if maps.shape[1] > 0:
        for b in range(len(worlds)):
            table = gauss[min(b, len(gauss) - 1)]
            write_map(c, worlds[b], table, area, circle, span, stream, maps[b])


@kernel
def report_worlds(
    constants, area, drones, positions, rewards, terminated, truncated, action_masks, first, last
):
    """Write positions, rewards, flags and action masks of the drones of the worlds first..last - 1.

    Args:
        constants: (1,) of `CONSTANTS`.
        area: As in `step_worlds`.
        drones: (B, N) of `DRONES`.
        positions: (B, N, 2) int64 out, as (x, y).
        rewards: (B, N) float64 out.
        terminated: (B, N) bool out.
        truncated: (B, N) bool out.
        action_masks: (B, N, A) int8 out, 0 for moves out of the grid or the area.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    c = constants[0]
    edge, num_actions = c.grid_size - 1, action_masks.shape[2]
    inner = np.uint64(max(edge - 1, 0))
    for b in range(first, last):
        of_world, cells, masks = drones[b], positions[b], action_masks[b]
        reward, ended, stopped = rewards[b], terminated[b], truncated[b]
        masks[:] = 1
        for n in range(len(of_world)):
            d = of_world[n]
            x, y = d.x, d.y
            cells[n, 0], cells[n, 1] = x, y
            reward[n] = d.reward
            ended[n], stopped[n] = d.terminated, d.truncated
            if area is not None and is_inside(c.grid_size, x, y):
                for a in range(num_actions):
                    masks[n, a] = is_open(area, c.grid_size, x + c.dx[a], y + c.dy[a])
            elif (np.uint64(x - 1) >= inner) | (np.uint64(y - 1) >= inner):
                for a in range(num_actions):
                    dx, dy = c.dx[a], c.dy[a]
                    west, east = dx < 0 and x == 0, dx > 0 and x == edge
                    north, south = dy < 0 and y == 0, dy > 0 and y == edge
                    masks[n, a] = not (west or east or north or south)


@kernel
def read_cells(constants, worlds, gauss, area, x, y, out):
    """Write the probabilities of cells of B worlds, 0 outside the grid and the area.

    Args:
        constants: (1,) of `CONSTANTS`.
        worlds: (B,) of `WORLDS`.
        gauss: (1 or B, 2, 2 G + 1) float64.
        area: As in `step_worlds`.
        x: (B, K) int64.
        y: (B, K) int64.
        out: (B, K) float32 out.
    """
    c = constants[0]
    for b in range(len(worlds)):
        table = gauss[min(b, len(gauss) - 1)]
        for k in range(x.shape[1]):
            out[b, k] = cell_probability(c, worlds[b], table, area, x[b, k], y[b, k])
