# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Telemetry of the vehicle: one function per message."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from .wire import Message, MissionCurrent, mavlink

if TYPE_CHECKING:
    from .vehicle import Vehicle

Builder = Callable[["Vehicle"], "Message | None"]

_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_POSITION = mavlink.MAV_SYS_STATUS_SENSOR_GPS | mavlink.MAV_SYS_STATUS_AHRS
_SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | _POSITION
    | _PREARM
)
_IGNORE_ALL_BUT_POSITION = 0x0DF8
_CELLS = 3
# Any day will do, as long as it is the same one in each run.
_START_US = 1_700_000_000_000_000
_FULL_V, _EMPTY_V = 12.6, 9.6


def _ms(vehicle: Vehicle) -> int:
    return int(vehicle.uptime_s * 1000)


def _us(vehicle: Vehicle) -> int:
    return int(vehicle.uptime_s * 1e6)


def _degrees_e7(vehicle: Vehicle) -> tuple[int, int]:
    """Latitude and longitude; without a position they are 0, as they are in the field."""
    if not vehicle.has_position:
        return 0, 0
    lat_deg, lon_deg = vehicle.frame.geodetic(vehicle.craft.north_m, vehicle.craft.east_m)
    return round(lat_deg * 1e7), round(lon_deg * 1e7)


def _amsl_m(vehicle: Vehicle) -> float:
    return vehicle.frame.home.alt_amsl_m + vehicle.craft.up_m


def _course_deg(vehicle: Vehicle) -> float:
    return math.degrees(vehicle.craft.heading_rad) % 360.0


def _millivolts(vehicle: Vehicle) -> int:
    return round(1000 * (_EMPTY_V + (_FULL_V - _EMPTY_V) * vehicle.battery))


def heartbeat(vehicle: Vehicle) -> Message:
    base_mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | vehicle.base_mode
    if vehicle.armed:
        base_mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    return mavlink.MAVLink_heartbeat_message(
        vehicle.kind,
        vehicle.autopilot,
        base_mode,
        vehicle.custom_mode,
        vehicle.system_status,
        3,
    )


def sys_status(vehicle: Vehicle) -> Message:
    health = _SENSORS
    if not vehicle.has_position:
        health &= ~_POSITION
    if not vehicle.ready:
        health &= ~_PREARM
    fence = mavlink.MAV_SYS_STATUS_GEOFENCE if vehicle.fenced else 0
    return mavlink.MAVLink_sys_status_message(
        _SENSORS | fence, _SENSORS | fence, health | fence, 100, _millivolts(vehicle), 1500,
        round(100 * vehicle.battery), 0, 0, 0, 0, 0, 0,
    )  # fmt: skip


def system_time(vehicle: Vehicle) -> Message:
    return mavlink.MAVLink_system_time_message(_START_US + _us(vehicle), _ms(vehicle))


def gps_raw_int(vehicle: Vehicle) -> Message:
    craft = vehicle.craft
    fix, satellites = (mavlink.GPS_FIX_TYPE_RTK_FIXED, 10) if vehicle.has_position else (1, 0)
    return mavlink.MAVLink_gps_raw_int_message(
        _us(vehicle), fix, *_degrees_e7(vehicle), round(1000 * _amsl_m(vehicle)), 121, 200,
        round(100 * craft.ground_speed_mps), round(100 * _course_deg(vehicle)), satellites,
    )  # fmt: skip


def attitude(vehicle: Vehicle) -> Message:
    heading = (vehicle.craft.heading_rad + math.pi) % (2 * math.pi) - math.pi
    return mavlink.MAVLink_attitude_message(_ms(vehicle), 0.0, 0.0, heading, 0.0, 0.0, 0.0)


def attitude_quaternion(vehicle: Vehicle) -> Message:
    half = vehicle.craft.heading_rad / 2
    return mavlink.MAVLink_attitude_quaternion_message(
        _ms(vehicle), math.cos(half), 0.0, 0.0, math.sin(half), 0.0, 0.0, 0.0
    )


def local_position_ned(vehicle: Vehicle) -> Message | None:
    if not vehicle.has_position:
        return None
    craft = vehicle.craft
    return mavlink.MAVLink_local_position_ned_message(
        _ms(vehicle), craft.north_m, craft.east_m, -craft.up_m,
        craft.north_mps, craft.east_mps, -craft.up_mps,
    )  # fmt: skip


def global_position_int(vehicle: Vehicle) -> Message:
    craft = vehicle.craft
    return mavlink.MAVLink_global_position_int_message(
        _ms(vehicle), *_degrees_e7(vehicle), round(1000 * _amsl_m(vehicle)),
        round(1000 * (craft.up_m - vehicle.home.up_m)),
        round(100 * craft.north_mps), round(100 * craft.east_mps), round(-100 * craft.up_mps),
        round(100 * _course_deg(vehicle)) % 36000,
    )  # fmt: skip


def mission_current(vehicle: Vehicle) -> Message:
    mission = vehicle.mission
    total = vehicle.mission_total
    if total <= 0:
        state = mavlink.MISSION_STATE_NO_MISSION
    elif mission.finished:
        state = mavlink.MISSION_STATE_COMPLETE
    elif mission.active:
        state = mavlink.MISSION_STATE_ACTIVE
    elif mission.reached is None:
        state = mavlink.MISSION_STATE_NOT_STARTED
    else:
        state = mavlink.MISSION_STATE_PAUSED
    return MissionCurrent(
        mission.current, max(total, 0), state, 1 if mission.active else 2,
        mission_id=vehicle.mission_id,
    )  # fmt: skip


