# SPDX-License-Identifier: Apache-2.0
"""Missions of waypoints from tracks, and the text of `QGC WPL 110` files.

Format: https://mavlink.io/en/file_formats/ ("Plain-Text File Format"); commands:
https://mavlink.io/en/messages/common.html.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from numpy.typing import ArrayLike

from msg_adapters.frames import GridFrame
from msg_adapters.geodesy import cell_to_geodetic
from msg_adapters.result import shown
from msg_adapters.tracks import without_repeats

NAV_WAYPOINT = 16
NAV_RETURN_TO_LAUNCH = 20
NAV_TAKEOFF = 22

FRAME_GLOBAL = 0
"""Altitude above mean sea level."""
FRAME_GLOBAL_RELATIVE_ALT = 3
"""Altitude above home."""

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


@dataclass(frozen=True)
class MissionItem:
    """One item of a mission; its number is its place in the list.

    Attributes:
        command: MAV_CMD.
        frame: MAV_FRAME, which says what the altitude is above.
        param1: As the command has it, likewise the next; NaN where it leaves the choice open.
        param2: For a waypoint the acceptance radius in metres.
        param3: For a waypoint the pass radius in metres.
        param4: For a waypoint the yaw in degrees.
        lat_deg: WGS84 latitude, 0 if the command has no place.
        lon_deg: WGS84 longitude.
        alt_m: Altitude in the frame.
    """

    command: int
    frame: int = FRAME_GLOBAL_RELATIVE_ALT
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    lat_deg: float = 0.0
    lon_deg: float = 0.0
    alt_m: float = 0.0


def track_items(
    frame: GridFrame,
    cells: ArrayLike,
    *,
    home: tuple[float, float, float] | None = None,
    hold_s: float = 0.0,
    acceptance_radius_m: float = 0.0,
) -> list[MissionItem]:
    """Return a track as a mission: home, take-off, a waypoint per cell and the return.

    Item 0 is home, as ArduPilot has it. The waypoints fly at the frame's altitude above home,
    which is taken to lie on the map plane.

    Args:
        frame: The grid.
        cells: (K, 2) of (col, row); consecutive equal cells are merged.
        home: Latitude and longitude in degrees and altitude in metres; if not given, the first
            cell of the track on the map plane.
        hold_s: Time to stay at each waypoint.
        acceptance_radius_m: Distance at which a waypoint is reached; 0 for the autopilot's own.

    Raises:
        ValueError: If the track is empty.
    """
    track = without_repeats(cells)
    if len(track) == 0:
        raise ValueError("cells: an empty track is not allowed; at least one cell")
    cols, rows = track[:, 0].astype(float), track[:, 1].astype(float)
    if home is None:
        home = cell_to_geodetic(frame, float(cols[0]), float(rows[0]), 0.0)
    lat_deg, lon_deg, home_alt_m = home
    alt_m = frame.alt_m
    items = [
        MissionItem(NAV_WAYPOINT, FRAME_GLOBAL, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=home_alt_m),
        MissionItem(NAV_TAKEOFF, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=alt_m),
    ]
    lats, lons, _ = cell_to_geodetic(frame, cols, rows, alt_m)
    for lat_deg, lon_deg in zip(lats.tolist(), lons.tolist(), strict=True):
        items.append(
            MissionItem(
                NAV_WAYPOINT,
                param1=float(hold_s),
                param2=float(acceptance_radius_m),
                param4=math.nan,
                lat_deg=lat_deg,
                lon_deg=lon_deg,
                alt_m=alt_m,
            )
        )
    items.append(MissionItem(NAV_RETURN_TO_LAUNCH))
    return items


def qgc_wpl(items: Iterable[MissionItem]) -> str:
    """Return the text of a `QGC WPL 110` file; numbers have 8 decimals (1 mm of latitude).

    Raises:
        ValueError: If an item has a place that is not finite or not on the Earth.
    """
    lines = [_HEADER]
    for index, item in enumerate(items):
        _check_place(item, f"item {index}")
        numbers = (
            item.param1,
            item.param2,
            item.param3,
            item.param4,
            item.lat_deg,
            item.lon_deg,
            item.alt_m,
        )
        fields = [str(index), str(int(index == 0)), str(item.frame), str(item.command)]
        fields += [_number_text(number) for number in numbers]
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
    _check_place(item, where)
    return item


def _check_place(item: MissionItem, where: str) -> None:
    for name, value, limit in (
        ("latitude", item.lat_deg, 90.0),
        ("longitude", item.lon_deg, 180.0),
        ("altitude", item.alt_m, 1e6),
    ):
        if not abs(value) <= limit:
            raise ValueError(f"{where}: {name} {value!r} is not allowed; {-limit:g} to {limit:g}")


def _number_text(number: float) -> str:
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
