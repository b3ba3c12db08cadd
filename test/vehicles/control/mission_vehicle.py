# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The vehicle's side of the mission protocol, as ArduPilot and PX4 implement it.

Both are stricter than a real ArduPilot in one thing: a new mission takes the place of the old one
only when it is complete.
"""

from __future__ import annotations

import math

from message_values import changed, item_int
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.mavlink.messages import (
    Address,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionMessage,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
)

VEHICLE = Address(1, 1)
HOME = item_int(seq=0, frame=0, command=16, x=-240400001, y=-461700001, z=3.5)


def addressed(item: MissionItemInt, to: Address) -> MissionItemInt:
    """Return an item with another target."""
    return changed(item, target_system=to.system, target_component=to.component)


class MissionVehicle:
    """What both autopilots have in common.

    Attributes:
        held: Every mission that the vehicle has held, the current one last.
    """

    rerequest_s: float
    stall_s: float

    def __init__(self) -> None:
        self.held: list[tuple[MissionItemInt, ...]] = [()]
        self.partner: Address | None = None
        self.incoming: list[MissionItemInt] = []
        self.expected = 0
        self.receiving = False
        self.requested_at = 0.0
        self.received_at = 0.0

    @property
    def mission(self) -> tuple[MissionItemInt, ...]:
        return self.held[-1]

    @property
    def deadline(self) -> float | None:
        if not self.receiving:
            return None
        return min(self.requested_at + self.rerequest_s, self.received_at + self.stall_s)

    def receive(self, message: MissionMessage, sender: Address, now: float) -> list[MissionMessage]:
        """Process a message; each reply has its target."""
        target = (message.target_system, message.target_component)
        if target != VEHICLE or message.mission_type != 0:
            return []
        match message:
            case MissionCount(count=count):
                return self.on_count(count, sender, now)
            case MissionItemInt():
                return self.on_item(message, sender, now)
            case MissionRequestList():
                return self.on_list(sender, now)
            case MissionRequestInt(seq=seq):
                return self.on_request(seq, sender, now)
            case MissionAck(type=result):
                return self.on_ack(result, sender)
        return []

    def tick(self, now: float) -> list[MissionMessage]:
        if self.deadline is None or now < self.deadline:
            return []
        if now >= self.received_at + self.stall_s:
            return self.end_stalled_transfer()
        return self.request(now)

    def begin(self, count: int, sender: Address, now: float) -> list[MissionMessage]:
        self.partner, self.incoming, self.expected = sender, [], count
        if count == 0:
            self.held.append(())
            return self.ack(sender, mavlink.MAV_MISSION_ACCEPTED)
        self.receiving = True
        self.received_at = now
        return self.request(now)

    def store(self, item: MissionItemInt, now: float) -> list[MissionMessage]:
        self.received_at = now
        self.incoming.append(item)
        if len(self.incoming) < self.expected:
            return self.request(now)
        self.receiving = False
        self.held.append(tuple(self.stored(item) for item in self.incoming))
        assert self.partner
        return self.ack(self.partner, mavlink.MAV_MISSION_ACCEPTED)

    def refuse_item(self, result: int) -> list[MissionMessage]:
        self.receiving = False
        assert self.partner
        return self.ack(self.partner, result)

    def request(self, now: float) -> list[MissionMessage]:
        self.requested_at = now
        assert self.partner
        return [self.request_message(self.partner, len(self.incoming))]

    def ack(self, to: Address, result: int) -> list[MissionMessage]:
        return [MissionAck(*to, result)]

    def request_message(self, to: Address, seq: int) -> MissionMessage:
        raise NotImplementedError

    def stored(self, item: MissionItemInt) -> MissionItemInt:
        raise NotImplementedError

    def end_stalled_transfer(self) -> list[MissionMessage]:
        raise NotImplementedError

    def on_count(self, count: int, sender: Address, now: float) -> list[MissionMessage]:
        raise NotImplementedError

    def on_item(self, item: MissionItemInt, sender: Address, now: float) -> list[MissionMessage]:
        raise NotImplementedError

    def on_list(self, sender: Address, now: float) -> list[MissionMessage]:
        raise NotImplementedError

    def on_request(self, seq: int, sender: Address, now: float) -> list[MissionMessage]:
        raise NotImplementedError

    def on_ack(self, result: int, sender: Address) -> list[MissionMessage]:
        raise NotImplementedError


class ArduPilot(MissionVehicle):
    """Sends the deprecated request, ignores a cancellation, sends a NACK for an item twice."""

    rerequest_s = 1.0
    stall_s = 8.0

    def request_message(self, to: Address, seq: int) -> MissionMessage:
        return MissionRequest(*to, seq)

    def stored(self, item: MissionItemInt) -> MissionItemInt:
        if item.seq == 0:
            return HOME
        if item.command == 20:
            return item_int(seq=item.seq, frame=0, command=20)
        return changed(
            item,
            frame={5: 0, 6: 3, 11: 10}.get(item.frame, item.frame),
            current=0,
            param1=float(math.floor(item.param1)),
            param4=0.0,
            x=item.x + item.seq % 3 - 1,
            y=item.y - item.seq % 2,
            z=round(item.z, 2),
        )

    def end_stalled_transfer(self) -> list[MissionMessage]:
        return self.refuse_item(mavlink.MAV_MISSION_OPERATION_CANCELLED)

    def on_count(self, count: int, sender: Address, now: float) -> list[MissionMessage]:
        if self.receiving and sender != self.partner:
            return self.ack(sender, mavlink.MAV_MISSION_DENIED)
        self.receiving = False
        return self.begin(count, sender, now)

    def on_item(self, item: MissionItemInt, sender: Address, now: float) -> list[MissionMessage]:
        assert item.current not in (2, 3), "a command to fly there"
        if not self.receiving:
            return self.ack(sender, mavlink.MAV_MISSION_ERROR)
        if item.seq != len(self.incoming):
            return self.ack(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE)
        if abs(item.x) > 90 * 10**7:
            return self.refuse_item(mavlink.MAV_MISSION_INVALID_PARAM5_X)
        if math.isnan(item.param4) and item.command == 19:
            return self.refuse_item(mavlink.MAV_MISSION_INVALID_PARAM4)
        return self.store(item, now)

    def on_list(self, sender: Address, now: float) -> list[MissionMessage]:
        if self.receiving:
            return self.ack(sender, mavlink.MAV_MISSION_DENIED)
        return [MissionCount(*sender, len(self.mission))]

    def on_request(self, seq: int, sender: Address, now: float) -> list[MissionMessage]:
        if self.receiving:
            return self.ack(sender, mavlink.MAV_MISSION_DENIED)
        if seq >= len(self.mission):
            return self.ack(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE)
        return [addressed(self.mission[seq], sender)]

    def on_ack(self, result: int, sender: Address) -> list[MissionMessage]:
        return []


class Px4(MissionVehicle):
    """Accepts one transfer at a time, and sends items in their order only."""

    rerequest_s = 0.25
    stall_s = 5.0

    def __init__(self) -> None:
        super().__init__()
        self.sending = False
        self.sent = 0
        self.last_stored = -1

    @property
    def deadline(self) -> float | None:
        return self.received_at + self.stall_s if self.sending else super().deadline

    def request_message(self, to: Address, seq: int) -> MissionMessage:
        return MissionRequestInt(*to, seq)

    def stored(self, item: MissionItemInt) -> MissionItemInt:
        self.last_stored = item.seq
        return changed(item, current=0, param3=0.0)

    def end_stalled_transfer(self) -> list[MissionMessage]:
        self.receiving = self.sending = False
        return []

    def on_count(self, count: int, sender: Address, now: float) -> list[MissionMessage]:
        if self.sending or self.receiving and (self.incoming or sender != self.partner):
            return self.ack(sender, mavlink.MAV_MISSION_ERROR)
        return self.begin(count, sender, now)

    def on_item(self, item: MissionItemInt, sender: Address, now: float) -> list[MissionMessage]:
        if sender != self.partner:
            return []
        if self.sending:
            return self.ack(sender, mavlink.MAV_MISSION_ERROR)
        if not self.receiving:
            again = item.seq == self.last_stored
            result = mavlink.MAV_MISSION_ACCEPTED if again else mavlink.MAV_MISSION_ERROR
            return self.ack(sender, result)
        self.received_at = now
        if item.seq != len(self.incoming):
            return []
        if item.command == 20 and item.frame != 2:
            return self.refuse_item(mavlink.MAV_MISSION_UNSUPPORTED)
        return self.store(item, now)

    def on_list(self, sender: Address, now: float) -> list[MissionMessage]:
        if self.receiving:
            return []
        self.partner, self.sending, self.sent, self.received_at = sender, True, 0, now
        return [MissionCount(*sender, len(self.mission))]

    def on_request(self, seq: int, sender: Address, now: float) -> list[MissionMessage]:
        if not self.sending or sender != self.partner:
            return []
        self.received_at = now
        if seq not in (self.sent, self.sent - 1) or not 0 <= seq < len(self.mission):
            self.sending = False
            return self.ack(sender, mavlink.MAV_MISSION_ERROR)
        self.sent = seq + 1
        return [addressed(self.mission[seq], sender)]

    def on_ack(self, result: int, sender: Address) -> list[MissionMessage]:
        if sender == self.partner and result == mavlink.MAV_MISSION_OPERATION_CANCELLED:
            self.receiving = False
        if sender == self.partner:
            self.sending = False
        return []


VEHICLES = {"ardupilot": ArduPilot, "px4": Px4}
