# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A vehicle on the bench: no process, no socket, and time passes in `wait` and `until` alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from .commands import ACCEPTED
from .main import make_vehicle
from .mission_items import Item
from .settings import Settings
from .vehicle import TICK_S, Vehicle
from .wire import Codec, Message, mavlink

GUIDED, AUTO, LOITER, RTL = 4, 3, 5, 6
"""Modes of ArduCopter, as HEARTBEAT.custom_mode has them."""

POSITION_ONLY = 3576
"""Type mask of a setpoint that is a position and nothing else."""


class Bench:
    """A vehicle and a ground station.

    Args:
        settings: Fields of `Settings`.

    Attributes:
        vehicle: The vehicle.
        received: Messages that the ground station has received, oldest first.
        sent: The same as bytes.
    """

    def __init__(self, **settings: Any) -> None:
        self.vehicle: Vehicle = make_vehicle(Settings(**settings))
        self.received: list[Message] = []
        self.sent: list[bytes] = []
        self._codecs: dict[tuple[int, int], Codec] = {}
        self._receiver = Codec(200, self.vehicle.settings.key)
        self.channel = self.vehicle.connect(self._receive, datagram=True)

    def _receive(self, data: bytes) -> None:
        self.sent.append(data)
        self.received += self._receiver.decode_all(data, datagram=True)

    # Time

    def wait(self, seconds: float) -> None:
        """Let vehicle time pass."""
        self.vehicle.advance(self.vehicle.time_s + seconds)

    def until(self, condition: Callable[[], Any], limit_s: float = 600.0) -> float:
        """Let time pass until something is true, and return how much has passed."""
        start_s = self.vehicle.time_s
        while not condition():
            assert self.vehicle.time_s - start_s < limit_s, f"not within {limit_s} s"
            self.wait(TICK_S)
        return self.vehicle.time_s - start_s

    def top_m_until_landed(self) -> float:
        """Let time pass until the vehicle has landed, and return how high it was."""
        top_m = 0.0

        def landed() -> bool:
            nonlocal top_m
            top_m = max(top_m, self.vehicle.craft.up_m)
            return self.vehicle.landed

        self.until(landed)
        return top_m

    # Sending

    def send(self, message: Message, system: int = 255, component: int = 190) -> None:
        """Send a message to the vehicle."""
        key = (system, component)
        if key not in self._codecs:
            self._codecs[key] = Codec(system, self.vehicle.settings.key)
            self._codecs[key].srcComponent = component
        self.vehicle.receive(self.channel, self._codecs[key].encode(message))

    def command(self, number: int, *parameters: float, target: int | None = None) -> int | None:
        """Send a COMMAND_LONG and return the result of its acknowledgement, if there is one."""
        numbers = [*parameters, *[0.0] * (7 - len(parameters))]
        target = self.vehicle.settings.system if target is None else target
        return self._acknowledged(
            mavlink.MAVLink_command_long_message(target, 1, number, 0, *numbers)
        )

    def command_at(
        self, number: int, lat_deg: float, lon_deg: float, z: float, *, frame: int, param2: float
    ) -> int | None:
        """Send a COMMAND_INT with a place, and return the result."""
        return self._acknowledged(
            mavlink.MAVLink_command_int_message(
                self.vehicle.settings.system, 1, frame, number, 0, 0, -1.0, param2, 0.0, math.nan,
                round(lat_deg * 1e7), round(lon_deg * 1e7), z,
            )
        )  # fmt: skip

    def _acknowledged(self, message: Message) -> int | None:
        before = len(self.received)
        self.send(message)
        acks = [m for m in self.received[before:] if m.get_type() == "COMMAND_ACK"]
        return acks[-1].result if acks else None

    def setpoint(
        self, north_m: float, east_m: float, alt_m: float, frame: int = 6, target: int = 1
    ) -> None:
        """Send a SET_POSITION_TARGET_GLOBAL_INT for a place that many metres from home."""
        lat_deg, lon_deg = self.vehicle.frame.geodetic(north_m, east_m)
        self.send(
            mavlink.MAVLink_set_position_target_global_int_message(
                0, target, 1, frame, POSITION_ONLY, round(lat_deg * 1e7), round(lon_deg * 1e7),
                alt_m, *[0.0] * 8,
            )
        )  # fmt: skip

    def stream(self, message_id: int, rate_hz: float) -> None:
        """Request messages of a kind."""
        assert self.command(511, message_id, 1e6 / rate_hz) == ACCEPTED

    # Receiving

    def all(self, kind: str) -> list[Message]:
        """Return the messages of a kind."""
        return [message for message in self.received if message.get_type() == kind]

    def last(self, kind: str) -> Message:
        """Return the last message of a kind."""
        return self.all(kind)[-1]

    def texts(self) -> list[str]:
        """Return all status texts."""
        return [message.text for message in self.all("STATUSTEXT")]

    # Flying

    def fly_to_altitude(self, up_m: float = 20.0) -> None:
        """Wait until it is ready, and take off: ArduCopter in GUIDED, PX4 then in HOLD."""
        self.until(lambda: self.vehicle.ready)
        if self.vehicle.settings.autopilot == "ardupilot":
            assert self.command(176, 1, GUIDED) == ACCEPTED
        assert self.command(400, 1) == ACCEPTED
        open_ = math.nan
        above_sea = self.vehicle.settings.autopilot == "px4"
        z = up_m + (self.vehicle.settings.home.alt_amsl_m if above_sea else 0.0)
        assert self.command(22, 0, 0, 0, open_, open_, open_, z) == ACCEPTED
        self.until(lambda: self.vehicle.craft.up_m > up_m - 0.3)
        self.wait(5.0)

    # Missions

    def send_count(self, items: Sequence[Item], system: int = 255) -> None:
        """Start an upload without sending an item."""
        self.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0), system)

    def send_item(self, items: Sequence[Item], seq: int, system: int = 255) -> None:
        """Send one item."""
        self.send(items[seq].message(seq, 0, (1, 1), current=False, floats=False), system)

    def upload(self, items: Sequence[Item]) -> int:
        """Send a mission, and return the MISSION_ACK's type."""
        before = len(self.received)
        self.send_count(items)
        for seq in range(len(items)):
            self.send_item(items, seq)
        acks = [m for m in self.received[before:] if m.get_type() == "MISSION_ACK"]
        result: int = acks[-1].type
        return result

    def download(self) -> list[Item]:
        """Read the mission back."""
        before = len(self.received)
        self.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
        count = self.last("MISSION_COUNT").count
        for seq in range(count):
            self.send(mavlink.MAVLink_mission_request_int_message(1, 1, seq, 0))
        self.send(mavlink.MAVLink_mission_ack_message(1, 1, 0, 0))
        got = [m for m in self.received[before:] if m.get_type() == "MISSION_ITEM_INT"]
        return [Item.received(message) for message in got]

    def item(
        self, command: int, north_m: float = 0.0, east_m: float = 0.0, z: float = 0.0, **fields: Any
    ) -> Item:
        """Return an item that many metres from home; `fields` are those of `Item`."""
        lat_deg, lon_deg = self.vehicle.frame.geodetic(north_m, east_m)
        values: dict[str, Any] = {
            "frame": 6, "command": command, "autocontinue": 1, "param1": 0.0, "param2": 0.0,
            "param3": 0.0, "param4": 0.0, "x": round(lat_deg * 1e7), "y": round(lon_deg * 1e7),
            "z": z,
        }  # fmt: skip
        return Item(**(values | fields))

    def mission(self, *places: tuple[float, float, float], hold_s: float = 0.0) -> list[Item]:
        """Return home, a take-off to 20 m, waypoints north, east and up of home, and the return."""
        way = [self.item(16, *place, param1=hold_s, param2=2.0) for place in places]
        home_item = self.item(16, frame=0)
        take_off = self.item(22, z=20.0)
        return_item = self.item(20, x=0, y=0)
        return [home_item, take_off, *way, return_item]
