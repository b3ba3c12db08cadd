# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What receivers of Cursor on Target have to show of a search, from the messages so far."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.screens.tak.areas import Ring, outlines, smallest_area
from dsse_ros.screens.tak.events import (
    BY_GPS,
    SIMULATED,
    area_event,
    contact_event,
    drone_event,
    removals,
)
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.geodesy import map_to_geodetic
from dsse_ros.world.scenario.live_texts import ShownContact

SHARES = (0.5, 0.9)
"""Shares of the POC whose smallest areas are sent."""
MAX_AREAS = 5
"""Largest number of polygons of each."""
MAX_CONTACTS = 200
"""Largest number of contacts that are sent, the last ones."""
FRESH_S = 5.0
"""Age at which the position of a vehicle no longer replaces that of its drone."""

Place = tuple[float, float, float]


class CotPicture:
    """The state of one search.

    Attributes:
        info: The search; None before it is known.
    """

    def __init__(self) -> None:
        self.info: AgentsInfo | None = None
        self._drones: Sequence[Place] = ()
        self._vehicles: dict[str, tuple[float, Place]] = {}
        self._contacts: tuple[ShownContact, ...] = ()
        self._areas: list[tuple[str, str, Ring]] = []
        self._sent: set[str] = set()

    def begin(self, info: AgentsInfo) -> None:
        """Take the description of the search; what is known of another run is dropped."""
        if self.info is not None and self.info.run_id != info.run_id:
            self._drones, self._contacts, self._areas = (), (), []
        self.info = info

    def put_drones(self, positions: Sequence[Place]) -> None:
        """Take the positions of all drones, m in the map frame."""
        self._drones = positions

    def put_vehicle(self, drone: str, place: Place, now_s: float) -> None:
        """Take latitude, longitude and height above the ellipsoid of a drone's vehicle."""
        self._vehicles[drone] = now_s, place

    def put_contacts(self, contacts: tuple[ShownContact, ...]) -> None:
        """Take the contacts."""
        self._contacts = contacts

    def put_poc(self, poc: NDArray[np.float32]) -> None:
        """Take the POC (R, C) of each cell, row 0 in the north.

        Raises:
            ValueError: If it is of another grid.
        """
        if self.info is None:
            return
        frame = self.info.frame
        if poc.shape != frame.grid_size.matrix:
            raise ValueError(f"the POC must be of {frame.grid_size} cells")
        self._areas = []
        for share in SHARES:
            rings = outlines(frame, smallest_area(poc, share), MAX_AREAS)
            percent = round(100 * share)
            for k, ring in enumerate(rings):
                name = f"POC {percent} %" + (f" ({k + 1} of {len(rings)})" if rings[1:] else "")
                self._areas.append((f"poc{percent}.{k}", name, ring))

    def events(self, now_s: float) -> list[bytes]:
        """Return the events of everything there is, and the removal of what is gone since.

        Args:
            now_s: The time, on the clock of `put_vehicle`.
        """
        if self.info is None:
            return []
        prefix = f"dsse_ros.{self.info.run_id}"
        events = {
            f"{prefix}.{name}": drone_event(f"{prefix}.{name}", name, place, how)
            for name, place, how in self._places(now_s)
        }
        shown = [contact for contact in self._contacts if contact.state != "dismissed"][
            -MAX_CONTACTS:
        ]
        for contact in shown:
            uid, place = f"{prefix}.{contact.name}", (contact.lat_deg, contact.lon_deg)
            events[uid] = contact_event(
                uid, contact.name, contact.state, place, contact.radius_m, _remarks(contact)
            )
        for area, name, ring in self._areas:
            events[f"{prefix}.{area}"] = area_event(f"{prefix}.{area}", name, ring)
        gone, self._sent = self._sent - events.keys(), set(events)
        return [*events.values(), *removals(sorted(gone))]

    def _places(self, now_s: float) -> list[tuple[str, Place, str]]:
        """Return name, place and its origin of each drone: its vehicle's if it has one."""
        assert self.info is not None
        found = []
        for i, name in enumerate(self.info.agents):
            heard_s, place = self._vehicles.get(name, (-np.inf, None))
            if place is not None and now_s - heard_s <= FRESH_S:
                found.append((name, place, BY_GPS))
            elif i < len(self._drones):
                place = map_to_geodetic(self.info.frame, *self._drones[i])
                found.append((name, place, SIMULATED))
        return found


def _remarks(contact: ShownContact) -> str:
    """Return what is known of a contact besides its place."""
    parts = [f"{contact.detections} detection" + "s" * (contact.detections != 1)]
    if contact.utc:
        parts.append(f"last {contact.utc}")
    if contact.probability is not None:
        parts.append(f"the person with probability {contact.probability:.0%}")
    return ", ".join(parts)
