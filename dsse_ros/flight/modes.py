# SPDX-License-Identifier: Apache-2.0
"""Flight modes by the names that people know them by.

ArduCopter: MAVLink's COPTER_MODE; PX4, of which MAVLink has none: `px4_custom_mode.h`, as
QGroundControl names them.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.upload import Dialect

_ARDUCOPTER = {
    number: entry.name.removeprefix("COPTER_MODE_")
    for number, entry in mavlink.enums["COPTER_MODE"].items()
    if not entry.name.endswith("_ENUM_END")
}
_PX4 = {
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
}
_CUSTOM_MODE_ENABLED = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_MODES: dict[Dialect, dict[str, tuple[int, int]]] = {
    "ardupilot": {name: (number, 0) for number, name in _ARDUCOPTER.items()},
    "px4": {name: numbers for numbers, name in _PX4.items()},
}


def mode_name(custom_mode: int, dialect: Dialect) -> str:
    """Return the name of HEARTBEAT.custom_mode, `MODE(n)` for one that is not known."""
    if dialect == "ardupilot":
        return _ARDUCOPTER.get(custom_mode, f"MODE({custom_mode})")
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    return _PX4.get((main, sub), f"MODE({main}.{sub})")


def mode_parameters(name: str, dialect: Dialect) -> tuple[int, int, int]:
    """Return parameters 1 to 3 of MAV_CMD_DO_SET_MODE."""
    return (_CUSTOM_MODE_ENABLED, *_MODES[dialect][name])
