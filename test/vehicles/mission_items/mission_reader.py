# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mission files as ground stations read them, by the columns and keys of their formats."""

from __future__ import annotations

import json
import math
from typing import Any

from dsse_ros.vehicles.mission_items.items import Home, MissionItem, VehicleMission


def waypoints(text: str) -> list[MissionItem]:
    """Return the items of a `QGC WPL 110` file."""
    header, *lines = text.removesuffix("\n").split("\n")
    assert header == "QGC WPL 110"
    rows = [line.split("\t") for line in lines]
    assert [row[0] for row in rows] == [str(index) for index in range(len(rows))]
    return [item(row[3], row[2], row[4:11]) for row in rows]


def plan(text: str) -> VehicleMission:
    """Return the mission of a `.plan` file; null is NaN."""
    document = json.loads(text)["mission"]
    items = (item(one["command"], one["frame"], one["params"]) for one in document["items"])
    return VehicleMission(Home(*document["plannedHomePosition"]), tuple(items))


def item(command: Any, frame: Any, numbers: list[Any]) -> MissionItem:
    """Return an item of what is written of it."""
    values = [math.nan if value is None else float(value) for value in numbers]
    return MissionItem(int(command), int(frame), *values)
