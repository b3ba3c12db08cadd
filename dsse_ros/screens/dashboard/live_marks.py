# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the map shows of a live search: contacts, and what is being entered."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from dsse_ros.screens.dashboard.map_chart import map_shares
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import geodetic_to_map, search_to_geodetic
from dsse_ros.world.scenario.live_texts import ShownContact

MAX_MARKS = 200
"""Largest number of contacts on the map, the first ones of `ranked`."""
CLICK_SHARE = 0.03
"""How far from a contact a click on the map may be, as a share of its longer side."""


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
    """Return what the map draws, in shares of its longer side from the west and the north.

    The keys are contacts (point, radius, name, state and label; the most probable one is first),
    sketch (points) and closed.
    """
    points = [geodetic_to_map(frame, lat, lon, 0.0)[:2] for lat, lon in sketch.places]
    return {
        "contacts": [
            [
                [*map_shares(frame, contact.x_m, contact.y_m)],
                contact.radius_m / max(frame.extent),
                contact.name,
                contact.state,
                _label(contact),
            ]
            for contact in ranked(contacts)[:MAX_MARKS]
        ],
        "sketch": [[*map_shares(frame, x_m, y_m)] for x_m, y_m in points],
        "closed": sketch.closed,
    }


def ranked(contacts: Iterable[ShownContact]) -> list[ShownContact]:
    """Return open contacts by their probability, the most probable first, then the others."""
    return sorted(
        contacts,
        key=lambda contact: (
            contact.state != "open",
            -(contact.probability or 0.0),
            -contact.time_s,
        ),
    )


def contact_at(
    frame: GridFrame, contacts: Iterable[ShownContact], lat_deg: float, lon_deg: float
) -> str | None:
    """Return the name of the open contact on which somebody has clicked; None for none."""
    x_m, y_m, _ = geodetic_to_map(frame, lat_deg, lon_deg, 0.0)
    away_m = {
        contact.name: math.hypot(contact.x_m - x_m, contact.y_m - y_m)
        for contact in contacts
        if contact.state == "open"
    }
    nearest = min(away_m, key=away_m.__getitem__, default=None)
    return nearest if nearest and away_m[nearest] <= CLICK_SHARE * max(frame.extent) else None


def _label(contact: ShownContact) -> str:
    known = contact.state == "open" and contact.probability is not None
    return f"{contact.name} {contact.probability:.0%}" if known else contact.name


def place_at(frame: GridFrame, east: float, south: float) -> tuple[float, float]:
    """Return latitude and longitude of a point of the map, in shares of its longer side."""
    side_m = max(frame.extent)
    return search_to_geodetic(frame, east * side_m, south * side_m)
