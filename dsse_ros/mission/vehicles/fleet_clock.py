# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""One clock from the clocks of several vehicles, without ROS."""

from __future__ import annotations

from collections.abc import Collection

WRAP_MS = 2**32
"""An autopilot's `time_boot_ms` starts again at 0 after so many, 49.7 days."""
MAX_SKIP_MS = 600_000
"""Longest time between two reports of a clock; more is another autopilot's clock."""
MAX_LEAD_MS = 60_000
"""Most that the clock of a vehicle counts as ahead of the others, or behind them."""


class FleetClock:
    """The time that has passed for the fleet, by the clocks of its vehicles.

    Only the differences between the reports of one vehicle count, because vehicles have been
    started at different times, and simulated ones run at different speeds. The fleet's time follows
    the lower median of the vehicles, so that one silent or odd clock of three neither stops nor
    drives it, and the slower one of two sets the pace.

    Attributes:
        time_s: The time so far, which never runs backwards.
    """

    def __init__(self) -> None:
        self._time_ms = 0
        self._last_ms: dict[int, int] = {}
        self._lead_ms: dict[int, int] = {}
        self._heard_ms: dict[int, int] = {}

    def begin(self) -> None:
        """Count from now on: no vehicle is ahead of the others, or behind them."""
        self._lead_ms = dict.fromkeys(self._lead_ms, 0)

    @property
    def time_s(self) -> float:
        """The time that has passed for the fleet, s."""
        return self._time_ms * 1e-3

    def set_time(self, vehicle: int, boot_ms: int) -> None:
        """Set the time since the start of a vehicle's autopilot, by its own clock.

        A clock that jumps is that of an autopilot that was restarted or replaced: it counts from
        the jump on.
        """
        passed_ms = boot_ms - self._last_ms.get(vehicle, boot_ms)
        if passed_ms < MAX_SKIP_MS - WRAP_MS:
            passed_ms += WRAP_MS
        if not 0 <= passed_ms <= MAX_SKIP_MS:
            passed_ms = 0
        self._last_ms[vehicle] = boot_ms
        self._lead_ms[vehicle] = self._lead_ms.get(vehicle, 0) + passed_ms
        self._follow()
        self._heard_ms[vehicle] = self._time_ms

    def silent_s(self, vehicle: int) -> float:
        """Return for how long the fleet has gone on without reports of a vehicle, s.

        A clock that goes slower than those of the others is not silent, nor is one that has come
        back with the time of its silence.
        """
        behind_ms = -self._lead_ms.get(vehicle, 0)
        return max(min(behind_ms, self._time_ms - self._heard_ms.get(vehicle, 0)), 0) * 1e-3

    def keep(self, vehicles: Collection[int]) -> None:
        """Count the clocks of these vehicles only: others may have landed."""
        for gone in self._lead_ms.keys() - {*vehicles}:
            del self._last_ms[gone], self._lead_ms[gone], self._heard_ms[gone]
        self._follow()

    def _follow(self) -> None:
        """Advance to the lower median of the vehicles."""
        leads = sorted(self._lead_ms.values())
        passed_ms = max(leads[(len(leads) - 1) // 2], 0) if leads else 0
        self._time_ms += passed_ms
        for vehicle, lead_ms in self._lead_ms.items():
            self._lead_ms[vehicle] = min(max(lead_ms - passed_ms, -MAX_LEAD_MS), MAX_LEAD_MS)
