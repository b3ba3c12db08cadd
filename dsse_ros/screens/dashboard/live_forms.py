# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Inputs of a live search from the fields of a form, and what has become of them in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dsse_ros.world.scenario.live_texts import Answer
from dsse_ros.world.scenario.positions import EXAMPLES, position

MAX_CORNERS = 200
"""Largest number of places of an area or a track in a form."""


def places_of(text: str) -> list[tuple[float, float]]:
    """Return the places (lat, lon) of a text that has one on each line.

    Raises:
        ValueError: If a line has none, or there are too many.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) > MAX_CORNERS:
        raise ValueError(f"places must be at most {MAX_CORNERS}, got {len(lines)}")
    places = []
    for line in lines:
        try:
            places.append(position(line))
        except ValueError:
            raise ValueError(
                f"a place must be latitude, longitude such as {EXAMPLES}, got {line!r:.60}"
            ) from None
    return places


def place_line(lat_deg: float, lon_deg: float) -> str:
    """Return a line for `places_of`."""
    return f"{lat_deg:.6f}, {lon_deg:.6f}"


def sighting(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return a sighting.

    Raises:
        ValueError: If the place is missing.
    """
    places = places_of(fields["place"] or "")
    if not places:
        raise ValueError("place is missing: click on the map, or enter latitude, longitude")
    lat, lon = places[0]
    return {"lat": lat, "lon": lon} | _given(fields, "time", "radius", "time_error", "weight")


def searched(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return an area or a track that others have searched.

    Raises:
        ValueError: If it has too few places.
    """
    # GeoJSON has longitudes first.
    line = [[lon, lat] for lat, lon in places_of(fields["places"] or "")]
    of_area = fields["shape"] == "area"
    if len(line) < (3 if of_area else 2):
        least = "three corners" if of_area else "two places"
        raise ValueError(f"places must be at least {least}: click on the map, or enter them")
    shape = "Polygon" if of_area else "LineString"
    places = [[*line, line[0]]] if of_area else line
    content = {"geometry": {"type": shape, "coordinates": places}}
    content |= _given(fields, "time", "end", "by")
    if fields.get("pod") is not None:
        content["pod"] = fields["pod"] / 100
    return content | ({} if of_area else _given(fields, "sweep_width"))


def weather(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return wind, current or both.

    Raises:
        ValueError: If there is neither, or a speed without its direction.
    """
    content: dict[str, Any] = _given(fields, "time")
    for kind, sense in (("wind", "from"), ("current", "toward")):
        speed, direction = fields.get(f"{kind}_speed"), fields.get(f"{kind}_{sense}")
        if (speed is None) != (direction is None):
            raise ValueError(f"{kind} must have a speed and a direction")
        if speed is not None:
            content[kind] = {"speed": speed, sense: direction}
    if not content.keys() & {"wind", "current"}:
        raise ValueError("wind or current must be given")
    return content


def _given(fields: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """Return the fields that are filled in."""
    found = {name: fields.get(name) for name in names}
    return {name: value for name, value in found.items() if value not in (None, "")}


def change_of(answer: Answer) -> str:
    """Return what an input has changed: POS before and after, and how much POC has moved."""
    if not answer.ok:
        return f"refused: {answer.reason}"
    if answer.code == "again":
        return "has been accepted before"
    parts = []
    if answer.pos_before is not None and answer.pos_after is not None:
        parts.append(f"POS {answer.pos_before:.1%} → {answer.pos_after:.1%}")
    if answer.poc_moved is not None:
        parts.append(f"{answer.poc_moved:.1%} of the POC moved")
    if answer.contact:
        parts.insert(0, f"contact {answer.contact}")
    return ", ".join(parts) or "accepted"
