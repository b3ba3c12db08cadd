# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is not well is not reported as well."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest

from dsse_ros.vehicles.fleet.health import fleet_health

NOT_WELL = {
    "no simulation": ({"following": False, "alive": False}, "warning", "waiting for step_report"),
    "simulation gone": ({"alive": False}, "warning", "the simulation is gone"),
    "no steps": ({"holding": True}, "warning", "no steps: the vehicles hold"),
    "all refused": (
        {"named": {"unreachable": ["drone0", "drone1"]}}, "error", "no vehicle can be reached",
    ),
    "one refused": ({"named": {"unreachable": ["drone1"]}}, "warning", "unreachable: drone1"),
    "blocked": ({"named": {"blocked": ["drone0"]}}, "warning", "blocked: drone0"),
    "slow": ({"named": {"slow": ["drone0"]}}, "warning", "slow: drone0"),
    "lost": ({"named": {"lost": ["drone0", "drone1"]}}, "warning", "lost: drone0, drone1"),
    "trouble": ({"trouble": "two simulations"}, "error", "two simulations"),
}  # fmt: skip

well = partial(fleet_health, 2, named={}, following=True, alive=True, holding=False, trouble=None)


@pytest.mark.parametrize("one", NOT_WELL.values(), ids=NOT_WELL)
def test_what_keeps_vehicles_from_flying_is_in_the_health(one: Any) -> None:
    changes, level, line = one
    assert well(**changes) == (level, line)


def test_the_worst_is_reported_first() -> None:
    named = {"blocked": ["drone0"], "unreachable": ["drone0", "drone1"]}
    assert well(alive=False, named=named) == ("error", "no vehicle can be reached")


def test_who_follows_a_search_with_all_vehicles_is_well() -> None:
    assert well() == ("ok", "following")
    named = {"lost": [], "refused": [], "blocked": [], "unreachable": []}
    assert well(named=named) == ("ok", "following")
