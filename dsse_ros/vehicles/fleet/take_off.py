# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle lacks before it may take off, by its reports and its parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from dsse_ros.base.result import Rejected
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.fence import check_take_off
from dsse_ros.vehicles.fleet.layer import Layer

_TOLERANCE = 0.05
"""Share by which the airspeed of a fixed wing may differ from the planned one."""
_ROUNDING = 1e-3


class Lack(NamedTuple):
    """What a vehicle lacks, and why if that is known."""

    what: str
    why: str | None = None

    def text(self, within: str = "") -> str:
        """Return both in words, with the time within which it should have come."""
        return f"{self.what}{within}: {self.why}" if self.why else f"{self.what}{within}"


@dataclass(frozen=True)
class Readiness:
    """What keeps a vehicle from taking off.

    Attributes:
        ready: Whether it could take off now if the other vehicles allow it.
        blocked: What it waits for, in words; None if for nothing.
        no_take_off: Why it must not take off from where it stood when that was known last.
        lack: What it lacks itself.
        lacks_since_s: Since when it lacks something, on a steady clock.
    """

    ready: bool = False
    blocked: str | None = None
    no_take_off: str | None = None
    lack: Lack | None = None
    lacks_since_s: float = math.inf


def lack_of(state: VehicleState, trouble: str | None) -> Lack | None:
    """Return what a vehicle must report before it may take off, and why it does not.

    Args:
        state: What it reports.
        trouble: What is wrong with its link.
    """
    if not state.mode:
        return Lack("no heartbeat", trouble)
    if not state.connected:
        return None
    if state.unfit:
        return Lack(state.unfit)
    if state.identity.uid is None:
        return Lack("no AUTOPILOT_VERSION", trouble)
    if not state.has_position:
        return Lack("no position", trouble or state.unready)
    return None


def reason_to_stay(state: VehicleState, layer: Layer) -> str | None:
    """Return why a vehicle must not take off from its position.

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
    return _reason_too_fast(state, layer)


def _reason_too_fast(state: VehicleState, layer: Layer) -> str | None:
    """Return why a vehicle cannot fly at the speed that a search in metres plans."""
    autopilot, planned = layer.autopilot, layer.speed_mps
    if planned <= 0.0:
        return None
    got = f"got {planned:g}: change the speed of the drone, or the vehicle's parameter"
    if planned > state.speed_limit_mps * (1.0 + _ROUNDING):
        names = _named(autopilot.speed_limits)
        return f"speed must be at most {state.speed_limit_mps:g} m/s, the vehicle's {names}, {got}"
    if planned < state.least_speed_mps * (1.0 - _ROUNDING):
        names = _named(autopilot.least_speeds)
        return f"speed must be at least {state.least_speed_mps:g} m/s, the vehicle's {names}, {got}"
    if not autopilot.circles:
        return None
    # A vehicle that streams setpoints ignores a requested speed.
    requested = 0.0 if autopilot.streams_setpoints else layer.settings.speed
    flown = requested or state.own_speed_mps
    names = "speed of mavlink_bridge" if requested else f"vehicle's {_named(autopilot.own_speeds)}"
    if abs(planned - flown) > _TOLERANCE * planned:
        return f"speed must be {flown:g} m/s, the {names}, got {planned:g}: change one of them"
    return None


def _named(parameters: Iterable[str]) -> str:
    return " or ".join(parameters)
