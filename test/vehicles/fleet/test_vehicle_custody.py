# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who has a vehicle when a bridge is started again, by what the one before has recorded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from dsse_ros.base.result import Accepted, Rejected
from dsse_ros.vehicles.autopilots import ARDUPILOT, PX4, Autopilot, Failsafe
from dsse_ros.vehicles.control.identity import Identity
from dsse_ros.vehicles.control.orders import FlyMission, GoTo, Hold, Land, Order, Return, TakeOff
from dsse_ros.vehicles.control.vehicle_controller import Outcome
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.custody import Custody
from dsse_ros.vehicles.fleet.failsafe_watch import FAILSAFE_S
from dsse_ros.vehicles.fleet.flight_record import FlightRecord, inherited
from dsse_ros.vehicles.fleet.foreign_acts import RISEN_M
from dsse_ros.vehicles.fleet.vehicle_custody import CONSENT_S, Arm, VehicleCustody
from dsse_ros.vehicles.mission_items.items import MissionItem

SEARCH = (7, 1)
TOP_M = 60.0
FLOWN = FlightRecord(Custody.FOLLOWING, SEARCH, flown=True, launched=True, top_amsl_m=TOP_M)
ENDING = replace(FLOWN, custody=Custody.ENDING)
HELD = replace(FLOWN, custody=Custody.HELD)
LANDING = replace(FLOWN, custody=Custody.RECALLED, end="land")
STEP = GoTo(-24.0, -46.0, TOP_M, 10.0)
MISSION = FlyMission(tuple(MissionItem(16, lat_deg=-24.0, lon_deg=-46.0) for _ in range(6)))


def custody_of(autopilot: Autopilot, record: FlightRecord, arm: Arm = "true") -> VehicleCustody:
    custody = VehicleCustody(autopilot, arm, record, lambda: None)
    custody.begin(SEARCH, TOP_M, first=True)
    return custody


def seen_in(mode: str, **changes: Any) -> VehicleState:
    state = VehicleState(
        connected=True, armed=True, flying=True, mode=mode, alt_m=TOP_M, alt_amsl_m=TOP_M,
        lat_deg=-24.0, lon_deg=-46.0,
    )  # fmt: skip
    changes |= {"alt_amsl_m": changes["alt_m"]} if "alt_m" in changes else {}
    return replace(state, **changes)


SHORT = {"alt_m": TOP_M - RISEN_M - 1.0}
CRITICAL = {"failsafe": Failsafe.CRITICAL}
CLIMB = TakeOff(TOP_M)
# The record, the last mode and the last order of the bridge before; the mode that is found.
FOUND = {
    # What the bridge before has commanded, or was about to.
    "guided": (ARDUPILOT, FLOWN, "GUIDED", STEP, "GUIDED", {}, Custody.FOLLOWING),
    "return begun": (ARDUPILOT, ENDING, "GUIDED", Return(), "RTL", {}, Custody.ENDING),
    "returning": (ARDUPILOT, ENDING, "RTL", Return(), "RTL", {}, Custody.ENDING),
    "landing begun": (ARDUPILOT, LANDING, "GUIDED", Land(), "LAND", {}, Custody.RECALLED),
    "take-off begun": (PX4, FLOWN, "HOLD", CLIMB, "TAKEOFF", SHORT, Custody.FOLLOWING),
    "climb": (PX4, FLOWN, "TAKEOFF", CLIMB, "TAKEOFF", SHORT, Custody.FOLLOWING),
    "end of the climb": (PX4, FLOWN, "TAKEOFF", CLIMB, "HOLD", {}, Custody.FOLLOWING),
    "brought to offboard": (PX4, FLOWN, "HOLD", STEP, "OFFBOARD", {}, Custody.FOLLOWING),
    "missed setpoints": (PX4, FLOWN, "OFFBOARD", STEP, "HOLD", CRITICAL, Custody.FOLLOWING),
    "missed them soon": (PX4, FLOWN, "HOLD", STEP, "RTL", CRITICAL, Custody.FOLLOWING),
    "hold begun": (PX4, HELD, "OFFBOARD", Hold(), "HOLD", {}, Custody.HELD),
    # What a person has.
    "guided after a return": (ARDUPILOT, ENDING, "RTL", Return(), "GUIDED", {}, Custody.TAKEN),
    "a return in the search": (ARDUPILOT, FLOWN, "GUIDED", STEP, "RTL", {}, Custody.TAKEN),
    "a return for a landing": (ARDUPILOT, LANDING, "LAND", Land(), "RTL", {}, Custody.TAKEN),
    "a landing for a return": (ARDUPILOT, ENDING, "GUIDED", Return(), "LAND", {}, Custody.TAKEN),
    "loiter": (ARDUPILOT, FLOWN, "GUIDED", STEP, "LOITER", {}, Custody.TAKEN),
    "a hold in the climb": (PX4, FLOWN, "TAKEOFF", CLIMB, "HOLD", SHORT, Custody.TAKEN),
    "a hold in the search": (PX4, FLOWN, "OFFBOARD", STEP, "HOLD", {}, Custody.TAKEN),
    "offboard after a return": (PX4, ENDING, "RTL", Return(), "OFFBOARD", {}, Custody.TAKEN),
    "another mode than hold": (PX4, HELD, "HOLD", Hold(), "POSCTL", {}, Custody.TAKEN),
    # What a failsafe has.
    "battery": (ARDUPILOT, FLOWN, "GUIDED", STEP, "LAND", {"failsafe": Failsafe.BATTERY},
                Custody.FAILSAFE),
    "gcs": (PX4, FLOWN, "OFFBOARD", STEP, "RTL", {"failsafe": Failsafe.GCS}, Custody.FAILSAFE),
}  # fmt: skip


