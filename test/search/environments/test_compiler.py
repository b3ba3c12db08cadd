# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The lines of the compiler name what is compiled, and count how much is done."""

from __future__ import annotations

import pytest
from numba import njit

from dsse_ros.search.environments.compiler import COMPILING, announced, progress

LOG = "[INFO] [1795708069.5] [sim_node]: "


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        (f"compiling the search{COMPILING}", "compiling the search"),
        (f"compiling the search{COMPILING}; topics appear later", "compiling the search"),
        ("compiling planner belief: 12 functions", "compiling planner belief: 12 functions"),
        ("compiling the search: 3 functions; topics", "compiling the search: 3 functions"),
        ("compiling the search: 1 function; topics", "compiling the search: 1 function"),
        ("drift 40 %; topics and services appear when it is done", "drift 40 %"),
        ("mission 1: 4 drones", ""),
    ],
)
def test_the_last_line_of_a_log_names_what_is_compiled(line: str, shown: str) -> None:
    assert progress(f"{LOG}{line}\n") == shown
    assert progress(f"{LOG}{line}\n{LOG}mission 1: 4 drones\n") == ""
    assert progress(f"{LOG}mission 0\n{LOG}{line}\n") == shown


def test_what_a_user_compiles_is_not_announced() -> None:
    lines: list[str] = []
    with announced(lines.append):
        assert njit(lambda value: value + 1)(1) == 2
    assert lines == []
