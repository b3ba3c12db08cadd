# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of a searcher: how a kind of drone flies, and with which sensor."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.world.sensors.sensor import SEARCH


@dataclass(frozen=True, kw_only=True)
class Searcher:
    """A kind of drone; None means the scenario's value.

    In a search on cells the values from `min_speed` on have no effect; one in metres refuses
    `moves`, an endurance and another altitude for searches.

    Attributes:
        doc: Description of the kind, as a phrase without a subject.
        speed: Airspeed, m/s; without wind also the ground speed.
        altitude: Height above the sea, m.
        endurance_min: Flight time in minutes, used if batteries do not run down.
        sensor: Name of its sensor, see `sensors.registry`.
        moves: Names of the actions that it can do besides `search`.
        search_altitude: Height above the sea, m, from which a search looks; None for its altitude.
        descent_speed: Speed at which it comes down to search, m/s.
        climb_speed: Speed at which it climbs afterwards, m/s.
        search_time: Time for which a search looks from `search_altitude`, s.
        min_speed: Lowest airspeed, m/s; that of an aircraft that cannot hover is above 0.
        turn_radius: Radius of the tightest turn, m; 0 turns on the spot.
        acceleration: Greatest change of the velocity, m/s^2; None changes it at once.
    """

    doc: str
    speed: float | None = None
    altitude: float | None = None
    endurance_min: float | None = None
    sensor: str | None = None
    moves: tuple[str, ...] | None = None
    search_altitude: float | None = None
    descent_speed: float = 2.0
    climb_speed: float = 3.0
    search_time: float = 5.0
    min_speed: float = 0.0
    turn_radius: float = 0.0
    acceleration: float | None = None

    def can_do(self, action: str) -> bool:
        """Return whether the kind can do an action, by its name."""
        return self.moves is None or action in (*self.moves, SEARCH)
