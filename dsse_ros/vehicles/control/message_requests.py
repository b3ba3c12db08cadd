# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The requests for the messages that are needed of a vehicle."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots import Autopilot
from dsse_ros.vehicles.mavlink.messages import (
    Address,
    Attitude,
    AutopilotVersion,
    GlobalPosition,
    HomePosition,
    Incoming,
    Outgoing,
    ParamRequestRead,
    ParamValue,
    PositionTarget,
    command_long,
)

_RATE_HZ = 1.0
_MISSED = 3
_GRACE_S = 1.0
_REQUEST_AGAIN_S = 2.0
_ASK_AGAIN_S = 10.0
_VERSION_ASKS = 4
_BY_NAME = -1


class MessageRequests:
    """Requests for the messages that are needed, repeated until they come, and when they stop.

    Its speeds, and the altitudes and the climb of its return, are requested too, as parameters. Its
    id is requested again and again, because it may be exchanged, or have a double.

    An autopilot may acknowledge a request and forget it, and loses all of them when it restarts.

    Args:
        target: The vehicle's autopilot.
        autopilot: Which autopilot it is.
        position_hz: How often to ask for positions, attitudes and the target.
    """

    def __init__(self, target: Address, autopilot: Autopilot, position_hz: float) -> None:
        self._target = target
        self._kinds = autopilot.messages
        # It has one parameter of each.
        kinds = (
            autopilot.return_altitudes, autopilot.return_climbs, autopilot.return_ends,
            autopilot.speed_limits, autopilot.own_speeds, autopilot.least_speeds,
            autopilot.disarm_delays,
        )  # fmt: skip
        self._parameters = [names for names in kinds if names]
        self._rates_hz = dict.fromkeys(self._kinds, _RATE_HZ)
        for kind in (GlobalPosition, Attitude, PositionTarget):
            if kind in self._rates_hz:
                self._rates_hz[kind] = position_hz
        self._received_s = dict.fromkeys(self._kinds, -math.inf)
        requested = [*self._kinds, HomePosition, AutopilotVersion]
        self._requested_s = dict.fromkeys(requested, -math.inf)
        self.forget()
        self._parameter_s = -math.inf
        self._asked_s = math.inf

    def forget(self) -> None:
        """Request again what does not change while the same vehicle is connected."""
        self._has_home = self._has_version = False
        self._version_asks = 0

    @property
    def has_no_version(self) -> bool:
        """Whether it does not answer the requests for its id."""
        return self._version_asks > _VERSION_ASKS and not self._has_version

    def receive(self, message: Incoming, now: float) -> None:
        """Take note of a message."""
        kind = type(message)
        if kind in self._received_s:
            self._received_s[kind] = now
        elif kind is HomePosition:
            self._has_home = True
        elif kind is AutopilotVersion:
            self._has_version = True
        elif isinstance(message, ParamValue) and math.isfinite(message.param_value):
            name = message.param_id
            self._parameters = [names for names in self._parameters if name not in names]

    def due(self, now: float, *, has_setpoint: bool, unexplained: bool = False) -> list[Outgoing]:
        """Return the requests to send now.

        Args:
            now: Our time in seconds.
            has_setpoint: Whether it flies to a setpoint, and should report it.
            unexplained: Whether it cannot be armed and has not reported why. PX4 reports its checks
                when they change, and when it is asked.
        """
        requests: list[Outgoing] = []
        if not (unexplained and math.isfinite(self._asked_s)):
            self._asked_s = now
        elif now - self._asked_s > _ASK_AGAIN_S:
            self._asked_s = now
            requests.append(command_long(self._target, mavlink.MAV_CMD_RUN_PREARM_CHECKS))
        for kind in self._kinds:
            rate_hz = self._rates_hz[kind]
            late = now - self._received_s[kind] > _MISSED / rate_hz + _GRACE_S
            # It reports its target only while it has one.
            requested = self._requested_s[kind] > -math.inf
            wanted = has_setpoint or kind is not PositionTarget or not requested
            if late and wanted and now - self._requested_s[kind] > _REQUEST_AGAIN_S:
                self._requested_s[kind] = now
                parameters = (float(kind.id), round(1e6 / rate_hz))
                requests.append(
                    command_long(self._target, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, *parameters)
                )
        again_s = _ASK_AGAIN_S if self._has_version else _REQUEST_AGAIN_S
        for message, wanted, period_s in (
            (HomePosition, not self._has_home, _REQUEST_AGAIN_S),
            (AutopilotVersion, True, again_s),
        ):
            if wanted and now - self._requested_s[message] > period_s:
                self._requested_s[message] = now
                self._version_asks += message is AutopilotVersion
                requests.append(
                    command_long(self._target, mavlink.MAV_CMD_REQUEST_MESSAGE, float(message.id))
                )
        if self._parameters and now - self._parameter_s > _ASK_AGAIN_S:
            self._parameter_s = now
            requests += [
                ParamRequestRead(*self._target, name.encode(), _BY_NAME)
                for name in sorted({name for names in self._parameters for name in names})
            ]
        return requests
