# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The messages of a step that follow from the mission, and digests to compare them by."""

from __future__ import annotations

import array
import struct
from collections.abc import Iterator
from hashlib import blake2b
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time

from dsse_ros.mission.run.step_messages import DEFAULT, Display, StepMessages
from msg_adapters.occupancy import SCALINGS
from msg_adapters.topics import of_drones

_DISPLAYS = {
    "probability_grid": [Display(grid_scaling=scaling) for scaling in SCALINGS],
    "belief_grid": [Display(grid_scaling=scaling) for scaling in SCALINGS],
    "markers": [Display(reveal_person=reveal) for reveal in (False, True)],
}
"""What the node may have shown, by topic."""


def computed(messages: StepMessages, topic: str, stamp: Time) -> Iterator[bytes]:
    """Yield the digests of the messages that the last step may have on a topic.

    There is none if the mission has none.

    Args:
        topic: One that `replay` compares, such as `markers` or `drone3/pose`.
    """
    drone, names = topic.rpartition("/")[0], messages.mission.env.possible_agents
    if drone and drone not in names:
        return
    number = names.index(drone) if drone else 0
    for display in _DISPLAYS.get(topic, [DEFAULT]):
        message = messages.make(of_drones(topic), stamp, number, display)
        if message is not None:
            yield digest(message)


def digest(message: Any) -> bytes:
    """Return a digest of all fields of a message.

    It is not that of the serialized message, in which rclpy leaves padding undefined.
    """
    found = blake2b(digest_size=16)
    for part in _parts(message):
        found.update(part)
    return found.digest()


def _parts(value: Any, kind: str = "") -> Iterator[bytes]:
    if hasattr(value, "get_fields_and_field_types"):
        for name, kind_of_field in value.get_fields_and_field_types().items():
            yield from _parts(getattr(value, name), kind_of_field)
    elif isinstance(value, list | tuple):
        for part in value:
            yield from _parts(part)
    elif isinstance(value, array.array | np.ndarray):
        yield value.tobytes()
    elif isinstance(value, float):
        # The text of every NaN is the same.
        yield struct.pack("<f" if kind == "float" else "<d", value)
    else:
        yield f"{value!r};".encode()
