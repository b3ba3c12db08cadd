# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""ArduPilot's side of the mission protocol.

Items are stored as they arrive, so an aborted transfer leaves a mixture of the new mission and the
old one.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from .channel import Sender
from .mission_items import PLACES, RELATIVE_FRAMES, TERRAIN_FRAMES, Item
from .mission_service import MAX_ITEMS, MissionService, Receiving
from .wire import Message, mavlink

if TYPE_CHECKING:
    from .vehicle import Vehicle

_REQUEST_INTERVAL_S = 1.0
_TRANSFER_TIMEOUT_S = 8.0
_YAW_MAY_BE_OPEN = frozenset(
    {mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_TAKEOFF}
)
# Commands, and which of their parameters 1 to 4 are stored.
_STORED_PARAMETERS: dict[int, tuple[int, ...]] = {
    mavlink.MAV_CMD_NAV_WAYPOINT: (1,),
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: (3,),
    mavlink.MAV_CMD_NAV_LOITER_TIME: (1, 3, 4),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: (),
    mavlink.MAV_CMD_NAV_LAND: (1,),
    mavlink.MAV_CMD_NAV_TAKEOFF: (1,),
    mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT: (1,),
    mavlink.MAV_CMD_NAV_DELAY: (1, 2, 3, 4),
    mavlink.MAV_CMD_CONDITION_YAW: (1, 2, 3, 4),
    mavlink.MAV_CMD_DO_JUMP: (1, 2),
    mavlink.MAV_CMD_DO_CHANGE_SPEED: (1, 2, 3),
    mavlink.MAV_CMD_DO_SET_ROI: (),
    mavlink.MAV_CMD_DO_MOUNT_CONTROL: (1, 2, 3),
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: (1, 2, 3, 4),
    mavlink.MAV_CMD_DO_DIGICAM_CONTROL: (1, 2, 3, 4),
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST: (1, 2, 3),
}
_WHOLE_SECONDS = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
    }
)


def refusal(item: Item) -> int | None:
    """Return the MAV_MISSION_RESULT that refuses an item, None if it is accepted."""
    if item.command not in _STORED_PARAMETERS:
        return mavlink.MAV_MISSION_UNSUPPORTED
    for number, value in enumerate((item.param1, item.param2, item.param3, item.param4), 1):
        open_yaw = number == 4 and math.isnan(value) and item.command in _YAW_MAY_BE_OPEN
        if not math.isfinite(value) and not open_yaw:
            return mavlink.MAV_MISSION_INVALID_PARAM1 + number - 1
    if item.command not in PLACES:
        return None
    if item.frame not in _frames_read_back():
        return mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    return item.place_fault()


def _frames_read_back() -> dict[int, int]:
    frames = dict.fromkeys(RELATIVE_FRAMES, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT)
    frames |= dict.fromkeys(TERRAIN_FRAMES, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT)
    return frames | {
        mavlink.MAV_FRAME_GLOBAL: mavlink.MAV_FRAME_GLOBAL,
        mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    }


