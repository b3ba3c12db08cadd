# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A vehicle of a fleet with its dispatcher: what concerns it alone, beside the choice of orders."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dsse_ros.base.defects import Defects, describe
from dsse_ros.vehicles.control.orders import FlyMission, Hold
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.fleet.custody import MAY_ORDER, Custody
from dsse_ros.vehicles.fleet.flight_record import FlightRecord
from dsse_ros.vehicles.fleet.flight_records import FlightRecords
from dsse_ros.vehicles.fleet.notices import Level, Log, Notices
from dsse_ros.vehicles.fleet.vehicle_dispatcher import VehicleDispatcher

if TYPE_CHECKING:
    from dsse_ros.vehicles.control.vehicle import Vehicle

_NOT_ENDED = ("under_way", "silent", "done", "failed")


class FleetVehicle:
    """A vehicle, and what makes it follow its drone.

    Args:
        number: Number of the drone.
        vehicle: The vehicle.
        dispatcher: Its dispatcher.
        log: Takes log lines.

    Attributes:
        number: Number of the drone.
        name: Name of the drone.
        vehicle: The vehicle.
        dispatcher: Its dispatcher.
    """

    def __init__(
        self, number: int, vehicle: Vehicle, dispatcher: VehicleDispatcher, log: Log
    ) -> None:
        self.number, self.name = number, f"drone{number}"
        self.vehicle, self.dispatcher = vehicle, dispatcher
        self._log = log
        self._notices = Notices(log)
        # The id with which it has been identified.
        self._uid: str | None = None
        self._defects = Defects()
        self._adopt()
        if dispatcher.custody.state is not Custody.FREE:
            log("warning", f"{self.name}: {self._shown}, from an earlier flight")

    def _adopt(self) -> None:
        """Count the modes that an earlier program has set as those of the bridge."""
        record = self.dispatcher.custody.record
        for mode in filter(None, (record.mode, *record.ordered)):
            self.vehicle.adopt(mode)

    def identify(self, records: FlightRecords | None) -> None:
        """Recognise that another vehicle has been connected, and take its record."""
        uid = self.vehicle.state.identity.uid
        if uid is None or uid == self._uid:
            return
        first, self._uid = self._uid is None, uid
        known = self.dispatcher.custody.record
        record = FlightRecord() if records is None else records.identify(self.number, uid)
        if record != known and not (first and records is None):
            self._log("warning", f"{self.name}: another vehicle is connected")
            self.dispatcher.replace_vehicle(record)
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
            self.dispatcher.custody.drop_out(why)

    def call_off(self) -> None:
        """Cancel an order that is no longer allowed."""
        custody, outcome = self.dispatcher.custody.state, self.vehicle.outcome
        # A completed order may continue as a stream of setpoints, except on the ground.
        ends = ("under_way", "silent") if custody is Custody.GROUNDED else _NOT_ENDED
        # Without a link the vehicle cannot get the next order, and would first go on with this one.
        void = not MAY_ORDER[custody] or (
            outcome.order != self.dispatcher.given_order.order and not self.vehicle.state.connected
        )
        leaves = isinstance(outcome.order, Hold) and outcome.status in ("under_way", "silent")
        if void and not leaves and outcome.order is not None and outcome.status in ends:
            self.vehicle.release()

    def give(self, order: Order) -> None:
        """Give the vehicle an order."""
        number = self.vehicle.give(order, self.dispatcher.custody.authority)
        self._log("info", f"{self.name}: order {number}: {shown_order(order)}")

    def log_news(self, before: Custody, now_s: float) -> None:
        """Log what is new about the vehicle.

        Args:
            before: Who controlled it before.
            now_s: Time on a steady clock.
        """
        dispatcher = self.dispatcher
        if dispatcher.custody.state is not before:
            self._log("info", f"{self.name}: {before.value} -> {self._shown}")
        notices: tuple[tuple[Level, str, str | None], ...] = (
            ("error", " is lost: ", dispatcher.lost),
            ("warning", ": ", dispatcher.refused),
            ("info", " waits: ", dispatcher.blocked),
            ("warning", ": ", dispatcher.leaves_layer),
            ("warning", " ", dispatcher.unplaced),
            ("warning", " ", dispatcher.strays),
            ("warning", " ", dispatcher.pace_watch.slow),
            ("warning", ": ", self.vehicle.trouble),
        )
        for level, what, reason in notices:
            if reason:
                self._notices.show(level, f"{self.name}{what}{reason}", now_s)
        for text in self.vehicle.take_texts():
            self._log("info", f"{self.name}: STATUSTEXT {text.text}")

    @property
    def _shown(self) -> str:
        record, custody = self.dispatcher.custody.record, self.dispatcher.custody.state
        if record.lost and custody.value in record.lost:
            return record.lost  # such as "taken over: in LOITER"
        if custody is Custody.CLEARED:
            return f"{custody.value} by {record.cleared_by}"
        return f"{custody.value}: {record.lost}" if record.lost else custody.value


def shown_order(order: Order | None) -> str:
    """Return an order as one line, with the number of items for a mission."""
    if order is None:
        return ""
    return (
        f"FlyMission of {len(order.items)} items" if isinstance(order, FlyMission) else repr(order)
    )
