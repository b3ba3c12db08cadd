# SPDX-License-Identifier: Apache-2.0
"""How far a step has come in wall time, without ROS and without a clock of its own."""

from __future__ import annotations


class Pace:
    """The way through one step after the other.

    Times are seconds of any steady clock. The share of a step that is done never shrinks until the
    next step begins, whatever else changes: mission time follows it and must not run backwards.
    """

    def __init__(self) -> None:
        self._share = 0.0
        self._since_s = 0.0
        self._period_s = 0.0
        self._held = False

    def begin(self, now_s: float, *, on_schedule: bool) -> None:
        """Begin a step, now or, with `on_schedule`, when the last one should have ended.

        A delay of a whole step or more is not caught up.
        """
        over = self._unbounded(now_s) - 1.0
        self._share = over if on_schedule and 0.0 < over < 1.0 else 0.0
        self._since_s = now_s

    def set_period(self, now_s: float, period_s: float) -> None:
        """Let a step take this long from now on; 0 lets time stand still."""
        self._share, self._since_s = self.share(now_s), now_s
        self._period_s = period_s

    def hold(self, now_s: float, held: bool) -> None:
        """Let time stand still, or go on from where it was."""
        self._share, self._since_s = self.share(now_s), now_s
        self._held = held

    def share(self, now_s: float) -> float:
        """Return the share of the step that is done, 0 to 1."""
        return min(self._unbounded(now_s), 1.0)

    def left_s(self, now_s: float) -> float:
        """Return the wall time until the step is done, if time goes on; 0 without a period."""
        return (1.0 - self.share(now_s)) * self._period_s

    def _unbounded(self, now_s: float) -> float:
        if self._held or self._period_s <= 0:
            return self._share
        return self._share + max(now_s - self._since_s, 0.0) / self._period_s
