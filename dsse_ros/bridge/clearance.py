# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle may do in view of the others and of the search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dsse_ros.flight.orders import GoTo
from dsse_ros.flight.vehicle_controller import Order


def _admit(order: Order) -> Order | str:
    return order


@dataclass(frozen=True)
class Clearance:
    """What a vehicle may do in view of the others and of the search.

    Attributes:
        search_alive: Whether the search is there; without it nothing takes off.
        take_off: Why it must not take off yet, as others cannot; empty if it may.
        home: Where to fly, at its altitude, before it comes down there; None to come down at once.
        admit: Returns the order to give in place of one, or why it has to wait.
    """

    search_alive: bool = True
    take_off: str = ""
    home: GoTo | None = None
    admit: Callable[[Order], Order | str] = _admit
