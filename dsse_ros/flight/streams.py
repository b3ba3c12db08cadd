# SPDX-License-Identifier: Apache-2.0
"""Has a vehicle send what is needed of it, and looks whether it does.

An autopilot may acknowledge a request and forget it, and may lose all of them when it restarts.
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.mavlink_messages import (
    BatteryStatus,
    CommandLong,
    EkfStatus,
    ExtendedSysState,
    GlobalPosition,
    HomePosition,
    Incoming,
    MissionCurrent,
    PositionTarget,
    SysStatus,
)
from dsse_ros.flight.mission_messages import Address
from dsse_ros.flight.upload import Dialect

SET_MESSAGE_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST_MESSAGE = mavlink.MAV_CMD_REQUEST_MESSAGE

_HOME_POSITION = mavlink.MAVLINK_MSG_ID_HOME_POSITION
_OF_BOTH: dict[type, int] = {
    GlobalPosition: mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    SysStatus: mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    ExtendedSysState: mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    MissionCurrent: mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
}
_NUMBERS: dict[Dialect, dict[type, int]] = {
    "ardupilot": {
        **_OF_BOTH,
        EkfStatus: mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        PositionTarget: mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    },
    "px4": {**_OF_BOTH, BatteryStatus: mavlink.MAVLINK_MSG_ID_BATTERY_STATUS},
}
_RATE_HZ = 1.0
_MISSED = 3
_GRACE_S = 1.0
_ASK_AGAIN_S = 2.0


class Streams:
    """Requests, each repeated until what was asked for comes, and again when it stops to come.

    Args:
        target: The vehicle's autopilot.
        dialect: Whose autopilot it is.
        position_hz: How often to ask for positions and for the place it flies to.
    """

    def __init__(self, target: Address, dialect: Dialect, position_hz: float) -> None:
        self._target = target
        self._numbers = _NUMBERS[dialect]
        self._rates_hz = dict.fromkeys(self._numbers, _RATE_HZ)
        for kind in (GlobalPosition, PositionTarget):
            if kind in self._rates_hz:
                self._rates_hz[kind] = position_hz
        self._heard_s = dict.fromkeys(self._numbers, -math.inf)
        self._asked_s = dict.fromkeys([*self._numbers, HomePosition], -math.inf)
        self._has_home = False
        # It says where it flies only while it flies somewhere.
        self._optional = {PositionTarget}

    def heard(self, message: Incoming, now: float) -> None:
        """Take note of a message."""
        kind = type(message)
        if kind in self._heard_s:
            self._heard_s[kind] = now
        elif kind is HomePosition:
            self._has_home = True

    def requests(self, now: float, *, flies_somewhere: bool) -> list[CommandLong]:
        """Return what to ask for now.

        Args:
            now: Our time in seconds.
            flies_somewhere: Whether it should say where.
        """
        said = []
        for kind, number in self._numbers.items():
            rate_hz = self._rates_hz[kind]
            late = now - self._heard_s[kind] > _MISSED / rate_hz + _GRACE_S
            wanted = flies_somewhere or kind not in self._optional or not self._asked(kind)
            if late and wanted and now - self._asked_s[kind] > _ASK_AGAIN_S:
                self._asked_s[kind] = now
                said.append(
                    CommandLong(
                        self._target, SET_MESSAGE_INTERVAL, float(number), round(1e6 / rate_hz)
                    )
                )
        if not self._has_home and now - self._asked_s[HomePosition] > _ASK_AGAIN_S:
            self._asked_s[HomePosition] = now
            said.append(CommandLong(self._target, REQUEST_MESSAGE, float(_HOME_POSITION)))
        return said

    def _asked(self, kind: type) -> bool:
        return self._asked_s[kind] > -math.inf
