# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which order a vehicle gets next."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.flight.autopilots import ARDUPILOT, PX4
from dsse_ros.flight.fence import Fence
from dsse_ros.flight.orders import FlyMission, GoTo, Hold, Land, Order, Return, Search, TakeOff
from dsse_ros.flight.vehicle_controller import Outcome
from dsse_ros.flight.vehicle_follower import (
    CRITICAL_S,
    RETRY_S,
    TRIES,
    FlightRecord,
    Leg,
    VehicleFollower,
    leg_task,
    mission_task,
)
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.mission.vehicle_missions import search_mission
from dsse_ros.nodes.settings import BridgeSettings
from msg_adapters.frames import GridFrame
from msg_adapters.geodesy import cell_to_geodetic
from msg_adapters.mission_files import Home
from msg_adapters.result import Accepted, Rejected

FRAME = GridFrame(10, 130.0, -24.0, -46.0, 0.0, 120.0)
SETTINGS = BridgeSettings()
FENCE = Fence(FRAME, 500.0, 10.0, 150.0)
ON_GROUND = VehicleState(
    connected=True, ready=True, mode="GUIDED", lat_deg=-23.999, lon_deg=-45.999, alt_m=0.0
)
FLYING = replace(ON_GROUND, armed=True, flying=True, alt_m=120.0)


class Vehicle:
    """Carries out its order when asked to, and remembers it."""

    def __init__(self, follower: VehicleFollower, state: VehicleState = ON_GROUND) -> None:
        self.follower, self.state = follower, state
        self.outcome = Outcome()
        self.orders: list[Order] = []
        self.now_s = 0.0

    def turn(self, **changes: Any) -> Order | None:
        """Let the follower look once; changes are of the outcome."""
        self.now_s += 0.1
        self.outcome = replace(self.outcome, **changes)
        order = self.follower.advance(self.state, self.outcome, self.now_s)
        if order is not None:
            self.orders.append(order)
            number = self.outcome.number + 1
            self.outcome = Outcome(order, number, "under_way", "")
        return order

    def obey(self) -> None:
        """Carry out the last order."""
        order = self.outcome.order
        if isinstance(order, TakeOff):
            self.state = FLYING
        elif isinstance(order, Return | Land | FlyMission):
            self.state = ON_GROUND
        self.turn(status="done")

    def fall_silent(self, seconds: float) -> Order | None:
        """Have no heartbeat come for some time, and return the orders it gets then."""
        ready = self.state.ready
        self.state = replace(self.state, connected=False, ready=False, heard_s=self.now_s)
        self.now_s += seconds
        order = self.turn(status="silent", reason="no heartbeat")
        self.state = replace(self.state, connected=False, ready=ready)
        return order

    def speak(self) -> None:
        """Have heartbeats come again."""
        self.state = replace(self.state, connected=True)
        self.outcome = replace(self.outcome, status="under_way")


def follower(**changes: Any) -> VehicleFollower:
    options = {
        "take_off_alt_m": 120.0, "fence": FENCE, "at_end": "return", "join_timeout_s": 100.0,
        "lost_timeout_s": 30.0,
    }  # fmt: skip
    return VehicleFollower(**(options | changes))


def follow(led: VehicleFollower, stamp: int, *cell: int, **changes: Any) -> None:
    leg = Leg(stamp, (cell[0], cell[1]), **changes)
    led.follow(leg, leg_task(leg, FRAME, SETTINGS, FENCE))


def place(*cell: int) -> tuple[float, float]:
    return cell_to_geodetic(FRAME, cell[0], cell[1], 120.0)[:2]


def test_a_vehicle_takes_off_first_and_its_climb_is_not_cut_short() -> None:
    led = follower()
    vehicle = Vehicle(led)
    assert vehicle.turn() is None
    follow(led, 0, 3, 4)
    assert vehicle.turn() == TakeOff(120.0)
    # In the air, but not there yet.
    vehicle.state = replace(FLYING, alt_m=40.0)
    follow(led, 13, 3, 5)
    assert vehicle.turn() is None
    vehicle.obey()
    assert vehicle.orders[-1] == GoTo(*place(3, 5), 120.0, 10.0)
    assert not led.arrived and led.arrived_stamp_ns == -1
    vehicle.obey()
    assert led.arrived_stamp_ns == 13 and vehicle.turn() is None


