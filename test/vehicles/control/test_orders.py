# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An order that makes no sense cannot be made."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from dsse_ros.vehicles.control.orders import FlyMission, GoTo, Order, SearchPlace, TakeOff
from dsse_ros.vehicles.mission_items.items import MissionItem


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: TakeOff(math.inf), "alt_amsl_m"),
        (lambda: TakeOff(math.nan), "alt_amsl_m"),
        (lambda: GoTo(100.0, 0.0, 10.0, 5.0), "lat_deg"),
        (lambda: GoTo(math.nan, 0.0, 10.0, 5.0), "lat_deg"),
        (lambda: GoTo(0.0, 181.0, 10.0, 5.0), "lon_deg"),
        (lambda: GoTo(0.0, 0.0, math.inf, 5.0), "alt_amsl_m"),
        (lambda: GoTo(0.0, 0.0, 10.0, 0.0), "radius_m"),
        (lambda: GoTo(0.0, 0.0, 10.0, math.nan), "radius_m"),
        (lambda: SearchPlace(0.0, 0.0, 10.0, math.nan, 5.0, 5.0), "search_amsl_m"),
        (lambda: SearchPlace(0.0, 0.0, 10.0, 5.0, -1.0, 5.0), "hold_s"),
        (lambda: SearchPlace(91.0, 0.0, 10.0, 5.0, 1.0, 5.0), "lat_deg"),
        (lambda: FlyMission(()), "items"),
        (lambda: FlyMission((MissionItem(16, lat_deg=math.nan),)), "latitude"),
    ],
)
def test_an_order_that_makes_no_sense_is_refused(make: Callable[[], Order], name: str) -> None:
    with pytest.raises(ValueError, match=name):
        make()
