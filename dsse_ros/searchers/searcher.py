# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of a searcher: how fast and how high a kind of drone flies, and what it sees."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Searcher:
    """A kind of drone; None stands for what the scenario says of its drones.

    Attributes:
        doc: What it is, without a subject.
        speed: Airspeed, m/s; without wind also that over the ground.
        altitude: Height above the sea, m.
        endurance_min: How long it can fly, minutes, where batteries do not run down.
        sensor: Name of its sensor, see `sensors.registry`.
        moves: Names of the actions that it can do beside `search`.
    """

    doc: str
    speed: float | None = None
    altitude: float | None = None
    endurance_min: float | None = None
    sensor: str | None = None
    moves: tuple[str, ...] | None = None
