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

from dsse_ros.base.result import Accepted, Rejected
from dsse_ros.vehicles.autopilots import Failsafe
from dsse_ros.vehicles.control.identity import Identity
from dsse_ros.vehicles.control.orders import (
    FlyMission,
    GoTo,
    Hold,
    Land,
    MakeReady,
    Order,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.vehicles.control.vehicle_controller import Outcome
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.custody import MAY_ORDER, Custody
from dsse_ros.vehicles.fleet.failsafe_watch import FAILSAFE_S
from dsse_ros.vehicles.fleet.fence import Fence
from dsse_ros.vehicles.fleet.flight_record import FlightRecord, inherited
from dsse_ros.vehicles.fleet.layer import Layer
from dsse_ros.vehicles.fleet.progress import RETRY_S, TRIES, LegProgress
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.fleet.vehicle_dispatcher import Permissions, VehicleDispatcher
from dsse_ros.vehicles.fleet.vehicle_missions import search_missions
from dsse_ros.vehicles.mission_items.items import Home
from dsse_ros.vehicles.mission_items.track_missions import VehicleLeg
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import cell_to_geodetic

FRAME = GridFrame(10, 130.0, -24.0, -46.0, 0.0, 120.0)
SETTINGS = BridgeSettings()
LAYER = Layer(Fence(FRAME, 500.0, 10.0, 150.0), SETTINGS, 13.0)
SEARCH, NEXT_SEARCH = (7, 1), (7, 2)
ON_GROUND = VehicleState(
    identity=Identity(uid=""), connected=True, ready=True, mode="GUIDED", lat_deg=-23.999,
    lon_deg=-45.999, alt_m=0.0, alt_amsl_m=0.0, climb_mps=0.0, disarmed_beats=2,
)  # fmt: skip
FLYING = replace(ON_GROUND, armed=True, flying=True, alt_m=120.0, alt_amsl_m=120.0)
FLOWN = FlightRecord(Custody.FOLLOWING, SEARCH, flown=True)


class Vehicle:
    """Carries out its order when asked to, and remembers it."""

    def __init__(self, dispatcher: VehicleDispatcher, state: VehicleState = ON_GROUND) -> None:
        self.dispatcher, self.state = dispatcher, state
        self.outcome = Outcome()
        self.orders: list[Order] = []
        self.permissions = Permissions()
        self.now_s = 0.0

    def turn(self, **changes: Any) -> Order | None:
        """Let the dispatcher look once; changes are of the outcome."""
        self.now_s += 0.1
        self.outcome = replace(self.outcome, **changes)
        led = self.dispatcher
        order = led.advance(self.state, self.outcome, self.now_s, None, self.permissions)
        if order is not None:
            assert isinstance(order, MAY_ORDER[led.custody.state])
            self.orders.append(order)
            number = self.outcome.number + 1
            self.outcome = Outcome(order, number, "under_way")
        return order

    def obey(self) -> None:
        """Carry out the last order."""
        order = self.outcome.order
        if isinstance(order, TakeOff):
            self.state = FLYING
        elif isinstance(order, Return | Land | FlyMission):
            self.state = ON_GROUND
        elif isinstance(order, GoTo | SearchPlace):
            alt_m = order.alt_amsl_m if isinstance(order, GoTo) else order.search_amsl_m
            self.be_at(order.lat_deg, order.lon_deg, alt_m)
        self.turn(status="done")

    def be_at(self, lat_deg: float, lon_deg: float, alt_m: float = 120.0) -> None:
        """Be at a place."""
        self.state = replace(
            self.state, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=alt_m, alt_amsl_m=alt_m
        )

    def take_off(self) -> None:
        """Get it into the air, from the ground."""
        assert isinstance(self.turn(), TakeOff)
        self.obey()

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


def dispatcher(**changes: Any) -> VehicleDispatcher:
    search, record = changes.pop("search", SEARCH), changes.pop("record", None)
    options = {"join_timeout": 100.0, "lost_timeout": 30.0, "arm": "true"}
    led = VehicleDispatcher(BridgeSettings(**(options | changes)), record)
    led.begin(search, LAYER, first=True)
    return led


def in_the_air(led: VehicleDispatcher | None = None, **changes: Any) -> Vehicle:
    """Return a vehicle that is in the air for the search."""
    return Vehicle(led or dispatcher(record=FLOWN, **changes), FLYING)


def follow(led: VehicleDispatcher, stamp: int, *cell: int, **changes: Any) -> None:
    leg = VehicleLeg(stamp, (cell[0], cell[1]), **changes)
    led.follow(leg, LAYER.leg_task(leg))


def place(*cell: int) -> tuple[float, float]:
    return cell_to_geodetic(FRAME, cell[0], cell[1], 120.0)[:2]


def test_a_vehicle_takes_off_first_and_its_climb_is_not_cut_short() -> None:
    led = dispatcher()
    vehicle = Vehicle(led)
    assert vehicle.turn() is None
    follow(led, 0, 3, 4)
    vehicle.state = replace(ON_GROUND, ready=False)
    assert vehicle.turn() == MakeReady()
    vehicle.state = ON_GROUND
    vehicle.obey()
    assert vehicle.orders[-1] == TakeOff(120.0)
    # In the air, but not there yet.
    vehicle.state = replace(FLYING, alt_m=40.0, alt_amsl_m=40.0)
    follow(led, 13, 3, 5)
    assert vehicle.turn() is None
    vehicle.obey()
    assert vehicle.orders[-1] == GoTo(*place(3, 5), 120.0, 10.0)
    assert not led.progress.arrived and led.arrived_number == -1
    vehicle.obey()
    assert led.arrived_number == 13 and vehicle.turn() is None


def test_a_search_is_done_once_for_each_step_that_has_one() -> None:
    vehicle = in_the_air()
    for stamp in (13, 26):
        follow(vehicle.dispatcher, stamp, 2, 2, searched=True)
        vehicle.turn()
        assert vehicle.orders[-1] == SearchPlace(*place(2, 2), 120.0, 30.0, 5.0, 10.0)
        assert not vehicle.dispatcher.progress.arrived
        vehicle.obey()
        assert vehicle.orders[-1] == GoTo(*place(2, 2), 120.0, 10.0)
        assert not vehicle.dispatcher.progress.arrived
        vehicle.obey()
        assert vehicle.dispatcher.arrived_number == stamp
    assert len(vehicle.orders) == 4


@pytest.mark.slow
@given(st.lists(st.sampled_from([(1, 0), (-1, 0), (0, 1), (0, -1), (0, 0)]), max_size=12))
def test_every_cell_is_flown_to_in_order_and_none_is_left_before_it_is_reached(
    moves: list[tuple[int, int]],
) -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    col = row = 5
    wanted = []
    for step, (dx, dy) in enumerate([(0, 0), *moves]):
        col, row = min(max(col + dx, 0), 9), min(max(row + dy, 0), 9)
        searched = bool(step) and not dx and not dy
        follow(led, 13 * step, col, row, searched=searched)
        wanted.append((place(col, row), searched))
        while not led.progress.arrived:
            vehicle.turn()
            vehicle.obey()
    flown = [
        ((order.lat_deg, order.lon_deg), isinstance(order, SearchPlace))
        for order, before in zip(vehicle.orders, [None, *vehicle.orders], strict=False)
        # After a search it climbs on the spot.
        if isinstance(order, GoTo | SearchPlace) and not isinstance(before, SearchPlace)
    ]
    without_repeats = [
        (there, searched)
        for (there, searched), before in zip(wanted, [None, *wanted], strict=False)
        if searched or before is None or there != before[0]
    ]
    assert flown == without_repeats


@pytest.mark.parametrize(
    ("at_end", "order"), [("return", Return()), ("land", Land()), ("hold", Hold())]
)
def test_at_the_end_the_last_leg_is_flown_and_then_the_end(at_end: str, order: Order) -> None:
    vehicle = in_the_air(at_end=at_end)
    led = vehicle.dispatcher
    follow(led, 0, 1, 1)
    vehicle.turn()
    follow(led, 13, 1, 1, searched=True, over=True)
    assert isinstance(vehicle.turn(), SearchPlace)
    assert vehicle.turn() is None
    vehicle.obey()
    vehicle.obey()
    assert vehicle.orders[-1] == order
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    assert not led.lost
    vehicle.obey()
    assert led.finished


def test_on_its_way_home_it_goes_there_in_its_layer_first_if_others_fly() -> None:
    vehicle = in_the_air()
    home = GoTo(-23.999, -45.999, 120.0, 10.0)
    vehicle.permissions = Permissions(home=home)
    follow(vehicle.dispatcher, 13, 1, 1, over=True, collided=True)
    assert vehicle.turn() == home
    assert vehicle.turn() is None
    vehicle.obey()
    assert vehicle.orders == [home, Return()]
    # From then on it comes down, whether others are left or not.
    vehicle.permissions = Permissions()
    assert vehicle.turn() is None


@pytest.mark.parametrize("mode", ["RTL", "LAND"])
def test_what_comes_down_already_is_not_sent_home_by_a_bridge_that_is_started_anew(
    mode: str,
) -> None:
    vehicle = in_the_air(dispatcher(record=replace(FLOWN, custody=Custody.ENDING, mode=mode)))
    vehicle.state = replace(FLYING, mode=mode)
    vehicle.permissions = Permissions(home=GoTo(-23.999, -45.999, 120.0, 10.0))
    follow(vehicle.dispatcher, 13, 1, 1, over=True)
    assert [vehicle.turn() for _ in range(3)] == [Return(), None, None]


def test_what_it_does_waits_for_others_and_the_reason_is_shown() -> None:
    vehicle = in_the_air()
    vehicle.permissions = Permissions(admit=lambda order: "waiting for drone1 to be out of the way")
    follow(vehicle.dispatcher, 13, 1, 1, searched=True)
    assert vehicle.turn() is None
    assert vehicle.dispatcher.blocked == "waiting for drone1 to be out of the way"
    level = SearchPlace(*place(1, 1), 120.0, 120.0, 5.0, 10.0)
    vehicle.permissions = Permissions(admit=lambda order: level)
    assert vehicle.turn() == level
    vehicle.permissions = Permissions()
    vehicle.obey()
    vehicle.obey()
    assert vehicle.dispatcher.progress.arrived and not vehicle.dispatcher.blocked


@pytest.mark.parametrize(("autopilot", "stops"), [("ardupilot", True), ("arduplane", False)])
def test_only_who_can_hover_is_stopped_before_another_that_a_person_flies(
    autopilot: str, stops: bool
) -> None:
    vehicle = in_the_air(autopilot=autopilot)
    follow(vehicle.dispatcher, 13, 1, 1)
    assert isinstance(vehicle.turn(), GoTo)
    vehicle.permissions = Permissions(intruder=lambda order: "waiting for drone1")
    assert vehicle.turn() == (Hold() if stops else None)


@pytest.mark.parametrize("over", [False, True], ids=["going on", "over"])
def test_who_is_recalled_waits_for_nobody(over: bool) -> None:
    vehicle = in_the_air()
    follow(vehicle.dispatcher, 13, 1, 1, over=over)
    vehicle.permissions = Permissions(admit=lambda order: "waiting for drone1 to be out of the way")
    vehicle.turn()
    assert isinstance(vehicle.dispatcher.custody.operate("land"), Accepted)
    assert vehicle.turn() == Land()


def test_nobody_is_sent_where_two_drones_have_collided() -> None:
    vehicle = in_the_air()
    follow(vehicle.dispatcher, 13, 1, 1, over=True, collided=True)
    assert vehicle.turn() == Return()


def test_a_step_that_is_reported_again_changes_nothing_but_its_end() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.obey()
    follow(led, 13, 1, 1)
    assert led.progress.arrived and vehicle.turn() is None
    follow(led, 13, 1, 1, over=True)
    assert vehicle.turn() == Return()


def test_a_vehicle_has_looked_before_it_is_back_and_a_restarted_bridge_knows_it() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1, searched=True)
    assert isinstance(vehicle.turn(), SearchPlace)
    assert (led.looked_number, led.arrived_number) == (-1, -1)
    vehicle.obey()
    assert isinstance(led.progress.due, GoTo)
    assert (led.looked_number, led.arrived_number) == (13, -1)
    # The same leg again, as its drone is still under way.
    follow(led, 13, 1, 1, searched=True)
    assert (led.looked_number, led.arrived_number) == (13, -1)
    again = LegProgress()
    again.follow(
        VehicleLeg(13, (1, 1), searched=True),
        Accepted(led.progress.task),
        led.custody.record.looked,
    )
    assert again.looked and not again.arrived
    vehicle.turn()
    vehicle.obey()
    assert (led.looked_number, led.arrived_number) == (13, 13)
    # Another search of the same cell is another leg.
    follow(led, 14, 1, 1, searched=True)
    assert (led.looked_number, led.arrived_number) == (-1, -1)
    assert isinstance(vehicle.turn(), SearchPlace)


