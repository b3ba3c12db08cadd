# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Contacts: detections near each other, until somebody confirms or dismisses them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

OPEN, CONFIRMED, DISMISSED = "open", "confirmed", "dismissed"
MOST_OPEN = 50
"""Open contacts: each takes memory and time."""
GATE = 3.0
"""Standard deviations within which two detections are of one contact."""
STRAYING_MPS = 0.2
"""How fast a contact may leave the way on which the sea takes it."""


class Detection(NamedTuple):
    """A detection.

    Attributes:
        id: Its identity.
        time_s: Time since the search began, s.
        x_m: Metres to the east in the map frame.
        y_m: Metres to the north.
        radius_m: Standard deviation of the position along each axis.
        drone: Number of the drone; -1 for anybody else.
        confidence: Probability that it is the person, if nobody looked; NaN if not stated.
    """

    id: str
    time_s: float
    x_m: float
    y_m: float
    radius_m: float
    drone: int = -1
    confidence: float = math.nan


Moved = Callable[[float, float, float, float], tuple[float, float]]
"""moved(x_m, y_m, from_s, to_s) returns where the sea takes what floats at a place."""


@dataclass
class Contact:
    """Detections of one thing.

    Attributes:
        name: `c1`, `c2`, ...
        state: `OPEN`, `CONFIRMED` or `DISMISSED`.
        detections: By id.
    """

    name: str
    state: str = OPEN
    detections: dict[str, Detection] = field(default_factory=dict)

    @property
    def drones(self) -> list[int]:
        """The drones that detected it."""
        return sorted(
            {detection.drone for detection in self.detections.values() if detection.drone >= 0}
        )


class Contacts:
    """The contacts of a search.

    Attributes:
        by_name: All contacts.
    """

    def __init__(self) -> None:
        self.by_name: dict[str, Contact] = {}
        self._of: dict[str, str] = {}
        self._last: dict[str, Detection] = {}
        self._opened = 0

    def of_state(self, state: str) -> list[Contact]:
        """Return the contacts in a state, in the order in which they were opened."""
        return [contact for contact in self.by_name.values() if contact.state == state]

    def match(self, detection: Detection, moved: Moved) -> str:
        """Return the name of the open contact that a detection belongs to, or of a new one."""
        nearest, name = GATE, ""
        for contact in self.of_state(OPEN):
            last = self._last[contact.name]
            x, y = moved(last.x_m, last.y_m, last.time_s, detection.time_s)
            straying = STRAYING_MPS * abs(detection.time_s - last.time_s)
            spread = math.hypot(last.radius_m, detection.radius_m, straying)
            away = math.hypot(detection.x_m - x, detection.y_m - y) / spread
            if away < nearest:
                nearest, name = away, contact.name
        return name or f"c{self._opened + 1}"

    def add(self, name: str, detection: Detection) -> None:
        """Add a detection to the contact with a name of `match`."""
        if name not in self.by_name:
            self._opened = max(self._opened, int(name[1:]))
            self.by_name[name] = Contact(name)
        contact = self.by_name[name]
        contact.detections[detection.id] = detection
        self._of[detection.id] = name
        last = self._last.get(name)
        if last is None or _by_time(last) <= _by_time(detection):
            self._last[name] = detection

    def remove(self, detection_id: str) -> str:
        """Remove a detection; return the name of its contact, which goes with its last one."""
        name = self._of.pop(detection_id)
        contact = self.by_name[name]
        del contact.detections[detection_id]
        if contact.detections:
            self._last[name] = max(contact.detections.values(), key=_by_time)
        else:
            del self.by_name[name], self._last[name]
        return name

    def last(self, name: str) -> Detection:
        """Return the last detection of a contact, by its own time."""
        return self._last[name]


def _by_time(detection: Detection) -> tuple[float, str]:
    return detection.time_s, detection.id
