# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far a vehicle is: with the leg of its drone, and with its last order."""

from __future__ import annotations

from typing import NamedTuple

from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.vehicles.control.orders import FlyMission
from dsse_ros.vehicles.control.vehicle_controller import Order, Outcome
from dsse_ros.vehicles.fleet.layer import Task
from dsse_ros.vehicles.mission_items.track_missions import VehicleLeg

TRIES = 3
"""How often a failing order is given."""
RETRY_S = 5.0


class Wanted(NamedTuple):
    """A wanted order.

    Attributes:
        order: The order.
        number: Number of the leg if each leg needs the order again; else 0.
    """

    order: Order
    number: int = 0


class LegProgress:
    """Goes through the task for a leg, one order after the other.

    Attributes:
        leg: The current leg, None before the first step.
        task: Its task; empty if it is not known or refused.
        refused: Why the vehicle may not do the task; None if it may.
        arrived: Whether the vehicle has done all of it.
        holding: Whether the vehicle holds until the next leg.
        late: Whether the search was already over at the first leg.
    """

    def __init__(self) -> None:
        self.leg: VehicleLeg | None = None
        self.task: Task = ()
        self.refused: str | None = None
        self.arrived = False
        self.holding = False
        self.late = False
        self._stage = 0

    def follow(self, leg: VehicleLeg, task: Result[Task] | None, looked: int) -> None:
        """Replace the leg and its task.

        Args:
            leg: The leg.
            task: The task, or why the vehicle may not do it; None if it is not known yet.
            looked: Number of the leg for which the vehicle has searched last.
        """
        before = self.leg
        known = self.has_task or task is None
        if before and known and leg.is_same(before):
            # Only the end of the search may be new.
            self.leg = leg
            return
        self.leg, self.holding, self.arrived = leg, False, False
        self.task = task.value if isinstance(task, Accepted) else ()
        self.refused = task.reason if isinstance(task, Rejected) else None
        self._stage = 1 if looked == leg.number and len(self.task) > 1 else 0
        if before is None:
            self.late = leg.over

    def advance(self) -> None:
        """Go on to the next order of the task; after the last one, the vehicle has arrived."""
        if self._stage + 1 < len(self.task):
            self._stage += 1
        else:
            self.arrived = True

    @property
    def due(self) -> Order | None:
        """The order of the task that is due; None without a task."""
        return self.task[self._stage] if self.task else None

    @property
    def has_task(self) -> bool:
        """Whether the task for the leg is known, even if it is refused."""
        return bool(self.task or self.refused)

    @property
    def number(self) -> int:
        """Number of the leg; 0 without a leg."""
        return self.leg.number if self.leg is not None else 0

    @property
    def looked(self) -> bool:
        """Whether the vehicle has searched, or has arrived where it looks on the way."""
        return self.arrived or self._stage > 0


class GivenOrder:
    """The last order of a vehicle; none, or a void one, before the first.

    Attributes:
        order: The order; None if there is none, or it is void.
        wanted: For which it was given.
        done: Whether the vehicle has done it.
        tries: How often it was given.
        failed_s: When it failed; None if it has not.
    """

    def __init__(self) -> None:
        self.order: Order | None = None
        self.wanted: Wanted | None = None
        self.done = False
        self.tries = 0
        self.failed_s: float | None = None

    def give(self, order: Order, wanted: Wanted) -> None:
        """Replace the order, or give it again."""
        self.tries = self.tries + 1 if wanted == self.wanted else 1
        self.order, self.wanted = order, wanted
        self.done, self.failed_s = False, None

    def take_outcome(self, outcome: Outcome, now_s: float) -> bool:
        """Take the outcome of the order; return whether it has just failed permanently."""
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
        return self.wanted is not None and self.wanted.order == order

    @property
    def under_way(self) -> Order | None:
        """The order while the vehicle is carrying it out; else None."""
        return None if self.done else self.order
