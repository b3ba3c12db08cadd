# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is not well is not reported as well."""

from __future__ import annotations

from typing import Any

import pytest

from dsse_ros.bridge.health import Situation, health

NOT_WELL = {
    "no simulation": ({"following": False, "alive": False}, "warning", "waiting for step_report"),
    "simulation gone": ({"alive": False}, "warning", "the simulation is gone"),
    "no steps": ({"holding": True}, "warning", "no steps: the vehicles hold"),
    "all refused": ({"unreachable": ["drone0", "drone1"]}, "error", "no vehicle can be reached"),
    "one refused": ({"unreachable": ["drone1"]}, "warning", "unreachable: drone1"),
    "blocked": ({"waiting": {"blocked": ["drone0"]}}, "warning", "blocked: drone0"),
    "lost": ({"waiting": {"lost": ["drone0", "drone1"]}}, "warning", "lost: drone0, drone1"),
    "trouble": ({"trouble": "two simulations"}, "error", "two simulations"),
}


@pytest.mark.parametrize("one", NOT_WELL.values(), ids=NOT_WELL)
def test_what_keeps_vehicles_from_flying_is_in_the_health(one: Any) -> None:
    changes, level, line = one
    assert health(Situation(2, **changes)) == (level, line)


def test_the_worst_is_reported_first() -> None:
    both = Situation(1, alive=False, unreachable=["drone0"], waiting={"blocked": ["drone0"]})
    assert health(both) == ("error", "no vehicle can be reached")


def test_who_follows_a_search_with_all_vehicles_is_well() -> None:
    assert health(Situation(2)) == ("ok", "following")
    waiting = {"lost": [], "refused": [], "blocked": []}
    assert health(Situation(2, waiting=waiting)) == ("ok", "following")
