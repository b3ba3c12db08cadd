# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sensors keep what they promise, and what one does not keep is named."""

from __future__ import annotations

from typing import Any

import pytest
from ahead import AHEAD

from dsse_ros.conformance.sensor import sensor_test
from dsse_ros.world.sensors.registry import SENSORS
from dsse_ros.world.sensors.sensor import Look, Sensor


@pytest.mark.slow
@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_the_sensors_of_the_package_keep_their_promises(name: str, rules: str) -> None:
    sensor_test(SENSORS[name], rules=rules)


def test_a_sensor_of_somebody_else_keeps_them_too() -> None:
    sensor_test(AHEAD, rules="paper")
    assert AHEAD not in SENSORS.values()


BAD: dict[str, tuple[Any, str]] = {
    "POD": (lambda s, k, a, h: [Look(0, 0, (1.5, 0.5))], "from 0 to 1"),
    "persons": (lambda s, k, a, h: [Look(0, 0, (0.5,))], "POD of each person"),
    "twice": (lambda s, k, a, h: [Look(0, 0, (0.5, 0.2))] * 2, "at different cells, got two"),
    "many": (lambda s, k, a, h: [Look(i, 0, (0.5, 0.2)) for i in range(65)], "at most 64"),
    "none": (lambda s, k, a, h: [], "no action looks at anything"),
    "NaN": (lambda s, k, a, h: [Look(0, 0, (float("nan"), 0.2))], "from 0 to 1"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_no_sensor_can_be_is_refused_in_a_line(name: str) -> None:
    looks, why = BAD[name]
    with pytest.raises(AssertionError, match=why) as error:
        sensor_test(Sensor("sees", looks))
    assert "\n" not in str(error.value)


def test_a_sensor_that_changes_its_mind_is_found_out() -> None:
    pods = iter([i / 1000 for i in range(1000)])
    with pytest.raises(AssertionError, match="differ"):
        sensor_test(Sensor("sees", lambda s, k, a, h: [Look(0, 0, (next(pods),) * 2)]))