def test_a_silent_vehicle_goes_on_when_it_is_connected_again_in_time() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    assert isinstance(vehicle.turn(), GoTo)
    assert vehicle.fall_silent(29.0) is None
    vehicle.speak()
    assert vehicle.turn() is None and not led.lost
    vehicle.obey()
    assert led.arrived_number == 13


def test_a_vehicle_silent_for_too_long_is_lost_returns_when_connected_and_stays_lost() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    assert vehicle.fall_silent(30.0) is None
    assert led.lost == "link lost: no heartbeat for 30 s"
    vehicle.speak()
    assert vehicle.turn() == Return()
    follow(led, 26, 1, 2)
    vehicle.obey()
    assert led.lost and [vehicle.turn() for _ in range(3)] == [None] * 3
    assert led.custody.state is Custody.GROUNDED


@pytest.mark.parametrize("at_end", ["return", "land", "hold"])
def test_who_is_lost_before_take_off_stays_on_the_ground(at_end: str) -> None:
    vehicle = Vehicle(dispatcher(at_end=at_end))
    led = vehicle.dispatcher
    follow(led, 0, 1, 1)
    assert isinstance(vehicle.turn(), TakeOff)
    assert vehicle.fall_silent(30.0) is None
    assert led.lost and led.custody.state is Custody.GROUNDED
    vehicle.speak()
    follow(led, 13, 1, 2, over=True)
    assert [vehicle.turn() for _ in range(3)] == [None] * 3