def left(record: FlightRecord, mode: str, order: Order, autopilot: Autopilot) -> FlightRecord:
    """Return the record of a vehicle that a bridge has left in a mode, with an order."""
    custody = VehicleCustody(autopilot, "true", replace(record, mode=mode), lambda: None)
    custody.record_order(order)
    return custody.record


@pytest.mark.parametrize("found", FOUND.values(), ids=FOUND)
def test_what_has_changed_without_a_bridge_was_changed_by_somebody_else(found: Any) -> None:
    autopilot, record, before, order, now, changes, expected = found
    custody = custody_of(autopilot, left(record, before, order, autopilot))
    custody.observe(seen_in(now, **changes), Outcome(), 0.0)
    assert custody.state is expected
    assert bool(custody.lost) == (expected in (Custody.TAKEN, Custody.FAILSAFE))


def test_whether_a_climb_has_ended_is_not_known_without_an_altitude() -> None:
    custody = custody_of(PX4, left(FLOWN, "TAKEOFF", CLIMB, PX4))
    lost = {"lat_deg": float("nan"), "lon_deg": float("nan"), "alt_m": float("nan")}
    custody.observe(seen_in("HOLD", **lost), Outcome(), 0.0)
    assert custody.state is Custody.FOLLOWING
    custody.observe(seen_in("HOLD", **SHORT), Outcome(), 0.0)
    assert custody.state is Custody.TAKEN


def test_a_bridge_that_ends_in_order_leaves_a_vehicle_that_the_next_one_knows_to_hold() -> None:
    custody = custody_of(PX4, left(FLOWN, "OFFBOARD", STEP, PX4))
    custody.rest()
    after = custody_of(PX4, custody.record)
    after.observe(seen_in("HOLD"), Outcome(), 0.0)
    assert after.state is Custody.FOLLOWING


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda one: one.name)
@pytest.mark.parametrize("status", ["taken_over", "failsafe"])
def test_what_ends_an_order_after_a_clearance_in_the_air_counts(
    autopilot: Autopilot, status: Any
) -> None:
    custody = custody_of(autopilot, HELD)
    climbs = Outcome(TakeOff(TOP_M), 2, "under_way")
    custody.observe(seen_in(autopilot.guided_mode), climbs, 0.0)
    assert custody.clear(0.0) == Accepted("cleared to fly")
    assert custody.state is Custody.FOLLOWING
    custody.observe(seen_in("LAND"), replace(climbs, status=status), 0.0)
    assert custody.state in (Custody.TAKEN, Custody.FAILSAFE)
    assert custody.lost


