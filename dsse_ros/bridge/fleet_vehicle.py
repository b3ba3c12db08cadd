# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A vehicle of a fleet with its follower: what concerns it alone, beside the choice of orders."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal

from dsse_ros.bridge.custody import MAY_ORDER, Custody
from dsse_ros.bridge.flight_record import FlightRecord
from dsse_ros.bridge.flight_records import FlightRecords
from dsse_ros.bridge.vehicle_follower import VehicleFollower
from dsse_ros.defects import Defects, describe
from dsse_ros.flight.orders import FlyMission, Hold
from dsse_ros.flight.vehicle_controller import Order

if TYPE_CHECKING:
    from dsse_ros.flight.vehicle import Vehicle

Level = Literal["debug", "info", "warning", "error"]
Log = Callable[[Level, str], None]

_NEWS: tuple[tuple[Level, str], ...] = (
    ("error", " is lost"), ("warning", ""), ("info", " waits"), ("warning", "")
)  # fmt: skip
"""How news of a vehicle are logged: why it is lost, refused, blocked, and where it returns."""
_NOT_ENDED = ("under_way", "silent", "done", "failed")


class FleetVehicle:
    """A vehicle, and what makes it follow its drone.

    Args:
        number: Number of the drone.
        vehicle: The vehicle.
        follower: Its follower.
        log: Takes log lines.

    Attributes:
        number: Number of the drone.
        name: Name of the drone.
        vehicle: The vehicle.
        follower: Its follower.
    """

    def __init__(self, number: int, vehicle: Vehicle, follower: VehicleFollower, log: Log) -> None:
        self.number, self.name = number, f"drone{number}"
        self.vehicle, self.follower = vehicle, follower
        self._log = log
        # The id with which it has been identified.
        self._uid: str | None = None
        self._defects = Defects()
        # The last logged reasons: see `_NEWS`.
        self._logged = ("",) * len(_NEWS)
        self._adopt()
        if follower.custody.state is not Custody.FREE:
            log("warning", f"{self.name}: {self._shown}, from an earlier flight")

    def _adopt(self) -> None:
        """Count the modes that an earlier program has set as those of the bridge."""
        record = self.follower.custody.record
        for mode in filter(None, (record.mode, *record.ordered)):
            self.vehicle.adopt(mode)

    def identify(self, records: FlightRecords | None) -> None:
        """Recognise that another vehicle is connected than the one whose record is known."""
        uid = self.vehicle.state.identity.uid
        if uid is None or uid == self._uid:
            return
        first, self._uid = self._uid is None, uid
        known = self.follower.custody.record
        record = FlightRecord() if records is None else records.identify(self.number, uid)
        if record != known and not (first and records is None):
            self._log("warning", f"{self.name}: another vehicle is connected")
            self.follower.replace_vehicle(record)
            self._adopt()

    @contextmanager
    def isolated(self) -> Iterator[None]:
        """Act for the vehicle; if that raises, only this vehicle drops out."""
        try:
            yield
        except Exception as error:
            why = f"defect: {describe(error)}"
            if self._defects.is_new(error):
                self._log("error", f"{self.name}: {why}")
                self._log("debug", traceback.format_exc())
            self.follower.custody.drop_out(why)

    def call_off(self) -> None:
        """Cancel an order that is no longer allowed."""
        custody, outcome = self.follower.custody.state, self.vehicle.outcome
        # A completed order may continue as a stream of setpoints, except on the ground.
        ends = ("under_way", "silent") if custody is Custody.GROUNDED else _NOT_ENDED
        # Without a link the vehicle cannot get the next order, and would first go on with this one.
        void = not MAY_ORDER[custody] or (
            outcome.order != self.follower.given_order.order and not self.vehicle.state.connected
        )
        leaves = isinstance(outcome.order, Hold) and outcome.status in ("under_way", "silent")
        if void and not leaves and outcome.order is not None and outcome.status in ends:
            self.vehicle.release()

    def give(self, order: Order) -> None:
        """Give the vehicle an order."""
        number = self.vehicle.give(order, self.follower.custody.authority)
        self._log("info", f"{self.name}: order {number}: {shown_order(order)}")

    def log_news(self, before: Custody) -> None:
        """Log what is new about the vehicle, which somebody had in custody before."""
        follower = self.follower
        if follower.custody.state is not before:
            self._log("info", f"{self.name}: {before.value} -> {self._shown}")
        reasons = (follower.lost, follower.refused, follower.blocked, follower.leaves_layer)
        for (level, what), reason, logged in zip(_NEWS, reasons, self._logged, strict=True):
            if reason and reason != logged:
                self._log(level, f"{self.name}{what}: {reason}")
        self._logged = reasons
        for text in self.vehicle.take_texts():
            self._log("info", f"{self.name}: STATUSTEXT {text.text}")

    @property
    def _shown(self) -> str:
        record = self.follower.custody.record
        if record.custody.value in record.lost:
            return record.lost  # such as "taken over: in LOITER"
        return f"{record.custody.value}: {record.lost}" if record.lost else record.custody.value


def shown_order(order: Order | None) -> str:
    """Return an order as one line, with the number of items for a mission."""
    if order is None:
        return ""
    return (
        f"FlyMission of {len(order.items)} items" if isinstance(order, FlyMission) else repr(order)
    )
