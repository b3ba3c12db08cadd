# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""ArduPilot: ArduCopter and ArduPlane."""

from __future__ import annotations

from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots.autopilot import FIXED_WINGS, MESSAGES, Autopilot
from dsse_ros.vehicles.mavlink.messages import EkfStatus, PositionTarget, Wind

ARDUPILOT = Autopilot(
    name="ardupilot",
    number=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    # https://mavlink.io/en/messages/ardupilotmega.html#COPTER_MODE
    modes={
        (number,): entry.name.removeprefix("COPTER_MODE_")
        for number, entry in mavlink.enums["COPTER_MODE"].items()
        if not entry.name.endswith("_ENUM_END")
    },
    mode_shifts=(0,),
    mode_mask=0xFFFFFFFF,
    guided_mode="GUIDED",
    resting_mode="GUIDED",
    mission_mode="AUTO",
    return_mode="RTL",
    land_mode="LAND",
    boot_modes=frozenset({"STABILIZE"}),
    landed_modes=frozenset({"RTL", "LAND", "AUTO"}),
    # The second of each comes with 4.7.
    return_altitudes={"RTL_ALT": 0.01, "RTL_ALT_M": 1.0},
    return_climbs={"RTL_CLIMB_MIN": 0.01, "RTL_CLIMB_MIN_M": 1.0},
    # The first is in centimetres, the second comes with 4.7.
    speed_limits={"WPNAV_SPEED": 0.01, "WP_SPD": 1.0},
    disarm_delays={"DISARM_DELAY": 1.0},
    messages=(*MESSAGES, EkfStatus, PositionTarget, Wind),
    position_is_checked=False,
    texts_prove_failsafe=True,
    mission_texts=("flight plan received", "auto mission changed"),
    check_texts=("prearm:", "arm:"),
    # It repeats them every 30 s.
    checks_s=35.0,
    acts_when_critical=False,
    mode_is_checked=False,
    streams_setpoints=False,
    paced_setpoints=False,
    take_off_amsl=False,
    unchanged=0.0,
    missions_by_command=True,
    home_first=True,
    keeps_item_radius=False,
    # It stores whole seconds and metres.
    parameter_tolerance=1.0,
    upload_can_be_cancelled=False,
    # As MAVProxy sends, which sim_vehicle.py starts.
    first_port=14550,
    port_step=10,
)

ARDUPLANE = replace(
    ARDUPILOT,
    name="arduplane",
    kinds=FIXED_WINGS,
    kind="a fixed wing",
    # WP_LOITER_RAD is 60 m unless it is changed.
    circle_m=120.0,
    # After turns it is up to 2.6 m off, PX4's plane circles up to 3.3 m too low.
    alt_error_m=4.0,
    repositions=True,
    # https://mavlink.io/en/messages/ardupilotmega.html#PLANE_MODE
    modes={
        (number,): entry.name.removeprefix("PLANE_MODE_")
        for number, entry in mavlink.enums["PLANE_MODE"].items()
        if not entry.name.endswith("_ENUM_END")
    },
    resting_mode="LOITER",
    land_mode="RTL",
    take_off_mode="TAKEOFF",
    takes_off_by_mode=True,
    boot_modes=frozenset({"MANUAL", "STABILIZE", "INITIALIZING"}),
    landed_modes=frozenset({"RTL", "AUTO"}),
    # The second comes with 4.5. It descends to that altitude too.
    return_altitudes={"ALT_HOLD_RTL": 0.01, "RTL_ALTITUDE": 1.0},
    return_climbs={"RTL_CLIMB_MIN": 1.0},
    return_ends={"ALT_HOLD_RTL": 0.01, "RTL_ALTITUDE": 1.0},
    # It waits for its take-off.
    disarm_delays={},
    # The second of each comes with 4.5.
    speed_limits={"ARSPD_FBW_MAX": 1.0, "AIRSPEED_MAX": 1.0},
    own_speeds={"TRIM_ARSPD_CM": 0.01, "AIRSPEED_CRUISE": 1.0},
    least_speeds={"ARSPD_FBW_MIN": 1.0, "AIRSPEED_MIN": 1.0},
)