def test_who_has_ended_an_order_before_a_clearance_is_known_to_who_clears_it() -> None:
    custody = custody_of(ARDUPILOT, FLOWN)
    ended = Outcome(STEP, 2, "taken_over", "in LOITER")
    custody.observe(seen_in("LOITER"), ended, 0.0)
    assert custody.state is Custody.TAKEN
    custody.observe(seen_in("GUIDED"), ended, 0.0)
    assert custody.state is Custody.RELEASED
    custody.begin((7, 2), TOP_M, first=False)
    assert custody.clear(0.0, alone=True) == Accepted("cleared to fly")
    custody.observe(seen_in("GUIDED"), ended, 0.0)
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
    record = left(FLOWN, autopilot.mission_mode, MISSION, autopilot)
    custody = VehicleCustody(autopilot, "true", record, lambda: None, as_mission=True)
    custody.begin(SEARCH, TOP_M, first=True)
    custody.observe(seen_in(autopilot.mission_mode), Outcome(), 0.0)
    custody.observe(seen_in(mode), Outcome(), 1.0)
    assert custody.state is (Custody.FOLLOWING if known else Custody.TAKEN)


def test_a_failsafe_in_a_mission_without_its_bridge_is_named() -> None:
    custody = VehicleCustody(
        ARDUPILOT, "true", replace(FLOWN, mode="AUTO"), lambda: None, as_mission=True
    )
    custody.begin(SEARCH, TOP_M, first=True)
    for time_s in (0.0, FAILSAFE_S):
        failed = seen_in("RTL", failsafe=Failsafe.BATTERY, heard_s=time_s)
        custody.observe(failed, Outcome(), time_s)
    assert custody.state is Custody.FAILSAFE and custody.lost == "battery failsafe"


@pytest.mark.parametrize("record", [HELD, LANDING], ids=["held", "recalled"])
def test_what_an_operator_has_called_back_is_not_given_back_by_the_parameter(
    record: FlightRecord,
) -> None:
    custody = custody_of(ARDUPILOT, record, "always")
    custody.begin((7, 2), TOP_M, first=False)
    custody.observe(seen_in("LAND"), Outcome(Land(), 1, "under_way"), 0.0)
    custody.clear_automatically(0.0)
    taken = Outcome(Land(), 1, "taken_over", "in GUIDED")
    for _ in range(3):
        custody.observe(seen_in("GUIDED"), taken, 0.0)
        custody.clear_automatically(0.0)
    assert custody.state is Custody.RELEASED


CLEARED = FlightRecord(Custody.CLEARED, SEARCH, arm=True, top_amsl_m=TOP_M)


def on_the_ground(autopilot: Autopilot = ARDUPILOT, **changes: Any) -> VehicleState:
    ground: dict[str, Any] = {
        "armed": False, "flying": False, "alt_m": 0.0, "heard_s": 100.0, "disarmed_beats": 2,
    }  # fmt: skip
    return seen_in(autopilot.resting_mode, **ground | changes)


@pytest.mark.parametrize("fresh", [True, False])
@pytest.mark.parametrize("record", [FLOWN, HELD, LANDING, ENDING], ids=lambda one: one.custody.name)
def test_a_vehicle_in_the_air_is_flown_on_only_by_a_bridge_that_comes_soon(
    record: FlightRecord, fresh: bool
) -> None:
    assert inherited(record, fresh=fresh).custody is (record.custody if fresh else Custody.RELEASED)


@pytest.mark.parametrize("fresh", [True, False])
@pytest.mark.parametrize("arm", ["false", "true"])
@pytest.mark.parametrize("search", [SEARCH, None], ids=["this search", "a search to come"])
def test_a_clearance_ends_with_its_bridge_and_the_parameter_of_the_next_one_counts(
    fresh: bool, arm: Arm, search: Any
) -> None:
    record = replace(CLEARED, search=search, arm=True, from_modes=("LOITER",))
    custody = custody_of(ARDUPILOT, inherited(record, fresh=fresh), arm)
    assert custody.state is Custody.FREE
    custody.observe(on_the_ground(), Outcome(), 0.0)
    custody.clear_automatically(0.0)
    assert custody.state is Custody.CLEARED and custody.record.arm == (arm == "true")
    assert custody.record.from_modes == ()
    later = VehicleCustody(ARDUPILOT, arm, inherited(record, fresh=fresh), lambda: None)
    later.begin((7, 2), TOP_M, first=False)
    later.observe(on_the_ground(), Outcome(), 0.0)
    later.clear_automatically(0.0)
    assert later.state is Custody.FREE


