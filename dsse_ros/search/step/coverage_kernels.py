# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The coverage task, compiled: drones visit each cell with a probability once.

`coverage` is the `CoverageTask` of one world, None in a search for persons; other arguments are as
in `sea_map`.

Source: the behaviour of `CoverageDroneSwarmSearch` in the package DSSE 1.1.9. The
rewards of `recipe.reward_of` are computed in its order of operations, so that they are the same to
the last bit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import part
from dsse_ros.base.compiled.records import dtype_of
from dsse_ros.search.step.entities import Map, Records, WorldRecord


class CoverageRecord:
    """What has been covered of a world."""

    cells: int  # to cover at the start
    repeated: int  # visits of cells that were covered before, or had no probability
    pos: float  # sum of the probability of the cells covered, times that of detection


COVERAGE = dtype_of(CoverageRecord)


class CoverageTask(NamedTuple):
    """The coverage task of B worlds, or of one: then `left` has no first axis B, and B is 1.

    Attributes:
        poc: (R, C) float64 as [y, x], the probability of each cell at the start.
        left: (B, R, C) float64, the rest of it; a cell is to be covered while this is not 0.
        records: (B,) of `COVERAGE`.
    """

    poc: NDArray[np.float64]
    left: NDArray[np.float64]
    records: Records


@part
def coverage_of(coverage: CoverageTask | None, b: int) -> CoverageTask | None:
    """Return the task of world b; None in a search for persons."""
    if coverage is None:
        return None
    return CoverageTask(
        poc=coverage.poc, left=coverage.left[b], records=coverage.records[b : b + 1]
    )


@part
def start_coverage(world: WorldRecord, coverage: CoverageTask) -> None:
    """Restore all probability, so that every cell is to be covered again."""
    poc, left, record = coverage.poc, coverage.left, coverage.records[0]
    cells = 0
    for y in range(poc.shape[0]):
        for x in range(poc.shape[1]):
            left[y, x] = poc[y, x]
            cells += poc[y, x] > 0.0
    world.num_missing = record.cells = cells
    record.repeated = 0
    record.pos = 0.0


@part
def cells_to_cover(coverage: CoverageTask | None) -> int:
    """Return the number of cells to cover at the start, 0 in a search for persons."""
    return 0 if coverage is None else coverage.records[0].cells


@part
def cover(world: WorldRecord, coverage: CoverageTask | None, x: int, y: int, pod: float) -> float:
    """Cover the cell of a drone; return its probability, 0 if there is none left to cover."""
    if coverage is None:
        return 0.0
    left, record = coverage.left, coverage.records[0]
    probability = left[y, x]
    if probability <= 0.0:
        record.repeated += 1
        return 0.0
    left[y, x] = 0.0
    world.num_missing -= 1
    record.pos += probability * pod
    return probability


@part
def write_left(coverage: CoverageTask, out: Map) -> None:
    """Write the remaining probability, (R, C) float32 as [y, x]."""
    left = coverage.left
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            out[y, x] = left[y, x]