def fly_mission(led: VehicleDispatcher, *, holds: bool = False) -> FlyMission:
    home = Home(-23.999, -45.999, 0.0)
    track = (st_array([(0, 9), (1, 9)]), st_array([0, 0], bool))
    hold_s = 600.0 if holds else 0.0
    (mission,) = search_missions([FRAME], [track], SETTINGS, [home], [8.0], hold_s, 0.0)
    layer = replace(LAYER, settings=BridgeSettings(autopilot="px4"))
    task = layer.mission_task(mission, holds_over_home=holds)
    led.follow(VehicleLeg(13, (1, 9), over=True), task)
    assert isinstance(task, Accepted)
    (order,) = task.value
    assert isinstance(order, FlyMission)
    return order


def st_array(values: list[Any], kind: type = int) -> Any:
    import numpy as np

    return np.array(values, dtype=kind)


ENDINGS = {
    "cleared": FlightRecord(Custody.CLEARED, SEARCH, arm=True),
    "following": FLOWN,
    "held": replace(FLOWN, custody=Custody.HELD),
    "recalled": replace(FLOWN, custody=Custody.RECALLED, lost="recalled", end="land"),
    "ending": replace(FLOWN, custody=Custody.ENDING),
    "link lost": replace(FLOWN, custody=Custody.ENDING, lost="link lost: no heartbeat for 30 s"),
    "lost before take-off": FlightRecord(Custody.GROUNDED, SEARCH, lost="no heartbeat"),
    "taken over": replace(FLOWN, custody=Custody.TAKEN, lost="taken over: in LOITER"),
    "released": replace(FLOWN, custody=Custody.RELEASED, lost="taken over: in LOITER"),
    "failsafe": replace(FLOWN, custody=Custody.FAILSAFE, lost="battery failsafe"),
    "grounded": replace(FLOWN, custody=Custody.GROUNDED),
}


