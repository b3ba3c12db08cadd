# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Joint paths of searchers that detect a moving target with the greatest probability.

The target moves by a Markov chain, and each look misses independently of the others, so that the
probability of no detection is convex in the number of looks at each place and time. Plans improve
as in Brown, "Optimal search for a moving target in discrete time and space" (1980): what the looks
of one searcher add to the plans of all others follows from one forward and one backward pass over
the chain. Each searcher in turn gets the path that adds most, by branch and bound (Martins 1993;
Lau, Huang and Dissanayake 2008), then parts of paths are replaced. Where that improves nothing, one
or two searchers get other paths, and the improvement starts again (iterated local search).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.protocol import TargetChain
from dsse_ros.planners import path_kernels

TOLERANCE = 1e-9
"""A plan is better than another one if its value is greater by more than this."""
WINDOW, WINDOW_STEP, WINDOW_WIDTH = 6, 2, 32
"""Steps of a replaced part of a path, steps between two such parts, and paths kept for each."""
SPREADS = (0.6, 1.0, 2.0)
"""Standard deviations of the logarithm of the factors that lead a searcher to another path."""


Plan: TypeAlias = NDArray[np.int64]
"""(H,) number of the move in each step."""
Plans: TypeAlias = Sequence[Plan | None]
"""A plan for each searcher; None for a searcher that does not look."""


