# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compilation of the search, at its first use after an installation unless it is prepared."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numba.core import event

from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.search.world import HOLD
from dsse_ros.search.world_beliefs import WorldBeliefs

COMPILING = "compiling the search, once after an installation; it takes 10 s, or a few times that"
"""Logged before the compiler starts; not logged if its cache is complete."""


class _Announcer(event.Listener):
    def __init__(self, announce: Callable[[str], object]) -> None:
        self._announce = announce
        self._has_announced = False

    def on_start(self, event: Any) -> None:
        if not self._has_announced:
            self._announce(COMPILING)
        self._has_announced = True

    def on_end(self, event: Any) -> None:
        """Ignore the end."""


@contextmanager
def announced(announce: Callable[[str], object]) -> Iterator[None]:
    """Announce the compiler when it first starts work during the block.

    Args:
        announce: Called with `COMPILING` at that moment.
    """
    with event.install_listener("numba:compile", _Announcer(announce)):
        yield


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
    with announced(announce):
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