@pytest.mark.parametrize("over", [False, True], ids=["going on", "over"])
@pytest.mark.parametrize("record", ENDINGS.values(), ids=ENDINGS)
@pytest.mark.parametrize("landed", [True, False], ids=["on the ground", "in the air"])
@pytest.mark.parametrize("arm", ["false", "true", "always"])
def test_a_bridge_started_again_flies_on_only_what_was_its_own(
    over: bool, record: FlightRecord, landed: bool, arm: str
) -> None:
    led = dispatcher(record=inherited(record, fresh=True), arm=arm)
    vehicle = Vehicle(led, ON_GROUND if landed else FLYING)
    follow(led, 13, 1, 1, over=over)
    for _ in range(3):
        vehicle.turn()
        vehicle.obey()
    kinds = {type(order) for order in vehicle.orders}
    custody, lost = record.custody, bool(record.lost)
    if landed:
        # Once in a search, whatever the parameter says.
        may_fly = custody is Custody.CLEARED
        assert (TakeOff in kinds) == (may_fly and not over and not lost)
        assert not kinds - {MakeReady, TakeOff, GoTo}
    elif custody in (Custody.TAKEN, Custody.FAILSAFE, Custody.GROUNDED, Custody.RELEASED):
        assert kinds == set()
    elif custody is Custody.CLEARED:
        # Somebody else has flown it up.
        assert kinds == set()
        assert led.custody.state is Custody.FREE
    elif custody is Custody.HELD:
        assert kinds == {Hold}
    elif custody is Custody.RECALLED:
        assert kinds == {Land}
    elif custody is Custody.ENDING or over:
        assert kinds == ({GoTo} if arm == "always" and not (over or lost) else {Return})
    else:
        assert kinds == {GoTo}


@pytest.mark.parametrize("record", ENDINGS.values(), ids=ENDINGS)
@pytest.mark.parametrize("landed", [True, False], ids=["on the ground", "in the air"])
@pytest.mark.parametrize("same_program", [True, False])
def test_without_a_persons_word_nothing_takes_off_for_a_second_search(
    record: FlightRecord, landed: bool, same_program: bool
) -> None:
    led = VehicleDispatcher(
        BridgeSettings(arm="true"), record if same_program else inherited(record, fresh=True)
    )
    if same_program:
        led.begin(SEARCH, LAYER, first=True)
        led.advance(VehicleState(), Outcome(), 0.0)
    led.begin(NEXT_SEARCH, LAYER, first=not same_program)
    vehicle = Vehicle(led, ON_GROUND if landed else FLYING)
    follow(led, 13, 1, 1)
    for _ in range(4):
        vehicle.turn()
        vehicle.obey()
    kinds = {type(order) for order in vehicle.orders}
    # One that was cleared for the first search and has not flown is free again.
    fresh = record.custody is Custody.CLEARED and not same_program
    if landed:
        assert (TakeOff in kinds) == fresh
        assert fresh or led.blocked.endswith("~/arm clears it to fly")
        # A person has all the time in the world.
        vehicle.now_s += 1000.0
        vehicle.turn()
        assert not led.lost
    else:
        assert not kinds & {TakeOff, MakeReady, GoTo}


def test_a_person_clears_what_has_landed_for_one_search() -> None:
    led = dispatcher(record=replace(FLOWN, custody=Custody.GROUNDED), search=NEXT_SEARCH)
    vehicle = Vehicle(led, replace(ON_GROUND, mode="RTL"))
    follow(led, 13, 1, 1)
    assert vehicle.turn() is None
    assert isinstance(led.custody.clear(vehicle.now_s), Accepted)
    # In whatever mode it stands there: the person has seen that.
    assert vehicle.turn() == TakeOff(120.0, arm=True, from_modes=("RTL",))
    vehicle.obey()
    follow(led, 26, 1, 1, over=True)
    vehicle.turn()
    vehicle.obey()
    vehicle.obey()
    assert led.custody.state is Custody.GROUNDED and not led.lost
    led.begin((7, 3), LAYER)
    follow(led, 39, 1, 1)
    assert [vehicle.turn() for _ in range(3)] == [None] * 3


def test_a_clearance_after_the_search_is_for_the_next_one() -> None:
    led = dispatcher(record=replace(FLOWN, custody=Custody.GROUNDED))
    vehicle = Vehicle(led)
    follow(led, 13, 1, 1, over=True)
    vehicle.turn()
    assert isinstance(led.custody.clear(vehicle.now_s), Accepted)
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    led.begin(NEXT_SEARCH, LAYER)
    follow(led, 13, 1, 1)
    vehicle.take_off()


def test_what_somebody_else_arms_while_it_waits_is_theirs() -> None:
    led = dispatcher()
    vehicle = Vehicle(led)
    follow(led, 0, 1, 1)
    vehicle.permissions = Permissions(take_off="waiting for drone1: not ready")
    assert isinstance(vehicle.turn(), MakeReady)
    vehicle.turn(status="done")
    vehicle.state = replace(ON_GROUND, armed=True)
    assert vehicle.turn() is None
    assert led.lost == "taken over: armed by somebody else, in GUIDED"
    vehicle.state = FLYING
    vehicle.permissions = Permissions()
    assert [vehicle.turn() for _ in range(3)] == [None] * 3


def test_what_a_pilot_has_taken_over_gets_no_order_any_more() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.turn(status="taken_over", reason="in LOITER")
    assert led.lost == "taken over: in LOITER"
    vehicle.state = replace(FLYING, mode="LOITER")
    vehicle.turn()
    follow(led, 26, 1, 2, over=True)
    # Given back in the air nobody moves it before it is cleared.
    vehicle.state = FLYING
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    assert led.custody.state is Custody.RELEASED
    led.begin(NEXT_SEARCH, LAYER)
    follow(led, 39, 4, 4)
    assert vehicle.turn() is None and not led.lost
    assert led.blocked == "nobody controls it, in GUIDED: drone<i>/arm clears it to fly"
    assert isinstance(led.custody.clear(vehicle.now_s, alone=True), Accepted)
    assert isinstance(vehicle.turn(), GoTo)


def test_a_mode_that_is_set_at_disarming_releases_nothing() -> None:
    vehicle = in_the_air(autopilot="px4")
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.turn(status="taken_over", reason="in LAND")
    vehicle.state = replace(FLYING, mode="LAND")
    vehicle.turn()
    # PX4 restores the mode of before the landing.
    for mode in ("OFFBOARD", "HOLD"):
        vehicle.state = replace(ON_GROUND, mode=mode)
        vehicle.turn()
    assert led.custody.state is Custody.TAKEN
    led.begin(NEXT_SEARCH, LAYER)
    follow(led, 39, 4, 4)
    assert [vehicle.turn() for _ in range(3)] == [None] * 3