def test_a_search_is_done_once_for_each_step_that_has_one() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    for stamp in (13, 26):
        follow(led, stamp, 2, 2, searched=True)
        vehicle.turn()
        assert vehicle.orders[-1] == Search(*place(2, 2), 120.0, 30.0, 5.0, 10.0)
        assert not led.arrived
        vehicle.obey()
        assert led.arrived_stamp_ns == stamp
    assert len(vehicle.orders) == 2


@given(st.lists(st.sampled_from([(1, 0), (-1, 0), (0, 1), (0, -1), (0, 0)]), max_size=12))
def test_every_cell_is_flown_to_in_order_and_none_is_left_before_it_is_reached(
    moves: list[tuple[int, int]],
) -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    col = row = 5
    wanted = []
    for step, (dx, dy) in enumerate([(0, 0), *moves]):
        col, row = min(max(col + dx, 0), 9), min(max(row + dy, 0), 9)
        searched = bool(step) and not dx and not dy
        follow(led, 13 * step, col, row, searched=searched)
        wanted.append((place(col, row), searched))
        while not led.arrived:
            vehicle.turn()
            vehicle.obey()
    flown = [
        ((order.lat_deg, order.lon_deg), isinstance(order, Search))
        for order in vehicle.orders
        if isinstance(order, GoTo | Search)
    ]
    without_repeats = [w for w, before in zip(wanted, [None, *wanted], strict=False)
                       if w != before or w[1]]  # fmt: skip
    assert flown == without_repeats


@pytest.mark.parametrize(
    ("at_end", "order"), [("return", Return()), ("land", Land()), ("hold", Hold())]
)
def test_at_the_end_the_last_leg_is_flown_and_then_the_end(at_end: str, order: Order) -> None:
    led = follower(at_end=at_end)
    vehicle = Vehicle(led, FLYING)
    follow(led, 0, 1, 1)
    vehicle.turn()
    follow(led, 13, 1, 1, searched=True, over=True)
    assert isinstance(vehicle.turn(), Search)
    assert vehicle.turn() is None
    vehicle.obey()
    assert vehicle.orders[-1] == order
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    assert not led.lost


def test_nobody_is_sent_where_two_drones_have_crashed() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1, over=True, crashed=True)
    assert vehicle.turn() == Return()


def test_a_step_that_is_reported_again_changes_nothing_but_its_end() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.obey()
    follow(led, 13, 1, 1)
    assert led.arrived and vehicle.turn() is None
    follow(led, 13, 1, 1, over=True)
    assert vehicle.turn() == Return()


def test_what_a_pilot_has_taken_over_gets_no_order_any_more() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.turn(status="taken_over", reason="in LOITER")
    assert led.lost == "taken over: in LOITER"
    follow(led, 26, 1, 2, over=True)
    vehicle.state = replace(FLYING, mode="GUIDED")
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    # A new search asks again; it is the pilot who decides.
    led.begin()
    follow(led, 39, 4, 4)
    assert isinstance(vehicle.turn(), GoTo) and not led.lost


def test_a_silent_vehicle_goes_on_when_it_is_connected_again_in_time() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1)
    assert isinstance(vehicle.turn(), GoTo)
    assert vehicle.fall_silent(29.0) is None
    vehicle.speak()
    assert vehicle.turn() is None and not led.lost
    vehicle.obey()
    assert led.arrived_stamp_ns == 13


def test_a_vehicle_silent_for_too_long_is_lost_returns_when_connected_and_stays_lost() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1)
    vehicle.turn()
    assert vehicle.fall_silent(30.0) is None
    assert led.lost == "link lost: no heartbeat for 30 s"
    vehicle.speak()
    assert vehicle.turn() == Return()
    follow(led, 26, 1, 2)
    vehicle.obey()
    assert led.lost and [vehicle.turn() for _ in range(3)] == [None] * 3


@pytest.mark.parametrize("at_end", ["return", "land", "hold"])
def test_who_is_lost_before_take_off_is_ordered_to_stay_even_before_it_is_connected_again(
    at_end: str,
) -> None:
    led = follower(at_end=at_end)
    vehicle = Vehicle(led)
    follow(led, 0, 1, 1)
    assert vehicle.turn() == TakeOff(120.0)
    order = vehicle.fall_silent(30.0)
    assert led.lost and isinstance(order, Return | Land | Hold)
    assert vehicle.turn(status="silent") is None
    vehicle.speak()
    assert vehicle.turn(status="done") is None
    follow(led, 13, 1, 2, over=True)
    assert [vehicle.turn() for _ in range(3)] == [None] * 3


