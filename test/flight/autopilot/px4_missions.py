# SPDX-License-Identifier: Apache-2.0
"""PX4's end of the mission protocol.

There are two places for a mission, and the new one counts only when it is complete. The transfer
has one partner at a time, and others hear MAV_MISSION_ERROR.
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

_ASK_AGAIN_S = 0.25
_GIVE_UP_S = 5.0
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
class _Giving:
    """A download under way: to whom, and the number of the item to come next."""

    partner: Sender
    following: int
    heard_s: float


def _refusal(item: Item) -> int | None:
    if item.command not in _KNOWN:
        return mavlink.MAV_MISSION_UNSUPPORTED
    if item.frame not in _FRAMES:
        return mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    return item.place_fault()


def _as_kept(item: Item) -> Item:
    """Return what will be read back: the frames are those of integers."""
    if item.frame in RELATIVE_FRAMES:
        return replace(item, frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
    if item.frame in ABSOLUTE_FRAMES:
        return replace(item, frame=mavlink.MAV_FRAME_GLOBAL_INT)
    return item


class Px4Missions(MissionService):
    """PX4's end of the mission protocol."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._giving: _Giving | None = None
        self._last: tuple[Sender, int] | None = None

    def count(self, message: Message, sender: Sender) -> None:
        receiving = self.receiving
        if self._giving is not None:
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
                self._ask()
        elif receiving.partner[1:] != sender[1:]:
            self.send_ack(mavlink.MAV_MISSION_ERROR, sender)
        elif receiving.items:
            self._busy(sender)
        else:
            receiving.heard_s = self.vehicle.time_s
            self._ask()

    def item(self, message: Message, sender: Sender) -> None:
        receiving = self.receiving
        if receiving is None:
            # The last item again: our acknowledgement was lost.
            again = self._last is not None and self._last == (sender, message.seq)
            result = mavlink.MAV_MISSION_ACCEPTED if again else mavlink.MAV_MISSION_ERROR
            self.send_ack(result, sender)
            return
        if receiving.partner[1:] != sender[1:]:
            self.vehicle.say("REJ. MIS ITEM: partner id mismatch", mavlink.MAV_SEVERITY_CRITICAL)
            return
        receiving.heard_s = self.vehicle.time_s
        if message.seq != len(receiving.items):
            return
        item = Item.received(message)
        result = _refusal(item)
        if result is not None:
            self.receiving = None
            self.vehicle.say("IGN MISSION_ITEM: Invalid item", mavlink.MAV_SEVERITY_CRITICAL)
            self.send_ack(result, sender)
            return
        receiving.items.append(_as_kept(item))
        if len(receiving.items) < receiving.count:
            self._ask()
            return
        self.receiving = None
        self._last = (sender, message.seq)
        self._replace(receiving.items)
        self.send_ack(mavlink.MAV_MISSION_ACCEPTED, sender)

    def request_list(self, message: Message, sender: Sender) -> None:
        if self.receiving is not None:
            self.vehicle.say("Mission download request ignored, already active")
            return
        count = len(self.vehicle.mission.items)
        self._giving = _Giving(sender, 0, self.vehicle.time_s)
        self.send_count(sender, count)

    def request(self, message: Message, sender: Sender) -> None:
        giving, items = self._giving, self.vehicle.mission.items
        if giving is None or giving.partner[1:] != sender[1:]:
            return
        giving.heard_s = self.vehicle.time_s
        if message.seq not in (giving.following, giving.following - 1) or message.seq >= len(items):
            self._giving = None
            self.send_ack(mavlink.MAV_MISSION_ERROR, sender)
            self.vehicle.say("WPM: REJ. CMD: Req. WP was unexpected", mavlink.MAV_SEVERITY_CRITICAL)
            return
        giving.following = message.seq + 1
        self.send_item(message.seq, items[message.seq], message, sender)

    def ack(self, message: Message, sender: Sender) -> None:
        if self._giving is not None and self._giving.partner[1:] == sender[1:]:
            self._giving = None
        receiving = self.receiving
        cancelled = message.type == mavlink.MAV_MISSION_OPERATION_CANCELLED
        if receiving is not None and cancelled and receiving.partner[1:] == sender[1:]:
            self.receiving = None

    def clear_all(self, message: Message, sender: Sender) -> None:
        if self.receiving is not None or self._giving is not None:
            self._busy(sender)
            return
        self._replace([])
        self.send_ack(mavlink.MAV_MISSION_ACCEPTED, sender, message.mission_type)

    def go_to_item(self, seq: int) -> bool:
        mission = self.vehicle.mission
        if not 0 <= seq < len(mission.items):
            self.vehicle.say("WPM: WP CURR CMD: Not in list", mavlink.MAV_SEVERITY_CRITICAL)
            return False
        active = mission.active
        mission.rewind(seq)
        mission.active = active
        if active:
            self.vehicle.restart_mission()
        return True

    def tick(self) -> None:
        receiving, now_s = self.receiving, self.vehicle.time_s
        heard_s = math.inf
        if receiving is not None:
            heard_s = receiving.heard_s
            if now_s - receiving.asked_s > _ASK_AGAIN_S:
                self._ask()
        elif self._giving is not None:
            heard_s = self._giving.heard_s
        if now_s - heard_s > _GIVE_UP_S:
            # Without a word to the other end.
            self.receiving = self._giving = None
            self.vehicle.say("Operation timeout", mavlink.MAV_SEVERITY_CRITICAL)

    def _busy(self, sender: Sender) -> None:
        self.vehicle.say("WPM: REJ. CMD: Busy", mavlink.MAV_SEVERITY_CRITICAL)
        self.send_ack(mavlink.MAV_MISSION_ERROR, sender)

    def _ask(self) -> None:
        receiving = self.receiving
        assert receiving is not None
        receiving.asked_s = self.vehicle.time_s
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