@pytest.mark.parametrize(
    "failsafe",
    [Failsafe.BATTERY, Failsafe.GPS, Failsafe.EKF, Failsafe.FENCE, Failsafe.MOTORS],
)
def test_a_failsafe_that_leaves_the_mode_takes_the_vehicle_out_and_home(failsafe: Failsafe) -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.state = replace(FLYING, failsafe=failsafe)
    assert vehicle.turn() == Return()
    assert led.lost == f"{failsafe.value} failsafe"


def test_a_bridge_started_again_leaves_what_a_named_failsafe_of_px4_has() -> None:
    led = dispatcher(autopilot="px4", record=replace(FLOWN, mode="HOLD"), search=NEXT_SEARCH)
    vehicle = Vehicle(led, replace(FLYING, mode="HOLD", failsafe=Failsafe.BATTERY))
    assert vehicle.turn() is None
    assert led.custody.state is Custody.FAILSAFE
    assert led.custody.operate("land") == Accepted("ordered to land")
    assert vehicle.turn() == Land("HOLD")


@pytest.mark.parametrize("failsafe", [Failsafe.RADIO, Failsafe.GCS, Failsafe.OFFBOARD])
def test_after_which_failsafes_an_autopilot_goes_on(failsafe: Failsafe) -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.state = replace(FLYING, failsafe=failsafe)
    assert vehicle.turn() is None and not led.lost


def test_a_failsafe_that_has_the_vehicle_is_left_alone_and_named_even_late() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.state = replace(FLYING, mode="HOLD", failsafe=Failsafe.CRITICAL)
    vehicle.turn(status="failsafe", reason="in HOLD, critical failsafe")
    assert led.lost == "critical failsafe"
    vehicle.state = replace(vehicle.state, failsafe=Failsafe.BATTERY)
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    assert led.lost == "battery failsafe"


def test_who_is_critical_without_a_reason_may_be_well_again_in_time() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    for failsafe in (Failsafe.CRITICAL, Failsafe.OFFBOARD, None, Failsafe.CRITICAL):
        vehicle.state = replace(FLYING, failsafe=failsafe)
        vehicle.now_s += FAILSAFE_S - 0.5
        assert vehicle.turn() is None and not led.lost
    vehicle.now_s += FAILSAFE_S
    assert vehicle.turn() == Return()
    assert led.lost == "critical failsafe"


OPERATIONS = {"hold": Hold(), "return": Return(), "land": Land()}


@pytest.mark.parametrize("what", OPERATIONS)
def test_an_operator_is_obeyed_whatever_the_search_does_until_a_clearance(what: str) -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    assert isinstance(led.custody.operate(what), Accepted)
    assert vehicle.turn() == OPERATIONS[what]
    assert bool(led.lost) == (what != "hold")
    for stamp, over in ((26, False), (39, True)):
        follow(led, stamp, 1, 2, over=over)
        assert vehicle.turn() is None
    led.begin(NEXT_SEARCH, LAYER)
    follow(led, 0, 3, 3)
    assert vehicle.turn() in (None, OPERATIONS[what])
    if what == "hold":
        assert isinstance(led.custody.clear(vehicle.now_s), Accepted)
        assert vehicle.turn() == GoTo(*place(3, 3), 120.0, 10.0)
        return
    vehicle.obey()
    assert led.custody.state is Custody.TAKEN
    assert [vehicle.turn() for _ in range(3)] == [None] * 3


def test_on_the_ground_an_operator_keeps_it_there_also_with_arm_always() -> None:
    for act in (lambda one: one.ground(), lambda one: one.operate("hold")):
        led = dispatcher(arm="always")
        vehicle = Vehicle(led)
        follow(led, 0, 1, 1)
        assert isinstance(vehicle.turn(), TakeOff)
        assert act(led.custody) == Accepted("kept on the ground")
        assert led.lost == "kept on the ground by the operator"
        led.begin(NEXT_SEARCH, LAYER)
        follow(led, 0, 1, 1)
        assert [vehicle.turn() for _ in range(3)] == [None] * 3
        assert isinstance(led.custody.clear(vehicle.now_s), Accepted)
        led.begin((7, 3), LAYER)
        follow(led, 0, 1, 1)
        vehicle.take_off()


@pytest.mark.parametrize("custody", [Custody.TAKEN, Custody.FAILSAFE, Custody.RELEASED])
@pytest.mark.parametrize("what", OPERATIONS)
@pytest.mark.parametrize("launched", [False, True])
def test_an_operator_stops_every_vehicle_in_the_air_whoever_controls_or_launched_it(
    custody: Custody, what: str, launched: bool
) -> None:
    record = replace(FLOWN, custody=custody, lost="taken over: in LOITER", launched=launched)
    vehicle = in_the_air(dispatcher(record=record))
    mode = "GUIDED" if custody is Custody.RELEASED else "LOITER"
    vehicle.state = replace(FLYING, mode=mode)
    follow(vehicle.dispatcher, 13, 1, 1)
    vehicle.turn()
    authority = vehicle.dispatcher.custody.authority
    result = vehicle.dispatcher.custody.operate(what)
    assert result == Accepted(f"ordered to {what}")
    assert vehicle.turn() == {"land": Land, "return": Return, "hold": Hold}[what](mode)
    # The order goes back to another consent than the one that was lost.
    assert vehicle.dispatcher.custody.authority == authority + 1
    vehicle.obey()
    assert vehicle.dispatcher.custody.state is (Custody.HELD if what == "hold" else Custody.TAKEN)


