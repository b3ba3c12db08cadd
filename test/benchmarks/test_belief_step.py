# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The belief's step in plain NumPy, which the compiled one is measured beside."""

from __future__ import annotations

from benchmarks import belief_step


def test_beliefs_in_plain_numpy_come_to_the_same_in_every_step_that_is_measured() -> None:
    lines: list[str] = []
    # It raises where they do not.
    found = belief_step.measure(rounds=1, log=lines.append, batch=8)
    assert list(found) == ["paper", "v2"]
    assert all(set(rates) == set(belief_step.WAYS) for rates in found.values())
    assert len(lines) == 2
