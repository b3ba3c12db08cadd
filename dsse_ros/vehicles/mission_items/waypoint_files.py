# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The text of `QGC WPL 110` files, in which most ground stations keep missions.

Format: https://mavlink.io/en/file_formats/ ("Plain-Text File Format").
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from dsse_ros.vehicles.mission_items.items import MissionItem, check_item

_HEADER = "QGC WPL 110"


def qgc_wpl(items: Iterable[MissionItem]) -> str:
    """Return the text of a `QGC WPL 110` file; numbers have 8 decimals (1 mm of latitude).

    Raises:
        ValueError: If an item has a place that is not finite or not on the Earth, or a parameter
            that is infinite.
    """
    lines = [_HEADER]
    for index, item in enumerate(items):
        check_item(item, f"item {index}")
        fields = [str(index), str(int(index == 0)), str(item.frame), str(item.command)]
        fields += [_number_text(number) for number in item.numbers.values()]
        lines.append("\t".join([*fields, "1"]))
    return "\n".join(lines) + "\n"


def _number_text(number: float) -> str:
    # Spelt as .NET reads it, which Mission Planner is written for; C and Python read any case.
    return "NaN" if math.isnan(number) else f"{number:.8f}"