@pytest.mark.parametrize("state", [ON_GROUND, FLYING], ids=["on the ground", "in the air"])
def test_of_the_steps_that_come_late_in_one_go_the_last_one_counts(state: VehicleState) -> None:
    led = dispatcher(record=FLOWN if state.flying else None)
    vehicle = Vehicle(led, state)
    for step in range(5):
        follow(led, 13 * step, step, 1, over=step == 4)
    vehicle.turn()
    vehicle.obey()
    assert [type(order) for order in vehicle.orders][:1] == ([GoTo] if state.flying else [])


def test_a_mission_that_was_begun_is_not_begun_again_by_a_bridge_started_anew() -> None:
    for state, custody in ((ON_GROUND, Custody.FOLLOWING), (FLYING, Custody.FOLLOWING),
                           (ON_GROUND, Custody.GROUNDED)):  # fmt: skip
        led = dispatcher(mode="mission", record=replace(FLOWN, custody=custody), arm="always")
        vehicle = Vehicle(led, state)
        fly_mission(led)
        assert [vehicle.turn() for _ in range(3)] == [None] * 3
        assert led.finished == (not state.flying) and not led.lost
    led = dispatcher(mode="mission")
    vehicle = Vehicle(led)
    fly_mission(led)
    assert isinstance(vehicle.turn(), FlyMission) and not led.finished


def ready_for_mission(led: VehicleDispatcher) -> Vehicle:
    vehicle = Vehicle(led)
    assert isinstance(vehicle.turn(), FlyMission)
    return vehicle


def test_a_mission_that_fails_in_the_air_is_not_begun_again() -> None:
    led = dispatcher(mode="mission")
    fly_mission(led)
    vehicle = ready_for_mission(led)
    vehicle.state = FLYING
    vehicle.turn()
    assert vehicle.turn(status="failed", reason="no progress for 60 s") == Return()
    assert led.lost == "failed: no progress for 60 s"


def test_who_came_down_by_itself_does_not_take_off_again() -> None:
    led = dispatcher()
    vehicle = Vehicle(led)
    follow(led, 0, 1, 1)
    vehicle.take_off()
    assert isinstance(vehicle.orders[-1], GoTo)
    vehicle.state = ON_GROUND
    vehicle.turn(status="failed", reason="the vehicle is not in the air")
    assert led.lost == "on the ground again before the end of the search"
    assert [vehicle.turn() for _ in range(3)] == [None] * 3


def test_nothing_takes_off_for_a_search_that_is_gone() -> None:
    led = dispatcher()
    vehicle = Vehicle(led)
    follow(led, 0, 1, 1)
    vehicle.permissions = Permissions(search_alive=False)
    assert isinstance(vehicle.turn(), MakeReady)
    assert vehicle.turn(status="done") is None
    vehicle.permissions = Permissions()
    assert vehicle.turn() == TakeOff(120.0)
    vehicle.permissions = Permissions(search_alive=False)
    # The take-off that has not begun is called off.
    assert vehicle.turn(reason="arming") == MakeReady()


EVENTS = [
    "step", "over", "obey", "fail", "silent", "land", "pilot", "failsafe", "restart", "reset",
    "clear", "withdraw", "hold", "return", "guided",
]  # fmt: skip


@pytest.mark.slow
@given(st.lists(st.sampled_from(EVENTS), max_size=25), st.sampled_from(["false", "true"]))
def test_a_vehicle_takes_off_once_for_each_clearance_whatever_happens(
    events: list[str], arm: str
) -> None:
    led = dispatcher(arm=arm)
    vehicle = Vehicle(led)
    stamp, over, mission, consents, take_offs = 0, False, 1, 1, 0
    for event in events:
        before = len(vehicle.orders)
        if event in ("step", "over"):
            stamp, over = stamp + 13, over or event == "over"
            follow(led, stamp, stamp % 10, 5, over=over)
        elif event == "obey" and vehicle.outcome.order is not None:
            if vehicle.outcome.status == "under_way":
                vehicle.obey()
        elif event == "fail":
            vehicle.now_s += RETRY_S
            vehicle.turn(status="failed", reason="no progress")
        elif event == "silent":
            vehicle.fall_silent(31.0)
            vehicle.speak()
        elif event == "land":
            vehicle.state = ON_GROUND
        elif event in ("pilot", "failsafe") and vehicle.outcome.order is not None:
            status = "taken_over" if event == "pilot" else "failsafe"
            vehicle.state = replace(vehicle.state, mode="LOITER")
            vehicle.turn(status=status, reason="in LOITER")
        elif event == "guided":
            vehicle.state = replace(vehicle.state, mode="GUIDED")
        elif event == "restart":
            record, leg = led.custody.record, led.progress.leg
            settings = BridgeSettings(arm="false")
            led = vehicle.dispatcher = VehicleDispatcher(settings, inherited(record, fresh=True))
            led.begin((7, mission), LAYER, first=True)
            consents += 1
            vehicle.outcome = Outcome()
            if leg is not None:
                led.follow(leg, LAYER.leg_task(leg))
        elif event == "reset":
            mission, over = mission + 1, False
            led.begin((7, mission), LAYER)
        elif event == "clear":
            led.custody.clear(vehicle.now_s)
            consents += 1
        elif event == "withdraw":
            led.custody.ground()
        elif event in ("hold", "return"):
            led.custody.operate(event)
        vehicle.turn()
        for order in vehicle.orders[before:]:
            if isinstance(order, TakeOff) and not vehicle.state.flying:
                assert not (over or led.lost)
        lifted = [o for o in vehicle.orders[before:] if isinstance(o, TakeOff)]
        # The same take-off may be called off, retried and given again.
        take_offs += bool(lifted) and vehicle.state.flying
    assert take_offs <= consents


