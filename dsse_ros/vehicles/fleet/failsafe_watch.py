# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a failsafe that keeps the mode, or takes the vehicle later, is one to act on."""

from __future__ import annotations

import math

from dsse_ros.vehicles.autopilots import Failsafe
from dsse_ros.vehicles.control.vehicle_state import VehicleState

FAILSAFE_S = 5.0
"""Time in which an autopilot may recover that is critical without giving a reason, or that has no
order and a failsafe that keeps its mode."""
_CONTINUES = (None, Failsafe.OFFBOARD, Failsafe.RADIO, Failsafe.GCS)
"""Failsafes after which the bridge goes on with an autopilot that stays in its mode, or brings it
back to that mode."""


class FailsafeWatch:
    """Watches the failsafes of one vehicle."""

    def __init__(self) -> None:
        self._since_s = math.inf
        self._overruled: Failsafe | None = None

    def overrule(self, state: VehicleState) -> None:
        """Take note that an operator has called the vehicle, whatever failsafe is active."""
        self._overruled = state.failsafe

    def acts(self, state: VehicleState, now_s: float, *, concerns: bool, known: bool) -> bool:
        """Return whether a failsafe has the vehicle.

        Args:
            state: What it reports.
            now_s: Time on a steady clock.
            concerns: Whether it matters.
            known: Whether a failsafe with a name is one at once.
        """
        if state.failsafe != self._overruled:
            self._overruled = None
        if not concerns or state.failsafe in (*_CONTINUES, self._overruled):
            self._since_s = math.inf
            return False
        self._since_s = min(self._since_s, now_s)
        # A critical state without a reason may become a named failsafe.
        certain = state.failsafe is not Failsafe.CRITICAL and known
        return certain or now_s - self._since_s >= FAILSAFE_S
