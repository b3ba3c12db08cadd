# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled motion of a belief: the layers whose persons move, and the sums of the cells.

Arguments are those of `belief_kernels`. A layer is (S S,) of a `Mass`, its span (2,) and the cells
of its class (S S,). Loops over slices of equal lengths are in functions without other arguments,
which the compiler vectorizes.
"""

from __future__ import annotations

from dsse_ros.belief.belief_kernels import (
    MARGIN,
    NEGLIGIBLE,
    complete,
    index_of,
    offset_of,
    step_of_drift,
)
from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.targets.drawn_cell import DRIFT_WEIGHT
from dsse_ros.targets.motion import STAND_STILL, STEPS

PER_DRIFT = 1.0 / DRIFT_WEIGHT


@inlined
def is_negligible(cells, negligible):
    """Return whether all cells are."""
    others = 0
    for i in range(len(cells)):
        others += cells[i] > negligible
    return others == 0


@part
def shrink(side, layer, span, cells, negligible):
    """Empty the rows of cells at both ends of a layer's span that are negligible."""
    for end in range(2):
        while span[0] < span[1]:
            first = span[0] if end == 0 else span[1] - side
            if not is_negligible(layer[first : first + side], negligible):
                break
            for i in range(first, first + side):
                cells[i] -= layer[i]
                layer[i] = 0.0
            span[end] += side if end == 0 else -side


@inlined
def copy_but_negligible(layer, negligible, known, before):
    """Copy cells, the negligible ones as empty; return how many others the table lacks."""
    unknown = 0
    for i in range(len(layer)):
        here = layer[i] if layer[i] > negligible else 0.0
        before[i] = here
        unknown += (here > 0.0) & (known[i] < 0.0)
    return unknown


@inlined
def weigh_but_negligible(layer, negligible, known, added, drifted):
    """Write what drifts from each cell but the negligible ones; return how many the table lacks."""
    unknown = 0
    for i in range(len(layer)):
        here = layer[i] if layer[i] > negligible else 0.0
        drifted[i] = here * added[i]
        unknown += (here > 0.0) & (known[i] < 0.0)
    return unknown


@part
def complete_table(constants, sea, step, layer, negligible, span, row):
    """Complete the table of a step for the cells of a layer but the negligible ones."""
    for i in range(span[0], span[1]):
        if layer[i] > negligible:
            complete(constants, sea, step, i, row)


@inlined
def add_products(out, sums, a, b):
    """Write the sum of nine products of equally long arrays, and add what changes to the sums.

    The compiler vectorizes this form.
    """
    a0, a1, a2, a3, a4, a5, a6, a7, a8 = a
    b0, b1, b2, b3, b4, b5, b6, b7, b8 = b
    for j in range(len(out)):
        after = (
            a0[j] * b0[j] + a1[j] * b1[j] + a2[j] * b2[j]
            + a3[j] * b3[j] + a4[j] * b4[j] + a5[j] * b5[j]
            + a6[j] * b6[j] + a7[j] * b7[j] + a8[j] * b8[j]
        )  # fmt: skip
        sums[j] += after - out[j]
        out[j] = after


@part
def gather(before, table, layer, cells, low, high, side):
    """Write the probability that steps from all cells bring to the cells low..high - 1."""
    # The cells where the steps 8 to 0 start.
    a, b, c = low - side - 1, low - side, low - side + 1
    d, e, f = low - 1, low, low + 1
    g, h, i = low + side - 1, low + side, low + side + 1
    n = high - low
    add_products(
        layer[low:high],
        cells[low:high],
        (
            before[a : a + n], before[b : b + n], before[c : c + n],
            before[d : d + n], before[e : e + n], before[f : f + n],
            before[g : g + n], before[h : h + n], before[i : i + n],
        ),
        (
            table[8, a : a + n], table[7, b : b + n], table[6, c : c + n],
            table[5, d : d + n], table[4, e : e + n], table[3, f : f + n],
            table[2, g : g + n], table[1, h : h + n], table[0, i : i + n],
        ),
    )  # fmt: skip


@inlined
def add_three(out, a, b, c):
    """Write sums of three."""
    for j in range(len(out)):
        out[j] = a[j] + b[j] + c[j]