def test_a_take_off_that_has_not_begun_is_called_off_once_it_is_not_wanted() -> None:
    def waiting() -> Vehicle:
        vehicle = Vehicle(dispatcher())
        follow(vehicle.dispatcher, 0, 1, 1)
        assert vehicle.turn() == TakeOff(120.0)
        return vehicle

    collided = waiting()
    follow(collided.dispatcher, 13, 1, 1, over=True, collided=True)
    assert collided.turn() is None
    assert collided.dispatcher.custody.state is Custody.FREE
    refused = waiting()
    follow(refused.dispatcher, 13, 19, 5)
    assert refused.dispatcher.refused and refused.turn() == MakeReady()
    moved = waiting()
    moved.state = replace(ON_GROUND, lat_deg=-35.0)
    assert moved.turn() == MakeReady() and moved.dispatcher.refused
    moved.turn(status="done")
    moved.state = ON_GROUND
    assert moved.turn() == TakeOff(120.0)


def test_a_leg_with_the_same_stamp_but_another_cell_is_of_another_search() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 0, 1, 1)
    vehicle.turn()
    vehicle.obey()
    follow(led, 0, 3, 3)
    assert not led.progress.arrived
    assert vehicle.turn() == GoTo(*place(3, 3), 120.0, 10.0)


def test_an_order_that_fails_is_given_again_and_then_the_vehicle_is_lost() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
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
    led = dispatcher(join_timeout=3.0)
    vehicle = Vehicle(led, VehicleState())
    follow(led, 0, 0, 0)
    vehicle.turn()
    assert not led.lost
    vehicle.now_s += 3.1
    assert vehicle.turn() is None
    assert led.lost == "no heartbeat within 3 s"


def test_another_kind_of_vehicle_is_lost_at_once_and_gets_no_order() -> None:
    led = dispatcher()
    problem = "HEARTBEAT.type must be a multicopter, got FIXED_WING"
    vehicle = Vehicle(led, replace(ON_GROUND, problem=problem))
    follow(led, 0, 1, 1)
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    assert problem in (led.lost, led.blocked)
    assert led.custody.clear(vehicle.now_s) == Rejected("unfit", problem)
    airborne = in_the_air()
    airborne.state = replace(FLYING, problem=problem)
    follow(airborne.dispatcher, 0, 1, 1)
    airborne.turn()
    assert airborne.dispatcher.lost == problem


def test_what_is_wrong_with_the_link_is_reported_of_who_is_lost() -> None:
    led = dispatcher(join_timeout=3.0)
    follow(led, 0, 0, 0)
    for now_s in (0.0, 3.1):
        led.advance(VehicleState(), Outcome(), now_s, "/dev/nope: No such file or directory")
    assert led.lost == "no heartbeat within 3 s: /dev/nope: No such file or directory"


@pytest.mark.parametrize(
    ("state", "lost"),
    [
        (
            VehicleState(identity=Identity(""), connected=True, ready=True, mode="GUIDED"),
            "no position within 3 s: unsigned",
        ),
        (replace(ON_GROUND, ready=False), "not ready within 3 s: PreArm: Compass not healthy"),
        (
            replace(ON_GROUND, lat_deg=-35.0),
            "no take-off within 3 s: place must be within 500 m of the search area, got "
            "(-35.0000000, -45.9990000)",
        ),
    ],
)
def test_who_cannot_take_off_is_lost_after_the_join_timeout_once_with_the_reason(
    state: VehicleState, lost: str
) -> None:
    led = dispatcher(join_timeout=3.0)
    follow(led, 0, 0, 0)
    outcome = Outcome()
    trouble = "unsigned" if not state.has_position else None
    for turn in range(40):
        order = led.advance(state, outcome, 0.1 * turn, trouble)
        if order is not None:
            reason = "PreArm: Compass not healthy"
            outcome = Outcome(order, outcome.number + 1, "under_way", reason)
        if turn in (2, 29):
            assert led.blocked and not led.lost
    assert led.lost == lost and led.finished


def test_somebody_who_may_arm_later_has_all_the_time_in_the_world() -> None:
    led = dispatcher(join_timeout=3.0, arm="false")
    vehicle = Vehicle(led)
    follow(led, 0, 0, 0)
    assert vehicle.turn() == TakeOff(120.0, arm=False)
    vehicle.now_s += 1000.0
    vehicle.turn(reason="waiting for somebody to arm it")
    assert not led.lost and not led.blocked
    vehicle.obey()
    assert isinstance(vehicle.orders[-1], GoTo)


def test_a_held_vehicle_goes_on_with_the_next_step() -> None:
    vehicle = in_the_air()
    led = vehicle.dispatcher
    follow(led, 13, 1, 1)
    vehicle.turn()
    vehicle.obey()
    led.progress.holding = True
    assert vehicle.turn() == Hold()
    assert led.waiting and led.progress.arrived
    follow(led, 26, 1, 2)
    assert isinstance(vehicle.turn(), GoTo)


@pytest.mark.parametrize(
    ("cell", "changes", "code"),
    [((15, 5), {}, "outside_fence"), ((5, 5), {"altitude": 200.0}, "altitude")],
)
def test_a_leg_out_of_the_fence_is_refused_and_the_vehicle_holds(
    cell: tuple[int, int], changes: dict[str, float], code: str
) -> None:
    fence = replace(LAYER.fence, frame=replace(FRAME, alt_m=changes.get("altitude", 120.0)))
    leg = VehicleLeg(13, cell)
    task = replace(LAYER, fence=fence).leg_task(leg)
    assert isinstance(task, Rejected) and task.code == code
    vehicle = in_the_air()
    led = vehicle.dispatcher
    led.follow(leg, task)
    assert vehicle.turn() == Hold()
    assert led.refused == task.reason and not led.lost and not led.progress.arrived
    follow(led, 26, 5, 5)
    assert isinstance(vehicle.turn(), GoTo) and not led.refused