@pytest.mark.parametrize("fresh", [True, False])
@pytest.mark.parametrize("custody", [Custody.TAKEN, Custody.GROUNDED])
def test_a_clearance_that_ends_with_its_bridge_leaves_the_vehicle_what_it_was(
    custody: Custody, fresh: bool
) -> None:
    lost = "taken over: its autopilot was restarted"
    before = custody_of(ARDUPILOT, replace(FLOWN, custody=custody, lost=lost), "false")
    before.observe(on_the_ground(), Outcome(), 0.0)
    assert before.clear(0.0, alone=True) == Accepted("cleared to fly")
    assert before.state is Custody.CLEARED and before.record.cleared_by == "~/arm"
    after = custody_of(ARDUPILOT, inherited(before.record, fresh=fresh), "false")
    after.observe(on_the_ground(), Outcome(), 0.0)
    after.clear_automatically(0.0)
    assert after.state is custody and after.lost == lost and not after.record.cleared_by
    assert after.record.flown


def test_a_clearance_that_lapses_is_none_for_the_next_bridge() -> None:
    led = VehicleCustody(ARDUPILOT, "false", replace(FLOWN, custody=Custody.GROUNDED), lambda: None)
    led.observe(on_the_ground(), Outcome(), 0.0)
    led.clear(0.0)
    led.lapse(CONSENT_S + 1.0)
    assert led.state is Custody.FREE
    assert inherited(led.record, fresh=True).custody is Custody.GROUNDED


def test_a_clearance_for_a_search_to_come_lapses_if_none_comes() -> None:
    custody = VehicleCustody(ARDUPILOT, "false", FlightRecord(), lambda: None)
    custody.observe(on_the_ground(), Outcome(), 0.0)
    assert custody.clear(50.0) == Accepted("cleared for the next search")
    for now_s, expected in ((CONSENT_S, Custody.CLEARED), (CONSENT_S + 51.0, Custody.FREE)):
        custody.lapse(now_s)
        assert custody.state is expected
    followed = custody_of(ARDUPILOT, FlightRecord(), "false")
    followed.observe(on_the_ground(), Outcome(), 0.0)
    assert followed.clear(50.0) == Accepted("cleared to fly")
    followed.lapse(CONSENT_S + 1000.0)
    assert followed.state is Custody.CLEARED


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda one: one.name)
@pytest.mark.parametrize("fresh", [True, False])
@pytest.mark.parametrize("seen", ["disarmed", "armed", "climbing"])
def test_what_a_bridge_was_about_to_launch_is_only_brought_down_by_the_next_one(
    autopilot: Autopilot, fresh: bool, seen: str
) -> None:
    before = custody_of(autopilot, CLEARED)
    waits = on_the_ground(autopilot)
    before.record_order(CLIMB)
    before.observe(waits, Outcome(TakeOff(TOP_M), 2, "under_way", "arming"), 0.0)
    after = custody_of(autopilot, inherited(before.record, fresh=fresh), "always")
    mode = autopilot.take_off_mode or autopilot.guided_mode
    state = {
        "disarmed": waits,
        "armed": replace(waits, armed=True),
        "climbing": seen_in(mode, alt_m=10.0),
    }[seen]
    after.observe(state, Outcome(), 0.0)
    after.clear_automatically(0.0)
    assert after.state is Custody.TAKEN
    comes_down = after.operate("land") == Accepted("ordered to land")
    assert comes_down == state.armed
    assert after.state is (Custody.RECALLED if state.armed else Custody.TAKEN)


def test_a_take_off_that_is_called_off_before_the_motors_turn_has_launched_nothing() -> None:
    custody = custody_of(ARDUPILOT, CLEARED)
    custody.record_order(CLIMB)
    custody.observe(on_the_ground(), Outcome(), 0.0)
    assert not custody.record.launched and custody.state is Custody.CLEARED


@pytest.mark.parametrize("mode", ["GUIDED", "LOITER"])
def test_what_nobody_has_commanded_to_arm_is_somebody_elses(mode: str) -> None:
    custody = custody_of(ARDUPILOT, CLEARED)
    custody.observe(seen_in(mode, flying=False, alt_m=0.0), Outcome(), 0.0)
    assert custody.state is Custody.TAKEN


