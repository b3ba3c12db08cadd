# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks with times, and searches along them.

Positions are metres to the east and to the south of the grid's north-west corner. Times are seconds
since the search began.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.sensors.lateral_range import LateralRange

Floats = NDArray[np.float64]


class TimedTrack(NamedTuple):
    """Where a unit is at which time: straight legs, each at a constant speed.

    Attributes:
        points: (K, 2) float64.
        times_s: (K,) float64, not decreasing.
    """

    points: Floats
    times_s: Floats

    def places_at(self, times_s: Floats) -> Floats:
        """Return where the unit is at these times, (..., 2); it waits at both ends."""
        return np.stack(
            [np.interp(times_s, self.times_s, self.points[:, axis]) for axis in (0, 1)], axis=-1
        )

    def between(self, begins_s: float, ends_s: float) -> TimedTrack:
        """Return the part of it between two times, without points if there is none."""
        if not len(self.times_s):
            return self
        begins_s, ends_s = max(begins_s, float(self.times_s[0])), min(ends_s, self.times_s[-1])
        if begins_s >= ends_s:
            return TimedTrack(np.empty((0, 2)), np.empty(0))
        inner = self.times_s[(self.times_s > begins_s) & (self.times_s < ends_s)]
        times = np.concatenate([[begins_s], inner, [ends_s]])
        return TimedTrack(self.places_at(times), times)


class TrackSearch(NamedTuple):
    """A search along a track, from its first point to its last one.

    Attributes:
        track: The track.
        lateral: How the unit sees what it passes.
        goes_on: Whether it looked right before the first point.
    """

    track: TimedTrack
    lateral: LateralRange
    goes_on: bool = False

    def between(self, begins_s: float, ends_s: float) -> TrackSearch:
        """Return the part of it between two times."""
        if not len(self.track.times_s):
            return self
        goes_on = self.goes_on or bool(self.track.times_s[0] < begins_s)
        return self._replace(track=self.track.between(begins_s, ends_s), goes_on=goes_on)
