# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Separates what the bridge has done with a vehicle from what somebody else has."""

from __future__ import annotations

import math

from dsse_ros.vehicles.autopilots import Autopilot, Failsafe
from dsse_ros.vehicles.control.commands import CHANGED_MISSION
from dsse_ros.vehicles.control.orders import (
    FlyMission,
    FlyTrack,
    GoTo,
    Hold,
    Land,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.flight_record import FlightRecord
from dsse_ros.world.scenario.geodesy import offset_m

RISEN_M = 3.0
"""Distance below its take-off altitude from which a vehicle counts as having taken off."""
_HOME_M, _HOME_UP_M = 10.0, 5.0
"""PX4 moves its own home by less in the first minutes of a flight."""
_SKIPPED = 3
_GAP_S = 3.0
"""Several items can be reached between two reports that are further apart."""


def modes_of(order: Order, autopilot: Autopilot) -> tuple[str, ...]:
    """Return the modes to which an order leads."""
    match order:
        case TakeOff():
            # In the air it flies to a setpoint.
            return (autopilot.take_off_mode or autopilot.guided_mode, autopilot.guided_mode)
        case GoTo() | SearchPlace() | FlyTrack():
            return (autopilot.guided_mode,)
        case Hold():
            return (autopilot.resting_mode,)
        case Return():
            return (autopilot.return_mode,)
        case Land():
            return (autopilot.land_mode,)
        case FlyMission():
            return tuple(sorted(autopilot.mission_modes))
    return ()


def is_ours(record: FlightRecord, state: VehicleState, autopilot: Autopilot) -> bool | None:
    """Return whether the bridge, or the one before it, has brought about the mode of a vehicle.

    Args:
        record: The last mode that one of them has, and the modes to which its last order leads.
        state: What it reports.
        autopilot: Autopilot of the vehicle.

    Returns:
        None if that cannot be decided yet.
    """
    mode, climbing = state.mode, autopilot.take_off_mode
    if not record.mode:
        return mode in autopilot.take_off_modes
    if mode in (record.mode, *record.ordered):
        return True
    if record.mode != climbing or mode != autopilot.resting_mode:
        return False
    # A climb ends in this mode. Before its top, only a person can have set it.
    return state.alt_amsl_m >= record.top_amsl_m - RISEN_M if state.has_position else None


def lacks_setpoints(record: FlightRecord, state: VehicleState, autopilot: Autopilot) -> bool:
    """Return whether a vehicle may have left its guided mode because setpoints stopped.

    Args:
        record: The same as for `is_ours`.
        state: What it reports.
        autopilot: Autopilot of the vehicle.
    """
    guided = autopilot.guided_mode in (record.mode, *record.ordered)
    unnamed = state.failsafe in (Failsafe.CRITICAL, Failsafe.OFFBOARD)
    return guided and unnamed and state.mode in autopilot.setpoint_loss_modes


def foreign_act(record: FlightRecord, before: VehicleState, state: VehicleState) -> str | None:
    """Return what somebody else has done without changing the mode.

    Args:
        record: Its home at the take-off, its mission and the number of that mission's items.
        before: The state that it reported before.
        state: The state that it reports.
    """
    if record.home is not None and state.home is not None:
        moved_m = math.hypot(*offset_m(record.home[:2], state.home[:2]))
        if moved_m > _HOME_M or abs(record.home[2] - state.home[2]) > _HOME_UP_M:
            return "its home was moved"
    if record.plan and state.mission not in (None, record.plan):
        return CHANGED_MISSION
    if not record.items or state.item_s <= before.item_s:
        return None
    if state.item_total not in (-1, record.items):
        return CHANGED_MISSION
    skipped = state.item_current - before.item_current
    lately = state.item_s - before.item_s < _GAP_S
    known = before.item_current >= 0 and state.item_current >= 0
    if known and (skipped < 0 or (lately and skipped > _SKIPPED)):
        return f"its mission was set to item {state.item_current}"
    return None