@pytest.mark.parametrize(
    ("mode", "expected"), [("GUIDED", Custody.FOLLOWING), ("LOITER", Custody.TAKEN)]
)
def test_who_arms_it_by_hand_hands_it_over_in_guided_alone(mode: str, expected: Custody) -> None:
    custody = custody_of(ARDUPILOT, replace(CLEARED, arm=False), "false")
    seen = seen_in(mode, flying=False, alt_m=0.0)
    waiting = Outcome(TakeOff(TOP_M, arm=False), 1, "under_way")
    custody.observe(seen, waiting, 0.0)
    assert custody.state is expected


def test_what_somebody_arms_and_disarms_after_its_flight_is_theirs() -> None:
    custody = custody_of(ARDUPILOT, replace(FLOWN, custody=Custody.GROUNDED), "always")
    for armed in (False, True, False):
        custody.observe(on_the_ground(armed=armed), Outcome(), 0.0)
    assert custody.state is Custody.TAKEN
    custody.begin((7, 2), TOP_M, first=False)
    custody.clear_automatically(0.0)
    assert custody.state is Custody.TAKEN


RESTARTED = Identity("", restarts=1)


@pytest.mark.parametrize("custody", Custody)
def test_a_restarted_autopilot_was_in_somebodys_hands(custody: Custody) -> None:
    led = custody_of(ARDUPILOT, replace(FLOWN, custody=custody), "false")
    led.observe(on_the_ground(identity=RESTARTED), Outcome(), 0.0)
    may_arm = led.state is Custody.CLEARED
    assert not may_arm
    # Before anybody has cleared it, it may be switched on as often as anybody likes.
    assert (led.state is Custody.FREE) == (custody is Custody.FREE)


def test_what_a_restarted_autopilot_was_cleared_for_is_cleared_again_by_a_person() -> None:
    led = custody_of(ARDUPILOT, CLEARED)
    for _ in range(3):
        led.observe(on_the_ground(identity=RESTARTED), Outcome(), 0.0)
        led.clear_automatically(0.0)
    assert led.state is Custody.TAKEN and led.lost == "taken over: its autopilot was restarted"
    assert led.clear(0.0) == Accepted("cleared to fly")


HOME = (-24.0, -46.0, 0.0)


@pytest.mark.parametrize(
    ("home", "expected"),
    [
        ((-24.0, -46.0, 4.0), Custody.FOLLOWING),
        ((-24.0, -46.0, 95.0), Custody.TAKEN),
        ((-24.001, -46.0, 0.0), Custody.TAKEN),
    ],
    ids=["PX4's own", "up here", "there"],
)
@pytest.mark.parametrize("restarted", [False, True])
def test_a_home_that_is_moved_in_flight_is_a_persons_act(
    home: Any, expected: Custody, restarted: bool
) -> None:
    led = custody_of(ARDUPILOT, FLOWN)
    led.observe(seen_in("GUIDED", home=HOME), Outcome(STEP, 1, "under_way"), 0.0)
    if restarted:
        led = custody_of(ARDUPILOT, inherited(led.record, fresh=True))
    led.observe(seen_in("GUIDED", home=home), Outcome(STEP, 1, "under_way"), 0.0)
    assert led.state is expected


def in_mission(item: int, time_s: float, total: int = 5, **changes: Any) -> VehicleState:
    return seen_in("AUTO", item_current=item, item_total=total, item_s=time_s, **changes)


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        (in_mission(3, 11.0), Custody.FOLLOWING),
        (in_mission(5, 20.0), Custody.FOLLOWING),
        (in_mission(2, 11.0, total=9), Custody.TAKEN),
        (in_mission(2, 11.0, total=0), Custody.TAKEN),
        (in_mission(1, 11.0), Custody.TAKEN),
        (in_mission(0, 11.0), Custody.TAKEN),
    ],
    ids=["goes on", "after a gap", "another", "cleared", "set back", "set home"],
)
@pytest.mark.parametrize("restarted", [False, True])
def test_who_changes_the_mission_that_it_flies_has_taken_it_over(
    state: VehicleState, expected: Custody, restarted: bool
) -> None:
    def bridge(record: FlightRecord) -> VehicleCustody:
        led = VehicleCustody(ARDUPILOT, "true", record, lambda: None, as_mission=True)
        led.begin(SEARCH, TOP_M, first=True)
        return led

    flies = Outcome(MISSION, 1, "under_way")
    led = bridge(left(FLOWN, "AUTO", MISSION, ARDUPILOT))
    led.observe(in_mission(2, 10.0), flies, 0.0)
    if restarted:
        led, flies = bridge(inherited(led.record, fresh=True)), Outcome()
        led.observe(in_mission(2, 10.0), flies, 0.0)
    led.observe(state, flies, 0.0)
    assert led.state is expected


