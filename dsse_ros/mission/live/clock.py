# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The time since a search began, by the stamps of its steps on the clock of a node."""

from __future__ import annotations

from bisect import bisect_right


class StepClock:
    """Converts stamps to the time since the search began.

    Steps may take more or less time on the node's clock than in the search: stamps between two
    steps are interpolated.

    Args:
        step_s: Duration of a step in the search.
    """

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._stamps: list[float] = []

    def set(self, step: int, stamp_s: float) -> None:
        """Set the stamp of the last step; 0 is the start of a search."""
        del self._stamps[step:]
        # The stamps of a search that is taken up at a later step are unknown.
        for before in range(len(self._stamps), step):
            self._stamps.append(stamp_s - (step - before) * self._step_s)
        # A clock that has been put back must not reverse the order.
        self._stamps.append(max([stamp_s, *self._stamps[-1:]]))

    @property
    def now_s(self) -> float:
        """Time of the last step."""
        return max(len(self._stamps) - 1, 0) * self._step_s

    def of_stamp(self, stamp_s: float) -> float:
        """Return the time since the search began of a stamp, at most a step after the last one."""
        after = bisect_right(self._stamps, stamp_s)
        if not self._stamps or after == 0:
            return stamp_s - (self._stamps[0] if self._stamps else stamp_s)
        begin = self._stamps[after - 1]
        if after == len(self._stamps):
            return (after - 1) * self._step_s + min(stamp_s - begin, self._step_s)
        share = (stamp_s - begin) / (self._stamps[after] - begin)
        return (after - 1 + share) * self._step_s