class SearchGraph(NamedTuple):
    """The moves and looks of a kind of searcher, on a graph of C columns.

    Attributes:
        ahead: (A, C) int64, the column after each move, -1 where the move is not possible.
        first: (A + 1,) int64, the looks of move a are first[a] .. first[a + 1] - 1.
        there: (L, C) int64, the column that a look sees from the column after the move, or -1.
        pods: (L, P) float64, POD of each person.
        alike: (A,) int64, number of each move's looks; moves with the same looks have the same.
        examples: (Q,) int64, a move of each number.
    """

    ahead: NDArray[np.int64]
    first: NDArray[np.int64]
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
                path_kernels.multiply_miss(self.chain, graph, start, plan, miss)
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
            reach: See `path_kernels.forward`.
        """
        ends = np.zeros(self.chain.starts.shape[1] - 1)
        if self.nearness is not None:
            left = np.bincount(self._columns, reach[self.chain.starts[-1, 0] :], len(ends))
            columns = path_kernels.reachable(
                self.graphs[searcher].ahead, self.starts[searcher], len(self.gains)
            )
            path_kernels.worth_of_ends(
                left, self._worth_of_columns(plans), self.nearness, columns, ends
            )
        return ends

    def cells(self, searcher: int, plan: Plan) -> NDArray[np.int64]:
        """Return the H columns of a plan."""
        cells: NDArray[np.int64] = path_kernels.columns_of(
            self.graphs[searcher].ahead, self.starts[searcher], plan
        )
        return cells

    def value(self, plans: Plans) -> float:
        """Return the expected value of plans; with gains of 1, the probability of detection."""
        miss, worth = self.miss(plans), self.worth(plans)
        reach = np.empty_like(miss)
        path_kernels.forward(self.chain, miss, reach)
        return float(path_kernels.value_of(self.chain, self.gains, worth, miss, reach))

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


class Improved(NamedTuple):
    """The result of a path search.

    Attributes:
        plans: The plans of the searchers.
        value: Their expected value, see `PathProblem.value`.
        bound: A bound on the value of all plans; inf if none was computed.
    """

    plans: list[Plan]
    value: float
    bound: float

    @property
    def optimal(self) -> bool:
        """Whether the plans are proven to be optimal."""
        return _proven(self.value, self.bound)


def _proven(value: float, bound: float) -> bool:
    """Return whether no plans can be better than those of this value."""
    return bound <= value + 2 * TOLERANCE


def _without(plans: Plans, searcher: int) -> Plans:
    """Return plans in which one searcher has none."""
    return [None if n == searcher else plan for n, plan in enumerate(plans)]


class _Passes(NamedTuple):
    """The passes over plans and over those without one searcher.

    Attributes:
        miss: (N,) of `PathProblem.miss`.
        later: (N,) of `path_kernels.backward`.
        others: (N,) of `PathProblem.miss`, without the searcher.
        reach: (N,) of `path_kernels.forward`, without the searcher.
        blocked: (H, C) of `PathProblem.blocked_for` the searcher.
    """

    miss: NDArray[np.float64]
    later: NDArray[np.float64]
    others: NDArray[np.float64]
    reach: NDArray[np.float64]
    blocked: NDArray[np.bool_]


class _Search:
    """A search for better plans until a deadline."""

    def __init__(self, problem: PathProblem, deadline_s: float) -> None:
        self._problem = problem
        self._deadline_s = deadline_s
        self._no_weights = np.empty((0, 0))

    @property
    def late(self) -> bool:
        return time.monotonic() > self._deadline_s

    def best(
        self,
        plans: Plans,
        searcher: int,
        width: int,
        least: float,
        weights: NDArray[np.float64] | None = None,
        fixed: Plan | None = None,
    ) -> tuple[Plan, float, float]:
        """Return the best path of a searcher beside the others' plans.

        Args:
            plans: Plans of all searchers.
            searcher: Number of the searcher; its own plan makes no difference.
            width: See `path_kernels.best_path`.
            least: Only a path with which the plans are worth more than this counts.
            weights: See `path_kernels.bound_rest`.
            fixed: First moves of the path.

        Returns:
            The path, the value of the plans with it, -inf if no path counts, and a bound on it.
        """
        given = 0 if fixed is None else len(fixed)
        problem = self._problem
        others = _without(plans, searcher)
        miss, moves = problem.miss(others), np.zeros(len(problem.gains), np.int64)
        if fixed is not None:
            moves[: len(fixed)] = fixed
        reach, worth = np.empty_like(miss), problem.worth(others)
        path_kernels.forward(problem.chain, miss, reach)
        base = path_kernels.value_of(problem.chain, problem.gains, worth, miss, reach)
        # With a worth at the end, what `best_path` adds is no bound: what a plan leaves for its
        # own end is less.
        threshold = least - base if problem.nearness is None else -math.inf
        added, bound = path_kernels.best_path(
            problem.chain, problem.graphs[searcher], problem.gains, worth,
            problem.ends(searcher, others, reach), miss, problem.blocked_for(searcher, plans),
            self._no_weights if weights is None else weights,
            problem.starts[searcher], width, threshold, problem.revisits, given, moves,
        )  # fmt: skip
        return moves, base + added, base + bound

    def passes(self, plans: Plans, searcher: int) -> _Passes:
        """Return what `window` needs of the plans."""
        problem, chain = self._problem, self._problem.chain
        miss, later = problem.miss(plans), np.empty(len(chain.persons))
        path_kernels.backward(chain, problem.gains, problem.worth(plans), miss, later)
        others = problem.miss(_without(plans, searcher))
        reach = np.empty_like(others)
        path_kernels.forward(chain, others, reach)
        return _Passes(miss, later, others, reach, problem.blocked_for(searcher, plans))

    def window(
        self, old: Plan, searcher: int, passes: _Passes, low: int, high: int, value: float
    ) -> Plan | None:
        """Return a better plan of a searcher that differs only from step `low` to before `high`.

        It joins the rest of the old plan, whose looks count as given. None if there is none.
        """
        problem = self._problem
        graph, chain = problem.graphs[searcher], problem.chain
        states = slice(chain.starts[high, 0], chain.starts[high, -1])
        miss = passes.miss[states]
        worth = (1.0 - miss) * problem.gains[high] + miss * passes.later[states]
        rest = problem.cells(searcher, old)[high:]
        blocked = passes.blocked[:high]
        if not problem.revisits:
            blocked = blocked.copy()
            blocked[:, rest] = True
        ends = np.where((graph.ahead == rest[0]).any(axis=0), 0.0, -np.inf)
        part, gains = chain._replace(starts=chain.starts[: high + 1]), problem.gains[:high]
        moves = old[:high].copy()
        base = path_kernels.value_of(part, gains, worth, passes.others, passes.reach)
        added, _ = path_kernels.best_path(
            part, graph, gains, worth, ends, passes.others, blocked, self._no_weights,
            problem.starts[searcher], WINDOW_WIDTH, value - base + TOLERANCE, problem.revisits, low,
            moves,
        )  # fmt: skip
        if added == -math.inf:
            return None
        cell = path_kernels.columns_of(graph.ahead, problem.starts[searcher], moves)[-1]
        joint = int(np.flatnonzero(graph.ahead[:, cell] == rest[0])[0])
        return np.concatenate([moves, [joint], old[high + 1 :]])

    def polish(self, plans: Plans, value: float) -> tuple[Plans, float]:
        """Return plans improved window by window, and their value."""
        steps = len(self._problem.gains)
        for n in range(len(plans)):
            passes = None
            for low in range(0, steps - 1, WINDOW_STEP):
                if self.late:
                    return plans, value
                old = plans[n]
                assert old is not None
                if passes is None:
                    passes = self.passes(plans, n)
                moves = self.window(old, n, passes, low, min(low + WINDOW, steps - 1), value)
                if moves is not None:
                    changed = [moves if m == n else plan for m, plan in enumerate(plans)]
                    reached = self._problem.value(changed)
                    if reached > value + TOLERANCE:
                        plans, value, passes = changed, reached, None
        return plans, value

    def descend(self, plans: Plans, value: float, order: Sequence[int]) -> tuple[Plans, float]:
        """Return plans of which no single one can be improved, and their value."""
        problem, unchanged = self._problem, 0
        while unchanged < len(order):
            for n in order:
                if self.late and plans[n] is not None:
                    return plans, value
                least = -math.inf if plans[n] is None else value + TOLERANCE
                moves, reached, _ = self.best(plans, n, 1, least)
                unchanged += 1
                if reached == -math.inf:
                    continue
                changed = [moves if m == n else plan for m, plan in enumerate(plans)]
                reached = problem.value(changed)
                if plans[n] is None or reached > value + TOLERANCE:
                    plans, value, unchanged = changed, reached, 1
                if unchanged >= len(order):
                    break
        return plans, value


def improve(
    problem: PathProblem,
    plans: Plans,
    rng: np.random.Generator,
    *,
    iterations: int,
    deadline_s: float = math.inf,
    width: int = 1,
) -> Improved:
    """Return better plans.

    Args:
        problem: The search.
        plans: The plans to start from, one for each searcher; None for a searcher without one.
        rng: Generator of the draws.
        iterations: How often one or two searchers get other paths, to be improved again.
        deadline_s: When to stop, on the clock of `time.monotonic`. With a deadline, the result
            depends on the machine.
        width: Paths that branch and bound keeps at each step for the proof that the plan of a
            single searcher is optimal; 1: no proof.
    """
    search, count = _Search(problem, deadline_s), len(plans)
    best, value = search.descend(plans, problem.value(plans), range(count))
    bound, tried = math.inf, 1
    while count == 1 and problem.nearness is None and tried < width and not search.late:
        tried = min(8 * tried, width)
        moves, reached, upper = search.best(best, 0, tried, value + TOLERANCE)
        if reached > value:
            best, value = [moves], reached
        bound = min(bound, max(upper, value))
        if _proven(value, bound):
            break
    for _ in range(iterations):
        if search.late or _proven(value, bound):
            break
        order = rng.permutation(count).tolist()
        removed = order[: int(rng.integers(1, 3))]
        others = [None if n in removed else plan for n, plan in enumerate(best)]
        spread = float(rng.choice(SPREADS))
        shape = problem.chain.starts.shape[0] - 1, problem.chain.starts.shape[1] - 1
        weights = np.exp(spread * rng.standard_normal(shape))
        kept = max(int(rng.integers(2 * shape[0])) - shape[0], 0)
        old = best[removed[0]]
        assert old is not None
        moves, reached, _ = search.best(others, removed[0], 1, -math.inf, weights, old[:kept])
        if reached == -math.inf:
            continue
        others[removed[0]] = moves
        changed: Plans = others
        reached = problem.value(others)
        if count > 1:
            changed, reached = search.descend(others, reached, rng.permutation(count).tolist())
        if any(plan is None for plan in changed):
            continue
        changed, reached = search.polish(changed, reached)
        if reached > value + TOLERANCE:
            best, value = changed, reached
    return Improved([plan for plan in best if plan is not None], value, bound)


def upper_bound(problem: PathProblem, cuts: int, rng: np.random.Generator) -> float:
    """Return a bound on the probability of detection by any plans.

    At any plans, the probability of no detection is at least a linear function of the looks, as it
    is convex in the number of looks that a target meets. So is the mean of such functions, whose
    least value is a longest path for each searcher. The cuts are at plans drawn from these paths
    (the method of Frank and Wolfe, with whole numbers of looks).

    Args:
        problem: The search; searchers and looks are alike, and gains are 1.
        cuts: Number of linear functions.
        rng: Generator of the draws.
    """
    graph, count, steps = problem.graphs[0], len(problem.starts), len(problem.gains)
    shape = (steps, *graph.ahead.shape)
    constant, slopes, bound = 0.0, np.zeros(shape), math.inf
    plans: Plans = [None] * count
    paths: list[Plan] = []
    for k in range(cuts):
        miss, values = problem.miss(plans), np.empty(shape)
        reach, later = np.empty((2, len(miss)))
        worth = problem.worth(plans)
        path_kernels.forward(problem.chain, miss, reach)
        path_kernels.backward(problem.chain, problem.gains, worth, miss, later)
        path_kernels.look_values(problem.chain, graph, problem.gains, miss, later, reach, values)
        value = problem.value(plans)
        for n, plan in enumerate(plans):
            if plan is not None:
                value -= values[np.arange(steps), plan, problem.cells(n, plan)].sum()
        share = 2.0 / (k + 2)
        constant += share * (value - constant)
        slopes += share * (values - slopes)
        total = constant
        for n, start in enumerate(problem.starts):
            path = np.empty(steps, np.int64)
            total += path_kernels.longest(
                graph.ahead, problem.blocked_for(n, [None] * count), slopes, start, path
            )
        bound = min(bound, total)
        paths.append(path)
        plans = [paths[i] for i in rng.integers(len(paths) // 2, len(paths), count)]
    return bound
