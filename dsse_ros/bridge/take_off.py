# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle lacks before it may take off."""

from __future__ import annotations

from dsse_ros.bridge.fence import check_take_off
from dsse_ros.bridge.layer import Layer
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.result import Rejected


def lacks(state: VehicleState, because: str) -> tuple[str, str]:
    """Return what a vehicle must report before it may take off, and why it does not.

    Args:
        state: What it reports.
        because: What is wrong with its link.
    """
    if not state.mode:
        return "no heartbeat", because
    if not state.connected:
        return "", ""
    if state.unfit:
        return state.unfit, ""
    if state.identity.uid is None:
        return "no AUTOPILOT_VERSION", because
    if not state.has_position:
        return "no position", because or unready(state)
    return "", ""


def unready(state: VehicleState) -> str:
    """Return why its autopilot is not ready, as an appendix; empty if that is not known."""
    return f": {state.unready}" if state.unready else ""


def reason_to_stay(state: VehicleState, layer: Layer) -> str:
    """Return why a vehicle must not take off from its position; empty if it may.

    Args:
        state: What it reports, with its position.
        layer: The layer to take off to.
    """
    top_amsl_m, fence, min_altitude = layer.top_amsl_m, layer.fence, layer.settings.min_altitude
    checked = check_take_off(state.lat_deg, state.lon_deg, top_amsl_m, fence)
    if isinstance(checked, Rejected):
        return checked.reason
    home_m = state.alt_amsl_m - state.alt_m
    if top_amsl_m - home_m < min_altitude:
        return (
            f"altitude must be at least {min_altitude:g} m above home, got "
            f"{top_amsl_m - home_m:g} m (home is {home_m:g} m above the sea: see datum_altitude)"
        )
    return_m = home_m + state.return_alt_m
    if return_m > fence.max_amsl_m:
        return (
            f"the vehicle's return altitude must be at most {fence.max_amsl_m:g} m above the sea, "
            f"got {return_m:g}"
        )
    return ""
