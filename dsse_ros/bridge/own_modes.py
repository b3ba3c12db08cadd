# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which modes of a vehicle the bridge has brought about, this program or an earlier one."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from dsse_ros.bridge.custody import Custody
from dsse_ros.bridge.flight_record import FlightRecord
from dsse_ros.flight.autopilots import Autopilot
from dsse_ros.flight.orders import Land, Return, TakeOff
from dsse_ros.flight.vehicle_controller import Outcome
from dsse_ros.flight.vehicle_state import VehicleState

COMING_DOWN: Mapping[str, str] = {"return": "RTL", "land": "LAND"}
"""Modes in which a vehicle comes down by itself, by the operator's command."""
RISEN_M = 3.0
"""Distance below its take-off altitude from which a vehicle counts as having taken off."""
_COMES_DOWN = (Custody.ENDING, Custody.RECALLED)


class OwnModes:
    """Separates modes that the bridge has brought about from those that somebody else has set.

    Args:
        autopilot: Autopilot of the vehicle.
        at_end: What the vehicle does when its search is over: `return`, `land` or `hold`.
        whole: Whether the vehicle flies searches as missions.
    """

    def __init__(self, autopilot: Autopilot, at_end: str, *, whole: bool) -> None:
        self._autopilot = autopilot
        self._at_end = at_end
        self._whole = whole

    def fits(self, mode: str, record: FlightRecord) -> bool:
        """Return whether a vehicle without an order may be in a mode.

        Args:
            mode: The mode.
            record: The vehicle's record.
        """
        autopilot = self._autopilot
        going = record.custody is Custody.FOLLOWING and self._whole
        if going and record.mode in autopilot.mission_modes:
            # It has begun its mission, which goes on without the bridge.
            return mode in autopilot.mission_modes
        lands = record.custody in _COMES_DOWN or self._whole
        return mode in autopilot.take_off_modes | (autopilot.landed_modes if lands else frozenset())

    def is_ours(self, state: VehicleState, record: FlightRecord, outcome: Outcome) -> bool:
        """Return whether an order of this program may have caused the mode of a vehicle.

        Args:
            state: What the vehicle reports.
            record: Its record, with the mode before.
            outcome: Outcome of its last order.
        """
        autopilot, order, mode = self._autopilot, outcome.order, state.mode
        if self._whole:
            return order is not None or mode in autopilot.mission_modes
        climbs = isinstance(order, TakeOff) and outcome.status != "done"
        if record.mode == autopilot.take_off_mode:
            climbs |= not _has_risen(state, record)
        if climbs and autopilot.take_off_mode and mode == autopilot.resting_mode:
            # Before the top of the climb, only a person can have set this mode.
            return False
        coming_down: Collection[str] = ()
        if isinstance(order, Return | Land):
            coming_down = ["RTL" if isinstance(order, Return) else "LAND"]
        elif order is None and record.custody in _COMES_DOWN:
            # An earlier program may have given the order.
            coming_down = COMING_DOWN.values()
        before = () if record.mode in coming_down else autopilot.take_off_modes
        return mode in coming_down or mode in before

    def is_result(
        self, state: VehicleState, record: FlightRecord, inherited: Custody
    ) -> bool | None:
        """Return whether the orders of an earlier program explain the mode of a vehicle.

        Args:
            state: What the vehicle reports.
            record: Its record, with the mode that the earlier program saw last.
            inherited: Who controlled it when that program ended.

        Returns:
            None if that cannot be decided yet.
        """
        if self._whole or not state.armed or record.mode in ("", state.mode):
            return True
        climbed = record.mode == self._autopilot.take_off_mode
        if climbed and state.mode == self._autopilot.resting_mode:
            if not state.has_position:
                return None
            if not _has_risen(state, record):
                return False
        return state.mode in self._results(state, record, inherited)

    def _results(
        self, state: VehicleState, record: FlightRecord, inherited: Custody
    ) -> frozenset[str]:
        """Return the modes to which the last order of an earlier program may have led."""
        autopilot = self._autopilot
        results: frozenset[str] = autopilot.orderly_modes
        going = record.mode in autopilot.take_off_modes - {autopilot.resting_mode}
        # The record shows whether the earlier program may have ordered it to hold.
        holds = inherited is Custody.HELD
        holds |= inherited is Custody.ENDING and self._at_end == "hold"
        if going and state.failsafe:
            # After missed setpoints the vehicle may have left the guided mode for any of these.
            results |= autopilot.setpoint_loss_modes
        elif inherited is Custody.FOLLOWING and not going:
            # The vehicle was armed for its take-off, so the take-off can have changed the mode.
            results |= autopilot.take_off_modes
        elif record.mode == autopilot.guided_mode and not holds:
            results = frozenset({autopilot.guided_mode})
        if inherited is Custody.RECALLED:
            ordered = frozenset({COMING_DOWN[record.end or "return"]})
            return results | ordered if going else ordered
        if inherited is Custody.ENDING:
            comes_down = record.mode in COMING_DOWN.values()
            ended = {COMING_DOWN.get(self._at_end, record.mode)}
            return frozenset() if comes_down else results | ended
        if inherited is Custody.HELD and not going:
            return frozenset({autopilot.resting_mode})
        return results


def _has_risen(state: VehicleState, record: FlightRecord) -> bool:
    return state.alt_amsl_m >= record.top_amsl_m - RISEN_M
