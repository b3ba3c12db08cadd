# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a vehicle that returns by itself, as its parameters say, stays in its layer."""

from __future__ import annotations

from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.layer import Layer

_LOWER_M = 1.0
"""How far below its layer a vehicle still counts as in it."""


def reason_to_leave(state: VehicleState, layer: Layer) -> str | None:
    """Return why a vehicle that returns by itself would leave its layer.

    Args:
        state: What it reports.
        layer: Its layer.
    """
    autopilot = layer.autopilot
    alt_m = layer.top_amsl_m - (state.alt_amsl_m - state.alt_m)
    reasons = []
    if alt_m < state.return_alt_m:
        names = " or ".join(autopilot.return_altitudes)
        reasons.append(
            f"altitude must be at least {state.return_alt_m:g} m above home, the vehicle's "
            f"{names}, to return in its own layer, got {alt_m:.0f} m"
        )
    if state.return_climb_m > 0:
        names = " or ".join(autopilot.return_climbs)
        reasons.append(
            f"the vehicle's {names} must be 0 to return in its own layer, got "
            f"{state.return_climb_m:g} m"
        )
    if 0 <= state.return_end_m < alt_m - _LOWER_M:
        names = " or ".join(autopilot.return_ends)
        reasons.append(
            f"the vehicle's {names} must be {alt_m:.0f} m to circle over home in its own layer, "
            f"got {state.return_end_m:g} m"
        )
    return "; ".join(reasons) or None
