# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Callbacks at times of a steady clock, without ROS and without a thread."""

from __future__ import annotations

import math
from collections.abc import Callable


class Alarm:
    """One callback and the time it is due; made by `Alarms`."""

    def __init__(self, callback: Callable[[], None], clock: Callable[[], float]) -> None:
        self._callback = callback
        self._clock = clock
        self._period_s: float | None = None
        self.due_s = math.inf

    def set(self, delay_s: float) -> None:
        """Ring once after this time, instead of any earlier setting."""
        self._period_s = None
        self.due_s = self._clock() + max(delay_s, 0.0)

    def repeat(self, period_s: float) -> None:
        """Ring periodically, first after one period; no effect if the alarm already does."""
        if self._period_s != period_s:
            self.set(period_s)
            self._period_s = period_s

    def cancel(self) -> None:
        """Do not ring."""
        self._period_s = None
        self.due_s = math.inf

    def ring(self, now_s: float) -> None:
        """Call the callback if it is due, once even if several periods have passed."""
        if self.due_s > now_s:
            return
        if self._period_s is None:
            self.due_s = math.inf
        else:
            missed = math.floor((now_s - self.due_s) / self._period_s)
            self.due_s += (missed + 1) * self._period_s
        self._callback()


class Alarms:
    """The alarms of a node, which its loop has to ring.

    Args:
        clock: Returns the time in seconds; it never runs backwards.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._alarms: list[Alarm] = []

    def make(self, callback: Callable[[], None]) -> Alarm:
        """Return an alarm for this callback; it is not set."""
        alarm = Alarm(callback, self._clock)
        self._alarms.append(alarm)
        return alarm

    def wait_s(self) -> float:
        """Return the time until the next alarm is due, 0 if one is."""
        return max(
            min((alarm.due_s for alarm in self._alarms), default=math.inf) - self._clock(), 0
        )

    def ring(self) -> None:
        """Call the callbacks that are due, each once, in the order of their times."""
        now_s = self._clock()
        for alarm in sorted(self._alarms, key=lambda alarm: alarm.due_s):
            # An earlier callback may have set it again: then it is for the next time.
            alarm.ring(now_s)
