# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""PX4's side of the mission protocol.

There is storage for two missions, and the new one becomes valid only when it is complete. The
transfer has one partner at a time, and others get MAV_MISSION_ERROR.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from .channel import Sender
from .mission_items import ABSOLUTE_FRAMES, GLOBAL_FRAMES, RELATIVE_FRAMES, Item
from .mission_service import MAX_ITEMS, MissionService, Receiving
from .wire import Message, mavlink

if TYPE_CHECKING:
    from .vehicle import Vehicle

_REQUEST_INTERVAL_S = 0.25
_TRANSFER_TIMEOUT_S = 5.0
_FRAMES = GLOBAL_FRAMES | {mavlink.MAV_FRAME_MISSION}
_KNOWN = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_DELAY,
        mavlink.MAV_CMD_DO_JUMP,
        mavlink.MAV_CMD_DO_CHANGE_SPEED,
        mavlink.MAV_CMD_DO_SET_ROI,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        mavlink.MAV_CMD_DO_SET_ROI_NONE,
        mavlink.MAV_CMD_DO_MOUNT_CONTROL,
        mavlink.MAV_CMD_DO_MOUNT_CONFIGURE,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
        mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
        mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        mavlink.MAV_CMD_CONDITION_YAW,
        mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
        mavlink.MAV_CMD_VIDEO_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
        mavlink.MAV_CMD_SET_CAMERA_MODE,
    }
)


@dataclass
class _Sending:
    """A download in progress: its client, and the number of the next item."""

    partner: Sender
    next_seq: int
    received_s: float


def _refusal(item: Item) -> int | None:
    if item.command not in _KNOWN:
        return mavlink.MAV_MISSION_UNSUPPORTED
    if item.frame not in _FRAMES:
        return mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    return item.place_fault()


def _as_stored(item: Item) -> Item:
    """Return the item as it will be read back: with the frame of integers."""
    if item.frame in RELATIVE_FRAMES:
        return replace(item, frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
    if item.frame in ABSOLUTE_FRAMES:
        return replace(item, frame=mavlink.MAV_FRAME_GLOBAL_INT)
    return item


class Px4Missions(MissionService):
    """PX4's side of the mission protocol."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._sending: _Sending | None = None
        self._last: tuple[Sender, int] | None = None

    def count(self, message: Message, sender: Sender) -> None:
        receiving = self.receiving
        if self._sending is not None:
            self._busy(sender)
        elif receiving is None:
            if message.count > MAX_ITEMS:
                self.send_ack(mavlink.MAV_MISSION_NO_SPACE, sender)
            elif message.count == 0:
                self._replace([])
                self.send_ack(mavlink.MAV_MISSION_ACCEPTED, sender)
            else:
                now_s = self.vehicle.time_s
                self.receiving = Receiving(sender, message.count, [], now_s, now_s)
                self._request_next()
        elif receiving.partner[1:] != sender[1:]:
            self.send_ack(mavlink.MAV_MISSION_ERROR, sender)
        elif receiving.items:
            self._busy(sender)
        else:
            receiving.received_s = self.vehicle.time_s
            self._request_next()

    def item(self, message: Message, sender: Sender) -> None:
        receiving = self.receiving
        if receiving is None:
            # The last item again: the acknowledgement was lost.
            again = self._last is not None and self._last == (sender, message.seq)
            result = mavlink.MAV_MISSION_ACCEPTED if again else mavlink.MAV_MISSION_ERROR
            self.send_ack(result, sender)
            return
        if receiving.partner[1:] != sender[1:]:
            self._send_error("REJ. MIS ITEM: partner id mismatch")
            return
        receiving.received_s = self.vehicle.time_s
        if message.seq != len(receiving.items):
            return
        item = Item.received(message)
        result = _refusal(item)
        if result is not None:
            self.receiving = None
            self._send_error("IGN MISSION_ITEM: Invalid item")
            self.send_ack(result, sender)
            return
        receiving.items.append(_as_stored(item))
        if len(receiving.items) < receiving.count:
            self._request_next()
            return
        self.receiving = None
        self._last = (sender, message.seq)
        self._replace(receiving.items)
        self.send_ack(mavlink.MAV_MISSION_ACCEPTED, sender)

    def request_list(self, message: Message, sender: Sender) -> None:
        if self.receiving is not None:
            self.vehicle.send_text("Mission download request ignored, already active")
            return
        count = len(self.vehicle.mission.items)
        self._sending = _Sending(sender, 0, self.vehicle.time_s)
        self.send_count(sender, count)

    def request(self, message: Message, sender: Sender) -> None:
        sending, items = self._sending, self.vehicle.mission.items
        if sending is None or sending.partner[1:] != sender[1:]:
            return
        sending.received_s = self.vehicle.time_s
        if message.seq not in (sending.next_seq, sending.next_seq - 1) or message.seq >= len(items):
            self._sending = None
            self.send_ack(mavlink.MAV_MISSION_ERROR, sender)
            self._send_error("WPM: REJ. CMD: Req. WP was unexpected")
            return
        sending.next_seq = message.seq + 1
        self.send_item(message.seq, items[message.seq], message, sender)

    def ack(self, message: Message, sender: Sender) -> None:
        if self._sending is not None and self._sending.partner[1:] == sender[1:]:
            self._sending = None
        receiving = self.receiving
        cancelled = message.type == mavlink.MAV_MISSION_OPERATION_CANCELLED
        if receiving is not None and cancelled and receiving.partner[1:] == sender[1:]:
            self.receiving = None

    def clear_all(self, message: Message, sender: Sender) -> None:
        if self.receiving is not None or self._sending is not None:
            self._busy(sender)
            return
        self._replace([])
        self.send_ack(mavlink.MAV_MISSION_ACCEPTED, sender, message.mission_type)

    def set_current_item(self, seq: int) -> bool:
        mission = self.vehicle.mission
        if not 0 <= seq < len(mission.items):
            self._send_error("WPM: WP CURR CMD: Not in list")
            return False
        active = mission.active
        mission.rewind(seq)
        mission.active = active
        if active:
            self.vehicle.restart_mission()
        return True

    def tick(self) -> None:
        receiving, now_s = self.receiving, self.vehicle.time_s
        received_s = math.inf
        if receiving is not None:
            received_s = receiving.received_s
            if now_s - receiving.requested_s > _REQUEST_INTERVAL_S:
                self._request_next()
        elif self._sending is not None:
            received_s = self._sending.received_s
        if now_s - received_s > _TRANSFER_TIMEOUT_S:
            # Without a message to the client.
            self.receiving = self._sending = None
            self._send_error("Operation timeout")

    def _send_error(self, text: str) -> None:
        self.vehicle.send_text(text, mavlink.MAV_SEVERITY_CRITICAL)

    def _busy(self, sender: Sender) -> None:
        self._send_error("WPM: REJ. CMD: Busy")
        self.send_ack(mavlink.MAV_MISSION_ERROR, sender)

    def _request_next(self) -> None:
        receiving = self.receiving
        assert receiving is not None
        receiving.requested_s = self.vehicle.time_s
        receiving.partner.channel.send(
            mavlink.MAVLink_mission_request_int_message(
                receiving.partner.system,
                receiving.partner.component,
                len(receiving.items),
                mavlink.MAV_MISSION_TYPE_MISSION,
            )
        )

    def _replace(self, items: list[Item]) -> None:
        mission = self.vehicle.mission
        active = mission.active
        mission.items = items
        mission.rewind(0)
        mission.active = active and bool(items)
        if active:
            self.vehicle.restart_mission()
