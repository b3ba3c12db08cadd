# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The last order that a vehicle was given, and what has become of it."""

from __future__ import annotations

from dsse_ros.flight.orders import FlyMission
from dsse_ros.flight.vehicle_controller import Order, Outcome

TRIES = 3
"""How often a failing order is given."""
RETRY_S = 5.0


class GivenOrder:
    """The last order of a vehicle; none, or a void one, before the first.

    Attributes:
        order: The order; None if there is none, or it is void.
        wanted: The wanted order for which it was given, and the stamp of its leg if each leg needs
            the order again.
        done: Whether the vehicle has done it.
        tries: How often it was given.
        failed_s: When it failed; None if it has not.
    """

    def __init__(self) -> None:
        self.order: Order | None = None
        self.wanted: tuple[Order, int] | None = None
        self.done = False
        self.tries = 0
        self.failed_s: float | None = None

    def give(self, order: Order, wanted: tuple[Order, int]) -> None:
        """Replace the order, or give it again."""
        self.tries = self.tries + 1 if wanted == self.wanted else 1
        self.order, self.wanted = order, wanted
        self.done, self.failed_s = False, None

    def look(self, outcome: Outcome, now_s: float) -> bool:
        """Handle the outcome of the order; returns whether it has just failed permanently."""
        if self.order is None or outcome.order != self.order:
            return False
        self.done = outcome.status == "done"
        if outcome.status != "failed" or self.failed_s is not None:
            return False
        self.failed_s = now_s
        # A mission that is started again would fly the whole search again.
        return self.tries >= TRIES or outcome.final or isinstance(self.order, FlyMission)

    def is_due_again(self, now_s: float) -> bool:
        """Return whether it has failed, and may be given once more."""
        return self.failed_s is not None and now_s - self.failed_s >= RETRY_S

    def was_given_for(self, order: Order) -> bool:
        """Return whether it was given for a wanted order, whichever leg."""
        return self.wanted is not None and self.wanted[0] == order

    @property
    def under_way(self) -> Order | None:
        """The order while the vehicle is carrying it out; else None."""
        return None if self.done else self.order
