# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The behaviour of ArduCopter 4.5."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import ClassVar

from .ardupilot_missions import ArduPilotMissions
from .channel import Sender
from .commands import ACCEPTED, DENIED, FAILED, Command
from .local_frame import Point
from .maneuvers import Follow, GoTo, Hold, Land, Maneuver, Return, TakeOff, Velocity
from .mission_items import ABSOLUTE_FRAMES, RELATIVE_FRAMES, TERRAIN_FRAMES, Item, height_m
from .mission_run import MissionRun
from .parameters import Number
from .point_mass import Limits
from .settings import Settings
from .telemetry import ARDUPILOT, heartbeat
from .vehicle import MIN_INTERVAL_S, Vehicle, clamp
from .wire import Message, mavlink


class Mode(IntEnum):
    """HEARTBEAT.custom_mode."""

    STABILIZE = 0
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    POSHOLD = 16
    BRAKE = 17


_ARMABLE = {Mode.STABILIZE, Mode.ALT_HOLD, Mode.GUIDED, Mode.LOITER, Mode.POSHOLD}
_WITHOUT_POSITION = {Mode.STABILIZE, Mode.ALT_HOLD}
_LOCAL_FRAMES = {mavlink.MAV_FRAME_LOCAL_NED}
_OFFSET_FRAMES = {mavlink.MAV_FRAME_LOCAL_OFFSET_NED}
_IGNORE_POSITION, _IGNORE_VELOCITY = 0x007, 0x038
_EKF_UNINITIALIZED, _EKF_WITHOUT_POSITION, _EKF_GOOD = 1024, 167, 831
_EKF_BLIND = 37
_GCS_FAILSAFE_LAND = 5
_REMINDER_S = 30.0
_RETURNS_ABOVE_M, _LEAST_SLOPE = 2.0, 0.5
_DISARMS_S = 2.0
"""From the ground felt to the motors stopped, as 4.5.7 in SITL takes."""
_STREAMS: dict[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    ),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}