def fly_mission(led: VehicleFollower) -> None:
    mission = search_mission(FRAME, [(0, 9), (1, 9)], [0, 0], SETTINGS, Home(-23.999, -45.999, 0.0))
    led.follow(Leg(13, (1, 9), over=True), mission_task(mission, FENCE, PX4))


def test_a_mission_that_waits_for_its_take_off_is_not_flown_by_who_was_lost() -> None:
    led = follower(whole=True)
    vehicle = Vehicle(led)
    fly_mission(led)
    assert isinstance(vehicle.turn(), FlyMission)
    assert vehicle.fall_silent(30.0) == Return()


ENDINGS = {
    "found elsewhere": (True, FlightRecord()),
    "has flown": (False, FlightRecord(took_off=True)),
    "link lost": (False, FlightRecord(took_off=True, lost="link lost: no heartbeat for 30 s")),
    "lost before take-off": (False, FlightRecord(lost="no heartbeat within 300 s")),
    "taken over": (
        False, FlightRecord(took_off=True, lost="taken over: in LOITER", taken_over=True)
    ),
}  # fmt: skip


@pytest.mark.parametrize(("over", "record"), ENDINGS.values(), ids=ENDINGS)
@pytest.mark.parametrize("landed", [True, False], ids=["on the ground", "in the air"])
def test_a_bridge_started_anew_has_nobody_take_off_who_is_out_of_the_search(
    over: bool, record: FlightRecord, landed: bool
) -> None:
    led = follower()
    led.begin(record)
    vehicle = Vehicle(led, ON_GROUND if landed else FLYING)
    follow(led, 13, 1, 1, over=over)
    vehicle.turn()
    vehicle.obey()
    follow(led, 26, 1, 2, over=over)
    for _ in range(5):
        vehicle.turn()
    flown = [type(order) for order in vehicle.orders]
    if record.taken_over or landed:
        assert flown == []
    elif over or record.lost:
        assert flown == [Return]
    else:
        assert TakeOff not in flown and GoTo in flown
    assert led.lost == record.lost or (landed and record.took_off)
    assert led.finished or not (landed or led.lost or over)


@pytest.mark.parametrize("state", [ON_GROUND, FLYING], ids=["on the ground", "in the air"])
def test_of_the_steps_that_come_late_in_one_go_the_last_one_counts(state: VehicleState) -> None:
    led = follower()
    vehicle = Vehicle(led, state)
    for step in range(5):
        follow(led, 13 * step, step, 1, over=step == 4)
    vehicle.turn()
    assert vehicle.orders == ([Return()] if state.flying else [])


def test_a_mission_that_was_begun_is_not_begun_again_by_a_bridge_started_anew() -> None:
    for state in (ON_GROUND, FLYING):
        led = follower(whole=True)
        led.begin(FlightRecord(took_off=True))
        vehicle = Vehicle(led, state)
        fly_mission(led)
        assert [vehicle.turn() for _ in range(3)] == [None] * 3
        assert led.finished == (not state.flying) and not led.lost
    led = follower(whole=True)
    vehicle = Vehicle(led)
    fly_mission(led)
    assert isinstance(vehicle.turn(), FlyMission) and not led.finished


def test_a_mission_that_fails_in_the_air_is_not_begun_again() -> None:
    led = follower(whole=True)
    vehicle = Vehicle(led)
    fly_mission(led)
    vehicle.turn()
    vehicle.state = FLYING
    vehicle.turn()
    assert vehicle.turn(status="failed", reason="no progress for 60 s") == Return()
    assert led.lost == "failed: no progress for 60 s"


def test_who_came_down_by_itself_does_not_take_off_again() -> None:
    led = follower()
    vehicle = Vehicle(led)
    follow(led, 0, 1, 1)
    vehicle.turn()
    vehicle.obey()
    assert isinstance(vehicle.orders[-1], GoTo)
    vehicle.state = ON_GROUND
    vehicle.turn(status="failed", reason="the vehicle is not in the air")
    assert led.lost == "on the ground again before the end of the search"
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    led.begin()
    follow(led, 26, 1, 1)
    assert vehicle.turn() == TakeOff(120.0)


