# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The wind in which the vehicles of a search fly, as they report it or as it slows them down."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from statistics import fmean, median
from typing import NamedTuple

from dsse_ros.vehicles.control.orders import FlyTrack
from dsse_ros.vehicles.control.vehicle_state import VehicleState

AVERAGED_S = 30.0
"""Time over which the wind is averaged."""
CHANGE_MPS = 1.0
"""Difference from the wind of the search from which on the wind is news."""
_LEAST_MPS = 0.05
"""ArduCopter reports a wind of 0 unless it estimates one, which it does not by default."""
_STEADY_S = 8.0
_STEADY_MPS = 1.0
"""Greatest difference from the mean of the velocities in that time."""
_STANDS_MPS = 0.5
"""Speed below which a vehicle stands, as without a link, and says nothing about the wind."""
_SLOW = 0.85
"""Share of the planned speed below which the wind slows a vehicle down."""
Velocity = tuple[float, float]
"""Speeds to the east and to the north, m/s."""


class InFlight(NamedTuple):
    """A vehicle that follows its drone.

    Attributes:
        state: What it reports.
        track: The track that it flies; None if it does something else.
        airspeed_mps: Airspeed of its drone at cruise.
    """

    state: VehicleState
    track: FlyTrack | None
    airspeed_mps: float


class FleetWind:
    """Averages the wind over the vehicles and over time.

    The wind is the median of those reported. If no vehicle reports one, it is the wind nearest to
    the last one in which the vehicles would fly as they do: against it no faster through the air
    than their drones, and exactly as fast if they are slower than planned.
    """

    def __init__(self) -> None:
        self._winds: deque[tuple[float, Velocity]] = deque()
        self._flights: dict[int, deque[tuple[float, Velocity, bool]]] = {}
        self._derived: Velocity | None = None
        self._sent_s = -math.inf

    def update(self, flying: Mapping[int, InFlight], now_s: float) -> None:
        """Take what the vehicles report that follow their drones, by their numbers."""
        reported = list(_reported(flying.values()))
        if not flying:
            self._derived = None
        self._flights = {n: past for n, past in self._flights.items() if n in flying}
        for number, vehicle in flying.items():
            self._derive(number, vehicle)
        winds = reported or ([] if self._derived is None else [self._derived])
        if winds:
            east, north = (median(parts) for parts in zip(*winds, strict=True))
            self._winds.append((now_s, (east, north)))
        while self._winds and now_s - self._winds[0][0] > AVERAGED_S:
            self._winds.popleft()

    def news(self, flown_in: Velocity, now_s: float) -> Velocity | None:
        """Return the wind if it is another one than that of the search, and has been for a while.

        It is returned again if the search does not take it.

        Args:
            flown_in: The wind of the search.
            now_s: Time of the last update.
        """
        if not self._winds or now_s - self._winds[0][0] < 0.9 * AVERAGED_S:
            return None
        east, north = (
            round(fmean(parts), 1) for parts in zip(*(wind for _, wind in self._winds), strict=True)
        )
        if math.dist((east, north), flown_in) < CHANGE_MPS or now_s - self._sent_s < AVERAGED_S:
            return None
        self._sent_s = now_s
        return east, north

    def _derive(self, number: int, vehicle: InFlight) -> None:
        """Take up what a steady flight says about the wind."""
        state, track = vehicle.state, vehicle.track
        past = self._flights.setdefault(number, deque())
        if track is None or vehicle.airspeed_mps <= 0.0:
            past.clear()
            return
        if past and past[-1][0] == state.boot_s:
            return
        north, east = state.velocity_mps
        # Downwind it is no faster over ground than its parameters allow.
        limit = state.speed_limit_mps if state.speed_limit_mps > 0.0 else math.inf
        planned = min(track.speed_mps, limit)
        past.append((state.boot_s, (east, north), math.hypot(east, north) < _SLOW * planned))
        while len(past) > 1 and past[-1][0] - past[1][0] >= _STEADY_S:
            past.popleft()
        if not past[-1][0] - past[0][0] >= _STEADY_S:
            return
        ground = fmean(v[0] for _, v, _ in past), fmean(v[1] for _, v, _ in past)
        steady = all(math.dist(velocity, ground) < _STEADY_MPS for _, velocity, _ in past)
        if not steady or math.hypot(*ground) < _STANDS_MPS:
            return
        slow = all(is_slow for *_, is_slow in past)
        if slow or self._derived is not None:
            self._derived = _nearest(
                self._derived or (0.0, 0.0), ground, vehicle.airspeed_mps, slow=slow
            )


def _reported(flying: Iterable[InFlight]) -> Iterable[Velocity]:
    """Return the winds that vehicles report."""
    for vehicle in flying:
        wind = vehicle.state.wind
        if wind is not None and math.hypot(*wind) > _LEAST_MPS:
            yield wind


def _nearest(wind: Velocity, ground: Velocity, airspeed_mps: float, *, slow: bool) -> Velocity:
    """Return the wind nearest to one in which a vehicle would fly as it does.

    Args:
        wind: The wind.
        ground: Velocity of the vehicle over ground.
        airspeed_mps: Its greatest airspeed.
        slow: Whether it flies as fast as it can.
    """
    east, north = wind[0] - ground[0], wind[1] - ground[1]
    length = math.hypot(east, north)
    if length == 0.0 or (length <= airspeed_mps and not slow):
        return wind
    share = airspeed_mps / length
    return ground[0] + share * east, ground[1] + share * north
