# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the map shows of a live search: contacts, and what is being entered."""

from __future__ import annotations

from typing import Any, NamedTuple

from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import geodetic_to_map, map_to_geodetic
from dsse_ros.scenario.live_texts import ShownContact

MAX_MARKS = 200
"""Largest number of contacts on the map, the last ones."""


class Sketch(NamedTuple):
    """Places in a form.

    Attributes:
        places: Latitudes and longitudes in degrees.
        closed: Whether they are the corners of an area.
    """

    places: tuple[tuple[float, float], ...]
    closed: bool


NO_SKETCH = Sketch((), closed=False)


def live_marks(
    frame: GridFrame, contacts: tuple[ShownContact, ...], sketch: Sketch
) -> dict[str, Any]:
    """Return what the map draws, in shares of its side from the west and the north.

    The keys are contacts (point, radius, label and state), sketch (points) and closed.
    """
    side_m = frame.side_m
    points = [geodetic_to_map(frame, lat, lon, 0.0)[:2] for lat, lon in sketch.places]
    return {
        "contacts": [
            [
                [contact.x_m / side_m, 1 - contact.y_m / side_m],
                contact.radius_m / side_m,
                contact.name,
                contact.state,
            ]
            for contact in contacts[-MAX_MARKS:]
        ],
        "sketch": [[x_m / side_m, 1 - y_m / side_m] for x_m, y_m in points],
        "closed": sketch.closed,
    }


def place_at(frame: GridFrame, east: float, south: float) -> tuple[float, float]:
    """Return latitude and longitude of a point of the map, in shares of its side."""
    side_m = frame.side_m
    lat, lon, _ = map_to_geodetic(frame, east * side_m, (1 - south) * side_m, 0.0)
    return lat, lon
