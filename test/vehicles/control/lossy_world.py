# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A vehicle, a bad link to it and a clock that jumps from event to event."""

from __future__ import annotations

import heapq
import random
from dataclasses import dataclass
from itertools import count

from mission_vehicle import VEHICLE, MissionVehicle

from dsse_ros.vehicles.control.transfer import Done, Failed, Transfer
from dsse_ros.vehicles.control.upload import VerifiedUpload
from dsse_ros.vehicles.mavlink.messages import Address, MissionMessage

OURSELVES = Address(245, 191)
Exchange = Transfer | VerifiedUpload


@dataclass(frozen=True)
class Channel:
    """Faults of a link, by message.

    Attributes:
        loss: Share of messages that are lost.
        duplicate: Share of the others that arrive twice.
        reorder: Share of copies that are overtaken by others.
        delay_s: Least delay.
        late_s: Greatest further delay of a copy that is overtaken.
    """

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay_s: float = 0.01
    late_s: float = 0.4


class World:
    """One vehicle behind a channel, both driven by a seed.

    Attributes:
        now: Seconds since the start.
    """

    def __init__(self, vehicle: MissionVehicle, channel: Channel, seed: int) -> None:
        self.vehicle = vehicle
        self.channel = channel
        self.now = 0.0
        self._random = random.Random(seed)
        self._order = count()
        self._in_transit: list[tuple[float, int, MissionMessage]] = []

    def run(self, exchange: Exchange, horizon_s: float = 1e4) -> Done | Failed:
        """Drive an exchange from its start to its end."""
        self.send(exchange.start(self.now))
        end = self.now + horizon_s
        while exchange.result is None:
            assert self.step(exchange, end), f"no end within {horizon_s} s"
        return exchange.result

    def step(self, exchange: Exchange, end: float = 1e9) -> bool:
        """Process the next event, if there is one before the end."""
        times = [self.vehicle.deadline, exchange.deadline]
        if self._in_transit:
            times.append(self._in_transit[0][0])
        now = min(time for time in [*times, end] if time is not None)
        self.now = max(self.now, now)
        if now >= end:
            return False
        if self._in_transit and self._in_transit[0][0] <= now:
            self._deliver(heapq.heappop(self._in_transit)[2], exchange)
        elif exchange.deadline is not None and exchange.deadline <= now:
            self.send(exchange.tick(now))
        else:
            self.send(self.vehicle.tick(now))
        return True

    def send(self, messages: list[MissionMessage]) -> None:
        """Put messages on the link; each has its target."""
        channel, draw = self.channel, self._random.random
        for message in messages:
            if draw() < channel.loss:
                continue
            for _ in range(1 + (draw() < channel.duplicate)):
                late_s = draw() * channel.late_s if draw() < channel.reorder else 0.0
                arrival = self.now + channel.delay_s + late_s
                heapq.heappush(self._in_transit, (arrival, next(self._order), message))

    def _deliver(self, message: MissionMessage, exchange: Exchange) -> None:
        if (message.target_system, message.target_component) == VEHICLE:
            self.send(self.vehicle.receive(message, OURSELVES, self.now))
        else:
            self.send(exchange.receive(message, VEHICLE, self.now))
