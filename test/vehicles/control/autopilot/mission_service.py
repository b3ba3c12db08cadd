# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What both autopilots' sides of the mission protocol share: https://mavlink.io/en/services/mission.html."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .channel import Sender
from .mission_items import Item
from .wire import Message, mavlink

if TYPE_CHECKING:
    from .vehicle import Vehicle

MAX_ITEMS = 724


@dataclass
class Receiving:
    """An upload in progress.

    Attributes:
        partner: The sender.
        count: Number of items to come.
        items: Those that have come.
        received_s: Vehicle time of the last one.
        requested_s: Vehicle time of the last request.
        first: Number of the first one.
    """

    partner: Sender
    count: int
    items: list[Item]
    received_s: float
    requested_s: float
    first: int = 0

    @property
    def next_seq(self) -> int:
        """Number of the next item."""
        return self.first + len(self.items)


class MissionService(ABC):
    """The vehicle's side of the mission protocol."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.receiving: Receiving | None = None
        self.handlers: dict[str, Callable[[Message, Sender], None]] = {
            "MISSION_COUNT": self._missions_only(self.count),
            "MISSION_ITEM": self._missions_only(self.item),
            "MISSION_ITEM_INT": self._missions_only(self.item),
            "MISSION_REQUEST_LIST": self._missions_only(self.request_list),
            "MISSION_REQUEST": self._missions_only(self.request),
            "MISSION_REQUEST_INT": self._missions_only(self.request),
            "MISSION_CLEAR_ALL": self._missions_only(self.clear_all),
            "MISSION_ACK": self.ack,
            "MISSION_SET_CURRENT": self.set_current,
        }

    @abstractmethod
    def count(self, message: Message, sender: Sender) -> None:
        """Start an upload."""

    @abstractmethod
    def item(self, message: Message, sender: Sender) -> None:
        """Receive an item of an upload."""

    @abstractmethod
    def request_list(self, message: Message, sender: Sender) -> None:
        """Start a download."""

    @abstractmethod
    def request(self, message: Message, sender: Sender) -> None:
        """Send an item of a download."""

    @abstractmethod
    def clear_all(self, message: Message, sender: Sender) -> None:
        """Delete the mission."""

    def ack(self, message: Message, sender: Sender) -> None:  # noqa: B027
        """End a download, or cancel an upload."""

    def set_current(self, message: Message, sender: Sender) -> None:
        """Continue with another item."""
        if self.set_current_item(message.seq):
            mission_current = self.vehicle.builders[mavlink.MAVLINK_MSG_ID_MISSION_CURRENT]
            self.vehicle.broadcast(mission_current(self.vehicle))

    @abstractmethod
    def set_current_item(self, seq: int) -> bool:
        """Make an item the current one; return whether there is such an item."""

    @abstractmethod
    def tick(self) -> None:
        """Repeat a request, or end a stalled transfer."""

    def send_ack(self, result: int, sender: Sender, mission_type: int = 0) -> None:
        """Send a MISSION_ACK, if it is not lost."""
        if not self.vehicle.loses("mission_acks"):
            sender.channel.send(
                mavlink.MAVLink_mission_ack_message(
                    sender.system, sender.component, result, mission_type
                )
            )

    def send_count(self, sender: Sender, count: int, mission_type: int = 0) -> None:
        """Send a MISSION_COUNT."""
        sender.channel.send(
            mavlink.MAVLink_mission_count_message(
                sender.system, sender.component, count, mission_type
            )
        )

    def send_item(self, seq: int, item: Item, request: Message, sender: Sender) -> None:
        """Reply to a request with MISSION_ITEM_INT or MISSION_ITEM, as requested."""
        sender.channel.send(
            item.message(
                seq,
                request.mission_type,
                (sender.system, sender.component),
                current=seq == self.vehicle.mission.current,
                floats=request.get_type() == "MISSION_REQUEST",
            )
        )

    def _missions_only(
        self, handler: Callable[[Message, Sender], None]
    ) -> Callable[[Message, Sender], None]:
        """Refuse fences and rally points."""

        def handle(message: Message, sender: Sender) -> None:
            kind = message.mission_type
            if kind == mavlink.MAV_MISSION_TYPE_MISSION:
                handler(message, sender)
            elif message.get_type() == "MISSION_REQUEST_LIST":
                self.send_count(sender, 0, kind)
            elif message.get_type() == "MISSION_CLEAR_ALL":
                if kind == mavlink.MAV_MISSION_TYPE_ALL:
                    handler(message, sender)
                else:
                    self.send_ack(mavlink.MAV_MISSION_ACCEPTED, sender, kind)
            else:
                self.send_ack(mavlink.MAV_MISSION_UNSUPPORTED, sender, kind)

        return handle
