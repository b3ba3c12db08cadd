# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The text of `QGC WPL 110` files, in which most ground stations keep missions.

Format: https://mavlink.io/en/file_formats/ ("Plain-Text File Format").
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from msg_adapters.mission_items import MissionItem, check_place
from msg_adapters.result import shown

_HEADER = "QGC WPL 110"
_FIELDS = (
    "index",
    "current",
    "frame",
    "command",
    "param1",
    "param2",
    "param3",
    "param4",
    "latitude",
    "longitude",
    "altitude",
    "autocontinue",
)


def qgc_wpl(items: Iterable[MissionItem]) -> str:
    """Return the text of a `QGC WPL 110` file; numbers have 8 decimals (1 mm of latitude).

    Raises:
        ValueError: If an item has a place that is not finite or not on the Earth, or a parameter
            that is infinite.
    """
    lines = [_HEADER]
    for index, item in enumerate(items):
        where = f"item {index}"
        check_place(item, where)
        numbers = {
            "param1": item.param1,
            "param2": item.param2,
            "param3": item.param3,
            "param4": item.param4,
            "latitude": item.lat_deg,
            "longitude": item.lon_deg,
            "altitude": item.alt_m,
        }
        fields = [str(index), str(int(index == 0)), str(item.frame), str(item.command)]
        fields += [_number_text(where, name, number) for name, number in numbers.items()]
        lines.append("\t".join([*fields, "1"]))
    return "\n".join(lines) + "\n"


def parse_qgc_wpl(text: str) -> list[MissionItem]:
    """Return the items of a `QGC WPL 110` file: the inverse of `qgc_wpl`.

    Blank lines and lines that start with `#` are skipped; any white space parts the fields.

    Raises:
        ValueError: If the text is not such a file; one line that names the line and the field.
    """
    header, *lines = text.split("\n")
    if header.split() != _HEADER.split():
        raise ValueError(f"line 1: {shown(header)} is not allowed; '{_HEADER}' is")
    items: list[MissionItem] = []
    for number, line in enumerate(lines, start=2):
        fields = line.split()
        if fields and not fields[0].startswith("#"):
            items.append(_parse_line(f"line {number}", fields, len(items)))
    return items


def _parse_line(where: str, fields: list[str], index: int) -> MissionItem:
    if len(fields) != len(_FIELDS):
        raise ValueError(f"{where}: {len(fields)} fields are not allowed; {len(_FIELDS)} are")
    texts = dict(zip(_FIELDS, fields, strict=True))
    if _integer(where, "index", texts, 65535) != index:
        raise ValueError(f"{where}: index {shown(texts['index'])} is not allowed; {index} is")
    _integer(where, "current", texts, 1)
    _integer(where, "autocontinue", texts, 1)
    item = MissionItem(
        command=_integer(where, "command", texts, 65535),
        frame=_integer(where, "frame", texts, 255),
        param1=_number(where, "param1", texts),
        param2=_number(where, "param2", texts),
        param3=_number(where, "param3", texts),
        param4=_number(where, "param4", texts),
        lat_deg=_number(where, "latitude", texts),
        lon_deg=_number(where, "longitude", texts),
        alt_m=_number(where, "altitude", texts),
    )
    check_place(item, where)
    return item


def _number_text(where: str, name: str, number: float) -> str:
    if math.isinf(number):
        raise ValueError(f"{where}: {name} {number!r} is not allowed; a number")
    # Spelt as .NET reads it, which Mission Planner is written for; C and Python read any case.
    return "NaN" if math.isnan(number) else f"{number:.8f}"


def _integer(where: str, field: str, texts: dict[str, str], most: int) -> int:
    try:
        value = int(texts[field])
    except ValueError:
        value = -1
    if not 0 <= value <= most:
        raise ValueError(f"{where}: {field} {shown(texts[field])} is not allowed; 0 to {most}")
    return value


def _number(where: str, field: str, texts: dict[str, str]) -> float:
    try:
        value = float(texts[field])
    except ValueError:
        value = math.inf
    if math.isinf(value):
        raise ValueError(f"{where}: {field} {shown(texts[field])} is not allowed; a number")
    return value
