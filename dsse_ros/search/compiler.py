# SPDX-License-Identifier: Apache-2.0
"""When the search is compiled: at its first use after an installation, unless it is prepared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core import event

from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.search.rules import profile
from dsse_ros.search.scenario import Scenario

COMPILING = "compiling the search, once after an installation; it takes 10 s, or a few times that"
"""Logged before the compiler starts; not logged where its cache has all that is needed."""


class _FirstCompilation(event.Listener):
    def __init__(self, announce: Callable[[str], None]) -> None:
        self._announce: Callable[[str], None] | None = announce

    def on_start(self, event: Any) -> None:
        announce, self._announce = self._announce, None
        if announce is not None:
            announce(COMPILING)

    def on_end(self, event: Any) -> None:
        pass


def prepare(announce: Callable[[str], None]) -> None:
    """Have reset and step compiled, or loaded from the cache, before a mission needs them.

    Args:
        announce: Called with `COMPILING` if the compiler has work to do.
    """
    with event.install_listener("numba:compile", _FirstCompilation(announce)):
        env = SearchEnv(Scenario(grid_size=2), profile("paper"))
        env.reset(seed=0)
        env.step({agent: 0 for agent in env.agents})