def test_nothing_takes_off_for_a_search_that_is_gone() -> None:
    led = follower()
    follow(led, 0, 1, 1)
    assert led.advance(ON_GROUND, Outcome(), 0.0, search_alive=False) is None
    order = led.advance(ON_GROUND, Outcome(), 0.1)
    assert order == TakeOff(120.0)
    outcome = Outcome(order, 1, "under_way", "waiting until it is ready")
    assert led.advance(ON_GROUND, outcome, 0.2, search_alive=False) == Hold()


@given(
    st.lists(
        st.sampled_from(["step", "over", "obey", "fail", "silent", "land", "pilot", "restart"]),
        max_size=25,
    )
)
def test_a_vehicle_takes_off_once_in_a_mission_whatever_happens(events: list[str]) -> None:
    led = follower()
    vehicle = Vehicle(led)
    stamp, over, was_up = 0, False, False
    for event in events:
        lost, before = led.lost, len(vehicle.orders)
        if event in ("step", "over"):
            stamp, over = stamp + 13, over or event == "over"
            follow(led, stamp, stamp % 10, 5, over=over)
        elif event == "obey" and vehicle.outcome.order is not None:
            vehicle.obey()
        elif event == "fail":
            vehicle.now_s += RETRY_S
            vehicle.turn(status="failed", reason="no progress")
        elif event == "silent":
            vehicle.fall_silent(31.0)
            vehicle.speak()
        elif event == "land":
            vehicle.state = ON_GROUND
        elif event == "pilot":
            vehicle.turn(status="taken_over", reason="in LOITER")
        elif event == "restart":
            record, leg = led.record, led.leg
            led = vehicle.follower = follower()
            led.begin(record)
            vehicle.outcome = Outcome()
            if leg is not None:
                led.follow(leg, leg_task(leg, FRAME, SETTINGS, FENCE))
        vehicle.turn()
        for order in vehicle.orders[before:]:
            if isinstance(order, TakeOff):
                assert not (lost or over or (was_up and not vehicle.state.flying))
        was_up = was_up or vehicle.state.flying


def test_a_take_off_that_has_not_begun_is_called_off_once_it_is_not_wanted() -> None:
    def waiting() -> Vehicle:
        vehicle = Vehicle(follower())
        follow(vehicle.follower, 0, 1, 1)
        assert vehicle.turn() == TakeOff(120.0)
        return vehicle

    crashed = waiting()
    follow(crashed.follower, 13, 1, 1, over=True, crashed=True)
    assert crashed.turn() == Return()
    refused = waiting()
    follow(refused.follower, 13, 19, 5)
    assert refused.follower.refused and refused.turn() == Hold()
    moved = waiting()
    moved.state = replace(ON_GROUND, lat_deg=-35.0)
    assert moved.turn() == Hold() and moved.follower.refused
    moved.turn(status="done")
    moved.state = ON_GROUND
    assert moved.turn() == TakeOff(120.0)
    anew = waiting()
    anew.follower.begin()
    assert anew.turn() == Hold()
    other = waiting()
    other.follower = follower()
    assert other.turn() == Hold()
    for vehicle in (crashed, refused, anew, other):
        vehicle.turn(status="done")
        assert vehicle.turn() is None


def test_a_leg_with_the_same_stamp_but_another_cell_is_of_another_search() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 0, 1, 1)
    vehicle.turn()
    vehicle.obey()
    follow(led, 0, 3, 3)
    assert not led.arrived
    assert vehicle.turn() == GoTo(*place(3, 3), 120.0, 10.0)


def test_a_failsafe_takes_the_vehicle_out() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.state = replace(FLYING, failsafe="battery")
    assert vehicle.turn() == Return()
    assert led.lost == "battery failsafe"


def test_who_is_critical_without_a_reason_may_be_well_again_in_time() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1)
    vehicle.turn()
    for failsafe in ("critical", "offboard", "", "critical"):
        vehicle.state = replace(FLYING, failsafe=failsafe)
        vehicle.now_s += CRITICAL_S - 0.5
        assert vehicle.turn() is None and not led.lost
    vehicle.now_s += CRITICAL_S
    assert vehicle.turn() == Return()
    assert led.lost == "critical failsafe"


