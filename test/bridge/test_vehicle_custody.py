# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who has a vehicle when a bridge is started again, by what the one before has recorded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from dsse_ros.bridge.custody import Custody
from dsse_ros.bridge.vehicle_custody import FOREIGN_S, RISEN_M, Arm, FlightRecord, VehicleCustody
from dsse_ros.flight.autopilots import ARDUPILOT, PX4, Autopilot
from dsse_ros.flight.orders import GoTo, Land, TakeOff
from dsse_ros.flight.vehicle_controller import Outcome
from dsse_ros.flight.vehicle_state import VehicleState

SEARCH = (7, 1)
TOP_M = 60.0
FLOWN = FlightRecord(Custody.FOLLOWING, SEARCH, flown=True, alt_m=TOP_M)
ENDING = replace(FLOWN, custody=Custody.ENDING)
HELD = replace(FLOWN, custody=Custody.HELD)
LANDING = replace(FLOWN, custody=Custody.RECALLED, end="land")
STEP = GoTo(-24.0, -46.0, TOP_M, 10.0)


def custody_of(autopilot: Autopilot, record: FlightRecord, arm: Arm = "true") -> VehicleCustody:
    custody = VehicleCustody(autopilot, arm, record, lambda: None)
    custody.begin(SEARCH, TOP_M, first=True)
    return custody


def seen_in(mode: str, **changes: Any) -> VehicleState:
    state = VehicleState(
        connected=True, armed=True, flying=True, mode=mode, alt_m=TOP_M, lat_deg=-24.0,
        lon_deg=-46.0,
    )  # fmt: skip
    return replace(state, **changes)


SHORT = {"alt_m": TOP_M - RISEN_M - 1.0}
CRITICAL = {"failsafe": "critical"}
FOUND = {
    # What the bridge before has commanded, or was about to.
    "guided": (ARDUPILOT, FLOWN, "GUIDED", "GUIDED", {}, Custody.FOLLOWING),
    "return begun": (ARDUPILOT, ENDING, "GUIDED", "RTL", {}, Custody.ENDING),
    "returning": (ARDUPILOT, ENDING, "RTL", "RTL", {}, Custody.ENDING),
    "landing begun": (ARDUPILOT, LANDING, "GUIDED", "LAND", {}, Custody.RECALLED),
    "climb": (PX4, FLOWN, "TAKEOFF", "TAKEOFF", SHORT, Custody.FOLLOWING),
    "end of the climb": (PX4, FLOWN, "TAKEOFF", "HOLD", {}, Custody.FOLLOWING),
    "brought to offboard": (PX4, FLOWN, "HOLD", "OFFBOARD", {}, Custody.FOLLOWING),
    "missed setpoints": (PX4, FLOWN, "OFFBOARD", "HOLD", CRITICAL, Custody.FOLLOWING),
    "hold begun": (PX4, HELD, "OFFBOARD", "HOLD", {}, Custody.HELD),
    # What a person has.
    "guided after a return": (ARDUPILOT, ENDING, "RTL", "GUIDED", {}, Custody.TAKEN),
    "a return in the search": (ARDUPILOT, FLOWN, "GUIDED", "RTL", {}, Custody.TAKEN),
    "a return for a landing": (ARDUPILOT, LANDING, "LAND", "RTL", {}, Custody.TAKEN),
    "loiter": (ARDUPILOT, FLOWN, "GUIDED", "LOITER", {}, Custody.TAKEN),
    "a hold in the climb": (PX4, FLOWN, "TAKEOFF", "HOLD", SHORT, Custody.TAKEN),
    "a hold in the search": (PX4, FLOWN, "OFFBOARD", "HOLD", {}, Custody.TAKEN),
    "offboard after a return": (PX4, ENDING, "RTL", "OFFBOARD", {}, Custody.TAKEN),
    "another mode than hold": (PX4, HELD, "HOLD", "POSCTL", {}, Custody.TAKEN),
    # What a failsafe has.
    "battery": (ARDUPILOT, FLOWN, "GUIDED", "LAND", {"failsafe": "battery"}, Custody.FAILSAFE),
}


