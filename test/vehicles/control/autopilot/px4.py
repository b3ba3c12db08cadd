# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The behaviour of PX4's multicopter."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import replace
from enum import IntEnum
from typing import ClassVar

from .channel import Channel, Sender
from .commands import ACCEPTED, TEMPORARILY_REJECTED, UNSUPPORTED, Command
from .local_frame import Point
from .maneuvers import GoTo, Hold, Land, Return, TakeOff, Track, Velocity
from .mission_items import GLOBAL_FRAMES, RELATIVE_FRAMES, Item, height_m
from .mission_run import MissionRun
from .parameters import Number
from .point_mass import Limits
from .px4_missions import Px4Missions
from .settings import Settings
from .telemetry import PX4
from .vehicle import Vehicle, clamp
from .wire import Event, Message, mavlink


def _encoded(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


class Mode(IntEnum):
    """HEARTBEAT.custom_mode: the main mode in its third byte, the sub-mode in the fourth."""

    MANUAL = _encoded(1)
    ALTCTL = _encoded(2)
    POSCTL = _encoded(3)
    OFFBOARD = _encoded(6)
    STABILIZED = _encoded(7)
    TAKEOFF = _encoded(4, 2)
    HOLD = _encoded(4, 3)
    MISSION = _encoded(4, 4)
    RTL = _encoded(4, 5)
    LAND = _encoded(4, 6)


_MANUAL = {Mode.MANUAL, Mode.ALTCTL, Mode.POSCTL, Mode.STABILIZED}
_PREVENT_ARMING = {Mode.RTL, Mode.LAND}
_OFFBOARD_LOSS = {3: Mode.RTL, 4: Mode.LAND, 5: Mode.HOLD}
"""Of COM_OBL_RC_ACT; a mode that needs a remote control becomes a return where there is none."""
_EMERGENCY = 0.04
_OPEN_ENDED_S = math.inf
_EKF_WITHOUT_POSITION, _EKF_AT_REST, _EKF_GOOD = 0x27, 0x3FF, 0x33F
_OFFBOARD_MPS2 = 8.0
_FAILSAFE_DELAY_S = 5.0
_IGNORE_POSITION, _IGNORE_VELOCITY = 0x007, 0x038
_FIRST_DESCENT_UP_M = 10.0
_REACHED_REPEATS = 10
_ALL_MODES = 0xFFFFFFFF
_IN_THE_AIR_M = 1.0
_PROTOCOL = 8
"""Log level of events that are not for people."""


class Px4(Vehicle):
    """A vehicle that behaves as PX4 does without a remote control.

    Attributes:
        mode: The current one, also if a failsafe has set it.
        events: Texts of the events that it has sent.
        home_above_origin_m: Height of home over the origin of the position estimate.
    """

    autopilot = mavlink.MAV_AUTOPILOT_PX4
    version = (1, 17, 0)
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    builders = PX4
    default_intervals_s: ClassVar[dict[int, float]] = {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 0.2,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 2.0,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 0.2,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.2,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 2.0,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 0.2,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 1.0,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 0.5,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 0.5,
    }
    default_parameters: ClassVar[dict[str, Number]] = {
        "SYS_AUTOSTART": 10016,
        "CAL_ACC0_ID": 1310988,
        "CAL_GYRO0_ID": 1310988,
        "CAL_MAG0_ID": 197388,
        "COM_ARM_MIS_REQ": 0,
        "COM_DISARM_LAND": 2.0,
        "COM_DISARM_PRFLT": 10.0,
        "COM_OBL_RC_ACT": 0,
        "COM_OF_LOSS_T": 1.0,
        "GF_ACTION": 2,
        "MIS_TAKEOFF_ALT": 2.5,
        "MPC_ACC_HOR": 3.0,
        "MPC_ACC_UP_MAX": 4.0,
        "MPC_LAND_SPEED": 0.7,
        "MPC_TKO_SPEED": 1.5,
        "MPC_XY_CRUISE": 5.0,
        "MPC_XY_VEL_MAX": 12.0,
        "MPC_Z_VEL_MAX_DN": 1.5,
        "MPC_Z_VEL_MAX_UP": 3.0,
        "NAV_ACC_RAD": 2.0,
        "NAV_DLL_ACT": 0,
        "RTL_CONE_ANG": 45,
        "RTL_DESCEND_ALT": 10.0,
        "RTL_LAND_DELAY": 0.0,
        "RTL_MIN_DIST": 10.0,
        "RTL_RETURN_ALT": 30.0,
    }
    bytewise_parameters = True
    mission_service = Px4Missions
    takes_off_by_itself = True

    def __init__(self, settings: Settings) -> None:
        self.mode = Mode.HOLD
        self.events: list[str] = []
        self.home_above_origin_m = 0.0
        self._stations: list[Channel] = []
        self._after_disarming = Mode.HOLD
        self._failsafe_s = 0.0
        self._has_landed = False
        self._setpoint_s = -math.inf
        self._reached_repeats = 0
        self._last_current = 0
        self._reported_checks: list[tuple[str, int, int]] = []
        super().__init__(settings)
        self.add_commands(
            {
                mavlink.MAV_CMD_NAV_TAKEOFF: self._nav_takeoff,
                mavlink.MAV_CMD_NAV_LAND: lambda _: self.set_mode_number(Mode.LAND),
                mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self.set_mode_number(Mode.RTL),
                mavlink.MAV_CMD_DO_REPOSITION: self._do_reposition,
                mavlink.MAV_CMD_MISSION_START: self._mission_start,
                mavlink.MAV_CMD_RUN_PREARM_CHECKS: lambda _: self._report_checks(),
            }
        )

    def set_speedup(self, speedup: float) -> None:
        # As its start script does in simulation: the sender's clock is not sped up.
        if "COM_OF_LOSS_T" not in dict(self.settings.parameters):
            self.parameters["COM_OF_LOSS_T"] = max(speedup, 1.0)

    def _own_parameters(self) -> Mapping[str, Number]:
        return {"MAV_SYS_ID": self.settings.system}

    # State

    @property
    def ekf_flags(self) -> int:
        if not self.has_position:
            return _EKF_WITHOUT_POSITION
        return _EKF_AT_REST if self.landed else _EKF_GOOD

    @property
    def ready(self) -> bool:
        """Whether it can be armed in its mode: in OFFBOARD only while setpoints come."""
        if self.mode in _PREVENT_ARMING or (self.mode is Mode.OFFBOARD and not self._has_stream):
            return False
        if self.failsafes & {"geofence", "gps"}:
            return False
        lacks_mission = self.parameters["COM_ARM_MIS_REQ"] and not self.mission.items
        return super().ready and not lacks_mission

    @property
    def system_status(self) -> int:
        if not self.armed:
            return mavlink.MAV_STATE_STANDBY if self.ready else mavlink.MAV_STATE_UNINIT
        return mavlink.MAV_STATE_CRITICAL if self.failsafes else mavlink.MAV_STATE_ACTIVE

    @property
    def charge_state(self) -> int:
        if self.battery <= _EMERGENCY:
            return mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY
        return super().charge_state

    @property
    def base_mode(self) -> int:
        if self.mode in _MANUAL:
            return mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        return (
            mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
            | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
            | mavlink.MAV_MODE_FLAG_AUTO_ENABLED
        )

    @property
    def custom_mode(self) -> int:
        return self.mode.value

    @property
    def mission_total(self) -> int:
        return len(self.mission.items)

    @property
    def mission_id(self) -> int:
        items = self.mission.items
        return zlib.crc32(repr(items).encode()) if items else 0

    @property
    def grounded_limit_s(self) -> float:
        return self.parameters["COM_DISARM_LAND" if self._has_landed else "COM_DISARM_PRFLT"]

    # What maneuvers are made of

    def usual_limits(self) -> Limits:
        parameters = self.parameters
        return Limits(
            parameters["MPC_XY_CRUISE"],
            parameters["MPC_ACC_HOR"],
            parameters["MPC_Z_VEL_MAX_UP"],
            parameters["MPC_Z_VEL_MAX_DN"],
            parameters["MPC_ACC_UP_MAX"],
        )

    def offboard_limits(self) -> Limits:
        """Return the limits of OFFBOARD, which has no cruise speed."""
        speed_mps = clamp(self.parameters["MPC_XY_VEL_MAX"], 0.1, 30.0)
        return replace(self.usual_limits(), speed_mps=speed_mps, acceleration_mps2=_OFFBOARD_MPS2)

    def take_off(self, up_m: float) -> TakeOff:
        climb_mps = clamp(self.parameters["MPC_TKO_SPEED"], 0.1, self.limits.climb_mps)
        return TakeOff(self.craft.point, up_m, climb_mps)

    def landing(self) -> Land:
        final_mps = clamp(self.parameters["MPC_LAND_SPEED"], 0.1, self.limits.descent_mps)
        return Land(_FIRST_DESCENT_UP_M, final_mps)

    def way_home(self) -> Return:
        here, wait_s = self.craft.point, self.parameters["RTL_LAND_DELAY"]
        descend_up_m = self._height_m("RTL_DESCEND_ALT") if wait_s else None
        up_m = self._return_up_m()
        near_m = self.parameters["NAV_ACC_RAD"]
        return Return(here, self.home, up_m, descend_up_m, wait_s, self.landing(), near_m)

    def _return_up_m(self) -> float:
        """Return the height above home to which it climbs before it flies home."""
        up_m, near_m = self._height_m("RTL_RETURN_ALT"), self.parameters["NAV_ACC_RAD"]
        half_angle_deg, away_m = self.parameters["RTL_CONE_ANG"], self.craft.distance_m(self.home)
        if half_angle_deg == 0 or away_m > max(near_m, self.parameters["RTL_MIN_DIST"]):
            return up_m
        if away_m <= near_m:
            return min(up_m, 2.0 * away_m)
        cone_m = away_m / math.tan(math.radians(clamp(half_angle_deg, 1, 89)))
        return min(up_m, max(cone_m, 2.0 * near_m))

    def _height_m(self, name: str) -> float:
        return clamp(self.parameters[name], 0.0, 3000.0)

    def acceptance_radius_m(self, item: Item) -> float:
        return item.param2 if item.param2 > 0 else self.parameters["NAV_ACC_RAD"]

    # Modes

    def request_mode(self, main: int, sub: int) -> int:
        return self.set_mode_number(_encoded(main, sub))

    def set_mode_number(self, custom_mode: int) -> int:
        try:
            mode = Mode(custom_mode)
        except ValueError:
            return UNSUPPORTED
        return ACCEPTED if self.set_mode(mode) else TEMPORARILY_REJECTED

    def set_mode(self, mode: Mode) -> bool:
        """Change the mode, unless it is refused; disarmed, none is."""
        if mode == self.mode and not self.failsafes:
            return True
        problem = self._mode_problem(mode) if self.armed else ""
        if problem:
            self.send_text(
                f"Switching to {mode.name} denied: {problem}", mavlink.MAV_SEVERITY_CRITICAL
            )
            return False
        self.failsafes.clear()
        self._set_intended_mode(mode)
        self._enter_mode()
        return True

    def _set_intended_mode(self, mode: Mode) -> None:
        self.mode = mode
        if mode not in _PREVENT_ARMING and mode is not Mode.TAKEOFF:
            self._after_disarming = mode

    def _set_failsafe_mode(self, mode: Mode) -> None:
        """Change the mode by a failsafe, without changing the one after disarming."""
        self.mode = mode
        self._enter_mode()

    def _mode_problem(self, mode: Mode) -> str:
        if mode not in _MANUAL and not self.has_position:
            return "no position"
        if mode is Mode.MISSION and not self.mission.items:
            return "no valid mission"
        if mode is Mode.OFFBOARD and not self._has_stream:
            return "no offboard signal"
        return ""

    def _enter_mode(self) -> None:
        self.mission.active = False
        match self.mode:
            case Mode.MISSION:
                if self.mission.finished:
                    self.mission.rewind(0)
                self.mission.active = True
                self.maneuver = MissionRun()
            case Mode.RTL:
                self.maneuver = self.way_home()
            case Mode.LAND:
                self.maneuver = self.landing()
            case Mode.TAKEOFF:
                self.maneuver = self.take_off(self._height_m("MIS_TAKEOFF_ALT"))
            case Mode.HOLD:
                self.maneuver = Hold(self.craft.point)
            case _:
                self.maneuver = Hold()

    # Arming

    def arm(self, *, force: bool) -> int:
        if not self.ready and not force:
            self.send_text("Arming denied: Resolve system health failures first", 2)
            return TEMPORARILY_REJECTED
        self._has_landed = False
        self.start_motors()
        self.send_text("Armed by external command")
        if self.craft.up_m > _IN_THE_AIR_M:
            self.send_text("Takeoff detected")
            self.lift_off()
        self._enter_mode()
        return ACCEPTED

    def disarm(self) -> None:
        if self.armed:
            self.send_text("Disarmed by landing" if self._has_landed else "Disarmed")
            self.mission.active = False
            self.failsafes.clear()
            self._set_intended_mode(self._after_disarming)
            if not self.landed:
                # What is not armed counts as landed, and home is where it landed.
                self.home = self.craft.point
                self.broadcast_home()
        super().disarm()
        self.maneuver = Hold()

    def touch_down(self) -> None:
        super().touch_down()
        self._has_landed = True
        self.send_text("Landing detected")

    # Commands

    def _nav_takeoff(self, command: Command) -> int:
        # Above the sea in any frame.
        up_m = command.z - self.frame.home.alt_amsl_m
        if not math.isfinite(command.z):
            up_m = self._height_m("MIS_TAKEOFF_ALT")
        if not self.has_position or not self.landed or not Point(0.0, 0.0, up_m).within_reach:
            return TEMPORARILY_REJECTED
        self._set_intended_mode(Mode.TAKEOFF)
        self._enter_mode()
        self.maneuver = self.take_off(up_m)
        return ACCEPTED

    def _do_reposition(self, command: Command) -> int:
        if command.param2 != mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE:
            return UNSUPPORTED
        north_m, east_m, up_m = self.craft.point
        if command.on_the_earth:
            north_m, east_m = self.frame.horizontal(command.lat_deg, command.lon_deg)
        if math.isfinite(command.z):
            # Above the sea in any frame.
            up_m = command.z - self.frame.home.alt_amsl_m
        target = Point(north_m, east_m, up_m)
        if not target.within_reach or not self.set_mode(Mode.HOLD):
            return TEMPORARILY_REJECTED
        self.maneuver = GoTo(target)
        return ACCEPTED

    def _mission_start(self, command: Command) -> int:
        if not self.mission.items or not self.set_mode(Mode.MISSION):
            return TEMPORARILY_REJECTED
        return ACCEPTED if self.armed else self.arm(force=False)

    # Setpoints

    @property
    def _has_stream(self) -> bool:
        """Whether the last setpoint is recent."""
        return self.time_s - self._setpoint_s < self.parameters["COM_OF_LOSS_T"]

    def set_position_target(self, message: Message, sender: Sender) -> None:
        """Fly to a setpoint in OFFBOARD; that mode needs a stream of them, before it too."""
        self._setpoint_s = self.time_s
        if self.mode is Mode.OFFBOARD and self.armed:
            self._fly_to_setpoint(message)

    def _fly_to_setpoint(self, message: Message) -> None:
        if self.landed:
            # Any setpoint above it lifts it off the ground.
            self.lift_off()
        if not message.type_mask & _IGNORE_POSITION:
            target = self._target(message)
            self.maneuver = Hold()
            if target and target.within_reach:
                stops = message.type_mask & _IGNORE_VELOCITY
                velocity = (0.0, 0.0) if stops else (message.vx, message.vy)
                self.maneuver = Track(target, *velocity, self.offboard_limits())
        elif not message.type_mask & _IGNORE_VELOCITY:
            self.maneuver = Velocity(message.vx, message.vy, -message.vz, _OPEN_ENDED_S)
        else:
            self.maneuver = Hold()

    def _target(self, message: Message) -> Point | None:
        if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            return Point(message.x, message.y, -message.z)
        if message.coordinate_frame not in GLOBAL_FRAMES:
            return None
        place = self.frame.horizontal(message.lat_int * 1e-7, message.lon_int * 1e-7)
        up_m = height_m(message.alt, message.coordinate_frame, self.frame)
        if message.coordinate_frame in RELATIVE_FRAMES:
            # mavlink_receiver.cpp has a wrong sign there.
            up_m -= 2 * self.home_above_origin_m
        return Point(*place, up_m)

    # Missions

    def item_begun(self, seq: int, item: Item) -> None:
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            # The mission ends with it, and after a mission comes HOLD.
            self._set_intended_mode(Mode.HOLD)
            self._set_intended_mode(Mode.RTL)

    def item_reached(self, seq: int) -> None:
        super().item_reached(seq)
        self._reached_repeats = _REACHED_REPEATS

    def mission_finished(self) -> None:
        if not self.landed:
            self.send_text("Mission finished, loitering")

    # Periodic checks

    def tick(self) -> None:
        self._send_progress()
        if isinstance(self.maneuver, TakeOff) and self.mode is Mode.TAKEOFF and self.maneuver.done:
            target = self.maneuver.target
            self._set_intended_mode(Mode.HOLD)
            self.maneuver = GoTo(target)
        if self.armed and self.mode is Mode.OFFBOARD and not self._has_stream:
            self.send_text("Failsafe activated", mavlink.MAV_SEVERITY_CRITICAL)
            self.failsafes.add("offboard")
            self._set_failsafe_mode(
                _OFFBOARD_LOSS.get(int(self.parameters["COM_OBL_RC_ACT"]), Mode.RTL)
            )
        elif self.failsafes == {"offboard"} and self._has_stream:
            self.failsafes.clear()
            self._set_failsafe_mode(Mode.OFFBOARD)
        if self.mode is Mode.HOLD and self.time_s >= self._failsafe_s:
            if "battery" in self.failsafes:
                self._set_failsafe_mode(Mode.LAND)
            elif "geofence" in self.failsafes:
                self._set_failsafe_mode(Mode.RTL)
        if self._failed_checks != self._reported_checks:
            self._report_checks()

    def send_text(self, text: str, severity: int = mavlink.MAV_SEVERITY_INFO) -> None:
        """Send an EVENT, a number without a text, here one made of the text.

        The text, with a tab at its end, goes only to links with a ground station.
        """
        self._send_event(text, severity)
        for channel in self._stations:
            channel.send(mavlink.MAVLink_statustext_message(severity, f"{text}\t".encode()[:50]))

    def _send_event(self, name: str, severity: int, arguments: bytes = b"") -> None:
        self.events.append(name)
        time_ms, sequence = int(self.time_s * 1000), len(self.events)
        self.broadcast(Event(name, time_ms, sequence, severity, arguments))

    @property
    def _failed_checks(self) -> list[tuple[str, int, int]]:
        """Name, modes and severity of each arming check that fails."""
        failed = [("check_modes_manual_control", _ALL_MODES, mavlink.MAV_SEVERITY_WARNING)]
        if not self._has_stream:
            failed.append(("check_modes_offboard_signal", 1 << 14, mavlink.MAV_SEVERITY_ERROR))
        if not self.mission.items:
            modes = _ALL_MODES if self.parameters["COM_ARM_MIS_REQ"] else 1 << 3
            failed.append(("check_modes_mission", modes, mavlink.MAV_SEVERITY_INFO))
        if "geofence" in self.failsafes:
            severity = mavlink.MAV_SEVERITY_ERROR
            failed.append(("check_gf_violation_max_hor_dist", _ALL_MODES, severity))
        if not self.has_position or "gps" in self.failsafes:
            failed.append(("check_modes_global_pos", 0x38, mavlink.MAV_SEVERITY_ERROR))
        return failed

    def _report_checks(self) -> int:
        """Report the arming checks that fail, as it does when they change and on request."""
        self._reported_checks = self._failed_checks
        self._send_event("commander_arming_check_summary", _PROTOCOL)
        for name, modes, severity in self._reported_checks:
            self._send_event(name, severity, modes.to_bytes(4, "little"))
        self._send_event("commander_health_summary", _PROTOCOL)
        return ACCEPTED

    def handle_heartbeat(self, message: Message, sender: Sender) -> None:
        if message.type == mavlink.MAV_TYPE_GCS and sender.channel not in self._stations:
            self._stations.append(sender.channel)

    def _send_progress(self) -> None:
        if self.mission.current != self._last_current:
            self._last_current = self.mission.current
            self.broadcast(self.builders[mavlink.MAVLINK_MSG_ID_MISSION_CURRENT](self))
        if self._reached_repeats and self.mission.reached is not None:
            whole_second = math.floor(self.time_s + 1e-9) > math.floor(self.time_s - 0.1 + 1e-9)
            if whole_second:
                self._reached_repeats -= 1
                self.broadcast(mavlink.MAVLink_mission_item_reached_message(self.mission.reached))

    def breach_geofence(self) -> None:
        """Hold, then return, without a message that names the cause."""
        self.failsafes.add("geofence")
        self._failsafe_s = self.time_s + _FAILSAFE_DELAY_S
        self._set_failsafe_mode(Mode.HOLD)

    def lose_gps(self) -> None:
        """Descend blindly; SYS_STATUS does not show the cause for some seconds."""
        self.failsafes.add("gps")
        self._set_failsafe_mode(Mode.ALTCTL)
        self.maneuver = self.landing()

    def battery_failsafe(self) -> None:
        self.battery = min(self.battery, _EMERGENCY)
        self.send_text("Emergency battery level", mavlink.MAV_SEVERITY_EMERGENCY)
        if self.armed and not self.landed:
            self._failsafe_s = self.time_s + _FAILSAFE_DELAY_S
            self._set_failsafe_mode(Mode.HOLD)

    def pilot_takes_over(self, mode: str) -> None:
        self.set_mode(Mode[mode or "POSCTL"])