def test_a_search_below_the_fence_is_refused() -> None:
    layer = replace(LAYER, settings=replace(SETTINGS, search_altitude=5.0))
    task = layer.leg_task(VehicleLeg(13, (5, 5), searched=True))
    assert isinstance(task, Rejected) and task.code == "altitude"
    assert isinstance(layer.leg_task(VehicleLeg(13, (5, 5))), Accepted)


def test_nothing_takes_off_that_stands_elsewhere_or_does_not_know_where() -> None:
    led = dispatcher()
    vehicle = Vehicle(led, replace(ON_GROUND, lat_deg=-35.0, lon_deg=149.0))
    follow(led, 0, 0, 0)
    for _ in range(3):
        vehicle.turn(status="done")
    assert led.refused.startswith("take-off: ") and not led.lost
    vehicle.state = VehicleState(identity=Identity(""), connected=True, ready=True, mode="GUIDED")
    assert vehicle.turn() is None
    assert TakeOff(120.0) not in vehicle.orders
    vehicle.state = ON_GROUND
    assert vehicle.turn() == TakeOff(120.0)
    assert not led.refused


def test_a_mission_is_flown_as_a_whole_with_its_own_end() -> None:
    led = dispatcher(mode="mission")
    mission = fly_mission(led)
    vehicle = ready_for_mission(led)
    assert vehicle.orders[-1] == mission
    vehicle.state = FLYING
    assert vehicle.turn() is None
    vehicle.obey()
    assert led.arrived_number == 13 and vehicle.turn() is None
    assert led.finished and not led.lost


def test_a_mission_that_holds_over_home_is_landed_from_there_when_the_others_allow() -> None:
    led = dispatcher(mode="mission")
    mission = fly_mission(led, holds=True)
    vehicle = ready_for_mission(led)
    vehicle.state = replace(FLYING, mode="AUTO", item_current=mission.hold_item, lat_deg=-23.99)
    # On its way there.
    assert vehicle.turn() is None and not led.progress.arrived
    vehicle.permissions = Permissions(admit=lambda order: "waiting for drone1 to be out of the way")
    vehicle.state = replace(vehicle.state, lat_deg=-23.999)
    assert vehicle.turn() is None and led.progress.arrived
    vehicle.permissions = Permissions()
    assert vehicle.turn() == Return()
    vehicle.obey()
    assert led.finished and not led.lost and led.custody.state is Custody.GROUNDED


def test_a_vehicle_that_a_person_flies_home_from_its_mission_is_not_landed_by_a_new_bridge() -> (
    None
):
    led = dispatcher(mode="mission", record=replace(FLOWN, mode="AUTO"))
    mission = fly_mission(led, holds=True)
    vehicle = Vehicle(
        led, replace(FLYING, mode="AUTO", item_current=mission.hold_item, lat_deg=-23.99)
    )
    assert vehicle.turn() is None
    # The current item does not change any more.
    vehicle.state = replace(vehicle.state, mode="GUIDED", lat_deg=-23.999)
    assert vehicle.turn() is None
    vehicle.state = replace(vehicle.state, heard_s=10.0)
    assert [vehicle.turn() for _ in range(3)] == [None] * 3
    assert led.custody.state is Custody.TAKEN and led.lost == "taken over: in GUIDED"


def test_a_mission_whose_vehicle_is_down_but_armed_is_let_end_by_itself() -> None:
    led = dispatcher(mode="mission")
    fly_mission(led)
    vehicle = ready_for_mission(led)
    vehicle.state = FLYING
    vehicle.turn()
    vehicle.state = replace(ON_GROUND, armed=True)
    assert vehicle.turn() is None and not led.finished
    vehicle.state = ON_GROUND
    vehicle.turn(status="done")
    assert led.progress.arrived and led.finished and len(vehicle.orders) == 1


def test_a_mission_that_cannot_be_made_without_home_is_given_up_in_the_end() -> None:
    led = dispatcher(mode="mission", join_timeout=3.0)
    vehicle = Vehicle(led)
    leg = VehicleLeg(13, (1, 9), over=True)
    led.follow(leg, None)
    vehicle.turn()
    assert led.blocked == "no home position" and not led.progress.has_task
    fly_mission(led)
    assert isinstance(vehicle.turn(status="done"), FlyMission) and not led.blocked
    other = dispatcher(mode="mission", join_timeout=3.0)
    other.follow(leg, None)
    for now_s in (0.0, 3.1):
        other.advance(ON_GROUND, Outcome(), now_s)
    assert other.lost == "no home position within 3 s"


def test_an_order_that_would_fail_again_is_given_once() -> None:
    led = dispatcher()
    vehicle = Vehicle(led)
    follow(led, 0, 3, 4)
    assert vehicle.turn() == TakeOff(120.0)
    vehicle.turn(status="failed", reason="taking off: UNSUPPORTED", final=True)
    assert led.lost == "failed: taking off: UNSUPPORTED"
    assert vehicle.orders.count(TakeOff(120.0)) == 1


@pytest.mark.parametrize("where", [{}, {"lat_deg": math.nan, "lon_deg": math.nan}])
def test_what_a_vehicle_reports_of_its_checks_is_why_it_cannot_take_off(where: Any) -> None:
    led = dispatcher()
    complaints = (("PreArm: GPS 1: Bad fix", 0.0),)
    vehicle = Vehicle(led, replace(ON_GROUND, ready=False, _complaints=complaints, **where))
    follow(led, 0, 3, 4)
    vehicle.turn()
    vehicle.turn(reason=None)
    assert led.blocked.startswith("no position" if where else "not ready")
    if where:
        assert led.blocked == "no position: PreArm: GPS 1: Bad fix"
