# SPDX-License-Identifier: Apache-2.0
"""The vehicle's side of the mission protocol, as ArduPilot and PX4 have it, with their quirks.

Both are stricter than a real ArduPilot in one thing: a new mission takes the place of the old one
only when it is complete.
"""

from __future__ import annotations

import dataclasses
import math

from dsse_ros.flight.items import WireItem
from dsse_ros.flight.messages import (
    Address,
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
    MissionResult,
)

VEHICLE = Address(1, 1)
HOME = WireItem(seq=0, frame=0, command=16, x=-240400001, y=-461700001, z=3.5)


class MissionVehicle:
    """What both autopilots have in common.

    Attributes:
        held: Every mission that the vehicle has held, the present one last.
        stubborn: Refuses to clear, as in AUTO.
    """

    rerequest_s: float
    stall_s: float

    def __init__(self) -> None:
        self.held: list[tuple[WireItem, ...]] = [()]
        self.stubborn = False
        self.partner: Address | None = None
        self.incoming: list[WireItem] = []
        self.expected = 0
        self.receiving = False
        self.asked_at = 0.0
        self.heard_at = 0.0

    @property
    def mission(self) -> tuple[WireItem, ...]:
        return self.held[-1]

    @property
    def deadline(self) -> float | None:
        if not self.receiving:
            return None
        return min(self.asked_at + self.rerequest_s, self.heard_at + self.stall_s)

    def receive(self, message: Message, sender: Address, now: float) -> list[Message]:
        """Take a message; the answers go to the address in each."""
        if message.target != VEHICLE or message.mission_type != 0:
            return []
        match message:
            case MissionCount(count=count):
                return self.on_count(count, sender, now)
            case MissionItemInt(item=item):
                return self.on_item(item, sender, now)
            case MissionRequestList():
                return self.on_list(sender, now)
            case MissionRequestInt(seq=seq):
                return self.on_request(seq, sender, now)
            case MissionClearAll():
                return self.on_clear(sender)
            case MissionAck(type=result):
                return self.on_ack(result, sender)
        return []

    def tick(self, now: float) -> list[Message]:
        if self.deadline is None or now < self.deadline:
            return []
        if now >= self.heard_at + self.stall_s:
            return self.give_up()
        return self.request(now)

    def begin(self, count: int, sender: Address, now: float) -> list[Message]:
        self.partner, self.incoming, self.expected = sender, [], count
        if count == 0:
            self.held.append(())
            return self.ack(sender, MissionResult.ACCEPTED)
        self.receiving = True
        self.heard_at = now
        return self.request(now)

    def store(self, item: WireItem, now: float) -> list[Message]:
        self.heard_at = now
        self.incoming.append(item)
        if len(self.incoming) < self.expected:
            return self.request(now)
        self.receiving = False
        self.held.append(tuple(self.stored(item) for item in self.incoming))
        assert self.partner
        return self.ack(self.partner, MissionResult.ACCEPTED)

    def refuse_item(self, result: MissionResult) -> list[Message]:
        self.receiving = False
        assert self.partner
        return self.ack(self.partner, result)

    def request(self, now: float) -> list[Message]:
        self.asked_at = now
        assert self.partner
        return [self.question(self.partner, len(self.incoming))]

    def ack(self, to: Address, result: int) -> list[Message]:
        return [MissionAck(to, result)]

    def clear(self, sender: Address) -> list[Message]:
        self.held.append(())
        return self.ack(sender, MissionResult.ACCEPTED)

    def question(self, to: Address, seq: int) -> Message:
        raise NotImplementedError

    def stored(self, item: WireItem) -> WireItem:
        raise NotImplementedError

    def give_up(self) -> list[Message]:
        raise NotImplementedError

    def on_count(self, count: int, sender: Address, now: float) -> list[Message]:
        raise NotImplementedError

    def on_item(self, item: WireItem, sender: Address, now: float) -> list[Message]:
        raise NotImplementedError

    def on_list(self, sender: Address, now: float) -> list[Message]:
        raise NotImplementedError

    def on_request(self, seq: int, sender: Address, now: float) -> list[Message]:
        raise NotImplementedError

    def on_clear(self, sender: Address) -> list[Message]:
        raise NotImplementedError

    def on_ack(self, result: int, sender: Address) -> list[Message]:
        raise NotImplementedError