def vfr_hud(vehicle: Vehicle) -> Message:
    craft = vehicle.craft
    speed_mps = craft.ground_speed_mps
    throttle = 0 if vehicle.landed else 40
    return mavlink.MAVLink_vfr_hud_message(
        speed_mps, speed_mps, round(_course_deg(vehicle)) % 360, throttle, _amsl_m(vehicle),
        craft.up_mps,
    )  # fmt: skip


def position_target_global_int(vehicle: Vehicle) -> Message | None:
    """The target as ArduPilot reports it: always in frame 0, with the altitude above sea level."""
    target = vehicle.maneuver.target
    if target is None or not vehicle.has_position:
        return None
    lat_deg, lon_deg = vehicle.frame.geodetic(target.north_m, target.east_m)
    return mavlink.MAVLink_position_target_global_int_message(
        _ms(vehicle), mavlink.MAV_FRAME_GLOBAL, _IGNORE_ALL_BUT_POSITION,
        round(lat_deg * 1e7), round(lon_deg * 1e7), vehicle.frame.home.alt_amsl_m + target.up_m,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip


def altitude(vehicle: Vehicle) -> Message:
    up_m, amsl_m = vehicle.craft.up_m, _amsl_m(vehicle)
    return mavlink.MAVLink_altitude_message(
        _us(vehicle), amsl_m, amsl_m, up_m, up_m, math.nan, math.nan
    )


def battery_status(vehicle: Vehicle) -> Message:
    cell = _millivolts(vehicle) // _CELLS
    return mavlink.MAVLink_battery_status_message(
        0, mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO, 2500,
        [cell] * _CELLS + [65535] * (10 - _CELLS), 1500, -1, -1, round(100 * vehicle.battery),
        charge_state=vehicle.charge_state,
    )  # fmt: skip


def autopilot_version(vehicle: Vehicle) -> Message:
    nothing = [0] * 8
    version = vehicle.version
    return mavlink.MAVLink_autopilot_version_message(
        vehicle.capabilities, version[0] << 24 | version[1] << 16 | version[2] << 8 | 255,
        0, 0, 0, nothing, nothing, nothing, 0, 0, vehicle.uid,
    )  # fmt: skip


def ekf_status_report(vehicle: Vehicle) -> Message:
    return mavlink.MAVLink_ekf_status_report_message(
        vehicle.ekf_flags, 0.1, 0.1, 0.1, 0.1, 0.1
    )  # fmt: skip


def estimator_status(vehicle: Vehicle) -> Message:
    return mavlink.MAVLink_estimator_status_message(
        _us(vehicle), vehicle.ekf_flags, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5
    )


def home_position(vehicle: Vehicle) -> Message | None:
    if not vehicle.has_position:
        return None
    home = vehicle.home_place
    return mavlink.MAVLink_home_position_message(
        round(home.lat_deg * 1e7), round(home.lon_deg * 1e7), round(1000 * home.alt_amsl_m),
        0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, _us(vehicle),
    )  # fmt: skip


def gps_global_origin(vehicle: Vehicle) -> Message | None:
    if not vehicle.has_position:
        return None
    home = vehicle.frame.home
    return mavlink.MAVLink_gps_global_origin_message(
        round(home.lat_deg * 1e7), round(home.lon_deg * 1e7), round(1000 * home.alt_amsl_m),
        _us(vehicle),
    )  # fmt: skip


def extended_sys_state(vehicle: Vehicle) -> Message:
    state = mavlink.MAV_LANDED_STATE_ON_GROUND
    if vehicle.seems_to_fly:
        state = vehicle.maneuver.landed_state
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, state)


def _estimated_wind(vehicle: Vehicle) -> tuple[float, float]:
    return vehicle.craft.wind_mps if vehicle.settings.estimates_wind else (0.0, 0.0)


def wind(vehicle: Vehicle) -> Message:
    """The wind as ArduPilot reports it: where it comes from, -180 to 180."""
    north_mps, east_mps = _estimated_wind(vehicle)
    from_deg = math.degrees(math.atan2(-east_mps, -north_mps))
    return mavlink.MAVLink_wind_message(from_deg, math.hypot(north_mps, east_mps), 0.0)


def wind_cov(vehicle: Vehicle) -> Message:
    """The wind as PX4 reports it: where it blows to."""
    return mavlink.MAVLink_wind_cov_message(
        _us(vehicle), *_estimated_wind(vehicle), 0.0, 0.1, 0.0, _amsl_m(vehicle), 0.0, 0.0
    )


COMMON: dict[int, Builder] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: mission_current,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: position_target_global_int,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
}
ARDUPILOT = COMMON | {
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: ekf_status_report,
    mavlink.MAVLINK_MSG_ID_WIND: wind,
}
PX4 = COMMON | {
    mavlink.MAVLINK_MSG_ID_ALTITUDE: altitude,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: estimator_status,
    mavlink.MAVLINK_MSG_ID_WIND_COV: wind_cov,
}
