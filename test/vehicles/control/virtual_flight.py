# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A controller and a simulated vehicle on a bad link, without sockets, in a time of their own."""

from __future__ import annotations

import heapq
import itertools
import math
import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from autopilot.main import make_vehicle
from autopilot.settings import Settings

from dsse_ros.vehicles.control.commands import ControllerSettings
from dsse_ros.vehicles.control.orders import Order
from dsse_ros.vehicles.control.vehicle_controller import Outcome, VehicleController
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.mavlink.codec import Codec
from dsse_ros.vehicles.mavlink.messages import (
    Address,
    CommandLong,
    Heartbeat,
    Incoming,
    Outgoing,
    SetPositionTarget,
)
from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, MissionItem

VEHICLE, OURSELVES, STATION = Address(1, 1), Address(245, 191), Address(255, 190)
HEARTBEAT = Heartbeat(18, 8, 0, 0, 4, 3)
STEP_S = 0.05


class VirtualFlight:
    """One vehicle, one controller.

    Args:
        autopilot: Which autopilot it has.
        loss: Share of messages that are lost, in each direction.
        duplicate: Share of the others that come twice.
        delay_s: Greatest delay of a message, which may so be overtaken.
        seed: Of the link and of the vehicle.
        vehicle: Fields of the vehicle's `Settings`.
        settings: Fields of `ControllerSettings`.

    Attributes:
        sent: What the controller has sent, with the time.
        heard: How many messages it had received before it sent each of these.
        received: What it has received.
        uplink: Whether messages reach the vehicle.
        seen: What became of its orders, in turn.
    """

    def __init__(
        self,
        autopilot: Any = "ardupilot",
        *,
        loss: float = 0.0,
        duplicate: float = 0.0,
        delay_s: float = 0.0,
        seed: int = 0,
        vehicle: dict[str, Any] | None = None,
        **settings: Any,
    ) -> None:
        options = {"ready_s": 5.0, **(vehicle or {})}
        self.vehicle = make_vehicle(Settings(autopilot=autopilot, seed=seed, **options))
        self._settings = ControllerSettings(autopilot=autopilot, **settings)
        self.controller = VehicleController(VEHICLE, OURSELVES, self._settings)
        self.now, self.uplink = 0.0, True
        self.loss, self.duplicate, self.delay_s = loss, duplicate, delay_s
        self.sent: list[tuple[float, Outgoing]] = []
        self.heard: list[int] = []
        self.received: list[Incoming] = []
        self.seen: list[Outcome] = []
        self._random = random.Random(seed)
        self._codec = Codec(OURSELVES, VEHICLE)
        self._order = itertools.count()
        self._under_way: list[tuple[float, int, bool, bytes]] = []
        self._vehicles = [self.vehicle]
        self._channels = [self._connect(self.vehicle)]
        self._station = Codec(STATION, VEHICLE)
        self._heartbeat_s = 0.0

    def _connect(self, vehicle: Any) -> Any:
        return vehicle.connect(lambda data: self._put(bytes(data), to_vehicle=False), datagram=True)

    def add_twin(self, **settings: Any) -> Any:
        """Return another vehicle with the same system id behind the same link."""
        twin = make_vehicle(replace(self.vehicle.settings, **settings))
        twin.advance(self.now)
        twin.boot_s = self.now
        twin.uid += 1000
        self._vehicles.append(twin)
        self._channels.append(self._connect(twin))
        return twin

    def send_from_station(self, message: Any) -> None:
        """Have another ground station send the vehicle a message."""
        for vehicle, channel in zip(self._vehicles, self._channels, strict=True):
            vehicle.receive(channel, self._station.encode(message))

    # Time

    def step(self) -> None:
        """Let a moment pass."""
        self.now += STEP_S
        for vehicle in self._vehicles:
            vehicle.advance(self.now)
        if self.now >= self._heartbeat_s:
            self._heartbeat_s = self.now + 1.0
            self._put(self._codec.encode(HEARTBEAT), to_vehicle=True)
        while self._under_way and self._under_way[0][0] <= self.now:
            _, _, to_vehicle, data = heapq.heappop(self._under_way)
            if to_vehicle:
                for vehicle, channel in zip(self._vehicles, self._channels, strict=True):
                    vehicle.receive(channel, data)
                continue
            for message in self._codec.decode(data, self.now, datagram=True):
                self.received.append(message)
                self._send(self.controller.receive(message, self.now))
        if self.now >= self.controller.deadline:
            self._send(self.controller.tick(self.now))
            # Its driver would not get any rest.
            assert self.controller.deadline > self.now
        if not self.seen or self.controller.outcome != self.seen[-1]:
            self.seen.append(self.controller.outcome)

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        end_s = self.now + seconds
        while self.now < end_s:
            self.step()

    def restart(self) -> None:
        """Put a new controller in place of the one there is, as when the program is restarted."""
        self.controller = VehicleController(VEHICLE, OURSELVES, self._settings)

    def until(self, condition: Callable[[], Any], limit_s: float = 600.0) -> None:
        """Let time pass until something is true."""
        end_s = self.now + limit_s
        while not condition():
            assert self.now < end_s, f"not within {limit_s:g} s: {self.outcome}, {self.state}"
            self.step()

    # Orders

    def give(self, order: Order, authority: int = 0) -> None:
        """Give an order and go on."""
        self._send(self.controller.give(order, self.now, authority))

    def fly(self, order: Order, limit_s: float = 600.0, authority: int = 0) -> Outcome:
        """Give an order, and return what has become of it in the end."""
        self.give(order, authority)
        self.until(lambda: self.outcome.status not in ("under_way", "silent"), limit_s)
        return self.outcome

    @property
    def outcome(self) -> Outcome:
        """Of the latest order."""
        return self.controller.outcome

    @property
    def state(self) -> VehicleState:
        """As the controller knows it."""
        return self.controller.state

    def statuses(self) -> list[str]:
        """Return what the status has been, in turn."""
        return [status for status, _ in itertools.groupby(one.status for one in self.seen)]

    # The truth

    def place(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Return the place that far from home."""
        lat_deg, lon_deg = self.vehicle.frame.geodetic(north_m, east_m)
        return lat_deg, lon_deg

    def off_m(self, north_m: float, east_m: float) -> float:
        """Return how far the vehicle really is from there."""
        craft = self.vehicle.craft
        return math.hypot(craft.north_m - north_m, craft.east_m - east_m)

    # What was sent

    def commands(self, number: int) -> list[CommandLong]:
        """Return the commands of a kind."""
        return [m for _, m in self.sent if isinstance(m, CommandLong) and m.command == number]

    def setpoints(self) -> list[SetPositionTarget]:
        """Return all setpoints."""
        return [message for _, message in self.sent if isinstance(message, SetPositionTarget)]

    def _send(self, messages: list[Outgoing]) -> None:
        for message in messages:
            self.sent.append((self.now, message))
            self.heard.append(len(self.received))
            self._put(self._codec.encode(message), to_vehicle=True)

    def _put(self, data: bytes, *, to_vehicle: bool) -> None:
        if to_vehicle and not self.uplink:
            return
        draw = self._random.random
        copies = 0 if draw() < self.loss else 2 if draw() < self.duplicate else 1
        for _ in range(copies):
            entry = (self.now + draw() * self.delay_s, next(self._order), to_vehicle, data)
            heapq.heappush(self._under_way, entry)


def mission(
    flight: VirtualFlight, *places: tuple[float, float, float], hold_s: float = 0.0
) -> tuple[MissionItem, ...]:
    """Return a mission of places, north, east and up of home: take-off, waypoints, return."""

    def item(
        command: int, north_m: float, east_m: float, up_m: float, **fields: Any
    ) -> MissionItem:
        lat_deg, lon_deg = flight.place(north_m, east_m)
        return MissionItem(command, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=up_m, **fields)

    items: list[MissionItem] = []
    if flight.vehicle.settings.autopilot == "ardupilot":
        items.append(item(16, 0.0, 0.0, 0.0))
    items.append(item(22, 0.0, 0.0, places[0][2]))
    for place in places:
        items.append(item(16, *place, param1=hold_s))
    items.append(MissionItem(20, FRAME_MISSION))
    return tuple(items)