class ArduPilot(MissionVehicle):
    """Asks in the old way, knows no cancellation, grumbles at items that come twice."""

    rerequest_s = 1.0
    stall_s = 8.0

    def question(self, to: Address, seq: int) -> Message:
        return MissionRequest(to, seq)

    def stored(self, item: WireItem) -> WireItem:
        if item.seq == 0:
            return HOME
        if item.command == 20:
            return WireItem(seq=item.seq, frame=0, command=20)
        return dataclasses.replace(
            item,
            frame={5: 0, 6: 3, 11: 10}.get(item.frame, item.frame),
            current=0,
            param1=float(math.floor(item.param1)),
            param4=0.0,
            x=item.x + item.seq % 3 - 1,
            y=item.y - item.seq % 2,
            z=round(item.z, 2),
        )

    def give_up(self) -> list[Message]:
        return self.refuse_item(MissionResult.OPERATION_CANCELLED)

    def on_count(self, count: int, sender: Address, now: float) -> list[Message]:
        if self.receiving and sender != self.partner:
            return self.ack(sender, MissionResult.DENIED)
        self.receiving = False
        return self.begin(count, sender, now)

    def on_item(self, item: WireItem, sender: Address, now: float) -> list[Message]:
        assert item.current not in (2, 3), "an order to fly there"
        if not self.receiving:
            return self.ack(sender, MissionResult.ERROR)
        if item.seq != len(self.incoming):
            return self.ack(sender, MissionResult.INVALID_SEQUENCE)
        if abs(item.x) > 90 * 10**7:
            return self.refuse_item(MissionResult.INVALID_PARAM5_X)
        if math.isnan(item.param4) and item.command == 19:
            return self.refuse_item(MissionResult.INVALID_PARAM4)
        return self.store(item, now)

    def on_list(self, sender: Address, now: float) -> list[Message]:
        if self.receiving:
            return self.ack(sender, MissionResult.DENIED)
        return [MissionCount(sender, len(self.mission))]

    def on_request(self, seq: int, sender: Address, now: float) -> list[Message]:
        if self.receiving:
            return self.ack(sender, MissionResult.DENIED)
        if seq >= len(self.mission):
            return self.ack(sender, MissionResult.INVALID_SEQUENCE)
        return [MissionItemInt(sender, self.mission[seq])]

    def on_clear(self, sender: Address) -> list[Message]:
        if self.receiving or self.stubborn:
            return self.ack(sender, MissionResult.ERROR)
        return self.clear(sender)

    def on_ack(self, result: int, sender: Address) -> list[Message]:
        return []


class Px4(MissionVehicle):
    """Takes one transfer at a time, and hands out items in their order only."""

    rerequest_s = 0.25
    stall_s = 5.0

    def __init__(self) -> None:
        super().__init__()
        self.sending = False
        self.sent = 0
        self.last_stored = -1

    @property
    def deadline(self) -> float | None:
        return self.heard_at + self.stall_s if self.sending else super().deadline

    def question(self, to: Address, seq: int) -> Message:
        return MissionRequestInt(to, seq)

    def stored(self, item: WireItem) -> WireItem:
        self.last_stored = item.seq
        return dataclasses.replace(item, current=0, param3=0.0)

    def give_up(self) -> list[Message]:
        self.receiving = self.sending = False
        return []

    def on_count(self, count: int, sender: Address, now: float) -> list[Message]:
        if self.sending or self.receiving and (self.incoming or sender != self.partner):
            return self.ack(sender, MissionResult.ERROR)
        return self.begin(count, sender, now)

    def on_item(self, item: WireItem, sender: Address, now: float) -> list[Message]:
        if sender != self.partner:
            return []
        if self.sending:
            return self.ack(sender, MissionResult.ERROR)
        if not self.receiving:
            again = item.seq == self.last_stored
            return self.ack(sender, MissionResult.ACCEPTED if again else MissionResult.ERROR)
        self.heard_at = now
        if item.seq != len(self.incoming):
            return []
        if item.command == 20 and item.frame != 2:
            return self.refuse_item(MissionResult.UNSUPPORTED)
        return self.store(item, now)

    def on_list(self, sender: Address, now: float) -> list[Message]:
        if self.receiving:
            return []
        self.partner, self.sending, self.sent, self.heard_at = sender, True, 0, now
        return [MissionCount(sender, len(self.mission))]

    def on_request(self, seq: int, sender: Address, now: float) -> list[Message]:
        if not self.sending or sender != self.partner:
            return []
        self.heard_at = now
        if seq not in (self.sent, self.sent - 1) or not 0 <= seq < len(self.mission):
            self.sending = False
            return self.ack(sender, MissionResult.ERROR)
        self.sent = seq + 1
        return [MissionItemInt(sender, self.mission[seq])]

    def on_clear(self, sender: Address) -> list[Message]:
        return [] if self.receiving or self.sending else self.clear(sender)

    def on_ack(self, result: int, sender: Address) -> list[Message]:
        if sender == self.partner and result == MissionResult.OPERATION_CANCELLED:
            self.receiving = False
        if sender == self.partner:
            self.sending = False
        return []


VEHICLES = {"ardupilot": ArduPilot, "px4": Px4}
