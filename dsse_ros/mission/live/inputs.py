# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The inputs of a live search as data: their kinds and fields, and how a JSON text is read.

A reader returns `Accepted` or `Rejected(code, reason)` and never raises. It checks an input by
itself; whether it fits the search, `LiveSearch.check` decides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from dsse_ros.base.fields import FieldError, Spec, check_known, shown
from dsse_ros.base.json_reader import read_json
from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.world.drift.flow import Kind as FlowKind
from dsse_ros.world.drift.flow import seconds
from dsse_ros.world.scenario.incident_flow import flow_dict, stated_flow
from dsse_ros.world.scenario.place_checks import LAT, LON

LONGEST_TEXT = 1 << 20
"""Characters of an input: a grid of wind or current fits in."""
MOST_POINTS = 5000
"""Points of a polygon or a line."""
DEFINITE_RANGE, INVERSE_CUBE = LAWS = ("definite_range", "inverse_cube")
"""How somebody who searches along a line sees what is beside it."""
Read = Callable[[str, Any], Any]
"""read(name, value) returns the value in its canonical form, and raises `FieldError`."""


def _number(**limits: Any) -> Read:
    return Spec("float", "", **limits).check


_LAT, _LON = LAT.check, LON.check
_ID = Spec("str", "")
_LONGEST_NAME = 100


def _time(name: str, value: Any) -> float | str:
    """Return a time: text in UTC, or a number of seconds on the node's clock."""
    try:
        if isinstance(value, str):
            seconds(value)
            return value
        return float(Spec("float", "", low=0, high=1e12).check(name, value))
    except (OverflowError, ValueError):
        raise FieldError(
            f"{name} must be a time like 2026-01-17T14:00Z, or seconds as in header stamps, got "
            f"{shown(value)}"
        ) from None


def _name(name: str, value: Any) -> str:
    """Return a name."""
    text: str = _ID.check(name, value)
    if not 0 < len(text) <= _LONGEST_NAME or not text.isprintable():
        raise FieldError(f"{name} must be 1 to {_LONGEST_NAME} printable characters, got "
                         f"{shown(text)}")  # fmt: skip
    return text


def _drone(name: str, value: Any) -> str:
    """Return the name of a drone, from its name or number."""
    number = value.removeprefix("drone") if isinstance(value, str) else value
    if isinstance(number, str) and number.isascii() and number.isdigit() and len(number) < 10:
        number = int(number)
    return f"drone{Spec('int', '', low=0, high=10**9).check(name, number)}"


def _geometry(name: str, value: Any) -> dict[str, Any]:
    """Return a GeoJSON polygon or line of points (lon, lat), without anything else in it."""
    kind = value.get("type") if isinstance(value, Mapping) else None
    stated: Any = value.get("coordinates") if isinstance(value, Mapping) else None
    least = {"Polygon": 4, "LineString": 2}
    try:
        lines = [stated] if kind == "LineString" else list(stated)
        if kind not in least or not lines or sum(map(len, lines)) > MOST_POINTS:
            raise ValueError
        if min(map(len, lines)) < least[kind]:
            raise ValueError
        # A third number is an altitude.
        places = [[[_LON(name, lon), _LAT(name, lat)] for lon, lat, *_ in line] for line in lines]
    except (FieldError, TypeError, ValueError):
        raise FieldError(
            f"{name} must be a GeoJSON Polygon or LineString of at most {MOST_POINTS} points "
            f"[lon, lat], got {shown(value)}"
        ) from None
    if kind == "LineString":
        return {"type": kind, "coordinates": places[0]}
    for ring in places:
        if ring[0] != ring[-1]:
            raise FieldError(
                f"{name}: a ring must end where it begins, at {ring[0]}, got the end {ring[-1]}"
            )
    return {"type": kind, "coordinates": places}


def _flow(kind: FlowKind) -> Read:
    """Return what reads the fields of wind or current; the incident takes them up."""

    def read_fields(name: str, value: Any) -> dict[str, Any]:
        if isinstance(value, Mapping) and "file" in value:
            raise FieldError(f"{name} must be values, because an input names no file, got a file")
        flow, uncertainty = stated_flow(name, kind, value)
        return flow_dict(flow, uncertainty) if "times_s" in value else dict(value)

    return read_fields


