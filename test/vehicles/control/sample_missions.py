# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions that differ from each other in every item but the first and the last."""

from __future__ import annotations

import math

from message_values import item_int

from dsse_ros.vehicles.mavlink.messages import MissionItemInt


def mission(number: int, count: int = 20) -> tuple[MissionItemInt, ...]:
    """Return home, waypoints and the return."""
    assert count >= 2
    waypoints = (
        item_int(
            seq=seq,
            frame=6,
            command=16,
            param1=5.0,
            param2=20.0,
            param4=math.nan,
            x=-240_400_000 + 11_700 * seq,
            y=-461_700_000 + 12_800 * number,
            z=120.0,
        )
        for seq in range(1, count - 1)
    )
    home = item_int(seq=0, frame=5, command=16, current=1, x=-240_400_000, y=-461_700_000 + number)
    return (home, *waypoints, item_int(seq=count - 1, frame=2, command=20))