@pytest.mark.parametrize("found", FOUND.values(), ids=FOUND)
def test_what_has_changed_without_a_bridge_was_changed_by_somebody_else(found: Any) -> None:
    autopilot, record, before, now, changes, expected = found
    custody = custody_of(autopilot, replace(record, mode=before))
    custody.observe(seen_in(now, **changes), Outcome(), takes_off=False)
    assert custody.state is expected
    assert bool(custody.lost) == (expected in (Custody.TAKEN, Custody.FAILSAFE))


def test_whether_a_climb_has_ended_is_not_known_without_an_altitude() -> None:
    custody = custody_of(PX4, replace(FLOWN, mode="TAKEOFF"))
    lost = {"lat_deg": float("nan"), "lon_deg": float("nan"), "alt_m": float("nan")}
    custody.observe(seen_in("HOLD", **lost), Outcome(), takes_off=False)
    assert custody.state is Custody.FOLLOWING
    custody.observe(seen_in("HOLD", **SHORT), Outcome(), takes_off=False)
    assert custody.state is Custody.TAKEN


def test_a_bridge_that_ends_in_order_leaves_a_vehicle_that_the_next_one_knows_to_hold() -> None:
    custody = custody_of(PX4, replace(FLOWN, mode="OFFBOARD"))
    custody.rest()
    after = custody_of(PX4, custody.record)
    after.observe(seen_in("HOLD"), Outcome(), takes_off=False)
    assert after.state is Custody.FOLLOWING


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda one: one.name)
@pytest.mark.parametrize("status", ["taken_over", "failsafe"])
def test_what_ends_an_order_after_a_clearance_in_the_air_counts(
    autopilot: Autopilot, status: Any
) -> None:
    custody = custody_of(autopilot, HELD)
    climbs = Outcome(TakeOff(TOP_M), 2, "under_way")
    custody.observe(seen_in(autopilot.guided_mode), climbs, takes_off=False)
    assert custody.clear() == ""
    assert custody.state is Custody.FOLLOWING
    custody.observe(seen_in("LAND"), replace(climbs, status=status), takes_off=False)
    assert custody.state in (Custody.TAKEN, Custody.FAILSAFE)
    assert custody.lost


def test_who_has_ended_an_order_before_a_clearance_is_known_to_who_clears_it() -> None:
    custody = custody_of(ARDUPILOT, FLOWN)
    ended = Outcome(STEP, 2, "taken_over", "in LOITER")
    custody.observe(seen_in("LOITER"), ended, takes_off=False)
    assert custody.state is Custody.TAKEN
    custody.observe(seen_in("GUIDED"), ended, takes_off=False)
    assert custody.state is Custody.RELEASED
    custody.begin((7, 2), TOP_M, first=False)
    assert custody.clear(alone=True) == ""
    custody.observe(seen_in("GUIDED"), ended, takes_off=False)
    assert custody.state is Custody.FOLLOWING


@pytest.mark.parametrize(
    ("autopilot", "mode", "known"),
    [
        (ARDUPILOT, "AUTO", True),
        (ARDUPILOT, "GUIDED", False),
        (ARDUPILOT, "LAND", False),
        (ARDUPILOT, "RTL", False),
        (PX4, "MISSION", True),
        # The last item of the mission brings it about.
        (PX4, "RTL", True),
        (PX4, "HOLD", False),
        (PX4, "OFFBOARD", False),
    ],
)
def test_a_mission_that_goes_on_without_its_bridge_is_left_by_a_person_alone(
    autopilot: Autopilot, mode: str, known: bool
) -> None:
    record = replace(FLOWN, mode=autopilot.mission_mode)
    custody = VehicleCustody(autopilot, "true", record, lambda: None, whole=True)
    custody.begin(SEARCH, TOP_M, first=True)
    custody.observe(seen_in(autopilot.mission_mode), Outcome(), takes_off=False)
    for time_s in (0.0, 1.0, FOREIGN_S):
        custody.observe(seen_in(mode, heard_s=time_s), Outcome(), takes_off=False)
    assert custody.state is (Custody.FOLLOWING if known else Custody.TAKEN)


def test_a_failsafe_in_a_mission_without_its_bridge_is_named() -> None:
    custody = VehicleCustody(
        ARDUPILOT, "true", replace(FLOWN, mode="AUTO"), lambda: None, whole=True
    )
    custody.begin(SEARCH, TOP_M, first=True)
    for time_s in (0.0, FOREIGN_S):
        failed = seen_in("RTL", failsafe="battery", heard_s=time_s)
        custody.observe(failed, Outcome(), takes_off=False)
    assert custody.state is Custody.FAILSAFE and custody.lost == "battery failsafe"


