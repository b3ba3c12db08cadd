# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The coverage task, compiled: drones visit each cell with a probability once.

`coverage` is the state of the task in B worlds: `(poc, left, records)`. `poc` (G, G) float64 as
[y, x] is the probability of each cell at the start, `left` (B, G, G) float64 the rest of it in each
world, `records` (B,) of `COVERAGE`. A cell is to be covered while `left` is not 0. `b` is the
number of a world; other arguments are as in `sea_map`.

Source: the behaviour of `CoverageDroneSwarmSearch` in the package DSSE 1.1.9. Rewards are computed
in its order of operations, so that they are the same to the last bit.
"""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.jit import part

COVERAGE = np.dtype(
    [
        ("cells", "i8"),  # to cover at the start
        ("repeated", "i8"),  # visits of cells that were covered before, or had no probability
        ("pos", "f8"),  # sum of the probability of the cells covered, times that of detection
    ],
    align=True,
)


@part
def put_back(w, coverage, b):
    """Restore all probability, so that every cell is to be covered again."""
    poc, left, records = coverage
    of_world, record = left[b], records[b]
    cells = 0
    for y in range(poc.shape[0]):
        for x in range(poc.shape[1]):
            of_world[y, x] = poc[y, x]
            cells += poc[y, x] > 0.0
    w.num_missing = record.cells = cells
    record.repeated = 0
    record.pos = 0.0


@part
def visit(c, w, coverage, b, x, y):
    """Cover the cell of a drone after its action; return the drone's reward."""
    _, left, records = coverage
    of_world, record = left[b], records[b]
    probability = of_world[y, x]
    if probability <= 0.0:
        record.repeated += 1
        return c.move
    of_world[y, x] = 0.0
    w.num_missing -= 1
    record.pos += probability * c.probability_of_detection
    time_left = 1.0 - (w.t + 1) / c.timestep_limit
    return c.cover + time_left * probability * c.cover_scale * record.cells


@part
def reward_if_all_covered(c, w, coverage, b, drones):
    """Flag and reward each drone in the search if this step covered the last cell."""
    if w.done or w.num_missing > 0:
        return
    share = coverage[2][b].cells / len(drones)
    reward = c.cover_all * share + (1.0 - w.t / c.timestep_limit) * c.cover_all_bonus * share
    for n in range(len(drones)):
        d = drones[n]
        if d.alive:
            d.episode_return += reward - d.reward
            d.reward = reward
            d.terminated = True


@part
def write_left(coverage, b, out):
    """Write the remaining probability, (G, G) float32 as [y, x]."""
    left = coverage[1][b]
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            out[y, x] = left[y, x]
