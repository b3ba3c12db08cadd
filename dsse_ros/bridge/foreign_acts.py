# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What somebody else does to a vehicle in the air without changing its mode."""

from __future__ import annotations

import math

from dsse_ros.bridge.flight_record import FlightRecord
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.scenario.geodesy import offset_m

_HOME_M, _HOME_UP_M = 10.0, 5.0
"""PX4 moves its own home by less in the first minutes of a flight."""
_SKIPPED = 3
_GAP_S = 3.0
"""Several items can be reached between two reports that are further apart."""


def foreign_act(record: FlightRecord, before: VehicleState, state: VehicleState) -> str:
    """Return what somebody else has done to a vehicle that the bridge flies; empty for nothing.

    Args:
        record: Its home at the take-off and the number of its mission's items.
        before: The state that it reported before.
        state: The state that it reports.
    """
    if record.home is not None and state.home is not None:
        moved_m = math.hypot(*offset_m(record.home[:2], state.home[:2]))
        if moved_m > _HOME_M or abs(record.home[2] - state.home[2]) > _HOME_UP_M:
            return "its home was moved"
    if not record.items or state.item_s <= before.item_s:
        return ""
    if state.item_total not in (-1, record.items):
        return "its mission was changed"
    skipped = state.item_current - before.item_current
    lately = state.item_s - before.item_s < _GAP_S
    known = before.item_current >= 0 and state.item_current >= 0
    if known and (skipped < 0 or (lately and skipped > _SKIPPED)):
        return f"its mission was set to item {state.item_current}"
    return ""