def test_an_order_that_fails_is_given_again_and_then_the_vehicle_is_lost() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1)
    vehicle.turn()
    for _ in range(TRIES - 1):
        vehicle.turn(status="failed", reason="no progress")
        assert not led.lost
        assert vehicle.turn() is None
        vehicle.now_s += RETRY_S
        assert isinstance(vehicle.turn(), GoTo)
    assert vehicle.turn(status="failed", reason="no progress") == Return()
    assert led.lost == "failed: no progress"


def test_a_vehicle_that_is_never_connected_is_lost_in_the_end() -> None:
    led = follower(join_timeout_s=3.0)
    vehicle = Vehicle(led, VehicleState())
    follow(led, 0, 0, 0)
    vehicle.turn()
    assert not led.lost
    vehicle.now_s += 3.1
    assert vehicle.turn() is None
    assert led.lost == "no heartbeat within 3 s"


def test_what_is_wrong_with_the_link_is_reported_of_who_is_lost() -> None:
    led = follower(join_timeout_s=3.0)
    follow(led, 0, 0, 0)
    for now_s in (0.0, 3.1):
        led.advance(VehicleState(), Outcome(), now_s, "/dev/nope: No such file or directory")
    assert led.lost == "no heartbeat within 3 s: /dev/nope: No such file or directory"


@pytest.mark.parametrize(
    ("state", "lost"),
    [
        (
            VehicleState(connected=True, ready=True, mode="GUIDED"),
            "no position within 3 s: unsigned",
        ),
        (replace(ON_GROUND, ready=False), "not ready within 3 s: PreArm: Compass not healthy"),
        (
            replace(ON_GROUND, lat_deg=-35.0),
            "no take-off within 3 s: take-off: (-35.0000000, -45.9990000) is not allowed; "
            "within 500 m of the search area",
        ),
    ],
)
def test_who_cannot_take_off_is_lost_after_the_join_timeout_once_with_the_reason(
    state: VehicleState, lost: str
) -> None:
    led = follower(join_timeout_s=3.0)
    follow(led, 0, 0, 0)
    outcome = Outcome()
    trouble = "unsigned" if not state.has_position else ""
    for turn in range(40):
        order = led.advance(state, outcome, 0.1 * turn, trouble)
        if order is not None:
            reason = "PreArm: Compass not healthy"
            outcome = Outcome(order, outcome.number + 1, "under_way", reason)
        if turn in (2, 29):
            assert led.blocked and not led.lost
    assert led.lost == lost and led.finished


def test_somebody_who_may_arm_later_has_all_the_time_in_the_world() -> None:
    led = follower(join_timeout_s=3.0)
    vehicle = Vehicle(led)
    follow(led, 0, 0, 0)
    vehicle.turn()
    vehicle.now_s += 1000.0
    vehicle.turn(reason="waiting for somebody to arm it")
    assert not led.lost and not led.blocked


def test_a_held_vehicle_goes_on_with_the_next_step() -> None:
    led = follower()
    vehicle = Vehicle(led, FLYING)
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.obey()
    led.hold()
    assert vehicle.turn() == Hold()
    assert led.waiting and led.arrived
    follow(led, 26, 1, 2)
    assert isinstance(vehicle.turn(), GoTo)


@pytest.mark.parametrize(
    ("cell", "changes", "code"),
    [((15, 5), {}, "outside_fence"), ((5, 5), {"altitude": 200.0}, "altitude")],
)
def test_a_leg_out_of_the_fence_is_refused_and_the_vehicle_holds(
    cell: tuple[int, int], changes: dict[str, float], code: str
) -> None:
    frame = replace(FRAME, alt_m=changes.get("altitude", 120.0))
    leg = Leg(13, cell)
    task = leg_task(leg, frame, SETTINGS, FENCE)
    assert isinstance(task, Rejected) and task.code == code
    led = follower()
    vehicle = Vehicle(led, FLYING)
    led.follow(leg, task)
    assert vehicle.turn() == Hold()
    assert led.refused == task.reason and not led.lost and not led.arrived
    follow(led, 26, 5, 5)
    assert isinstance(vehicle.turn(), GoTo) and not led.refused


