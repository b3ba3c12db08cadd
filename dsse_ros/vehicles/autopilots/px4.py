# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""PX4: its multicopters and its fixed wings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots.autopilot import FIXED_WINGS, MESSAGES, Autopilot
from dsse_ros.vehicles.mavlink.events import EventMessage, event_number
from dsse_ros.vehicles.mavlink.messages import (
    BatteryStatus,
    EstimatorStatus,
    PositionTarget,
    WindCov,
)

_ALL_MODES = 0xFFFFFFFF
_RESTING = 1 << 4
"""HOLD is NAVIGATION_STATE_AUTO_LOITER."""
# An event's number is a hash of its name, so these need no metadata. All failing arming checks are
# reported whenever they change: the summary, the checks, and the summary of its health.
_CHECK_REPORT = event_number("commander_arming_check_summary")
_CHECKS: Mapping[int, str] = {
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
"""Checks that a multicopter may fail, in PX4 1.17's `HealthAndArmingChecks`."""


def _failed_check(event: EventMessage) -> str | None:
    """Return which arming check has failed in HOLD; None if an event is about something else."""
    modes = int.from_bytes(event.arguments[:4], "little")
    # A check that no mode needs is reported as a warning of all modes.
    optional = modes == _ALL_MODES and event.log_levels & 0xF == mavlink.MAV_SEVERITY_WARNING
    if event.id == _CHECK_REPORT or not modes & _RESTING or optional:
        return None
    return _CHECKS.get(event.id)


PX4 = Autopilot(
    name="px4",
    number=mavlink.MAV_AUTOPILOT_PX4,
    # MAVLink does not enumerate these: see px4_custom_mode.h; the names are QGroundControl's.
    modes={
        (1, 0): "MANUAL",
        (2, 0): "ALTCTL",
        (3, 0): "POSCTL",
        (3, 1): "ORBIT",
        (4, 1): "READY",
        (4, 2): "TAKEOFF",
        (4, 3): "HOLD",
        (4, 4): "MISSION",
        (4, 5): "RTL",
        (4, 6): "LAND",
        (4, 8): "FOLLOW",
        (4, 9): "PRECLAND",
        (5, 0): "ACRO",
        (6, 0): "OFFBOARD",
        (7, 0): "STABILIZED",
        (8, 0): "RATTITUDE",
        (9, 0): "SIMPLE",
        (10, 0): "TERMINATION",
    },
    mode_shifts=(16, 24),
    mode_mask=0xFF,
    guided_mode="OFFBOARD",
    resting_mode="HOLD",
    mission_mode="MISSION",
    return_mode="RTL",
    land_mode="LAND",
    take_off_mode="TAKEOFF",
    # Without a remote control it starts in HOLD; with one, the switches choose the mode.
    boot_modes=frozenset(),
    landed_modes=frozenset({"RTL", "LAND", "MISSION"}),
    item_modes={
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: "RTL",
        mavlink.MAV_CMD_NAV_LAND: "LAND",
    },
    return_altitudes={"RTL_RETURN_ALT": 1.0},
    # MPC_XY_CRUISE limits missions alone.
    speed_limits={"MPC_XY_VEL_MAX": 1.0},
    disarm_delays={"COM_DISARM_PRFLT": 1.0},
    disarmed_modes=frozenset({"HOLD"}),
    disarming_s=3.0,
    messages=(*MESSAGES, BatteryStatus, EstimatorStatus, PositionTarget, WindCov),
    # At rest its EKF_STATUS_REPORT always has CONST_POS_MODE.
    position_is_checked=True,
    # It sends the same texts as a mere warning.
    texts_prove_failsafe=False,
    check_texts=("preflight:", "preflight fail:"),
    checks_s=35.0,
    check_report=_CHECK_REPORT,
    checks=_CHECKS,
    failed_check=_failed_check,
    acts_when_critical=True,
    # In OFFBOARD the check fails as long as no setpoints come.
    mode_is_checked=True,
    streams_setpoints=True,
    # Parameter COM_OBL_RC_ACT chooses among them.
    setpoint_loss_modes=frozenset({"RTL", "HOLD", "LAND", "POSCTL", "ALTCTL", "STABILIZED"}),
    setpoint_loss_event=event_number("check_modes_offboard_signal"),
    paced_setpoints=True,
    take_off_amsl=True,
    unchanged=math.nan,
    missions_by_command=False,
    home_first=False,
    keeps_item_radius=True,
    parameter_tolerance=1e-3,
    upload_can_be_cancelled=True,
    first_port=14540,
    port_step=1,
)

PX4_PLANE = replace(
    PX4,
    name="px4plane",
    kinds=FIXED_WINGS,
    kind="a fixed wing",
    # NAV_LOITER_RAD is 80 m unless it is changed.
    circle_m=150.0,
    alt_error_m=4.0,
    land_mode="RTL",
    return_ends={"RTL_DESCEND_ALT": 1.0},
    speed_limits={"FW_AIRSPD_MAX": 1.0},
    own_speeds={"FW_AIRSPD_TRIM": 1.0},
    least_speeds={"FW_AIRSPD_MIN": 1.0},
    paced_setpoints=False,
)