class ArduPilotMissions(MissionService):
    """ArduPilot's side of the mission protocol."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self.handlers["MISSION_WRITE_PARTIAL_LIST"] = self._write_partial_list

    def _write_partial_list(self, message: Message, sender: Sender) -> None:
        """Start an upload of some items in place of those there are."""
        first, last = message.start_index, message.end_index
        if self.receiving or not 0 < first <= last < len(self.vehicle.mission.items):
            self.vehicle.send_text("Flight plan update rejected", mavlink.MAV_SEVERITY_WARNING)
            return
        now_s = self.vehicle.time_s
        self.receiving = Receiving(sender, last - first + 1, [], now_s, now_s, first)
        self._request_next()

    def count(self, message: Message, sender: Sender) -> None:
        if self.receiving and self.receiving.partner[1:] != sender[1:]:
            self.send_ack(mavlink.MAV_MISSION_DENIED, sender)
            return
        if message.count > MAX_ITEMS:
            self.send_ack(mavlink.MAV_MISSION_NO_SPACE, sender)
            return
        self.receiving = None
        del self.vehicle.mission.items[message.count :]
        if message.count == 0:
            self._complete(sender)
            return
        now_s = self.vehicle.time_s
        self.receiving = Receiving(sender, message.count, [], now_s, now_s)
        self._request_next()

    def item(self, message: Message, sender: Sender) -> None:
        receiving = self.receiving
        if receiving is None:
            self.send_ack(mavlink.MAV_MISSION_ERROR, sender)
            return
        seq = receiving.next_seq
        if message.seq != seq:
            # The transfer continues.
            self.send_ack(mavlink.MAV_MISSION_INVALID_SEQUENCE, sender)
            return
        if receiving.partner[1:] != sender[1:]:
            self.send_ack(mavlink.MAV_MISSION_DENIED, sender)
            return
        item = Item.received(message)
        result = refusal(item)
        if result is not None:
            self.receiving = None
            self.send_ack(result, sender)
            return
        self._store(seq, item)
        receiving.items.append(item)
        receiving.received_s = self.vehicle.time_s
        if len(receiving.items) == receiving.count:
            self._complete(sender)
        else:
            self._request_next()

    def request_list(self, message: Message, sender: Sender) -> None:
        if self.receiving:
            self.send_ack(mavlink.MAV_MISSION_DENIED, sender)
        else:
            self.send_count(sender, len(self.vehicle.mission.items))

    def request(self, message: Message, sender: Sender) -> None:
        items = self.vehicle.mission.items
        if self.receiving:
            self.send_ack(mavlink.MAV_MISSION_DENIED, sender)
        elif message.seq == 0:
            self.send_item(0, _home(self.vehicle), message, sender)
        elif message.seq >= len(items):
            self.send_count(sender, len(items))
            self.send_ack(mavlink.MAV_MISSION_ERROR, sender)
        else:
            self.send_item(message.seq, items[message.seq], message, sender)

    def clear_all(self, message: Message, sender: Sender) -> None:
        refused = self.receiving is not None or self.vehicle.mission.active
        if not refused:
            self.vehicle.mission.items.clear()
            self.vehicle.mission.rewind(0)
        result = mavlink.MAV_MISSION_ERROR if refused else mavlink.MAV_MISSION_ACCEPTED
        self.send_ack(result, sender, message.mission_type)

    def set_current_item(self, seq: int) -> bool:
        mission = self.vehicle.mission
        if not 0 <= seq < len(mission.items):
            return False
        active = mission.active
        mission.rewind(seq)
        mission.active = active
        if active:
            self.vehicle.restart_mission()
        return True

    def tick(self) -> None:
        receiving, now_s = self.receiving, self.vehicle.time_s
        if receiving is None:
            return
        if now_s - receiving.received_s > _TRANSFER_TIMEOUT_S:
            self.receiving = None
            self.send_ack(mavlink.MAV_MISSION_OPERATION_CANCELLED, receiving.partner)
            self.vehicle.send_text("Mission upload timeout")
        elif now_s - receiving.requested_s > _REQUEST_INTERVAL_S:
            self._request_next()

    def _request_next(self) -> None:
        receiving = self.receiving
        assert receiving is not None
        receiving.requested_s = self.vehicle.time_s
        # The deprecated message, even to clients that use the new one.
        receiving.partner.channel.send(
            mavlink.MAVLink_mission_request_message(
                receiving.partner.system,
                receiving.partner.component,
                receiving.next_seq,
                mavlink.MAV_MISSION_TYPE_MISSION,
            )
        )

    def _complete(self, sender: Sender) -> None:
        self.receiving = None
        self.send_ack(mavlink.MAV_MISSION_ACCEPTED, sender)
        self.vehicle.send_text("Flight plan received")
        if self.vehicle.mission.active:
            # It flies the item that now has the number of the current one.
            self.vehicle.restart_mission()
            self.vehicle.send_text("Auto mission changed, restarted command")

    def _store(self, seq: int, item: Item) -> None:
        items = self.vehicle.mission.items
        stored = _home(self.vehicle) if seq == 0 else self._as_stored(item)
        items[seq : seq + 1] = [stored]

    def _as_stored(self, item: Item) -> Item:
        """Return the item as it will be read back: not all fields are stored."""
        numbers = (item.param1, item.param2, item.param3, item.param4)
        stored_ones = _STORED_PARAMETERS[item.command]
        param1, param2, param3, param4 = (
            value if number in stored_ones else 0.0 for number, value in enumerate(numbers, 1)
        )
        if item.command in _WHOLE_SECONDS:
            param1 = float(max(0, min(int(param1), 65535)))
        stored = replace(
            item, autocontinue=1, param1=param1, param2=param2, param3=param3, param4=param4
        )
        if item.command not in PLACES:
            return replace(stored, frame=mavlink.MAV_FRAME_GLOBAL, x=0, y=0, z=0.0)
        x, y = item.x, item.y
        if (x, y) != (0, 0):
            x, y = (v + self.vehicle.random.choice((-1, 0, 1)) for v in (x, y))
        return replace(stored, frame=_frames_read_back()[item.frame], x=x, y=y)


def _home(vehicle: Vehicle) -> Item:
    home = vehicle.frame.home
    x, y = (round(v * 1e7) for v in (home.lat_deg, home.lon_deg))
    return Item(
        mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_NAV_WAYPOINT, 1, 0.0, 0.0, 0.0, 0.0,
        x, y, home.alt_amsl_m,
    )  # fmt: skip
