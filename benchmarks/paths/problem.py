# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The problem of a path search: searchers on a graph of columns, a target on a Markov chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from benchmarks.paths import kernels
from benchmarks.paths.chain import TargetChain

Plan: TypeAlias = NDArray[np.int64]
"""(H,) number of the move in each step."""
Plans: TypeAlias = Sequence[Plan | None]
"""A plan for each searcher; None for a searcher that does not look."""


class SearchGraph(NamedTuple):
    """The moves and looks of a kind of searcher, on a graph of C columns.

    Attributes:
        ahead: (A, C) int64, the column after each move, -1 where the move is not possible.
        looks: (A + 1,) int64, the looks of move a are looks[a] .. looks[a + 1] - 1.
        there: (L, C) int64, the column that a look sees from the column after the move, or -1.
        pods: (L, P) float64, POD of each person.
        alike: (A,) int64, number of each move's looks; moves with the same looks have the same.
        examples: (Q,) int64, a move of each number.
    """

    ahead: NDArray[np.int64]
    looks: NDArray[np.int64]
    there: NDArray[np.int64]
    pods: NDArray[np.float64]
    alike: NDArray[np.int64]
    examples: NDArray[np.int64]


def search_graph(
    ahead: NDArray[np.int64],
    first: NDArray[np.int64],
    there: NDArray[np.int64],
    pods: NDArray[np.float64],
) -> SearchGraph:
    """Return the graph of these moves and looks; see `SearchGraph`."""
    looks: dict[bytes, int] = {}
    alike, examples = np.empty(len(ahead), np.int64), list[int]()
    for a in range(len(ahead)):
        rows = slice(first[a], first[a + 1])
        alike[a] = looks.setdefault(there[rows].tobytes() + pods[rows].tobytes(), len(looks))
        if alike[a] == len(examples):
            examples.append(a)
    return SearchGraph(ahead, first, there, pods, alike, np.array(examples))


@dataclass
class PathProblem:
    """A search by J searchers in H steps; each moves, and then looks, once a step.

    Attributes:
        chain: The target's motion.
        graphs: (J,) moves and looks of each searcher.
        starts: (J,) columns of the searchers before their first move.
        gains: (H,) float64, value of a first detection in each step, never increasing; ones for the
            probability of detection.
        blocked: (J, H, C) bool, the columns that each searcher must not be in; None for none.
        apart: Whether no two searchers may be in one column.
        revisits: Whether a searcher may be in a column twice.
        nearness: (S, S) float64 [dy, dx], value of a target left at the end by its distance from
            the nearest searcher, for columns row by row, S in a row; None for none.
    """

    chain: TargetChain
    graphs: Sequence[SearchGraph]
    starts: Sequence[int]
    gains: NDArray[np.float64]
    blocked: NDArray[np.bool_] | None = None
    apart: bool = False
    revisits: bool = True
    nearness: NDArray[np.float64] | None = None
    _columns: NDArray[np.int64] = field(init=False, repr=False)
    _around: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        last = self.chain.starts[-1]
        self._columns = np.repeat(np.arange(len(last) - 1), np.diff(last))
        near = np.zeros((0, 0)) if self.nearness is None else self.nearness
        self._around = np.pad(near, ((max(len(near) - 1, 0), 0),) * 2, mode="reflect")

    def miss(self, plans: Plans) -> NDArray[np.float64]:
        """Return the probability (N,) that the looks of plans miss the target in each state."""
        miss = np.ones(len(self.chain.persons))
        for graph, start, plan in zip(self.graphs, self.starts, plans, strict=True):
            if plan is not None:
                kernels.multiply_miss(self.chain, graph, start, plan, miss)
        return miss

    def worth(self, plans: Plans) -> NDArray[np.float64]:
        """Return the value of an undetected target in each state of the last layer."""
        return self._worth_of_columns(plans)[self._columns]

    def _worth_of_columns(self, plans: Plans) -> NDArray[np.float64]:
        if self.nearness is None:
            return np.zeros(self.chain.starts.shape[1] - 1)
        side = len(self.nearness)
        worth = np.zeros((side, side))
        for n, plan in enumerate(plans):
            if plan is not None:
                row, col = divmod(int(self.cells(n, plan)[-1]), side)
                rows = slice(side - 1 - row, 2 * side - 1 - row)
                cols = slice(side - 1 - col, 2 * side - 1 - col)
                np.maximum(worth, self._around[rows, cols], out=worth)
        return worth.ravel()

    def ends(self, searcher: int, plans: Plans, reach: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what a searcher that ends in each column adds to the worth, (C,).

        Columns that the searcher cannot reach have no value.

        Args:
            searcher: Number of the searcher.
            plans: Plans of the other searchers.
            reach: See `kernels.forward`.
        """
        ends = np.zeros(self.chain.starts.shape[1] - 1)
        if self.nearness is not None:
            left = np.bincount(self._columns, reach[self.chain.starts[-1, 0] :], len(ends))
            columns = kernels.reachable(
                self.graphs[searcher].ahead, self.starts[searcher], len(self.gains)
            )
            kernels.worth_of_ends(left, self._worth_of_columns(plans), self.nearness, columns, ends)
        return ends

    def cells(self, searcher: int, plan: Plan) -> NDArray[np.int64]:
        """Return the H columns of a plan."""
        cells: NDArray[np.int64] = kernels.columns_of(
            self.graphs[searcher].ahead, self.starts[searcher], plan
        )
        return cells

    def value(self, plans: Plans) -> float:
        """Return the expected value of plans; with gains of 1, the probability of detection."""
        miss, worth = self.miss(plans), self.worth(plans)
        reach = np.empty_like(miss)
        kernels.forward(self.chain, miss, reach)
        return float(kernels.value_of(self.chain, self.gains, worth, miss, reach))

    def blocked_for(self, searcher: int, plans: Plans) -> NDArray[np.bool_]:
        """Return the columns (H, C) that a searcher must not be in, given the other plans."""
        if self.blocked is not None:
            blocked = self.blocked[searcher].copy()
        else:
            blocked = np.zeros((len(self.gains), self.graphs[searcher].ahead.shape[1]), np.bool_)
        if self.apart:
            for n, plan in enumerate(plans):
                if n != searcher and plan is not None:
                    blocked[np.arange(len(plan)), self.cells(n, plan)] = True
        return blocked
