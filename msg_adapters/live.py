# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detections of other nodes as fields of inputs, and contacts as markers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.stamps import to_nanoseconds

_COLORS = {"open": (1.0, 0.6, 0.1), "confirmed": (0.2, 0.9, 0.3), "dismissed": (0.5, 0.5, 0.5)}


class FramedDetection(NamedTuple):
    """A detection that a node sent, in a frame that may be any.

    Attributes:
        frame_id: Name of the frame.
        values: Fields of the input `detection`.
    """

    frame_id: str
    values: dict[str, Any]


def detection_of_pose(drone: str, message: PoseWithCovarianceStamped) -> FramedDetection:
    """Return a drone's detection of a pose, whose identity is drone and stamp."""
    return _detection(drone, message.header, message.pose, "")


def detections_of_array(drone: str, message: Any) -> Iterator[FramedDetection]:
    """Yield a drone's detections of a vision_msgs/Detection3DArray: the best hypothesis of each.

    Its place is that of the hypothesis, with its covariance. Its identity is drone, stamp, and its
    id or number in the array.
    """
    for number, seen in enumerate(message.detections):
        header = seen.header if seen.header.frame_id else message.header
        if not seen.results:
            continue
        best = max(seen.results, key=lambda result: result.hypothesis.score)
        detection = _detection(drone, header, best.pose, f"#{seen.id or number}")
        # It counts where no look of the drone has seen the place.
        detection.values["confidence"] = float(best.hypothesis.score)
        yield detection


def _detection(drone: str, header: Header, pose: Any, suffix: str) -> FramedDetection:
    nanoseconds = to_nanoseconds(header.stamp)
    place, covariance = pose.pose.position, pose.covariance
    # Rows and columns are x, y, z and three rotations.
    variance = (float(covariance[0]) + float(covariance[7])) / 2
    return FramedDetection(
        header.frame_id,
        {
            "id": f"{drone}@{nanoseconds}{suffix}",
            "drone": drone,
            "time": nanoseconds / 1e9,
            "x": float(place.x),
            "y": float(place.y),
            "radius": math.sqrt(variance) if variance > 0.0 else variance,
        },
    )


def contact_markers(
    header: Header, contacts: Iterable[Mapping[str, Any]], cell_m: float
) -> MarkerArray:
    """Return contacts as discs of their standard deviations with their names.

    The first marker deletes all earlier ones. Namespaces: `contacts` and `contact_names`.

    Args:
        header: Time of the state, and the map frame.
        contacts: With `contact`, `state`, `x`, `y`, `radius` and `probability`.
        cell_m: Side of a cell.
    """
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for number, contact in enumerate(contacts):
        color = ColorRGBA(**dict(zip("rgb", _COLORS[contact["state"]], strict=True)), a=0.7)
        disc = Marker(header=header, ns="contacts", id=number, type=Marker.CYLINDER)
        disc.scale.x = disc.scale.y = float(max(2.0 * contact["radius"], 0.3 * cell_m))
        disc.scale.z = 0.1 * cell_m
        name = Marker(header=header, ns="contact_names", id=number, type=Marker.TEXT_VIEW_FACING)
        name.scale.z = 0.5 * cell_m
        probability = contact["probability"]
        name.text = contact["contact"] + ("" if probability is None else f" {probability:.0%}")
        for marker in (disc, name):
            marker.color = color
            marker.pose.position = Point(x=float(contact["x"]), y=float(contact["y"]), z=0.0)
            markers.append(marker)
    return MarkerArray(markers=markers)