@inlined
def add_windows(out, sums, chances, above, here, below, drifted):
    """Write what steps to the window and those of the drift bring, and add the change to the sums.

    Args:
        out: The cells.
        sums: Of the cells.
        chances: Probabilities of the cells, see `Steps`.
        above: What drifts from three cells around each cell's neighbour in the row before.
        here: The same of the cell.
        below: The same of its neighbour in the next row.
        drifted: What drifts to each cell.
    """
    for j in range(len(out)):
        after = chances[j] * (above[j] + here[j] + below[j]) * PER_DRIFT + drifted[j]
        sums[j] += after - out[j]
        out[j] = after


@part
def draw_together(chances, scratch, layer, cells, low, high, side, offset):
    """Write the probability that steps to the window and the drift bring to cells low..high - 1.

    Args:
        chances: Of `Steps`.
        scratch: Of `predict`; it begins with what drifts from each cell. What steps to a neighbour
            is this times the neighbour's probability, over `DRIFT_WEIGHT`.
        layer: The cells, out.
        cells: Their sums, in and out.
        low: The first cell.
        high: The last one, plus one.
        side: S.
        offset: What the drift's step adds to a column.
    """
    drifted, rows = scratch[: len(layer)], scratch[len(layer) :]
    a, b = low - side, high + side
    add_three(rows[a:b], drifted[a - 1 : b - 1], drifted[a:b], drifted[a + 1 : b + 1])
    add_windows(
        layer[low:high], cells[low:high], chances[low:high], rows[a : high - side], rows[low:high],
        rows[low + side : b], drifted[low - offset : high - offset],
    )  # fmt: skip


@part
def keep_within(constants, area, span, drifted, direction, layer, cells):
    """Move what the drift brought out of the area to the cells where the persons stay."""
    side, inner = constants.grid_size + 2 * MARGIN, constants.grid_size - 2
    for y in range(span[0] // side - MARGIN, span[1] // side - MARGIN):
        start, end = index_of(constants, 0, y), index_of(constants, constants.grid_size, y)
        # Without an area, only the cells at the edges can lead out of it.
        at_edge = area is not None or y == 0 or y == constants.grid_size - 1
        for i in range(start, end, 1 if at_edge else inner + 1):
            if drifted[i] <= 0.0:
                continue
            step = step_of_drift(constants, area, i - start, y, direction)
            if step != direction:
                out, to = i + offset_of(constants, direction), i + offset_of(constants, step)
                layer[out], cells[out] = layer[out] - drifted[i], cells[out] - drifted[i]
                layer[to], cells[to] = layer[to] + drifted[i], cells[to] + drifted[i]


@part
def move_layer(constants, sea, mass, k, step, scratch):
    """Advance layer k of a belief by the persons' step, see `predict`."""
    drifts, side, table = len(step.directions), constants.grid_size + 2 * MARGIN, step.tables
    layer, span, cells = mass.layers[k], mass.spans[k], mass.cells[k // drifts]
    direction, negligible = step.directions[k % drifts], NEGLIGIBLE * mass.totals[k // drifts]
    count = len(layer)
    before, row = scratch[:count], scratch[2 * count :]
    # The outermost cells are always empty.
    first, last = max(span[0] - side, side), min(span[1] + side, count - side)
    low, high = first - side, last + side
    here, known, out = layer[low:high], table[0, low:high], before[low:high]
    if constants.own_drift:
        added, offset = table[STEPS, low:high], offset_of(constants, direction)
        if weigh_but_negligible(here, negligible, known, added, out) > 0:
            complete_table(constants, sea, step, layer, negligible, span, row)
            weigh_but_negligible(here, negligible, known, added, out)
        draw_together(step.chances, scratch, layer, cells, first + 1, last - 1, side, offset)
        keep_within(constants, sea.area, span, before, direction, layer, cells)
    else:
        if copy_but_negligible(here, negligible, known, out) > 0:
            complete_table(constants, sea, step, layer, negligible, span, row)
        gather(before, table, layer, cells, first + 1, last - 1, side)
    span[0], span[1] = first, last
    # Now its rows are in the caches; before the next move they no longer are.
    shrink(side, layer, span, cells, negligible)


@kernel
def predict(constants, sea, mass, step, scratch):
    """Advance a belief by the persons' step; its totals do not change.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of the scenario.
        mass: The belief.
        step: One of `Steps`; its table is completed.
        scratch: (2 S S + `ROW`,) float64.
    """
    for k in range(len(mass.layers)):
        direction = step.directions[k % len(step.directions)]
        if direction != STAND_STILL and mass.spans[k, 0] < mass.spans[k, 1]:
            move_layer(constants[0], sea, mass, k, step, scratch)