@pytest.mark.parametrize("record", [HELD, LANDING], ids=["held", "recalled"])
def test_what_an_operator_has_called_back_is_not_given_back_by_the_parameter(
    record: FlightRecord,
) -> None:
    custody = custody_of(ARDUPILOT, record, "always")
    custody.begin((7, 2), TOP_M, first=False)
    custody.observe(seen_in("LAND"), Outcome(Land(), 1, "under_way"), takes_off=False)
    custody.clear_automatically()
    taken = Outcome(Land(), 1, "taken_over", "in GUIDED")
    for _ in range(3):
        custody.observe(seen_in("GUIDED"), taken, takes_off=False)
        custody.clear_automatically()
    assert custody.state is Custody.RELEASED


CLEARED = FlightRecord(Custody.CLEARED, SEARCH, arm=True, alt_m=TOP_M)


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda one: one.name)
@pytest.mark.parametrize("flying", [False, True], ids=["on the ground", "in the air"])
def test_what_was_to_arm_as_a_bridge_ended_is_flown_on_by_the_next_one_if_that_comes_soon(
    autopilot: Autopilot, flying: bool
) -> None:
    before = custody_of(autopilot, CLEARED)
    waits = seen_in(autopilot.resting_mode, armed=False, flying=False, alt_m=0.0, heard_s=100.0)
    before.begin_arming(100.0)
    before.observe(waits, Outcome(TakeOff(TOP_M), 2, "under_way", "arming"), takes_off=True)
    mode = (autopilot.take_off_mode or autopilot.guided_mode) if flying else autopilot.resting_mode
    for later_s, expected in (
        (3.0, Custody.FOLLOWING),
        (20.0, Custody.TAKEN),
        (-90.0, Custody.TAKEN),
    ):
        after = custody_of(autopilot, before.record)
        seen = seen_in(mode, flying=flying, alt_m=10.0 * flying, heard_s=100.0 + later_s)
        after.observe(seen, Outcome(), takes_off=False)
        assert after.state is expected


@pytest.mark.parametrize("mode", ["GUIDED", "LOITER"])
def test_what_nobody_has_commanded_to_arm_is_somebody_elses(mode: str) -> None:
    custody = custody_of(ARDUPILOT, CLEARED)
    custody.observe(seen_in(mode, flying=False, alt_m=0.0), Outcome(), takes_off=False)
    assert custody.state is Custody.TAKEN


def test_what_was_to_arm_as_a_bridge_ended_and_is_not_armed_stays_down() -> None:
    custody = custody_of(ARDUPILOT, replace(CLEARED, arming_s=5.0), "always")
    waits = seen_in("GUIDED", armed=False, flying=False, alt_m=0.0)
    custody.observe(waits, Outcome(), takes_off=False)
    custody.clear_automatically()
    assert custody.state is Custody.TAKEN
    assert custody.lost == "disarmed while no bridge was there"


def test_what_somebody_arms_and_disarms_after_its_flight_is_theirs() -> None:
    custody = custody_of(ARDUPILOT, replace(FLOWN, custody=Custody.GROUNDED), "always")
    for armed in (False, True, False):
        seen = seen_in("GUIDED", armed=armed, flying=False, alt_m=0.0)
        custody.observe(seen, Outcome(), takes_off=False)
    assert custody.state is Custody.TAKEN
    custody.begin((7, 2), TOP_M, first=False)
    custody.clear_automatically()
    assert custody.state is Custody.TAKEN


@pytest.mark.parametrize("flies", [False, True])
def test_what_was_to_arm_and_disarms_before_it_flies_may_be_a_persons(flies: bool) -> None:
    custody = custody_of(ARDUPILOT, replace(CLEARED, arming_s=100.0), "always")
    for armed, flying in ((True, False), (True, flies), (False, False)):
        seen = seen_in("GUIDED", armed=armed, flying=flying, alt_m=0.0, heard_s=102.0)
        custody.observe(seen, Outcome(), takes_off=False)
    assert custody.state is (Custody.GROUNDED if flies else Custody.TAKEN)