def test_a_search_below_the_fence_is_refused() -> None:
    settings = replace(SETTINGS, search_altitude=5.0)
    task = leg_task(Leg(13, (5, 5), searched=True), FRAME, settings, FENCE)
    assert isinstance(task, Rejected) and task.code == "altitude"
    assert isinstance(leg_task(Leg(13, (5, 5)), FRAME, settings, FENCE), Accepted)


def test_nothing_takes_off_that_stands_elsewhere_or_does_not_know_where() -> None:
    led = follower()
    vehicle = Vehicle(led, replace(ON_GROUND, lat_deg=-35.0, lon_deg=149.0))
    follow(led, 0, 0, 0)
    assert vehicle.turn() is None
    assert led.refused.startswith("take-off: ") and not led.lost
    vehicle.state = VehicleState(connected=True, ready=True, mode="GUIDED")
    assert vehicle.turn() is None
    vehicle.state = ON_GROUND
    assert vehicle.turn() == TakeOff(120.0)
    assert not led.refused


def test_a_mission_is_flown_as_a_whole_with_its_own_end() -> None:
    home = Home(-23.999, -45.999, 0.0)
    mission = search_mission(FRAME, [(0, 9), (1, 9), (1, 9)], [0, 0, 1], SETTINGS, home)
    task = mission_task(mission, FENCE, ARDUPILOT)
    assert isinstance(task, Accepted)
    led = follower(whole=True)
    vehicle = Vehicle(led)
    led.follow(Leg(26, (1, 9), over=True), task)
    order = vehicle.turn()
    assert isinstance(order, FlyMission) and len(order.items) == len(mission.items) + 1
    vehicle.state = FLYING
    assert vehicle.turn() is None
    vehicle.obey()
    assert led.arrived_stamp_ns == 26 and vehicle.turn() is None
    far = mission_task(replace(mission, home=Home(0.0, 0.0, 0.0)), FENCE, ARDUPILOT)
    assert isinstance(far, Rejected)


def test_a_mission_whose_vehicle_is_down_but_armed_is_let_end_by_itself() -> None:
    led = follower(whole=True)
    vehicle = Vehicle(led)
    fly_mission(led)
    vehicle.turn()
    vehicle.state = FLYING
    vehicle.turn()
    vehicle.state = replace(ON_GROUND, armed=True)
    assert vehicle.turn() is None and not led.finished
    vehicle.state = ON_GROUND
    assert vehicle.turn() is None
    vehicle.obey()
    assert led.arrived and led.finished and len(vehicle.orders) == 1


def test_a_mission_that_cannot_be_made_without_home_is_given_up_in_the_end() -> None:
    led = follower(whole=True, join_timeout_s=3.0)
    vehicle = Vehicle(led)
    leg = Leg(13, (1, 9), over=True)
    led.follow(leg, None)
    vehicle.turn()
    assert led.blocked == "no home position" and not led.has_task
    fly_mission(led)
    assert isinstance(vehicle.turn(), FlyMission) and not led.blocked
    other = follower(whole=True, join_timeout_s=3.0)
    other.follow(leg, None)
    for now_s in (0.0, 3.1):
        assert other.advance(ON_GROUND, Outcome(), now_s) is None
    assert other.lost == "no home position within 3 s"


def test_an_order_that_would_fail_again_is_given_once() -> None:
    led = follower()
    vehicle = Vehicle(led)
    follow(led, 0, 3, 4)
    assert vehicle.turn() == TakeOff(120.0)
    vehicle.turn(status="failed", reason="taking off: UNSUPPORTED", final=True)
    assert led.lost == "failed: taking off: UNSUPPORTED"
    assert vehicle.orders == [TakeOff(120.0)]


@pytest.mark.parametrize("where", [{}, {"lat_deg": math.nan, "lon_deg": math.nan}])
def test_what_a_vehicle_reports_of_its_checks_is_why_it_cannot_take_off(where: Any) -> None:
    led = follower()
    complaints = (("PreArm: GPS 1: Bad fix", 0.0),)
    vehicle = Vehicle(led, replace(ON_GROUND, ready=False, _complaints=complaints, **where))
    follow(led, 0, 3, 4)
    vehicle.turn()
    vehicle.turn(reason="")
    assert led.blocked.startswith("no position" if where else "not ready")
    if where:
        assert led.blocked == "no position: PreArm: GPS 1: Bad fix"
