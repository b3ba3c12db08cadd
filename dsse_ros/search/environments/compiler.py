# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compiles the search ahead of its first use, and announces when and what is compiled."""

from __future__ import annotations

import math
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numpy as np
from numba.core import event

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.world_beliefs import WorldBeliefs
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario

COMPILING = ", once after an installation, in 10 s to a minute"
"""End of the line that is logged before the compiler starts, if its cache is not complete."""
_REPORT_S = 1.0
"""Wall time between two lines of the compiler's progress."""
_LINES = re.compile(r"\b(compiling .+?|drift \d+ %)(?:: (\d+ functions?))?(?:[,;] .*)?$")


class _Announcer(event.Listener):
    """Counts the functions of this package that are compiled."""

    def __init__(self, what: str, announce: Callable[[str], object]) -> None:
        self._what = what
        self._announce = announce
        self._functions = 0
        self._due_s = -math.inf

    def _is_ours(self, event: Any) -> bool:
        function: Any = event.data["dispatcher"].py_func
        return str(function.__module__).startswith("dsse_ros.")

    def on_start(self, event: Any) -> None:
        if self._is_ours(event) and self._due_s == -math.inf:
            self._announce(f"compiling {self._what}{COMPILING}")
            self._due_s = time.monotonic() + _REPORT_S

    def on_end(self, event: Any) -> None:
        self._functions += self._is_ours(event)
        if time.monotonic() >= self._due_s > -math.inf:
            plural = "" if self._functions == 1 else "s"
            self._announce(f"compiling {self._what}: {self._functions} function{plural}")
            self._due_s = time.monotonic() + _REPORT_S


@contextmanager
def announced(announce: Callable[[str], object], what: str = "the search") -> Iterator[None]:
    """Announce the compiler when it first starts work during the block, and its progress.

    Args:
        announce: Called with a line at that moment, and every second while it works.
        what: What is compiled.
    """
    with event.install_listener("numba:compile", _Announcer(what, announce)):
        yield


def announced_on_stderr() -> AbstractContextManager[None]:
    """Announce the compiler on standard error."""
    return announced(lambda line: print(line, file=sys.stderr, flush=True))


def progress(log: str) -> str:
    """Return what is being computed or compiled, and how much is done; empty for nothing.

    Args:
        log: Log of a process; only its last line is read.
    """
    found = _LINES.search(log.rstrip().rpartition("\n")[2])
    if found is None:
        return ""
    return ": ".join(filter(None, found.groups()))


def prepared_env(
    scenario: Scenario,
    rules: Rules,
    *,
    has_belief: Callable[[GridShape], bool] = lambda grid: False,
) -> SearchEnv:
    """Return an environment with its reset, step and paths compiled, or loaded from the cache.

    Args:
        scenario: Of the environment.
        rules: Of the environment.
        has_belief: Called with the shape of the grid; returns whether to prepare a belief too.

    Raises:
        FieldError: If the scenario does not fit the rules.
    """
    # Refuse bad input before the slow compilation.
    grid = scenario.resolve(rules).grid_size
    with_belief = not rules.covers and has_belief(grid)
    env = SearchEnv(scenario, rules)
    env.reset(seed=0)
    hold = np.full(env.world.num_drones, NO_ACTION, np.int8)
    beliefs = WorldBeliefs(env.world) if with_belief else None
    if beliefs is not None:
        beliefs.before_step(hold[None])
    env.advance(hold)
    if env.world.metres is not None:
        env.world.metres.plan(0, np.zeros(2), 0)
    if beliefs is not None:
        beliefs.after_step()
        beliefs.write()
    return env