@dataclass(frozen=True)
class Kind:
    """A kind of input.

    Attributes:
        doc: What it reports.
        required: Its required fields by name, and what reads each; `id` is one of every kind.
        optional: Its other fields.
        has_place: Whether it has a place: `lat` and `lon`, or `x` and `y` in the map frame.
    """

    doc: str
    required: Mapping[str, Read] = field(default_factory=dict)
    optional: Mapping[str, Read] = field(default_factory=dict)
    has_place: bool = False


_PLACE: dict[str, Read] = {
    "lat": _LAT,
    "lon": _LON,
    "x": _number(low=-1e7, high=1e7),
    "y": _number(low=-1e7, high=1e7),
}

KINDS: Mapping[str, Kind] = {
    "detection": Kind(
        "somebody was detected",
        {"radius": _number(above=0, high=1e5)},
        {"time": _time, "drone": _drone, "confidence": _number(low=0, high=1)},
        has_place=True,
    ),
    "sighting": Kind(
        "the object was seen",
        {"time": _time},
        {
            "radius": _number(low=0, high=1e5), "time_error": _number(low=0, high=1e4),
            "weight": _number(above=0, high=1e6),
        },
        has_place=True,
    ),
    "searched": Kind(
        "others have searched an area or along a line",
        {"geometry": _geometry},
        {
            "time": _time, "end": _time, "pod": _number(low=0, high=1),
            "sweep_width": _number(above=0, high=1e5), "by": _name,
            "law": Spec("str", "", choices=LAWS).check,
        },
    ),
    "weather": Kind(
        "wind or current",
        optional={"time": _time, "wind": _flow("wind"), "current": _flow("current")},
    ),
    "confirm": Kind("a contact is the person", {"contact": _name}),
    "dismiss": Kind("a contact is a false alarm", {"contact": _name}),
    "withdraw": Kind("an input was wrong", {"input": _name}),
}  # fmt: skip
"""The kinds by name; each has the topic `live/<kind>`."""


@dataclass(frozen=True)
class Input:
    """An input that was understood.

    Attributes:
        kind: One of `KINDS`.
        id: Its identity.
        values: Its fields without `id`, by name.
    """

    kind: str
    id: str
    values: Mapping[str, Any]


def parse(kind: str, text: str) -> Result[Input]:
    """Return the input of a JSON text.

    Args:
        kind: One of `KINDS`.
        text: The text.
    """
    try:
        values = read_json(text, kind, LONGEST_TEXT)
    except ValueError as error:
        return Rejected("bad_json", str(error))
    if not isinstance(values, dict):
        return Rejected("bad_json", f"{kind}: must be a JSON object, got {shown(values)}")
    return read(kind, values)


def read(kind: str, values: Mapping[str, Any]) -> Result[Input]:
    """Return the input of these fields.

    Args:
        kind: One of `KINDS`.
        values: The fields, `id` among them; a None stands for a field that is not given.
    """
    of_kind = KINDS[kind]
    readers = {"id": _name, **of_kind.required, **of_kind.optional}
    if of_kind.has_place:
        readers |= _PLACE
    try:
        check_known(f"a {kind}", values, readers)
    except FieldError as error:
        return Rejected("unknown_field", str(error))
    present = {name: value for name, value in values.items() if value is not None}
    for name in ("id", *of_kind.required):
        if name not in present:
            return Rejected("missing_field", f"{kind}.{name} must be given")
    if missing := _missing(kind, present):
        return Rejected("missing_field", missing)
    try:
        checked = {name: readers[name](f"{kind}.{name}", value) for name, value in present.items()}
    except FieldError as error:
        return Rejected("bad_value", str(error))
    return Accepted(Input(kind, checked.pop("id"), checked))


def _missing(kind: str, present: Mapping[str, Any]) -> str:
    """Return which of several fields is missing, "" if none is."""
    if KINDS[kind].has_place:
        pairs = [all(name in present for name in pair) for pair in (("lat", "lon"), ("x", "y"))]
        if sum(name in present for name in _PLACE) != 2 or not any(pairs):
            return f"{kind} must have a place: lat and lon, or x and y in the map frame"
    if kind == "weather" and not {"wind", "current"} & present.keys():
        return "weather must have wind or current"
    if kind == "searched":
        geometry = present["geometry"]
        is_line = isinstance(geometry, Mapping) and geometry.get("type") == "LineString"
        lacks = "sweep_width" if is_line else "pod"
        if lacks not in present:
            return f"searched.{lacks} must be given with this geometry"
    return ""