def test_an_autopilot_that_does_not_report_the_length_of_its_mission_may_go_on() -> None:
    record = left(FLOWN, "AUTO", MISSION, ARDUPILOT)
    led = VehicleCustody(ARDUPILOT, "true", record, lambda: None, as_mission=True)
    led.begin(SEARCH, TOP_M, first=True)
    for item in range(1, 5):
        state = in_mission(item, 10.0 * item, total=0)
        led.observe(state, Outcome(MISSION, 1, "under_way"), 0.0)
    assert led.state is Custody.FOLLOWING


@pytest.mark.parametrize(("later_s", "named"), [(1.0, True), (20.0, False)])
def test_a_failsafe_whose_cause_comes_after_its_mode_is_named(later_s: float, named: bool) -> None:
    led = custody_of(ARDUPILOT, FLOWN)
    taken = Outcome(STEP, 1, "taken_over", "in LAND")
    led.observe(seen_in("LAND", heard_s=10.0), taken, 0.0)
    assert led.state is Custody.TAKEN and led.lost == "taken over: in LAND"
    seen = seen_in("LAND", heard_s=10.0 + later_s, failsafe=Failsafe.FENCE)
    led.observe(seen, taken, 0.0)
    assert led.state is (Custody.FAILSAFE if named else Custody.TAKEN)
    assert led.lost == ("fence failsafe" if named else "taken over: in LAND")


def test_who_arms_a_vehicle_that_crashed_in_an_earlier_search_is_named_alone() -> None:
    crashed = custody_of(ARDUPILOT, FlightRecord(Custody.CRASHED, (7, 0), lost="crashed: it fell"))
    crashed.observe(seen_in("LOITER"), Outcome(), 0.0)
    assert crashed.lost == "taken over: armed by somebody else, in LOITER"


def test_a_failsafe_without_a_name_is_named_later_but_explains_no_later_mode() -> None:
    led = custody_of(ARDUPILOT, FLOWN)
    order = Outcome(STEP, 1, "failsafe", "in LAND, critical failsafe")
    led.observe(seen_in("LAND", heard_s=10.0, failsafe=Failsafe.CRITICAL), order, 0.0)
    assert led.state is Custody.FAILSAFE and led.lost == "critical failsafe"
    led.observe(seen_in("GUIDED", heard_s=11.0), order, 1.0)
    led.observe(seen_in("LOITER", heard_s=12.0), order, 2.0)
    assert led.state is Custody.TAKEN and led.lost == "critical failsafe"
    led.observe(seen_in("LOITER", heard_s=60.0, failsafe=Failsafe.BATTERY), order, 50.0)
    assert led.state is Custody.TAKEN and led.lost == "battery failsafe"


@pytest.mark.parametrize("launched", [True, False])
def test_whoever_has_launched_it_it_is_recalled_from_a_pilot(launched: bool) -> None:
    led = custody_of(ARDUPILOT, replace(FLOWN, custody=Custody.RELEASED, launched=launched))
    led.observe(seen_in("GUIDED"), Outcome(), 0.0)
    assert led.clear(0.0, alone=True) == Accepted("cleared to fly")
    led.observe(seen_in("LOITER"), Outcome(STEP, 1, "taken_over", "in LOITER"), 1.0)
    assert led.state is Custody.TAKEN
    assert led.operate("return") == Accepted("ordered to return")


def test_a_vehicle_without_a_search_is_not_cleared_to_fly() -> None:
    landing = replace(LANDING, lost="recalled by the operator: land")
    for record, why in ((HELD, "no search goes on"), (landing, "coming down")):
        led = VehicleCustody(ARDUPILOT, "true", record, lambda: None)
        led.observe(seen_in("GUIDED"), Outcome(), 0.0)
        refused = led.clear(0.0)
        assert isinstance(refused, Rejected) and why in refused.reason
        assert led.state is record.custody
    led = custody_of(ARDUPILOT, HELD)
    led.observe(seen_in("GUIDED"), Outcome(), 0.0)
    assert isinstance(led.clear(0.0, search_alive=False), Rejected)
    assert led.state is Custody.HELD