class ArduCopter(Vehicle):
    """A vehicle that behaves as ArduCopter does."""

    autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    version = (4, 5, 6)
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    builders = ARDUPILOT
    default_intervals_s: ClassVar[dict[int, float]] = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
    default_parameters: ClassVar[dict[str, Number]] = {
        "FORMAT_VERSION": 120,
        "SYSID_MYGCS": 255,
        "FRAME_CLASS": 1,
        "ARMING_CHECK": 1,
        "AUTO_OPTIONS": 0,
        "BATT_CAPACITY": 3300,
        "BATT_FS_LOW_ACT": 0,
        "DISARM_DELAY": 10,
        "EK3_ENABLE": 1,
        "FENCE_ACTION": 1,
        "FENCE_ALT_MAX": 100.0,
        "FENCE_ENABLE": 0,
        "FENCE_RADIUS": 300.0,
        "FS_GCS_ENABLE": 0,
        "FS_GCS_TIMEOUT": 5.0,
        "GUID_TIMEOUT": 3.0,
        "LAND_ALT_LOW": 1000.0,
        "LAND_SPEED": 50.0,
        "MIS_RESTART": 0,
        "MIS_TOTAL": 0,
        "RTL_ALT": 1500.0,
        "RTL_ALT_FINAL": 0.0,
        "RTL_CLIMB_MIN": 0.0,
        "RTL_CONE_SLOPE": 3.0,
        "RTL_LOIT_TIME": 5000,
        "STAT_RUNTIME": 0,
        "WPNAV_ACCEL": 250.0,
        "WPNAV_ACCEL_Z": 100.0,
        "WPNAV_RADIUS": 200.0,
        "WPNAV_SPEED": 1000.0,
        "WPNAV_SPEED_DN": 150.0,
        "WPNAV_SPEED_UP": 250.0,
    }
    bytewise_parameters = False
    mission_service = ArduPilotMissions
    takes_off_by_itself = False
    not_guided = DENIED
    """Its answer to MAV_CMD_DO_REPOSITION in another mode."""
    go_to: Callable[[Point], Maneuver] = GoTo
    blind_flags, blind_s = _EKF_BLIND, 7.0
    """EKF_STATUS_REPORT.flags without GPS, and how much later than the loss."""

    def __init__(self, settings: Settings) -> None:
        self.mode = Mode.STABILIZE
        self._gcs_heartbeat_s: float | None = None
        self._reminded_s = 0.0
        self._breached = False
        self._disarms_s = math.inf
        self._gps_lost_s = math.inf
        self._blind = False
        super().__init__(settings)
        self.add_handlers({"REQUEST_DATA_STREAM": self._request_data_stream})
        self.add_commands(
            {
                mavlink.MAV_CMD_NAV_TAKEOFF: self._nav_takeoff,
                mavlink.MAV_CMD_NAV_LAND: lambda _: self.request_mode(Mode.LAND, 0),
                mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self.request_mode(Mode.RTL, 0),
                mavlink.MAV_CMD_DO_REPOSITION: self._do_reposition,
                mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: self._do_set_mission_current,
                mavlink.MAV_CMD_MISSION_START: self._mission_start,
                mavlink.MAV_CMD_CONDITION_YAW: lambda _: ACCEPTED,
            }
        )

    def _own_parameters(self) -> Mapping[str, Number]:
        return {"SYSID_THISMAV": self.settings.system}

    # State

    @property
    def ekf_flags(self) -> int:
        if self._blind:
            return self.blind_flags
        if self.has_position:
            return _EKF_GOOD
        started = self.time_s >= 0.1 * self.settings.ready_s
        return _EKF_WITHOUT_POSITION if started else _EKF_UNINITIALIZED

    @property
    def ready(self) -> bool:
        return super().ready and "battery" not in self.failsafes

    @property
    def _unready(self) -> str:
        """Why it is not ready."""
        return "AHRS: waiting for home" if not super().ready else "Battery failsafe"

    @property
    def base_mode(self) -> int:
        guided = self.mode not in (Mode.STABILIZE, Mode.ALT_HOLD, Mode.LAND)
        return (
            mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
            | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
            | (mavlink.MAV_MODE_FLAG_GUIDED_ENABLED if guided else 0)
        )

    @property
    def custom_mode(self) -> int:
        return self.mode.value

    @property
    def fenced(self) -> bool:
        return bool(self.parameters["FENCE_ENABLE"] and self.parameters["FENCE_ACTION"])

    def in_fence(self, place: Point) -> bool:
        """Whether a place is within the circle and below the ceiling, if they count."""
        return not self.parameters["FENCE_ENABLE"] or (
            math.hypot(*place[:2]) <= self.parameters["FENCE_RADIUS"]
            and place.up_m <= self.parameters["FENCE_ALT_MAX"]
        )

    @property
    def mission_total(self) -> int:
        return len(self.mission.items) - 1

    @property
    def grounded_limit_s(self) -> float:
        return float(self.parameters["DISARM_DELAY"])

    # What maneuvers are made of

    def _metres(self, name: str) -> float:
        """Return a parameter that is in centimetres, as most are."""
        return clamp(self.parameters[name] / 100, 0.0, 3000.0)

    def usual_limits(self) -> Limits:
        return Limits(
            self._metres("WPNAV_SPEED"),
            self._metres("WPNAV_ACCEL"),
            self._metres("WPNAV_SPEED_UP"),
            self._metres("WPNAV_SPEED_DN"),
            self._metres("WPNAV_ACCEL_Z"),
        )

    def take_off(self, up_m: float) -> TakeOff:
        return TakeOff(self.craft.point, up_m)

    def landing(self) -> Land:
        return Land(self._metres("LAND_ALT_LOW"), max(0.1, self._metres("LAND_SPEED")))

    def way_home(self) -> Return:
        here, home = self.craft.point, self.home
        above_m, away_m = here.up_m - home.up_m, self.craft.distance_m(home)
        least_m = max(_RETURNS_ABOVE_M, above_m + self._metres("RTL_CLIMB_MIN"))
        up_m, slope = max(self._metres("RTL_ALT"), least_m), self.parameters["RTL_CONE_SLOPE"]
        if slope >= _LEAST_SLOPE:
            # Near home it does not climb all the way, but at least what it always climbs.
            up_m = min(up_m, max(slope * away_m, least_m))
        wait_s = self.parameters["RTL_LOIT_TIME"] / 1000
        return Return(here, home, up_m, None, wait_s, self.landing())

    def acceptance_radius_m(self, item: Item) -> float:
        return self._metres("WPNAV_RADIUS")

    # Modes

    def request_mode(self, main: int, sub: int) -> int:
        return self.set_mode_number(main)

    def set_mode_number(self, custom_mode: int) -> int:
        try:
            mode = Mode(custom_mode)
        except ValueError:
            self.send_text(f"No such mode {custom_mode}", mavlink.MAV_SEVERITY_WARNING)
            return FAILED
        return ACCEPTED if self.set_mode(mode) else FAILED

    def set_mode(self, mode: Mode) -> bool:
        """Change the mode, unless it is refused."""
        if mode == self.mode:
            return True
        problem = self._mode_problem(mode)
        if problem:
            self.send_text(
                f"Mode change to {mode.name} failed: {problem}", mavlink.MAV_SEVERITY_WARNING
            )
            return False
        self.mission.active = False
        self.mode = mode
        self._enter_mode()
        # It does not wait for the next second.
        self.broadcast(heartbeat(self))
        return True

    def _mode_problem(self, mode: Mode) -> str:
        # Disarmed, it accepts nearly any mode.
        if self.armed and not self.has_position and mode not in _WITHOUT_POSITION:
            return "requires position"
        if mode is Mode.AUTO and self.armed:
            if self.mission_total < 1:
                return "init failed"
            first = self.mission.items[1].command
            if self.landed and first != mavlink.MAV_CMD_NAV_TAKEOFF:
                self.send_text("Auto: Missing Takeoff Cmd", mavlink.MAV_SEVERITY_CRITICAL)
                return "init failed"
        return ""

    def _enter_mode(self) -> None:
        if self.mode is Mode.RTL:
            self.maneuver = self.way_home()
        elif self.mode is Mode.LAND:
            self.maneuver = self.landing()
        elif self.mode is Mode.AUTO:
            self.maneuver = MissionRun()
            if self.armed:
                self._run_mission()
        else:
            self.maneuver = Hold()

    def _run_mission(self) -> None:
        mission = self.mission
        if mission.finished or mission.current == 0 or self.parameters["MIS_RESTART"]:
            mission.rewind(1)
        mission.active = True

    # Arming

    def arm(self, *, force: bool) -> int:
        problem = ""
        if self.mode not in _ARMABLE:
            problem = f"{self.mode.name} mode not armable"
        elif not self.has_position and self.mode not in _WITHOUT_POSITION:
            problem = "Need Position Estimate"
        elif not self.ready:
            problem = self._unready
        if problem and not force:
            self.send_text(f"Arm: {problem}", mavlink.MAV_SEVERITY_CRITICAL)
            return FAILED
        self.send_text("Arming motors")
        self.start_motors()
        self._enter_mode()
        self.home = self.craft.point
        self.broadcast_home()
        return ACCEPTED

    def disarm(self) -> None:
        if self.armed:
            self.send_text("Disarming motors")
            self.mission.active = False
        super().disarm()
        self.maneuver = Hold()

    def touch_down(self) -> None:
        super().touch_down()
        self._disarms_s = self.time_s + _DISARMS_S

    # Commands

    def _nav_takeoff(self, command: Command) -> int:
        ready = self.armed and self.landed and self.mode is Mode.GUIDED
        up_m = self.home.up_m + command.z
        higher = up_m > self.craft.up_m and Point(0.0, 0.0, up_m).within_reach
        if not ready or not higher:
            return FAILED
        self.maneuver = self.take_off(up_m)
        return ACCEPTED

    def _do_reposition(self, command: Command) -> int:
        flags = max(command.whole(2), 0)
        change_mode = flags & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
        if self.mode.name != Mode.GUIDED.name and not change_mode:
            return self.not_guided
        if not command.on_the_earth or command.frame not in ABSOLUTE_FRAMES | RELATIVE_FRAMES:
            return DENIED
        up_m = height_m(command.z, command.frame, self.frame, self.home.up_m)
        target = Point(*self.frame.horizontal(command.lat_deg, command.lon_deg), up_m)
        if not target.within_reach:
            return DENIED
        if not self.set_mode(Mode.GUIDED) or not self.in_fence(target):
            return FAILED
        self.maneuver = self.go_to(target)
        return ACCEPTED

    def _mission_start(self, command: Command) -> int:
        if not self.set_mode(Mode.AUTO):
            return FAILED
        if self.armed and not self.mission.active:
            self._run_mission()
        return ACCEPTED

    def _do_set_mission_current(self, command: Command) -> int:
        return ACCEPTED if self.missions.set_current_item(command.whole(1)) else FAILED

    # Setpoints

    def set_position_target(self, message: Message, sender: Sender) -> None:
        """Fly to a setpoint, in GUIDED alone; there is no reply."""
        if self.mode is not Mode.GUIDED:
            return
        mask = message.type_mask
        if not mask & _IGNORE_POSITION:
            self._set_position(message)
        elif not mask & _IGNORE_VELOCITY:
            self.maneuver = Velocity(
                message.vx,
                message.vy,
                -message.vz,
                self.time_s + self.parameters["GUID_TIMEOUT"],
            )
        else:
            self.maneuver = Hold()

    def _set_position(self, message: Message) -> None:
        frame = message.coordinate_frame
        if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            here = Point(0.0, 0.0, 0.0) if frame in _LOCAL_FRAMES else self.craft.point
            target = Point(here.north_m + message.x, here.east_m + message.y, here.up_m - message.z)
            if frame in _LOCAL_FRAMES | _OFFSET_FRAMES and target.within_reach:
                self.maneuver = GoTo(target)
            return
        if frame in TERRAIN_FRAMES:
            # There is no terrain, so it continues its maneuver.
            return
        lat_deg, lon_deg = message.lat_int * 1e-7, message.lon_int * 1e-7
        up_m = height_m(message.alt, frame, self.frame, self.home.up_m)
        target = Point(*self.frame.horizontal(lat_deg, lon_deg), up_m)
        known = frame in ABSOLUTE_FRAMES | RELATIVE_FRAMES
        on_the_earth = abs(lat_deg) <= 90 and abs(lon_deg) <= 180
        good = known and on_the_earth and target.within_reach
        if good and not self.in_fence(target):
            # It continues its maneuver, without a message.
            return
        if good and not message.type_mask & _IGNORE_VELOCITY:
            until_s = self.time_s + self.parameters["GUID_TIMEOUT"]
            self.maneuver = Follow(target, message.vx, message.vy, until_s)
            return
        self.maneuver = GoTo(target) if good else Hold()

    # Missions

    def item_begun(self, seq: int, item: Item) -> None:
        self.send_text(f"Mission: {seq} {_SHORT_NAMES.get(item.command, f'CMD({item.command})')}")

    def item_reached(self, seq: int) -> None:
        super().item_reached(seq)
        self.send_text(f"Reached command #{seq}")

    def mission_finished(self) -> None:
        self.send_text("Mission complete")

    # Periodic checks

    def tick(self) -> None:
        if self.time_s >= self._disarms_s:
            self._disarms_s = math.inf
            if self.landed:
                self.disarm()
        remind = self.time_s - self._reminded_s >= _REMINDER_S
        if remind:
            self._reminded_s = self.time_s
            self.broadcast(self.parameters.message("STAT_RUNTIME"))
            if not self.ready and not self.armed:
                self.send_text(f"PreArm: {self._unready}", mavlink.MAV_SEVERITY_CRITICAL)
        self._watch_gcs()
        self._watch_fence()
        if not self._blind and self.time_s - self._gps_lost_s >= self.blind_s:
            self._blind = True
            self.position_failsafe()

    def handle_heartbeat(self, message: Message, sender: Sender) -> None:
        if sender.system == self.parameters["SYSID_MYGCS"]:
            self._gcs_heartbeat_s = self.time_s

    def _watch_gcs(self) -> None:
        if not self.parameters["FS_GCS_ENABLE"] or self._gcs_heartbeat_s is None:
            self.failsafes.discard("gcs")
            return
        lost = self.time_s - self._gcs_heartbeat_s > self.parameters["FS_GCS_TIMEOUT"]
        if lost and "gcs" not in self.failsafes:
            self.failsafes.add("gcs")
            land = self.parameters["FS_GCS_ENABLE"] == _GCS_FAILSAFE_LAND
            self._set_failsafe_mode(Mode.LAND if land else Mode.RTL, "GCS Failsafe")
        elif not lost and "gcs" in self.failsafes:
            # The mode stays what it is.
            self.failsafes.discard("gcs")
            self.send_text("GCS Failsafe Cleared", mavlink.MAV_SEVERITY_WARNING)

    def _watch_fence(self) -> None:
        breached = self.armed and not self.landed and not self.in_fence(self.craft.point)
        if breached and not self._breached:
            self.send_text("Fence Breached", mavlink.MAV_SEVERITY_NOTICE)
            if self.fenced:
                self._set_failsafe_mode(Mode.RTL)
        self._breached = breached

    def lose_gps(self) -> None:
        """Have no GPS from now on."""
        self._gps_lost_s = self.time_s

    def position_failsafe(self) -> None:
        """Land, as the position is not known any more."""
        self.failsafes.add("ekf")
        self._set_failsafe_mode(Mode.LAND, "EKF variance", "EKF Failsafe: changed to LAND Mode")

    def battery_failsafe(self) -> None:
        self._set_failsafe_mode(
            Mode.RTL, "Battery 1 is low 9.96V used 2900 mAh", "Battery Failsafe"
        )

    def _set_failsafe_mode(self, mode: Mode, *texts: str) -> None:
        """Come down; texts wait in a queue, so that the heartbeat overtakes them."""
        if self.armed and self.landed:
            self.disarm()
        elif self.armed:
            self.set_mode(mode)
        for text in texts:
            self.send_text(text, mavlink.MAV_SEVERITY_WARNING)

    def pilot_takes_over(self, mode: str) -> None:
        self.set_mode(Mode[mode or "LOITER"])

    def _request_data_stream(self, message: Message, sender: Sender) -> None:
        rate_hz = message.req_message_rate
        on = message.start_stop and rate_hz
        interval_s = max(MIN_INTERVAL_S, 1.0 / rate_hz) if on else None
        for stream, numbers in _STREAMS.items():
            if message.req_stream_id in (mavlink.MAV_DATA_STREAM_ALL, stream):
                for number in numbers:
                    sender.channel.stream(number, interval_s, self.time_s)


_SHORT_NAMES = {
    mavlink.MAV_CMD_NAV_WAYPOINT: "WP",
    mavlink.MAV_CMD_NAV_LOITER_TIME: "LoitTime",
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: "LoitUnlim",
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: "RTL",
    mavlink.MAV_CMD_NAV_LAND: "Land",
    mavlink.MAV_CMD_NAV_TAKEOFF: "Takeoff",
}
