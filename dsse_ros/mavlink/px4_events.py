# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Events of PX4: numbers, which a ground station looks up in the autopilot's metadata.

https://mavlink.io/en/services/events.html. An event's number is a hash of its name, so the few
about arming need no metadata. PX4 reports all failing arming checks whenever they change: the
summary, the checks, and the summary of its health.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1 << 24
_FNV_BASIS, _FNV_PRIME = 0x811C9DC5, 0x01000193
_ALL_MODES = 0xFFFFFFFF
_RESTING = 1 << 4
"""HOLD is PX4's NAVIGATION_STATE_AUTO_LOITER."""
_WARNING = mavlink.MAV_SEVERITY_WARNING


def event_number(name: str) -> int:
    """Return the number of an event of the autopilot: FNV-1a of its name."""
    number = _FNV_BASIS
    for letter in name.encode():
        number = (number ^ letter) * _FNV_PRIME % 2**32
    return _COMPONENT | number & 0xFFFFFF


SUMMARY = event_number("commander_arming_check_summary")
"""Begins a report."""

_TEXTS: Mapping[int, str] = {
    event_number(f"check_{name}"): text
    for name, text in {
        "accel_missing": "accelerometer is missing",
        "accel_no_data": "accelerometer has no data",
        "accel_not_calibrated": "accelerometer is not calibrated",
        "armable_configuration": "safety configuration",
        "avionics_power_low": "avionics power is low",
        "avionics_power_missing": "power module is missing",
        "baro_missing": "barometer is missing",
        "baro_no_data": "barometer has no data",
        "battery_critical": "battery is critical",
        "battery_disconnected": "battery is disconnected",
        "battery_emergency": "battery is nearly empty",
        "battery_fault": "battery fault",
        "battery_low": "battery is low",
        "battery_missing": "battery is missing",
        "battery_unhealthy": "battery is unhealthy",
        "cpuload_too_high": "CPU load is too high",
        "escs_fault": "ESC fault",
        "escs_offline": "ESC is offline",
        "escs_telem_missing": "ESC telemetry is missing",
        "estimator_gps_fix_too_low": "GPS fix is too low",
        "estimator_gps_generic": "GPS quality is poor",
        "estimator_gps_hor_pos_err_too_high": "GPS position error is too high",
        "estimator_gps_not_fusing": "GPS is not used by the estimator",
        "estimator_gps_num_sats_too_low": "too few GPS satellites",
        "estimator_gps_pdop_too_high": "GPS PDOP is too high",
        "estimator_heading_not_stable": "heading estimate is not stable",
        "estimator_hgt_not_stable": "height estimate is not stable",
        "estimator_high_accel_bias": "accelerometer bias is high",
        "estimator_high_gyro_bias": "gyro bias is high",
        "estimator_hor_pos_not_stable": "position estimate is not stable",
        "estimator_hor_vel_not_stable": "velocity estimate is not stable",
        "estimator_mag_interference": "magnetic interference is strong",
        "estimator_missing_data": "estimator is starting",
        "failure_detector_arm_esc": "ESC failure",
        "failure_detector_motor": "motor failure",
        "flight_time_limit": "flight time limit is reached",
        "gf_violation_custom_gf": "it is outside its geofence",
        "gf_violation_max_alt": "it is outside its geofence",
        "gf_violation_max_hor_dist": "it is outside its geofence",
        "gyro_missing": "gyro is missing",
        "gyro_no_data": "gyro has no data",
        "gyro_not_calibrated": "gyro is not calibrated",
        "imu_accel_inconsistent": "accelerometers are inconsistent",
        "imu_gyro_inconsistent": "gyros are inconsistent",
        "mag_consistency": "compasses are inconsistent",
        "mag_fault": "compass fault",
        "mag_missing": "compass is missing",
        "mag_no_data": "compass has no data",
        "mag_not_calibrated": "compass is not calibrated",
        "man_control_kill_engaged": "kill switch is engaged",
        "man_control_rtl_engaged": "RTL switch is engaged",
        "missing_fmu_sdcard": "SD card is missing",
        "mission_failure": "its mission cannot be flown",
        "modes_attitude": "no attitude estimate",
        "modes_cannot_takeoff": "its mode does not allow arming",
        "modes_global_pos": "no global position estimate",
        "modes_home_position": "home position is not set",
        "modes_local_alt": "no altitude estimate",
        "modes_local_pos": "no position estimate",
        "modes_manual_control": "no remote control",
        "modes_mission": "no valid mission",
        "open_drone_id_missing": "Open Drone ID is missing",
        "open_drone_id_unhealthy": "Open Drone ID is not ready",
        "parachute_missing": "parachute is missing",
        "parachute_unhealthy": "parachute is not ready",
        "rc_dl_no_dllink": "no ground station",
        "system_arm_auth_failed": "arming is not authorised",
        "system_flight_term_active": "flight termination is active",
        "system_no_global_pos": "no global position estimate",
        "system_no_home_pos": "home position is not set",
        "system_safety_button": "safety button is not pressed",
        "system_usb_connected": "USB is connected",
        "wind_too_high": "wind is too strong",
    }.items()
}
"""Of the checks that a multicopter may fail, in PX4 1.17's `HealthAndArmingChecks`."""


def failed_check(event: EventMessage) -> str:
    """Return which arming check has failed in HOLD, empty if that is not what an event is about."""
    modes = int.from_bytes(event.arguments[:4], "little")
    # Those that no mode needs are reported as warnings of all.
    optional = modes == _ALL_MODES and event.log_levels & 0xF == _WARNING
    if event.id == SUMMARY or not modes & _RESTING or optional:
        return ""
    return _TEXTS.get(event.id, "")


class EventMessage(mavlink.MAVLink_message):
    """EVENT as pymavlink's generator would write it, which leaves it out."""

    id = 410
    msgname = "EVENT"
    fieldnames = (
        "number", "event_time_boot_ms", "sequence", "destination_component", "destination_system",
        "log_levels", "arguments",
    )  # fmt: skip
    ordered_fieldnames = fieldnames
    fieldtypes = ("uint32_t", "uint32_t", "uint16_t", "uint8_t", "uint8_t", "uint8_t", "uint8_t")
    array_lengths = (0, 0, 0, 0, 0, 0, 40)
    crc_extra = 160
    unpacker = struct.Struct("<IIHBBB40s")
    orders = tuple(range(7))
    lengths = (1,) * 7

    def __init__(self, number: int, *others: Any, **named: Any) -> None:
        super().__init__(EventMessage.id, EventMessage.msgname)
        given = dict(zip(self.fieldnames, (number, *others), strict=False)) | named
        self._values = [given[name] for name in self.fieldnames]
        self.id, self.log_levels = number, given["log_levels"]
        self.arguments = self._values[-1] = bytes(given["arguments"])

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Return the frame."""
        payload = self.unpacker.pack(*self._values)
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1))
