# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Orders are carried out, and done only when the vehicle has done what they ask for."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from autopilot.commands import ACCEPTED
from autopilot.faults import Fault
from autopilot.local_frame import Place, Point
from autopilot.main import make_vehicle
from autopilot.px4 import Px4
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from virtual_flight import OURSELVES, VEHICLE, VirtualFlight, mission

from dsse_ros.vehicles.autopilots import Failsafe
from dsse_ros.vehicles.control.commands import ControllerSettings
from dsse_ros.vehicles.control.orders import (
    FlyMission,
    GoTo,
    Hold,
    Land,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.vehicles.control.transfer import Timeouts
from dsse_ros.vehicles.control.vehicle_controller import VehicleController
from dsse_ros.vehicles.mavlink.messages import (
    Address,
    CommandAck,
    CommandLong,
    GlobalPosition,
    Heartbeat,
    ParamRequestRead,
    PositionTarget,
    SetPositionTarget,
    StatusText,
)
from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, MissionItem

AUTOPILOTS = ("ardupilot", "px4")
ARM, TAKEOFF, SET_MODE, CHANGE_SPEED, START, INTERVAL = 400, 22, 176, 178, 300, 511
# To find a shorter one that fails takes too many flights.
AS_DRAWN = (Phase.explicit, Phase.reuse, Phase.generate)
both = pytest.mark.parametrize("autopilot", AUTOPILOTS)


def flying(autopilot: str = "ardupilot", up_m: float = 20.0, **options: Any) -> VirtualFlight:
    flight = VirtualFlight(autopilot, **options)
    assert flight.fly(TakeOff(up_m)).status == "done"
    return flight


def go_to(flight: VirtualFlight, north_m: float, east_m: float, up_m: float = 20.0) -> GoTo:
    return GoTo(*flight.place(north_m, east_m), up_m, radius_m=3.0)


# Each order


@both
def test_take_off_is_done_when_it_is_up_there(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    outcome = flight.fly(TakeOff(30.0))
    assert (outcome.status, outcome.number) == ("done", 1)
    assert abs(flight.vehicle.craft.up_m - 30.0) < 4.0
    assert flight.state.flying and flight.state.armed


@both
def test_take_off_of_what_flies_climbs_on_the_spot(autopilot: str) -> None:
    flight = flying(autopilot)
    assert flight.fly(TakeOff(40.0)).status == "done"
    assert len(flight.commands(TAKEOFF)) == 1
    assert abs(flight.vehicle.craft.up_m - 40.0) < 4.0
    assert flight.off_m(0.0, 0.0) < 1.0


@both
def test_a_place_is_reached_when_the_vehicle_is_there(autopilot: str) -> None:
    flight = flying(autopilot)
    assert flight.fly(go_to(flight, 40.0, -60.0, 35.0)).status == "done"
    assert flight.off_m(40.0, -60.0) < 4.0
    assert abs(flight.vehicle.craft.up_m - 35.0) < 4.0


@both
def test_a_search_descends_over_its_place_and_holds_there(autopilot: str) -> None:
    flight = flying(autopilot, up_m=40.0)
    flight.give(SearchPlace(*flight.place(30.0, 0.0), 40.0, 12.0, hold_s=8.0, radius_m=3.0))
    heights = []
    while flight.outcome.status == "under_way":
        flight.step()
        heights.append((flight.now, flight.vehicle.craft.up_m, flight.off_m(30.0, 0.0)))
    assert flight.outcome.status == "done"
    low = [now for now, up_m, _ in heights if up_m < 13.1]
    assert 8.0 <= low[-1] - low[0] < 16.0
    assert all(off_m < 4.0 for _, up_m, off_m in heights if up_m < 35.0)
    assert abs(heights[-1][1] - 12.0) < 1.1


@both
def test_a_search_that_is_begun_again_over_its_place_goes_on_from_there(autopilot: str) -> None:
    flight = flying(autopilot, up_m=40.0)
    search = SearchPlace(*flight.place(30.0, 0.0), 40.0, 12.0, hold_s=8.0, radius_m=3.0)
    flight.give(search)
    flight.until(lambda: flight.vehicle.craft.up_m < 20.0)
    flight.give(search)
    highest_m = 0.0
    while flight.outcome.status == "under_way":
        flight.step()
        highest_m = max(highest_m, flight.vehicle.craft.up_m)
    assert flight.outcome.status == "done"
    assert highest_m < 21.0


HILL = {"home": Place(-24.0, -46.3, 300.0)}


@both
def test_altitudes_of_orders_are_above_the_sea_wherever_home_is(autopilot: str) -> None:
    flight = VirtualFlight(autopilot, vehicle=HILL)
    assert flight.fly(TakeOff(340.0)).status == "done"
    assert flight.vehicle.craft.up_m == pytest.approx(40.0, abs=3.5)
    assert flight.fly(GoTo(*flight.place(40.0, 0.0), 320.0, 3.0)).status == "done"
    flight.wait(5.0)
    assert flight.vehicle.craft.up_m == pytest.approx(20.0, abs=0.5)


@both
@pytest.mark.parametrize("up_m", [None, 25.0], ids=["here", "elsewhere"])
def test_a_home_that_is_moved_in_flight_moves_no_target(autopilot: str, up_m: float | None) -> None:
    flight = flying(autopilot, up_m=40.0)
    flight.fly(go_to(flight, 40.0, 0.0, 40.0))
    vehicle = flight.vehicle
    vehicle.home = vehicle.craft.point if up_m is None else Point(5.0, 5.0, up_m)
    vehicle.broadcast_home()
    flight.wait(5.0)
    assert flight.fly(go_to(flight, 60.0, 0.0, 40.0)).status == "done"
    flight.wait(5.0)
    assert vehicle.craft.up_m == pytest.approx(40.0, abs=0.5)


@both
def test_a_hold_in_flight_stops_where_it_is(autopilot: str) -> None:
    flight = flying(autopilot)
    flight.give(go_to(flight, 500.0, 0.0))
    flight.until(lambda: flight.vehicle.craft.north_m > 150.0)
    assert flight.fly(Hold()).status == "done"
    assert flight.vehicle.craft.ground_speed_mps < 1.5
    at_m = flight.vehicle.craft.north_m
    flight.wait(20.0)
    assert abs(flight.vehicle.craft.north_m - at_m) < 6.0
    assert at_m < 250.0


@both
def test_a_hold_on_the_ground_sends_nothing(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    assert flight.fly(Hold()).status == "done"
    assert {m.command for _, m in flight.sent if isinstance(m, CommandLong)} <= {INTERVAL, 512}


@pytest.mark.slow
@both
@pytest.mark.parametrize("order", [Return(), Land()])
def test_a_return_and_a_landing_are_done_when_the_motors_stand(autopilot: str, order: Any) -> None:
    flight = flying(autopilot)
    flight.fly(go_to(flight, 30.0, 0.0))
    assert flight.fly(order).status == "done"
    assert flight.vehicle.landed and not flight.vehicle.armed
    assert flight.off_m(*((0.0, 0.0) if order == Return() else (30.0, 0.0))) < 4.0
    assert flight.fly(TakeOff(15.0, from_modes=("RTL", "LAND", "AUTO"))).status == "done"


@both
def test_a_mission_is_read_back_and_flown_to_its_last_item(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    items = mission(flight, (40.0, 0.0, 20.0), (40.0, 40.0, 30.0), hold_s=3.0)
    flight.give(FlyMission(items))
    near = {0: 99.0, 1: 99.0}
    while flight.outcome.status == "under_way":
        flight.step()
        for index, place in enumerate(((40.0, 0.0), (40.0, 40.0))):
            near[index] = min(near[index], flight.off_m(*place))
    assert flight.outcome.status == "done"
    assert all(off_m < 3.0 for off_m in near.values())
    assert flight.vehicle.landed and not flight.vehicle.armed
    assert flight.state.item_reached == len(items) - 1


@both
def test_a_mission_in_the_air_replaces_the_one_that_is_flown(autopilot: str) -> None:
    flight = flying(autopilot)
    flight.give(FlyMission(mission(flight, (300.0, 0.0, 20.0))))
    flight.until(lambda: flight.vehicle.craft.north_m > 50.0)
    assert flight.fly(FlyMission(mission(flight, (0.0, 60.0, 20.0)))).status == "done"
    assert flight.vehicle.landed
    assert flight.off_m(0.0, 0.0) < 4.0


@pytest.mark.slow
@both
def test_a_mission_flown_before_starts_at_its_first_item_again(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    items = mission(flight, (40.0, 0.0, 20.0))
    for _ in range(2):
        flight.give(FlyMission(items, from_modes=("RTL", "LAND", "AUTO")))
        near_m = 99.0
        while flight.outcome.status == "under_way":
            flight.step()
            near_m = min(near_m, flight.off_m(40.0, 0.0))
        assert flight.outcome.status == "done"
        assert near_m < 3.0


# What counts as done, and what does not


@both
def test_an_acknowledgement_alone_proves_nothing(autopilot: str) -> None:
    controller = VehicleController(
        VEHICLE, OURSELVES, ControllerSettings(autopilot=autopilot, command_tries=3)
    )
    kind, mode = (12, 4 << 16 | 3 << 24) if autopilot == "px4" else (3, 4)
    sent = controller.give(TakeOff(10.0), 0.0)
    for tick in range(600):
        now = tick * 0.1
        if tick % 10 == 0:
            sent += controller.receive(Heartbeat(2, kind, 1, mode, 3, 3), now)
        for message in sent:
            if isinstance(message, CommandLong):
                controller.receive(CommandAck(message.command, ACCEPTED), now)
        sent = controller.tick(now)
        assert controller.outcome.status == "under_way"


@both
def test_lost_acknowledgements_do_no_harm(autopilot: str) -> None:
    flight = flying(autopilot, vehicle={"faults": (Fault("acks", 0.0),)}, speed_mps=5.0)
    assert flight.fly(go_to(flight, 50.0, 0.0)).status == "done"
    assert flight.fly(Land()).status == "done"
    assert not [m for m in flight.received if isinstance(m, CommandAck)]


def test_a_setpoint_that_gets_lost_is_sent_again_until_it_is_taken_up() -> None:
    flight = flying()
    flight.loss = 1.0
    flight.give(go_to(flight, 50.0, 0.0))
    flight.wait(3.0)
    flight.loss = 0.0
    flight.until(lambda: flight.outcome.status == "done")
    assert flight.off_m(50.0, 0.0) < 4.0
    sent = len(flight.setpoints())
    flight.wait(20.0)
    assert len(flight.setpoints()) == sent


def test_being_at_a_place_already_is_not_enough() -> None:
    flight = flying()
    flight.give(go_to(flight, 400.0, 0.0))
    flight.until(lambda: flight.vehicle.craft.north_m > 100.0)
    assert flight.fly(go_to(flight, flight.vehicle.craft.north_m, 0.0)).status == "done"
    flight.wait(30.0)
    assert flight.vehicle.craft.north_m < 150.0


def test_messages_are_asked_for_until_they_come() -> None:
    flight = VirtualFlight(vehicle={"requests_lost_s": 10.0})
    flight.wait(9.0)
    assert not flight.state.has_position
    flight.wait(9.0)
    assert flight.state.has_position and flight.state.ready and flight.state.home is not None
    asked = len(flight.commands(INTERVAL))
    flight.wait(30.0)
    assert len(flight.commands(INTERVAL)) == asked


@both
def test_its_altitude_of_the_return_and_its_speed_are_asked_for_until_they_come(
    autopilot: str,
) -> None:
    flight = VirtualFlight(autopilot, loss=0.7, seed=3)
    climbs = autopilot == "ardupilot"
    flight.until(
        lambda: (
            not math.isnan(flight.state.return_alt_m)
            and math.isnan(flight.state.return_climb_m) != climbs
            and not math.isnan(flight.state.speed_limit_mps)
            and not math.isnan(flight.state.disarm_delay_s)
        )
    )
    assert flight.state.speed_limit_mps == {"ardupilot": 10.0, "px4": 12.0}[autopilot]
    assert flight.state.disarm_delay_s == 10.0
    assert flight.state.return_alt_m == {"ardupilot": 15.0, "px4": 30.0}[autopilot]
    assert not climbs or flight.state.return_climb_m == 0.0
    asked = sum(isinstance(message, ParamRequestRead) for _, message in flight.sent)
    flight.wait(30.0)
    assert sum(isinstance(message, ParamRequestRead) for _, message in flight.sent) == asked


def test_places_and_targets_are_asked_for_at_the_rate_that_is_set() -> None:
    flight = flying(position_hz=8.0)
    flight.give(go_to(flight, 900.0, 0.0))
    flight.wait(10.0)
    for kind in (GlobalPosition, PositionTarget):
        before = sum(isinstance(m, kind) for m in flight.received)
        flight.wait(5.0)
        received = sum(isinstance(m, kind) for m in flight.received) - before
        assert received == pytest.approx(40, abs=3)


def test_messages_that_stop_to_come_are_asked_for_again() -> None:
    flight = VirtualFlight()
    flight.wait(10.0)
    # As after a restart of the autopilot.
    flight._channels[0].stream_only(flight.vehicle.default_intervals_s, flight.now)
    before = flight.now
    flight.wait(10.0)
    assert flight.state.position_s > before + 5.0


@both
def test_a_speed_is_asked_for_and_flown(autopilot: str) -> None:
    flight = flying(autopilot, speed_mps=3.0)
    flight.give(go_to(flight, 200.0, 0.0))
    flight.until(lambda: flight.vehicle.craft.north_m > 50.0)
    assert flight.vehicle.craft.ground_speed_mps == pytest.approx(3.0, abs=0.3)


# Arming


@both
def test_nothing_is_armed_unless_it_may_be(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    flight.give(TakeOff(10.0, arm=False))
    flight.wait(60.0)
    assert flight.outcome.status == "under_way"
    assert "waiting for" in flight.outcome.reason
    assert not flight.commands(ARM) and not flight.commands(START)
    assert not flight.commands(SET_MODE)
    assert not flight.vehicle.armed


@both
def test_who_may_not_arm_takes_off_once_somebody_else_has(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    flight.give(TakeOff(10.0, arm=False))
    flight.wait(20.0)
    if autopilot == "ardupilot":
        assert flight.vehicle.request_mode(4, 0) == ACCEPTED
    flight.wait(2.0)
    assert "arm" in flight.outcome.reason
    assert flight.vehicle.arm(force=False) == ACCEPTED
    flight.until(lambda: flight.outcome.status == "done")
    assert not flight.commands(ARM)
    assert abs(flight.vehicle.craft.up_m - 10.0) < 4.0


def test_armed_in_another_mode_it_waits_for_guided() -> None:
    flight = VirtualFlight()
    flight.give(TakeOff(10.0, arm=False))
    flight.wait(20.0)
    assert flight.vehicle.arm(force=False) == ACCEPTED
    flight.wait(5.0)
    assert "GUIDED" in flight.outcome.reason and "STABILIZE" in flight.outcome.reason
    assert not flight.commands(SET_MODE) and not flight.commands(TAKEOFF)


@both
def test_arming_waits_until_the_vehicle_is_ready(autopilot: str) -> None:
    flight = VirtualFlight(autopilot, vehicle={"ready_s": 40.0})
    flight.give(TakeOff(10.0))
    flight.wait(38.0)
    assert "checks" in flight.outcome.reason
    assert not flight.commands(ARM)
    flight.until(lambda: flight.outcome.status == "done")
    assert len(flight.commands(ARM)) <= 2


@pytest.mark.slow
def test_a_take_off_waits_as_long_as_it_takes_and_reports_for_what() -> None:
    flight = VirtualFlight(vehicle={"ready_s": 900.0})
    flight.give(TakeOff(10.0))
    flight.wait(600.0)
    assert (flight.outcome.status, flight.state.has_position) == ("under_way", True)
    complaint = "waiting for the autopilot's checks (PreArm: AHRS: waiting for home)"
    # It reports it every 30 s, and is known all the time.
    while not flight.state.ready:
        assert flight.outcome.reason == complaint and flight.state.unready in complaint
        assert not flight.commands(ARM)
        flight.step()
    flight.until(lambda: flight.outcome.status == "done")
    assert flight.state.unready is None


@pytest.mark.slow
def test_a_vehicle_that_never_has_a_position_is_waited_for_without_a_word_of_its_own() -> None:
    # In STABILIZE ArduCopter needs none: its checks are passed.
    flight = VirtualFlight(vehicle={"gps": False, "ready_s": 5.0})
    flight.give(TakeOff(10.0))
    flight.wait(600.0)
    waits = "waiting for the vehicle's position"
    assert (flight.outcome.status, flight.outcome.reason) == ("under_way", waits)
    assert flight.state.connected and not flight.state.has_position and not flight.state.ready
    assert not flight.commands(ARM)


def test_a_vehicle_without_a_position_reports_why_it_is_not_ready() -> None:
    flight = VirtualFlight(vehicle={"ready_s": 900.0})
    flight.give(TakeOff(10.0))
    flight.wait(100.0)
    assert not flight.state.has_position
    waits = "waiting for the vehicle's position (PreArm: AHRS: waiting for home)"
    assert (flight.outcome.status, flight.outcome.reason) == ("under_way", waits)


@both
def test_who_is_on_the_ground_goes_nowhere(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    outcome = flight.fly(go_to(flight, 10.0, 0.0))
    assert (outcome.status, "not in the air" in outcome.reason) == ("failed", True)
    assert not flight.vehicle.armed


# Missions that do not get across


@both
def test_a_mission_that_fails_to_get_across_is_not_flown(autopilot: str) -> None:
    patience = Timeouts(retries=2, upload_retries=1)
    flight = VirtualFlight(autopilot, transfer=patience)
    flight.wait(10.0)
    bad = list(mission(flight, (40.0, 0.0, 20.0)))
    # No autopilot knows this command.
    bad[-1] = MissionItem(31999, FRAME_MISSION)
    assert flight.fly(FlyMission(tuple(bad))).status == "failed"
    assert "refused" in flight.outcome.reason
    flight.wait(20.0)
    assert not flight.commands(ARM) and not flight.commands(START)
    assert not flight.commands(SET_MODE)


def test_another_order_during_an_upload_ends_it() -> None:
    flight = flying()
    flight.give(FlyMission(mission(flight, *[(float(k), 50.0, 20.0) for k in range(60)])))
    flight.wait(0.1)
    flight.give(go_to(flight, 30.0, 0.0))
    flight.until(lambda: flight.outcome.status == "done")
    assert flight.vehicle.custom_mode == 4
    assert flight.fly(FlyMission(mission(flight, (0.0, 30.0, 20.0)))).status == "done"


def test_a_mission_of_home_alone_is_refused() -> None:
    flight = VirtualFlight()
    assert flight.fly(FlyMission(mission(flight, (1.0, 1.0, 1.0))[:1])).status == "failed"


# The latest order counts


@pytest.mark.slow
@both
def test_the_latest_order_wins(autopilot: str) -> None:
    flight = flying(autopilot)
    flight.give(go_to(flight, 200.0, 0.0))
    flight.wait(5.0)
    assert flight.fly(go_to(flight, 0.0, 50.0)).status == "done"
    assert flight.outcome.number == 3
    flight.wait(20.0)
    assert flight.off_m(0.0, 50.0) < 4.0


@both
def test_a_return_ends_a_climb(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    flight.give(TakeOff(60.0))
    flight.until(lambda: flight.vehicle.craft.up_m > 20.0)
    assert flight.fly(Return()).status == "done"
    assert flight.vehicle.landed


@both
@pytest.mark.parametrize("order", ["go", "hold", "land"])
def test_an_order_just_after_a_start_is_about_the_flight_that_begins(
    autopilot: str, order: str
) -> None:
    flight = VirtualFlight(autopilot)
    orders = {"go": go_to(flight, 20.0, 0.0, 15.0), "hold": Hold(), "land": Land()}
    flight.give(FlyMission(mission(flight, (400.0, 0.0, 15.0))))
    flight.until(lambda: "item" in flight.outcome.reason and flight.vehicle.armed)
    assert flight.fly(orders[order]).status == "done"
    flight.wait(30.0)
    assert flight.outcome.status == "done"
    assert flight.off_m(0.0, 0.0) < 25.0


# Somebody else


@both
@pytest.mark.parametrize("during", ["climb", "flight", "search", "rest", "mission", "return"])
def test_a_pilot_who_takes_over_is_left_alone(autopilot: str, during: str) -> None:
    flight = flying(autopilot, up_m=30.0)
    orders: dict[str, Any] = {
        "climb": TakeOff(90.0),
        "flight": go_to(flight, 300.0, 0.0, 30.0),
        "search": SearchPlace(*flight.place(0.0, 0.0), 30.0, 10.0, 60.0, 3.0),
        "mission": FlyMission(mission(flight, (300.0, 0.0, 30.0))),
        "return": Return(),
    }
    if during in orders:
        flight.give(orders[during])
    flight.wait(8.0)
    mode = "POSCTL" if autopilot == "px4" else "LOITER"
    flight.vehicle.pilot_takes_over(mode)
    flight.until(lambda: flight.outcome.status == "taken_over", limit_s=4.0)
    assert mode in flight.outcome.reason
    sent = len(flight.sent)
    flight.wait(60.0)
    assert len(flight.sent) == sent
    assert flight.state.mode == mode


def test_texts_that_merely_inform_are_not_the_reason_of_a_take_over() -> None:
    flight = flying()
    flight.give(go_to(flight, 300.0, 0.0))
    flight.wait(3.0)
    flight.vehicle.send_text("EKF3 IMU0 MAG0 in-flight yaw alignment complete")
    flight.vehicle.send_text("EKF variance", mavlink.MAV_SEVERITY_CRITICAL)
    flight.vehicle.pilot_takes_over("LOITER")
    flight.until(lambda: flight.outcome.status == "taken_over")
    assert flight.outcome.reason == "in LOITER (EKF variance)"


def test_a_text_that_is_repeated_is_named_once() -> None:
    flight = flying()
    flight.give(go_to(flight, 300.0, 0.0))
    flight.wait(3.0)
    flight.vehicle.send_text("Crash: Disarming", mavlink.MAV_SEVERITY_CRITICAL)
    for _ in range(4):
        flight.vehicle.send_text("EKF variance", mavlink.MAV_SEVERITY_CRITICAL)
    flight.vehicle.pilot_takes_over("LOITER")
    flight.until(lambda: flight.outcome.status == "taken_over")
    assert flight.outcome.reason == "in LOITER (Crash: Disarming; EKF variance)"


@both
def test_after_a_take_over_only_an_order_of_a_new_authority_counts(autopilot: str) -> None:
    flight = flying(autopilot)
    flight.vehicle.pilot_takes_over("POSCTL" if autopilot == "px4" else "LOITER")
    flight.wait(4.0)
    assert flight.fly(go_to(flight, 20.0, 0.0)).status == "taken_over"
    assert flight.outcome.number == 2
    # Neither the pilot's own mode nor one of ours releases it.
    flight.vehicle.request_mode(*((4, 3) if autopilot == "px4" else (4, 0)))
    flight.wait(5.0)
    sent = len(flight.sent)
    for order in (go_to(flight, 20.0, 0.0), Hold(), Return(), Land()):
        assert flight.fly(order).status == "taken_over"
    assert len(flight.sent) == sent
    assert flight.fly(go_to(flight, 20.0, 0.0), authority=1).status == "done"


def test_a_vehicle_in_anothers_hands_at_the_start_is_not_taken() -> None:
    flight = VirtualFlight()
    vehicle = flight.vehicle
    flight.until(lambda: vehicle.ready)
    vehicle.request_mode(4, 0)
    vehicle.arm(force=False)
    vehicle.maneuver = vehicle.take_off(20.0)
    flight.until(lambda: vehicle.craft.up_m > 19.0)
    vehicle.request_mode(5, 0)
    flight.wait(5.0)
    for order in (go_to(flight, 20.0, 0.0), Hold(), Return(), Land()):
        assert flight.fly(order).status == "taken_over"
    assert not flight.commands(SET_MODE) and not flight.setpoints()


@both
def test_a_failsafe_has_the_vehicle_and_is_named(autopilot: str) -> None:
    fault = Fault("battery", 20.0, since_airborne=True)
    flight = flying(autopilot, vehicle={"faults": (fault,)})
    flight.give(go_to(flight, 900.0, 0.0))
    flight.until(lambda: flight.outcome.status == "failsafe")
    # ArduCopter's text, which names it, comes after its heartbeat.
    flight.wait(0.5)
    mode = "HOLD" if autopilot == "px4" else "RTL"
    assert mode in flight.outcome.reason and "battery" in flight.outcome.reason
    assert flight.state.failsafe is Failsafe.BATTERY
    assert not flight.controller.counts["offboard_lost"]
    assert flight.state.battery < 0.2


# PX4 without setpoints


def px4_without_setpoints(action: int, seconds: float) -> VirtualFlight:
    """Return a flight of which the setpoints have been lost for a while."""
    flight = flying("px4")
    flight.vehicle.parameters["COM_OBL_RC_ACT"] = action
    flight.fly(go_to(flight, 20.0, 0.0))
    flight.give(go_to(flight, 200.0, 0.0))
    flight.wait(3.0)
    put = flight._put

    def deaf(data: bytes, *, to_vehicle: bool) -> None:
        if not to_vehicle:
            put(data, to_vehicle=False)

    flight._put = deaf  # type: ignore[method-assign]
    flight.wait(seconds)
    flight._put = put  # type: ignore[method-assign]
    return flight


@pytest.mark.parametrize(
    ("action", "mode"), [(0, "RTL"), (3, "RTL"), (4, "LAND"), (5, "HOLD")], ids=str
)
def test_px4_that_missed_setpoints_gets_them_and_flies_on(action: int, mode: str) -> None:
    flight = px4_without_setpoints(action, 4.0)
    assert flight.state.mode == mode
    assert (flight.state.failsafe, flight.outcome.status) == (Failsafe.OFFBOARD, "under_way")
    assert not [m for m in flight.received if isinstance(m, StatusText)]
    modes = len(flight.commands(SET_MODE))
    flight.until(lambda: flight.outcome.status != "under_way")
    assert flight.outcome.status == "done"
    assert flight.off_m(200.0, 0.0) < 4.0
    assert len(flight.commands(SET_MODE)) == modes
    assert flight.controller.counts["offboard_lost"] == 1


@pytest.mark.parametrize("seconds", [2.0, 6.0])
def test_a_restarted_pilot_gives_px4_the_setpoints_that_it_misses(seconds: float) -> None:
    flight = flying("px4")
    flight.fly(go_to(flight, 60.0, 0.0))
    flight.restart()
    flight.wait(seconds)
    assert flight.state.mode == "RTL" and flight.state.failsafe is Failsafe.CRITICAL
    # Nothing is sent before there is an order.
    modes = len(flight.commands(SET_MODE))
    sent = len(flight.setpoints())
    flight.wait(1.0)
    assert len(flight.setpoints()) == sent
    assert flight.fly(go_to(flight, 90.0, 0.0)).status == "done"
    assert flight.off_m(90.0, 0.0) < 4.0
    assert len(flight.commands(SET_MODE)) == modes


@both
def test_a_restarted_pilot_does_not_undo_what_a_person_does_in_a_failsafe(autopilot: str) -> None:
    flight = flying(autopilot)
    flight.fly(go_to(flight, 60.0, 0.0))
    flight.vehicle.failsafes.add("battery")
    flight.vehicle.battery_failsafe()
    flight.until(lambda: flight.vehicle.mode.name in ("RTL", "LAND"))
    # The text that names it has come before.
    flight.wait(0.3)
    flight.restart()
    flight.until(lambda: flight.state.mode in ("RTL", "LAND"))
    flight.give(Return())
    person = (4, 3) if autopilot == "px4" else (4, 0)
    modes, sent = len(flight.commands(SET_MODE)), len(flight.setpoints())
    flight.vehicle.request_mode(*person)
    flight.wait(10.0)
    assert flight.outcome.status in ("taken_over", "failsafe")
    assert flight.vehicle.mode.name == ("HOLD" if autopilot == "px4" else "GUIDED")
    assert len(flight.commands(SET_MODE)) == modes and not flight.setpoints()[sent:]


@pytest.mark.parametrize("cause", ["geofence", "gps"])
@pytest.mark.parametrize("events", [True, False])
@pytest.mark.parametrize("phase", range(5))
def test_px4_gets_nothing_in_a_failsafe_of_which_the_cause_is_not_known(
    cause: str, events: bool, phase: int
) -> None:
    flight = flying("px4", seed=phase)
    flight.give(go_to(flight, 900.0, 0.0))
    flight.wait(8.0 + 0.17 * phase)
    vehicle = flight.vehicle
    assert isinstance(vehicle, Px4)
    if not events:
        vehicle._send_event = lambda *_: None  # type: ignore[method-assign]
    mode = "HOLD" if cause == "geofence" else "ALTCTL"
    (vehicle.breach_geofence if cause == "geofence" else vehicle.lose_gps)()
    flight.until(lambda: flight.state.mode == mode, limit_s=2.0)
    flight.step()
    sent = len(flight.setpoints())
    flight.until(lambda: flight.outcome.status == "failsafe", limit_s=6.0)
    assert f"{mode}, critical failsafe" in flight.outcome.reason
    assert flight.state.failsafe is Failsafe.CRITICAL
    flight.wait(20.0)
    assert len(flight.setpoints()) == sent
    assert vehicle.failsafes == {cause}


@pytest.mark.parametrize("cause", ["geofence", "gps"])
@pytest.mark.parametrize("later_s", [0.0, 0.4, 1.0])
def test_px4_that_returns_for_missing_setpoints_gets_none_in_another_failsafe(
    cause: str, later_s: float
) -> None:
    flight = flying("px4")
    flight.give(go_to(flight, 900.0, 0.0))
    flight.wait(8.0)
    vehicle = flight.vehicle
    assert isinstance(vehicle, Px4)
    flight.loss = 1.0
    flight.until(lambda: vehicle.mode.name == "RTL", limit_s=5.0)
    flight.wait(later_s)
    (vehicle.breach_geofence if cause == "geofence" else vehicle.lose_gps)()
    flight.loss = 0.0
    # Its next report of checks names the other one.
    flight.wait(2.2)
    sent = len(flight.setpoints())
    flight.until(lambda: flight.outcome.status == "failsafe", limit_s=8.0)
    flight.wait(20.0)
    assert len(flight.setpoints()) == sent
    assert vehicle.failsafes >= {cause}


@pytest.mark.parametrize("seconds", [1.5, 4.0, 12.0])
@pytest.mark.parametrize("seed", range(3))
def test_px4_flies_on_after_a_link_that_was_cut_both_ways(seconds: float, seed: int) -> None:
    flight = flying("px4", seed=seed)
    flight.fly(go_to(flight, 20.0, 0.0))
    flight.give(go_to(flight, 200.0, 0.0))
    flight.wait(3.0)
    flight.loss = 1.0
    flight.wait(seconds)
    assert flight.vehicle.mode.name == "RTL"
    flight.loss = 0.0
    flight.until(lambda: flight.outcome.status not in ("under_way", "silent"))
    assert flight.outcome.status == "done"
    assert flight.off_m(200.0, 0.0) < 4.0


def test_a_return_that_a_pilot_chooses_is_a_take_over_at_once() -> None:
    flight = flying("px4")
    flight.give(go_to(flight, 900.0, 0.0))
    flight.wait(8.0)
    flight.vehicle.pilot_takes_over("RTL")
    flight.until(lambda: flight.outcome.status == "taken_over", limit_s=3.0)


@pytest.mark.slow
@pytest.mark.parametrize("order", [Return(), Land()])
def test_px4_that_falls_into_offboard_by_disarming_has_done_its_order(order: Any) -> None:
    flight = flying("px4")
    for _ in range(2):
        flight.fly(go_to(flight, 30.0, 0.0))
        assert flight.fly(order).status == "done"
        flight.wait(10.0)
        assert flight.state.mode == "OFFBOARD" and not flight.state.ready
        assert flight.outcome.status == "done"
        # A second search.
        assert flight.fly(TakeOff(20.0, from_modes=("RTL", "LAND", "AUTO"))).status == "done"


def test_px4_on_the_ground_is_ready_although_its_position_is_constant() -> None:
    flight = VirtualFlight("px4")
    flight.until(lambda: flight.state.ready, limit_s=20.0)
    assert flight.vehicle.ekf_flags == 1023
    assert flight.fly(TakeOff(10.0)).status == "done"


def test_px4_flies_above_home_wherever_the_origin_of_its_estimate_is() -> None:
    flight = flying("px4")
    assert isinstance(flight.vehicle, Px4)
    flight.vehicle.home_above_origin_m = 5.0
    assert flight.fly(go_to(flight, 40.0, 0.0, 30.0)).status == "done"
    flight.wait(5.0)
    assert flight.vehicle.craft.up_m == pytest.approx(30.0, abs=0.5)


@pytest.mark.parametrize("missed", [False, True], ids=["heard", "missed"])
def test_the_check_that_keeps_px4_on_the_ground_is_named(missed: bool) -> None:
    flight = VirtualFlight("px4", vehicle={"parameters": (("COM_ARM_MIS_REQ", 1),)})
    flight.wait(8.0)
    if missed:
        # Its report came before we did.
        flight.restart()
    flight.give(TakeOff(10.0))
    flight.wait(15.0)
    assert flight.outcome.reason == "waiting for the autopilot's checks (no valid mission)"
    flight.vehicle.parameters["COM_ARM_MIS_REQ"] = 0
    flight.until(lambda: flight.outcome.status != "under_way")
    assert flight.outcome.status == "done"


@pytest.mark.parametrize("home_up_m", [-2.0, 2.0])
def test_px4_whose_home_moves_rests_at_the_top_of_its_climb_unasked(home_up_m: float) -> None:
    flight = VirtualFlight("px4", alt_tolerance_m=1.0)
    flight.give(TakeOff(30.0))
    flight.until(lambda: flight.vehicle.craft.up_m > 15.0)
    flight.vehicle.home = Point(0.0, 0.0, home_up_m)
    flight.until(lambda: flight.outcome.status != "under_way")
    assert flight.outcome.status == "done"
    assert flight.fly(go_to(flight, 40.0, 0.0, 30.0)).status == "done"
    assert flight.vehicle.craft.up_m == pytest.approx(30.0, abs=1.5)


def test_a_hold_short_of_the_top_of_px4s_climb_is_a_persons() -> None:
    flight = VirtualFlight("px4", alt_tolerance_m=1.0)
    flight.give(TakeOff(30.0))
    flight.until(lambda: flight.vehicle.craft.up_m > 25.0)
    flight.vehicle.pilot_takes_over("HOLD")
    flight.until(lambda: flight.outcome.status != "under_way", limit_s=4.0)
    assert flight.outcome.status == "taken_over"


def test_who_may_not_arm_reports_that_px4_has_to_leave_offboard() -> None:
    flight = VirtualFlight("px4")
    flight.wait(10.0)
    flight.vehicle.request_mode(6, 0)
    flight.wait(3.0)
    flight.give(TakeOff(10.0, arm=False))
    flight.wait(3.0)
    assert flight.outcome.reason == "waiting for HOLD: it is in OFFBOARD"
    assert not flight.commands(SET_MODE)


# The link


@both
def test_a_lost_link_is_reported_and_the_vehicle_flown_on_after_it(autopilot: str) -> None:
    fault = Fault("link", 15.0, since_airborne=True, duration_s=20.0)
    flight = flying(autopilot, vehicle={"faults": (fault,)})
    flight.give(go_to(flight, 150.0, 0.0))
    flight.until(lambda: flight.outcome.status == "silent")
    assert not flight.state.connected
    sent = len(flight.sent)
    flight.until(lambda: flight.outcome.status != "silent")
    assert len(flight.sent) - sent < 20
    flight.until(lambda: flight.outcome.status != "under_way")
    assert flight.outcome.status == "done"
    assert flight.off_m(150.0, 0.0) < 4.0
    assert flight.controller.counts["link_lost"] == flight.controller.counts["link_found"] == 1


@pytest.mark.slow
def test_taken_over_while_the_link_was_lost_is_seen_after_it() -> None:
    faults = (Fault("link", 30.0, duration_s=20.0), Fault("pilot", 35.0, value="LOITER"))
    flight = flying(vehicle={"faults": faults})
    flight.give(go_to(flight, 900.0, 0.0))
    flight.until(lambda: flight.outcome.status == "taken_over")
    assert "silent" in flight.statuses()
    assert not [m for now, m in flight.sent if now > 50.0 and isinstance(m, SetPositionTarget)]


def test_a_vehicle_that_is_not_there_gets_nothing() -> None:
    controller = VehicleController(VEHICLE, OURSELVES, ControllerSettings())
    sent = controller.give(TakeOff(10.0), 0.0)
    for tick in range(1000):
        sent += controller.tick(tick * 0.1)
    assert sent == []
    assert controller.outcome.status == "under_way"


@both
def test_a_vehicle_that_does_not_move_fails_the_order(autopilot: str) -> None:
    flight = flying(autopilot, stall_s=10.0)
    vehicle, stuck = flight.vehicle, type(flight.vehicle.limits)(0.001, 0.001, 0.001, 0.001, 0.001)
    vehicle.limits = stuck
    if isinstance(vehicle, Px4):
        vehicle.offboard_limits = lambda: stuck  # type: ignore[method-assign]
    assert flight.fly(go_to(flight, 100.0, 0.0)).status == "failed"
    assert "no progress for 10 s" in flight.outcome.reason


@pytest.mark.slow
@settings(max_examples=12, phases=AS_DRAWN)
@given(
    autopilot=st.sampled_from(AUTOPILOTS),
    seed=st.integers(0, 2**32),
    loss=st.floats(0.0, 0.3),
    duplicate=st.floats(0.0, 0.2),
    delay_s=st.floats(0.0, 0.1),
)
# The first three take-off commands are lost, and the vehicle disarms itself after 10 s.
@example(
    autopilot="ardupilot",
    seed=622723065,
    loss=0.2126,
    duplicate=0.14412525996059505,
    delay_s=0.03324164343899235,
)
def test_on_a_bad_link_done_means_done(
    autopilot: str, seed: int, loss: float, duplicate: float, delay_s: float
) -> None:
    flight = VirtualFlight(
        autopilot,
        seed=seed,
        loss=loss,
        duplicate=duplicate,
        delay_s=delay_s,
        # Enough that with 30 % lost it does not miss three of four.
        setpoint_hz=10.0,
        link_timeout_s=8.0,
    )
    assert flight.fly(TakeOff(20.0)).status == "done"
    assert abs(flight.vehicle.craft.up_m - 20.0) < 5.0
    for north_m, east_m in ((40.0, 0.0), (40.0, 40.0)):
        outcome = flight.fly(go_to(flight, north_m, east_m))
        assert outcome.status == "done"
        assert flight.off_m(north_m, east_m) < 9.0
    assert flight.fly(Return()).status == "done"
    assert flight.vehicle.landed and not flight.vehicle.armed


def any_order(flight: VirtualFlight, *, arm: bool = True) -> st.SearchStrategy[Any]:
    places = st.tuples(*(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(5.0, 40.0)))
    return st.one_of(
        st.builds(lambda up_m: TakeOff(up_m, arm), st.floats(5.0, 40.0)),
        st.builds(lambda place: go_to(flight, *place), places),
        st.builds(
            lambda place: SearchPlace(*flight.place(*place[:2]), place[2], 5.0, 3.0, 3.0), places
        ),
        st.sampled_from([Hold(), Return(), Land()]),
        st.builds(
            lambda north: FlyMission(mission(flight, (north, 0.0, 15.0)), arm), st.floats(5, 40)
        ),
    )


@pytest.mark.slow
@settings(max_examples=15, phases=AS_DRAWN)
@given(data=st.data(), seed=st.integers(0, 2**32), autopilot=st.sampled_from(AUTOPILOTS))
def test_whatever_is_ordered_in_the_end_it_lands(
    data: st.DataObject, seed: int, autopilot: str
) -> None:
    flight = VirtualFlight(autopilot, seed=seed, delay_s=0.1)
    for number in range(1, 7):
        flight.give(data.draw(any_order(flight)))
        flight.wait(data.draw(st.floats(0.1, 40.0)))
        assert flight.outcome.number == number
        assert flight.outcome.status in ("under_way", "done", "failed")
    assert flight.fly(Land()).status == "done"
    assert flight.vehicle.landed and not flight.vehicle.armed


@pytest.mark.slow
@settings(max_examples=10, phases=AS_DRAWN)
@given(data=st.data(), seed=st.integers(0, 2**32), autopilot=st.sampled_from(AUTOPILOTS))
def test_whatever_is_ordered_nothing_is_armed_unless_it_may_be(
    data: st.DataObject, seed: int, autopilot: str
) -> None:
    flight = VirtualFlight(autopilot, seed=seed, delay_s=0.1)
    for _ in range(5):
        flight.give(data.draw(any_order(flight, arm=False)))
        flight.wait(data.draw(st.floats(0.1, 30.0)))
    assert not flight.commands(ARM) and not flight.commands(START) and not flight.vehicle.armed
    assert not flight.commands(SET_MODE)


@pytest.mark.slow
@settings(max_examples=15, phases=AS_DRAWN)
@given(
    data=st.data(),
    seed=st.integers(0, 2**32),
    autopilot=st.sampled_from(AUTOPILOTS),
    after_s=st.floats(0.0, 30.0),
)
def test_whenever_a_pilot_takes_over_nothing_is_sent_any_more(
    data: st.DataObject, seed: int, autopilot: str, after_s: float
) -> None:
    flight = flying(autopilot, seed=seed, delay_s=0.1)
    flight.give(data.draw(any_order(flight)))
    flight.wait(after_s)
    if flight.vehicle.landed:
        return
    mode = "POSCTL" if autopilot == "px4" else "LOITER"
    for _ in range(5):
        # A command that was sent before a heartbeat showed it comes after it: then once more.
        if flight.vehicle.mode.name != mode:
            flight.vehicle.pilot_takes_over(mode)
        flight.wait(3.0)
    assert flight.vehicle.mode.name == mode
    sent = len(flight.sent)
    flight.wait(10.0)
    flight.give(data.draw(any_order(flight)))
    flight.wait(10.0)
    assert len(flight.sent) == sent
    assert flight.outcome.status == "taken_over"
    assert flight.state.mode == mode


def test_no_message_makes_the_controller_raise_or_end_an_order() -> None:
    controller = VehicleController(VEHICLE, OURSELVES, ControllerSettings())
    controller.give(GoTo(0.0, 0.0, 10.0, 5.0), 0.0)
    for mode, status, base in itertools.product((0, 4, 2**32 - 1), range(0, 256, 51), (0, 255)):
        controller.receive(Heartbeat(2, 3, base, mode, status, 3), 1.0)
        controller.tick(1.0)
        assert controller.outcome.status != "done"


def test_the_target_is_one_vehicle() -> None:
    for system in (0, 256):
        with pytest.raises(ValueError, match="must be 1 to 255, got "):
            VehicleController(Address(system, 1), OURSELVES, ControllerSettings())


def test_the_simulated_vehicles_home_is_where_the_test_thinks() -> None:
    flight = VirtualFlight()
    assert type(flight.vehicle) is type(make_vehicle(flight.vehicle.settings))
    assert flight.place(0.0, 0.0) == pytest.approx((-24.0, -46.3))
