# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Events of Cursor on Target (MITRE, "Cursor on Target Message Router User's Guide"), by pytak."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

import pytak

from dsse_ros.screens.tak.areas import Ring

STALE_S = 30
"""Time after which a receiver greys out or drops what has not been sent again."""
_PRECISION = 7
"""Decimals of degrees: a centimetre."""
_DRONE = "a-f-A-M-H-Q"
"""A friendly unmanned aircraft with rotary wings, as tools for drones in ATAK have it."""
_SPOT = "b-m-p-s-m"
"""A spot on the map, which says nothing about who it is."""
_FREEFORM = "u-d-f"
"""A drawn shape."""
_DELETE = "t-x-d-d"
SIMULATED, BY_GPS, FUSED = "m-s", "m-g", "m-f"
"""How a position came about."""
_COLOURS = {"open": -256, "confirmed": -16711936}
"""Yellow and green as signed ARGB, by the state of a contact."""
_OUTLINE, _FILL = -1, 0x20FFFFFF


def drone_event(uid: str, name: str, place: tuple[float, float, float], how: str) -> bytes:
    """Return the event of a drone.

    Args:
        uid: Identity, the same in each event of the drone.
        name: Its name.
        place: Latitude and longitude in degrees, and height above the ellipsoid in m.
        how: `SIMULATED` or `BY_GPS`.
    """
    lat, lon, alt_m = place
    point = pytak.cot_point(lat, lon, hae=round(alt_m, 1), precision=_PRECISION)
    return _event(uid, _DRONE, how, point, pytak.cot_detail(flow_tag=False), name)


def contact_event(
    uid: str, name: str, state: str, place: tuple[float, float], radius_m: float, remarks: str
) -> bytes:
    """Return the event of a contact: a spot whose circular error is the contact's radius.

    Args:
        uid: Identity, the same in each event of the contact.
        name: Its name.
        state: Its state.
        place: Latitude and longitude in degrees.
        radius_m: Uncertainty of the place.
        remarks: What else is known.
    """
    colour = _COLOURS.get(state, _OUTLINE)
    detail = pytak.cot_detail(flow_tag=False)
    ElementTree.SubElement(detail, "color", {"argb": str(colour)})
    icon = f"COT_MAPPING_SPOTMAP/{_SPOT}/{colour}"
    ElementTree.SubElement(detail, "usericon", {"iconsetpath": icon})
    pytak.add_remarks(detail, [f"{state}.", remarks])
    point = pytak.cot_point(*place, ce=round(radius_m, 1), precision=_PRECISION)
    return _event(uid, _SPOT, FUSED, point, detail, name)


def area_event(uid: str, name: str, ring: Ring) -> bytes:
    """Return the event of an area, a closed shape.

    Args:
        uid: Identity, the same in each event of the area.
        name: Its name.
        ring: Its outline.
    """
    detail = pytak.cot_detail(flow_tag=False)
    for lat, lon in ring:
        place = ",".join(pytak.truncate_float(value, _PRECISION) for value in (lat, lon))
        ElementTree.SubElement(detail, "link", {"point": place})
    for tag, value in (("strokeColor", _OUTLINE), ("strokeWeight", 3.0), ("fillColor", _FILL)):
        ElementTree.SubElement(detail, tag, {"value": str(value)})
    lat, lon = (sum(values) / (len(ring) - 1) for values in zip(*ring[:-1], strict=True))
    point = pytak.cot_point(lat, lon, precision=_PRECISION)
    return _event(uid, _FREEFORM, FUSED, point, detail, name)


def removals(uids: Sequence[str]) -> list[bytes]:
    """Return events that have receivers delete what they have of these identities."""
    events = []
    for uid in uids:
        detail = pytak.cot_detail(flow_tag=False)
        link = {"uid": uid, "relation": "none", "type": "none"}
        ElementTree.SubElement(detail, "link", link)
        ElementTree.SubElement(detail, "__forcedelete")
        events.append(_event(f"{uid}.delete", _DELETE, "m-g", pytak.cot_point(), detail, ""))
    return events


def _event(
    uid: str,
    kind: str,
    how: str,
    point: ElementTree.Element,
    detail: ElementTree.Element,
    name: str,
) -> bytes:
    event = pytak.cot_event(
        uid=uid, cot_type=kind, how=how, stale=STALE_S, point=point, detail=detail, callsign=name
    )
    return pytak.serialize_cot(event, trailing_newline=True)
