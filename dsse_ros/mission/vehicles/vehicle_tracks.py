# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle has flown in a step in metres, from its own positions and clock, without ROS."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.vehicles.fleet_clock import MAX_SKIP_MS

MAX_SKIP_S = MAX_SKIP_MS * 1e-3
LONGEST_GAP_S = 2.0
"""Time between two positions of a vehicle after which nobody knows where it has looked."""
_LATE_S = 5.0
"""A clock that is behind by less is that of a position that came late."""
_RESOLUTION_S = 1e-3
_MOST_WAITING = 32
_MOST_POSITIONS = 10_000
"""Positions that are kept; a step with more has a gap at its start."""


class Position(NamedTuple):
    """A position of a vehicle in the map frame.

    Attributes:
        x: To the east, m.
        y: To the north, m.
        looks: Whether it can look from there: at its altitude, and level enough.
    """

    x: float
    y: float
    looks: bool


class VehicleTrack:
    """The positions of one vehicle since the last step.

    Args:
        step_s: Time of a step.
    """

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._positions: deque[tuple[float, Position]] = deque(maxlen=_MOST_POSITIONS)
        self._start_s = 0.0
        self._looked = False
        # Positions whose time is not known yet, by stamp; the last two clocks, with their stamps.
        self._places: dict[int, Position] = {}
        self._before, self._clock = (-1, math.nan), (-1, math.nan)

    def begin(self) -> None:
        """Begin a mission where the vehicle is."""
        if self._positions:
            self._start_s = self._positions[-1][0]
            self._forget_until(self._start_s)
        self._looked = False

    def set_place(self, stamp_ns: int, place: Position) -> None:
        """Take a position, with the stamp of its message."""
        self._places[stamp_ns] = place
        while len(self._places) > _MOST_WAITING:
            del self._places[min(self._places)]
        if stamp_ns <= self._clock[0]:
            self._time_places(*self._before, *self._clock)

    def set_time(self, stamp_ns: int, time_s: float) -> None:
        """Take the vehicle's clock, with the stamp of its message.

        The time of a position is between those of the clocks before and after it: a node that has
        no time for all messages does not get the two that belong together.
        """
        if stamp_ns > self._clock[0]:
            self._before = self._clock
        self._clock = (stamp_ns, time_s)
        self._time_places(*self._before, *self._clock)

    def _time_places(self, from_ns: int, from_s: float, to_ns: int, to_s: float) -> None:
        """Add the waiting positions whose times are known now, and drop older ones."""
        goes_on = 0.0 <= to_s - from_s <= MAX_SKIP_S
        for stamp_ns in sorted(self._places):
            if stamp_ns > to_ns:
                return
            place = self._places.pop(stamp_ns)
            if stamp_ns == to_ns:
                self._add(to_s, place)
            elif goes_on and stamp_ns >= from_ns:
                share = (stamp_ns - from_ns) / (to_ns - from_ns)
                self._add(from_s + share * (to_s - from_s), place)

    def _add(self, time_s: float, place: Position) -> None:
        last_s = self._positions[-1][0] if self._positions else -math.inf
        if -_LATE_S < time_s - last_s <= 0.0:
            return
        if not 0.0 < time_s - last_s <= MAX_SKIP_S:
            # The first one, or that of an autopilot that was restarted: the way to it is not known.
            self._positions.clear()
            self._start_s, self._looked = time_s, False
        self._positions.append((time_s, place))

    def _forget_until(self, time_s: float) -> None:
        """Forget the positions before the last one at or before a time."""
        while len(self._positions) > 1 and self._positions[1][0] <= time_s:
            self._positions.popleft()

    def take(
        self, pieces: int, ahead_s: float = 0.0, silent_s: float = 0.0
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]] | None:
        """Return what was flown in a step, and forget it; None before any position.

        A vehicle whose positions stop coming counts as where it was last, and does not look.

        Args:
            pieces: K.
            ahead_s: Time that has passed since the end of the step: it belongs to later ones.
            silent_s: Time that has passed without reports of the vehicle.

        Returns:
            (K + 1, 2) float64 x and y, m, at equal times, and (K + 1,) bool: whether it looked
            right before the first one and on each piece.
        """
        if not self._positions:
            return None
        times = np.array([time_s for time_s, _ in self._positions])
        x, y, looks = np.array([place for _, place in self._positions]).T
        start_s, end_s = self._start_s, float(times[-1]) - ahead_s
        # Its clock may have gone on without positions, too.
        age_s = self._clock[1] - float(times[-1])
        unknown_s = silent_s + (age_s if 0.0 < age_s <= MAX_SKIP_S else 0.0)
        if unknown_s > LONGEST_GAP_S:
            end_s += unknown_s
        if end_s < start_s and len(times) > 1:
            # Its clock was taken to have gone on without positions, and has not.
            start_s = float(times[0])
        if end_s <= start_s:
            end_s = start_s + self._step_s
        at_s = np.linspace(start_s, end_s, pieces + 1)
        path = np.stack([np.interp(at_s, times, x), np.interp(at_s, times, y)], axis=1)
        looked = np.concatenate([[self._looked], _looked(times, looks > 0.0, at_s)])
        self._forget_until(end_s)
        self._start_s, self._looked = end_s, bool(looked[-1])
        return path, looked


def _looked(
    times: NDArray[np.float64], looks: NDArray[np.bool_], at_s: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return whether a vehicle looked all the time on each piece (K,) between times (K + 1,).

    Args:
        times: (Q,) float64, increasing times of its positions.
        looks: (Q,) bool, whether it could look there.
        at_s: The ends of the pieces.
    """
    begin_s, until_s = at_s[:-1] + _RESOLUTION_S, at_s[1:] - _RESOLUTION_S
    blind = ~(looks[:-1] & looks[1:]) | (np.diff(times) > LONGEST_GAP_S)
    meets = (times[:-1, None] < until_s) & (times[1:, None] > begin_s)
    known = (times[0] <= begin_s) & (until_s <= times[-1])
    return known & ~(meets & blind[:, None]).any(axis=0)


def tilt_deg(orientation: tuple[float, float, float, float]) -> float:
    """Return how far a body's vertical axis is from the vertical; NaN if it is not known.

    Args:
        orientation: Quaternion x, y, z, w, of any length; one of zeros, as in an empty message, is
            level.
    """
    x, y, z, w = orientation
    length = x * x + y * y + z * z + w * w
    if length == 0.0:
        return 0.0
    return math.degrees(math.acos(min(max(1.0 - 2.0 * (x * x + y * y) / length, -1.0), 1.0)))
