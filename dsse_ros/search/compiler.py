# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""When the search is compiled: at its first use after an installation, unless it is prepared."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from numba.core import event

from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.search.rules import Rules
from dsse_ros.search.scenario import Scenario
from dsse_ros.search.world import HOLD
from dsse_ros.search.world_beliefs import WorldBeliefs

COMPILING = "compiling the search, once after an installation; it takes 10 s, or a few times that"
"""Logged before the compiler starts; not logged where its cache has all that is needed."""


class _FirstCompilation(event.Listener):
    def __init__(self, announce: Callable[[str], object]) -> None:
        self._announce: Callable[[str], object] | None = announce

    def on_start(self, event: Any) -> None:
        announce, self._announce = self._announce, None
        if announce is not None:
            announce(COMPILING)

    def on_end(self, event: Any) -> None:
        pass


def announced(announce: Callable[[str], object]) -> AbstractContextManager[Any]:
    """Return a context in which the compiler is announced when it first has work to do.

    Args:
        announce: Called with `COMPILING` then.
    """
    context: AbstractContextManager[Any] = event.install_listener(
        "numba:compile", _FirstCompilation(announce)
    )
    return context


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
        has_belief: Called with the size of the grid, whether a belief is prepared too.

    Raises:
        FieldError: If the scenario does not fit the rules.
    """
    # Bad input is refused before the compiler takes its time.
    grid_size = scenario.resolve(rules).grid_size
    with announced(announce):
        env = SearchEnv(scenario, rules)
        env.reset(seed=0)
        hold = np.full(env.world.num_drones, HOLD, np.int8)
        of_persons = not rules.covers and has_belief(grid_size)
        beliefs = WorldBeliefs(env.world) if of_persons else None
        if beliefs is not None:
            beliefs.before_step(hold[None])
        env.advance(hold)
        if beliefs is not None:
            beliefs.after_step()
            beliefs.write()
    return env
