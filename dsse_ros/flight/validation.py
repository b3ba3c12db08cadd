# SPDX-License-Identifier: Apache-2.0
"""Whether what a vehicle says of places can be true; a message that cannot is not believed."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.telegrams import GlobalPosition, Heard, HomePosition, PositionTarget

NO_POSITION = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
"""Bits of PositionTarget.type_mask with which it tells no place."""
MAX_ALT_M = 100_000.0
"""No vehicle is higher than this, nor lower below the sea or its home."""


def is_valid(message: Heard) -> bool:
    """Return whether the coordinates in a message, if there are any, are on Earth and finite."""
    match message:
        case GlobalPosition(_, lat, lon, alt, relative_alt):
            return _is_place(lat, lon, alt * 1e-3) and abs(relative_alt * 1e-3) <= MAX_ALT_M
        case HomePosition(lat, lon, alt):
            return _is_place(lat, lon, alt * 1e-3)
        case PositionTarget(_, type_mask, lat, lon, alt_m):
            return bool(type_mask & NO_POSITION) or _is_place(lat, lon, alt_m)
    return True


def _is_place(lat_e7: int, lon_e7: int, alt_m: float) -> bool:
    # Not a number is not within any limits.
    return abs(lat_e7) <= 90e7 and abs(lon_e7) <= 180e7 and abs(alt_m) <= MAX_ALT_M
