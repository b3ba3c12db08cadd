# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands, whichever of the two messages they come in: https://mavlink.io/en/services/command.html."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .channel import Sender
from .wire import Message, mavlink

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
TEMPORARILY_REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
FAILED = mavlink.MAV_RESULT_FAILED

_NO_INT = 2**31 - 1


@dataclass(frozen=True)
class Command:
    """A command.

    Attributes:
        number: MAV_CMD.
        param1: As the command has it, likewise the next three.
        lat_deg: Parameter 5 as a latitude, NaN if it is left open.
        lon_deg: Parameter 6 as a longitude.
        z: Parameter 7.
        frame: MAV_FRAME of the place.
        sender: Who gets the acknowledgement.
    """

    number: int
    param1: float
    param2: float
    param3: float
    param4: float
    lat_deg: float
    lon_deg: float
    z: float
    frame: int
    sender: Sender

    @classmethod
    def received(cls, message: Message, sender: Sender) -> Command:
        """Take a command from COMMAND_LONG or COMMAND_INT."""
        numbers = (message.param1, message.param2, message.param3, message.param4)
        if message.get_type() == "COMMAND_LONG":
            place = (message.param5, message.param6, message.param7)
            frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
        else:
            lat, lon = (math.nan if v == _NO_INT else v * 1e-7 for v in (message.x, message.y))
            place, frame = (lat, lon, message.z), message.frame
        return cls(message.command, *numbers, *place, frame, sender)

    def whole(self, number: int) -> int:
        """Return parameter 1 or 2 as a whole number, -1 if it is none."""
        value = (self.param1, self.param2)[number - 1]
        return int(value) if math.isfinite(value) else -1

    @property
    def on_the_earth(self) -> bool:
        """Whether its place is one."""
        return abs(self.lat_deg) <= 90 and abs(self.lon_deg) <= 180
