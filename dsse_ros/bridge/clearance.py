# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Clearance of a vehicle: what the other vehicles and the search allow it to do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dsse_ros.flight.orders import GoTo
from dsse_ros.flight.vehicle_controller import Order


@dataclass(frozen=True)
class Clearance:
    """Permissions of a vehicle, from the other vehicles and the search.

    Attributes:
        search_alive: Whether the search is running; without it no vehicle takes off.
        take_off: Why the vehicle must not take off yet; empty if it may.
        home: Place to fly to, at its altitude, before it comes down there; None to come down at
            once.
        admit: Returns the order to give instead of the wanted one, or why that has to wait.
        intruder: Returns why an order under way has to be interrupted; empty if it goes on.
    """

    search_alive: bool = True
    take_off: str = ""
    home: GoTo | None = None
    admit: Callable[[Order], Order | str] = lambda order: order
    intruder: Callable[[Order | None], str] = lambda order: ""
