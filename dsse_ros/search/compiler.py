# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compilation of the search, at its first use after an installation unless it is prepared."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from types import CodeType
from typing import Any

import numpy as np
from numba.core import event
from numba.core.dispatcher import Dispatcher

from dsse_ros.belief import belief_kernels, follow_kernels
from dsse_ros.progress import progress_to
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.search.world import HOLD
from dsse_ros.search.world_beliefs import WorldBeliefs
from dsse_ros.step import kernels

COMPILING = "compiling the search, once after an installation; it takes 10 s, or a few times that"
"""Logged before the compiler starts; not logged if its cache is complete."""


_OF_WORLDS = (kernels.reset_worlds, kernels.refresh_worlds, kernels.step_worlds)
_OF_BELIEFS = (
    belief_kernels.start_sea, belief_kernels.forecast_step, follow_kernels.follow_worlds,
    follow_kernels.write_beliefs,
)  # fmt: skip


class Compilation:
    """Progress of the compiler from now on, in any process, measured by its cache entries.

    Args:
        belief: Whether a belief is compiled too.

    Attributes:
        total: Number of functions.
    """

    def __init__(self, *, belief: bool) -> None:
        functions = _with_callees(_OF_WORLDS + (_OF_BELIEFS if belief else ()))
        # Numba has no public interface for its progress. Without a cache none is visible.
        caches: list[Any] = [
            getattr(getattr(function, "_cache", None), "_cache_file", None)
            for function in functions
        ]
        self._files = [file for file in caches if hasattr(file, "_load_index")]
        self.total = len(self._files)
        self._before = self._entries()

    def done(self) -> int:
        """Return the number of functions compiled since construction."""
        return min(self._entries() - self._before, self.total)

    def _entries(self) -> int:
        return sum(len(file._load_index()) for file in self._files)


@contextmanager
def compilation_bar(*, belief: bool) -> Iterator[Callable[[], None]]:
    """Show a progress bar on a terminal during the block; yield a function that updates it.

    Args:
        belief: Whether a belief is compiled too.
    """
    if not sys.stderr.isatty():
        yield lambda: None
        return
    compilation = Compilation(belief=belief)
    with progress_to(compilation.total, "compiling") as move_to:
        yield lambda: move_to(compilation.done())


class _Announcer(event.Listener):
    def __init__(self, announce: Callable[[str], object], belief: bool | None) -> None:
        self._announce = announce
        self._belief = belief
        self._update: Callable[[], None] | None = None
        self.bar = ExitStack()

    def on_start(self, event: Any) -> None:
        if self._update is None:
            self._announce(COMPILING)
            self._update = lambda: None
            if self._belief is not None:
                self._update = self.bar.enter_context(compilation_bar(belief=self._belief))

    def on_end(self, event: Any) -> None:
        assert self._update is not None
        self._update()


@contextmanager
def announced(announce: Callable[[str], object], *, belief: bool | None = None) -> Iterator[None]:
    """Announce the compiler when it first starts work during the block.

    Args:
        announce: Called with `COMPILING` at that moment.
        belief: For an environment, whether a belief is compiled too; a terminal then shows the
            compiler's progress. None if something else is compiled.
    """
    announcer = _Announcer(announce, belief)
    with announcer.bar, event.install_listener("numba:compile", announcer):
        yield


def _with_callees(functions: Iterable[Dispatcher]) -> set[Dispatcher]:
    """Return compiled functions and all functions that they call."""
    found: set[Dispatcher] = set()
    left = list(functions)
    while left:
        if (function := left.pop()) not in found:
            found.add(function)
            left += _callees(function)
    return found


def _callees(function: Dispatcher) -> list[Dispatcher]:
    python = function.py_func
    names: set[str] = set()
    codes = [python.__code__]
    while codes:
        code = codes.pop()
        names.update(code.co_names)
        codes += [part for part in code.co_consts if isinstance(part, CodeType)]
    values = [python.__globals__.get(name) for name in names]
    values += [cell.cell_contents for cell in python.__closure__ or ()]
    return [value for value in values if isinstance(value, Dispatcher)]


def prepared_env(
    scenario: Scenario,
    rules: Rules,
    announce: Callable[[str], object],
    *,
    has_belief: Callable[[int], bool] = lambda grid_size: False,
) -> SearchEnv:
    """Return an environment whose reset and step are compiled, or loaded from the cache.

    Args:
        scenario: Of the environment.
        rules: Of the environment.
        announce: Called with `COMPILING` if the compiler has work to do.
        has_belief: Called with the size of the grid; returns whether to prepare a belief too.

    Raises:
        FieldError: If the scenario does not fit the rules.
    """
    # Refuse bad input before the slow compilation.
    grid_size = scenario.resolve(rules).grid_size
    with_belief = not rules.covers and has_belief(grid_size)
    with announced(announce, belief=with_belief):
        env = SearchEnv(scenario, rules)
        env.reset(seed=0)
        hold = np.full(env.world.num_drones, HOLD, np.int8)
        beliefs = WorldBeliefs(env.world) if with_belief else None
        if beliefs is not None:
            beliefs.before_step(hold[None])
        env.advance(hold)
        if beliefs is not None:
            beliefs.after_step()
            beliefs.write()
    return env
