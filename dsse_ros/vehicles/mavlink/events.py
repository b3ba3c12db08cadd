# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Events: numbers, which a ground station looks up in the autopilot's metadata.

https://mavlink.io/en/services/events.html.
"""

from __future__ import annotations

import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1 << 24
_FNV_BASIS, _FNV_PRIME = 0x811C9DC5, 0x01000193


def event_number(name: str) -> int:
    """Return the number of an event of the autopilot: FNV-1a of its name."""
    number = _FNV_BASIS
    for letter in name.encode():
        number = (number ^ letter) * _FNV_PRIME % 2**32
    return _COMPONENT | number & 0xFFFFFF


class EventMessage(mavlink.MAVLink_message):
    """EVENT as pymavlink's generator would write it, which leaves it out."""

    id = 410
    msgname = "EVENT"
    fieldnames = (
        "number", "event_time_boot_ms", "sequence", "destination_component", "destination_system",
        "log_levels", "arguments",
    )  # fmt: skip
    ordered_fieldnames = fieldnames
    fieldtypes = ("uint32_t", "uint32_t", "uint16_t", "uint8_t", "uint8_t", "uint8_t", "uint8_t")
    array_lengths = (0, 0, 0, 0, 0, 0, 40)
    crc_extra = 160
    unpacker = struct.Struct("<IIHBBB40s")
    orders = tuple(range(7))
    lengths = (1,) * 7

    def __init__(self, number: int, *others: Any, **named: Any) -> None:
        super().__init__(EventMessage.id, EventMessage.msgname)
        values = dict(zip(self.fieldnames, (number, *others), strict=False)) | named
        self._values = [values[name] for name in self.fieldnames]
        self.id, self.log_levels = number, values["log_levels"]
        self.arguments = self._values[-1] = bytes(values["arguments"])

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Return the frame."""
        payload = self.unpacker.pack(*self._values)
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1))
