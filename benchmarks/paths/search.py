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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.paths import kernels
from benchmarks.paths.branch_and_bound import PathOptions, best_path
from benchmarks.paths.kernels import PathTask
from benchmarks.paths.problem import PathProblem, Plan, Plans

TOLERANCE = 1e-9
"""A plan is better than another one if its value is greater by more than this."""
WINDOW, WINDOW_STEP, WINDOW_WIDTH = 6, 2, 32
"""Steps of a replaced part of a path, steps between two such parts, and paths kept for each."""
SPREADS = (0.6, 1.0, 2.0)
"""Standard deviations of the logarithm of the factors that lead a searcher to another path."""


_NO_WEIGHTS = np.empty((0, 0))
_NO_MOVES = np.empty(0, np.int64)


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
        later: (N,) of `kernels.backward`.
        others: (N,) of `PathProblem.miss`, without the searcher.
        reach: (N,) of `kernels.forward`, without the searcher.
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
            width: See `PathOptions`.
            least: Only a path with which the plans are worth more than this counts.
            weights: See `PathTask`.
            fixed: First moves of the path.

        Returns:
            The path, the value of the plans with it, -inf if no path counts, and a bound on it.
        """
        problem = self._problem
        others = _without(plans, searcher)
        miss = problem.miss(others)
        reach, worth = np.empty_like(miss), problem.worth(others)
        kernels.forward(problem.chain, miss, reach)
        base = kernels.value_of(problem.chain, problem.gains, worth, miss, reach)
        # With a worth at the end, what `best_path` adds is no bound: what a plan leaves for its
        # own end is less.
        threshold = least - base if problem.nearness is None else -math.inf
        task = PathTask(
            problem.chain, problem.graphs[searcher], problem.gains,
            problem.ends(searcher, others, reach), miss, np.empty_like(miss),
            problem.blocked_for(searcher, plans), _NO_WEIGHTS if weights is None else weights,
        )  # fmt: skip
        kernels.backward(problem.chain, problem.gains, worth, miss, task.later)
        options = PathOptions(
            width, threshold, problem.revisits, _NO_MOVES if fixed is None else fixed
        )
        added, bound, moves = best_path(task, options, problem.starts[searcher])
        return moves, base + added, base + bound

    def passes(self, plans: Plans, searcher: int) -> _Passes:
        """Return what `window` needs of the plans."""
        problem, chain = self._problem, self._problem.chain
        miss, later = problem.miss(plans), np.empty(len(chain.persons))
        kernels.backward(chain, problem.gains, problem.worth(plans), miss, later)
        others = problem.miss(_without(plans, searcher))
        reach = np.empty_like(others)
        kernels.forward(chain, others, reach)
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
        base = kernels.value_of(part, gains, worth, passes.others, passes.reach)
        later = np.empty(part.starts[-1, -1])
        kernels.backward(part, gains, worth, passes.others, later)
        task = PathTask(part, graph, gains, ends, passes.others, later, blocked, _NO_WEIGHTS)
        options = PathOptions(WINDOW_WIDTH, value - base + TOLERANCE, problem.revisits, old[:low])
        added, _, moves = best_path(task, options, problem.starts[searcher])
        if added == -math.inf:
            return None
        cell = kernels.columns_of(graph.ahead, problem.starts[searcher], moves)[-1]
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
