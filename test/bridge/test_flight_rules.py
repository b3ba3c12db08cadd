# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What befalls vehicles in flight: moved homes, foreign missions, dead motors, winds, doubles."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import pytest
from autopilot.maneuvers import CarriedAway
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from virtual_fleet import FRAME, VirtualFleet, pilots_mode
from virtual_flight import VirtualFlight

from dsse_ros.bridge.airspace import UNKNOWN_FACTOR
from dsse_ros.flight.orders import SearchPlace
from dsse_ros.mavlink.messages import CommandLong, SetPositionTarget
from dsse_ros.mission_items.separation import separation_m

ARM, TAKE_OFF, SET_MODE = 400, 22, 176
both = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
GUIDED = {"ardupilot": "GUIDED", "px4": "OFFBOARD"}


def following(autopilot: str, vehicles: int = 1, **options: Any) -> tuple[VirtualFleet, Any]:
    """Return a fleet whose vehicles have arrived at the cells of their drones, and the search."""
    fleet = VirtualFleet(vehicles, autopilot, **options)
    search = fleet.simulate(7)
    fleet.until(lambda: fleet.arrived(search))
    return fleet, search


def sent_since(flight: VirtualFlight, since_s: float) -> list[object]:
    """Return what was sent that moves a vehicle or may."""
    return [
        message
        for now_s, message in flight.sent
        if now_s > since_s
        and (
            isinstance(message, SetPositionTarget)
            or (isinstance(message, CommandLong) and message.command in (ARM, TAKE_OFF, SET_MODE))
        )
    ]


# Altitudes


@both
@pytest.mark.parametrize("datum_m", [0.0, 300.0])
def test_layers_are_apart_whatever_the_heights_of_the_homes(autopilot: str, datum_m: float) -> None:
    homes = [(20.0 + 20.0 * i, 20.0, datum_m + 5.0 * i) for i in range(3)]
    fleet, search = following(autopilot, 3, homes_m=homes, datum_altitude=datum_m)
    fleet.fly(search, 2)
    fleet.until(lambda: fleet.arrived(search))
    fleet.wait(5.0)
    heights_m = [fleet.amsl_m(i) - datum_m for i in range(3)]
    assert heights_m == pytest.approx([40.0, 35.0, 30.0], abs=1.1)


@pytest.mark.parametrize("mode", ["guided", "mission"])
def test_a_home_that_is_too_high_for_its_layer_is_refused_with_the_remedy(mode: str) -> None:
    fleet = VirtualFleet(1, homes_m=[(20.0, 20.0, 584.0)], mode=mode)
    search = fleet.simulate(7)
    if mode == "mission":
        search.advance()
        fleet.finish(search)
    fleet.wait(20.0)
    refused = fleet.controller.followers[0].refused
    assert refused.startswith("take-off: altitude must be at least 10 m above home, got -544 m")
    assert "datum_altitude" in refused
    assert fleet.down() and not fleet.flights[0].commands(ARM)


@pytest.mark.parametrize(
    ("autopilot", "name", "value"),
    [("ardupilot", "RTL_ALT", 20000.0), ("px4", "RTL_RETURN_ALT", 200.0)],
)
def test_a_return_above_the_highest_altitude_keeps_it_on_the_ground(
    autopilot: str, name: str, value: float
) -> None:
    fleet = VirtualFleet(1, autopilot, vehicle={"parameters": ((name, value),)})
    fleet.simulate(7)
    fleet.wait(20.0)
    refused = fleet.controller.followers[0].refused
    assert refused == (
        "take-off: the vehicle's return altitude must be at most 150 m above the sea, got 200"
    )
    assert not fleet.flights[0].commands(ARM)


@pytest.mark.slow
@both
@pytest.mark.parametrize("mode", ["guided", "mission"])
def test_a_home_that_a_person_moves_in_flight_moves_no_layer_and_is_a_take_over(
    autopilot: str, mode: str
) -> None:
    fleet = VirtualFleet(1, autopilot, mode=mode)
    search = fleet.simulate(7)
    if mode == "mission":
        for _ in range(4):
            search.advance()
        fleet.finish(search)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.craft.up_m > 37.0)
    fleet.wait(3.0)
    flight.send_from_station(
        CommandLong(1, 1, mavlink.MAV_CMD_DO_SET_HOME, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    )
    fleet.until(lambda: fleet.custody() == "taken over", 10.0)
    assert fleet.controller.followers[0].lost == "taken over: its home was moved"
    since_s, highest_m = fleet.now, 0.0
    for _ in range(400):
        fleet.step()
        highest_m = max(highest_m, vehicle.craft.up_m)
    assert highest_m < 42.0
    # PX4 is left in HOLD, as without setpoints it would return.
    assert not sent_since(flight, since_s + 3.0)


# Somebody else


@pytest.mark.slow
@both
@pytest.mark.parametrize("act", ["clear", "shorter", "set current"])
@pytest.mark.parametrize("restarted", [False, True])
def test_who_changes_the_mission_that_a_vehicle_flies_has_taken_it_over(
    autopilot: str, act: str, restarted: bool
) -> None:
    fleet = VirtualFleet(1, autopilot, mode="mission", merge_legs=False)
    search = fleet.simulate(7, [(0, 3)])
    for _ in range(8):
        search.advance([1])
    fleet.finish(search)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.mission.current >= 3)
    if restarted:
        fleet.start()
        fleet.wait(5.0)
    if act == "set current":
        flight.send_from_station(mavlink.MAVLink_mission_set_current_message(1, 1, 1))
    elif act == "shorter":
        del vehicle.mission.items[-2:]
    else:
        vehicle.mission.items.clear()
    fleet.until(lambda: fleet.custody() == "taken over", 10.0)
    since_s = fleet.now
    fleet.wait(30.0)
    assert not sent_since(flight, since_s + 0.5)


def reposition(flight: VirtualFlight, north_m: float, up_m: float) -> object:
    lat_deg, lon_deg = flight.place(north_m, 0.0)
    return mavlink.MAVLink_command_int_message(
        1, 1, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_DO_REPOSITION, 0, 0,
        -1.0, 1.0, 0.0, math.nan, round(lat_deg * 1e7), round(lon_deg * 1e7), up_m,
    )  # fmt: skip


def act_on(fleet: VirtualFleet, act: str) -> None:
    """Do to a vehicle in the air what a person at a ground station may do."""
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    if act == "home":
        numbers = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        flight.send_from_station(CommandLong(1, 1, mavlink.MAV_CMD_DO_SET_HOME, 0, *numbers))
    elif act == "shorter mission":
        del vehicle.mission.items[-2:]
    elif act == "item":
        flight.send_from_station(mavlink.MAVLink_mission_set_current_message(1, 1, 1))
    else:
        flight.send_from_station(reposition(flight, 60.0, 40.0))


@pytest.mark.slow
@both
@pytest.mark.parametrize(
    ("act", "mode"),
    [
        ("home", "guided"), ("home", "mission"), ("shorter mission", "mission"),
        ("item", "mission"), ("fly here", "guided"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("operation", ["land", "return"])
def test_whatever_somebody_has_done_to_it_an_operator_brings_a_vehicle_down(
    autopilot: str, act: str, mode: str, operation: str
) -> None:
    fleet = VirtualFleet(1, autopilot, mode=mode, merge_legs=False)
    search = fleet.simulate(7, [(0, 3)])
    if mode == "mission":
        for _ in range(8):
            search.advance([1])
        fleet.finish(search)
    vehicle = fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.craft.up_m > 37.0)
    fleet.until(lambda: mode == "guided" or vehicle.mission.current >= 3)
    fleet.wait(3.0)
    act_on(fleet, act)
    fleet.until(lambda: fleet.custody() == "taken over", 10.0)
    fleet.wait(5.0)
    fleet.controller.operate(None, operation)
    fleet.wait(5.0)
    assert fleet.custody() == "recalled"
    fleet.until(fleet.down, 400.0)


@both
@pytest.mark.parametrize("held", [False, True])
def test_fly_to_here_is_a_take_over_in_held_too(autopilot: str, held: bool) -> None:
    fleet, _ = following(autopilot)
    flight = fleet.flights[0]
    if held:
        fleet.controller.operate(None, "hold")
        fleet.wait(8.0)
        assert fleet.custody() == "held"
    flight.send_from_station(reposition(flight, 150.0, 40.0))
    fleet.until(lambda: fleet.custody() == "taken over", 5.0)
    since_s = fleet.now
    fleet.wait(30.0)
    assert not sent_since(flight, since_s + 0.5)
    assert abs(flight.vehicle.craft.north_m - 150.0) < 2.0


@both
@pytest.mark.parametrize("waits", ["cleared", "no search"])
def test_a_power_cycle_on_the_ground_ends_consent(autopilot: str, waits: str) -> None:
    fleet = VirtualFleet(1, autopilot)
    search = fleet.simulate(7)
    search.commanded = False
    fleet.publish(search)
    fleet.wait(15.0)
    assert fleet.custody() == "cleared"
    if waits == "no search":
        fleet.end(search)
        fleet.wait(1.0)
    flight = fleet.flights[0]
    flight.vehicle.power_cycle()
    fleet.wait(5.0)
    assert fleet.custody() == "taken over"
    if waits == "no search":
        search = fleet.simulate(8)
    search.commanded = True
    fleet.publish(search)
    fleet.wait(60.0)
    assert not flight.commands(ARM) and flight.vehicle.landed
    done, _ = fleet.controller.arm(None, True)
    assert done
    fleet.until(lambda: fleet.arrived(search))


@both
@pytest.mark.parametrize("when", ["before", "in flight"])
def test_of_two_vehicles_with_one_system_id_none_is_armed_and_all_come_down(
    autopilot: str, when: str
) -> None:
    fleet = VirtualFleet(1, autopilot)
    flight = fleet.flights[0]
    search = fleet.simulate(7)
    if when == "in flight":
        fleet.until(lambda: fleet.arrived(search))
    beside = replace(flight.vehicle.settings.home, lon_deg=-46.1695)
    twin = flight.add_twin(home=beside)
    fleet.until(lambda: flight.state.identity.twins, 25.0)
    fleet.wait(30.0)
    follower = fleet.controller.followers[0]
    text = "two vehicles have its system id"
    assert text in (follower.lost, follower.blocked)
    if when == "before":
        assert not flight.commands(ARM)
        done, why = fleet.controller.arm(None, True)
        assert not done and why == f"drone0: {text}"
        return
    assert not twin.armed
    done, why = fleet.controller.operate(None, "land")
    assert done and why == "ordered to land: drone0"
    fleet.until(fleet.down, 200.0)


@both
@pytest.mark.parametrize("what", ["return", "land"])
@pytest.mark.parametrize("who", ["pilot", "failsafe", "released", "silent"])
def test_an_operator_brings_down_what_the_bridge_has_launched_in_anybody_s_hands(
    autopilot: str, what: str, who: str
) -> None:
    fleet, _ = following(autopilot)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    if who == "failsafe":
        vehicle.failsafes.add("battery")
        vehicle.battery = min(vehicle.battery, 0.1)
        vehicle.battery_failsafe()
    elif who == "silent":
        put = flight._put
        flight._put = lambda data, *, to_vehicle: None  # type: ignore[method-assign]
        fleet.wait(40.0)
    else:
        vehicle.pilot_takes_over(pilots_mode(flight))
    fleet.wait(4.0)
    if who == "released":
        vehicle.request_mode(*((6, 0) if autopilot == "px4" else (4, 0)))
        fleet.wait(3.0)
    assert fleet.custody() != "following"
    done, text = fleet.controller.operate(None, what)
    assert done and text == f"ordered to {what}: drone0"
    if who == "silent":
        flight._put = put  # type: ignore[method-assign]
    fleet.until(fleet.down, 300.0)
    fleet.wait(10.0)
    assert fleet.custody() in ("taken over", "grounded")
    assert fleet.down()


# Motors, wind, restarts


@both
@pytest.mark.parametrize("moment", ["arrived", "leg", "climb", "search", "mission"])
def test_a_vehicle_that_falls_is_reported_and_not_ordered_up_again(
    autopilot: str, moment: str
) -> None:
    mode = "mission" if moment == "mission" else "guided"
    fleet = VirtualFleet(1, autopilot, mode=mode)
    search = fleet.simulate(7)
    vehicle, flight = fleet.flights[0].vehicle, fleet.flights[0]
    if mode == "mission":
        for _ in range(4):
            search.advance([1])
        fleet.finish(search)
    fleet.until(lambda: vehicle.craft.up_m > (20.0 if moment == "climb" else 39.0))
    if moment == "arrived":
        fleet.until(lambda: fleet.arrived(search))
        fleet.wait(3.0)
    elif moment in ("leg", "search"):
        fleet.until(lambda: fleet.arrived(search))
        search.advance([4 if moment == "search" else 1])
        fleet.publish(search)
        fleet.wait(3.0)
    vehicle.lose_motors()
    fleet.until(lambda: fleet.controller.followers[0].lost, 20.0)
    assert fleet.controller.followers[0].lost.startswith("fell to ")
    assert fleet.controller.followers[0].arrived_number == -1
    assert fleet.custody() == "recalled"
    fleet.start()
    fleet.wait(60.0)
    assert not [one for one in sent_since(flight, fleet.now - 60.0) if _climbs(one)]


def _climbs(message: object) -> bool:
    return isinstance(message, SetPositionTarget) or (
        isinstance(message, CommandLong) and message.command in (ARM, TAKE_OFF)
    )


@both
def test_arrival_is_withdrawn_while_a_vehicle_is_out_of_its_place(autopilot: str) -> None:
    fleet, search = following(autopilot)
    follower, vehicle = fleet.controller.followers[0], fleet.flights[0].vehicle
    assert follower.arrived_number == search.stamp_ns
    vehicle.craft.north_m += 80.0
    vehicle.craft.up_m -= 6.0
    fleet.until(lambda: follower.arrived_number == -1, 5.0)
    fleet.until(lambda: follower.arrived_number == search.stamp_ns, 60.0)
    assert not follower.lost


@both
def test_one_that_the_wind_carries_off_is_out_at_once_and_the_others_go_on(autopilot: str) -> None:
    fleet, search = following(autopilot, 2, fence_margin=60.0)
    search.advance([2, 1])
    fleet.publish(search)
    fleet.wait(1.0)
    vehicle = fleet.flights[0].vehicle
    begun_s = fleet.now
    while not fleet.controller.followers[0].lost:
        target = vehicle.maneuver.target or vehicle.craft.point
        vehicle.maneuver = CarriedAway(target, 6.0, 0.0)
        fleet.step()
        assert fleet.now - begun_s < 80.0, fleet.shown()
    assert fleet.controller.followers[0].lost.startswith("outside the fence: place must be within")
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    assert not fleet.controller.followers[1].lost


@both
def test_a_search_ends_although_the_bridge_is_restarted_every_twenty_seconds(
    autopilot: str,
) -> None:
    fleet, search = following(autopilot, frame=replace(FRAME, alt_m=80.0), search_altitude=15.0)
    search.advance([4])
    fleet.publish(search)
    begun_s, restarted_s = fleet.now, fleet.now
    while not fleet.arrived(search):
        if fleet.now - restarted_s > 20.0:
            fleet.start()
            restarted_s = fleet.now
        fleet.step()
        assert fleet.now - begun_s < 400.0, fleet.shown()
    orders = [line for line in fleet.log if "SearchPlace(" in line]
    assert orders and not fleet.controller.followers[0].lost


def test_a_look_that_is_done_is_not_done_again_by_a_restarted_bridge() -> None:
    fleet, search = following("ardupilot", search_altitude=15.0)
    search.advance([4])
    fleet.publish(search)
    follower = fleet.controller.followers[0]
    fleet.until(lambda: follower.custody.record.looked == search.stamp_ns)
    fleet.log.clear()
    fleet.start()
    fleet.until(lambda: fleet.arrived(search))
    assert not any("SearchPlace(" in line for line in fleet.log)
    assert not isinstance(fleet.flights[0].outcome.order, SearchPlace)


# Others in the air


def apart_m(fleet: VirtualFleet, i: int, j: int) -> tuple[float, float]:
    """Return how far two vehicles are from each other, horizontally and vertically."""
    places = []
    for k in (i, j):
        vehicle = fleet.flights[k].vehicle
        home = vehicle.settings.home
        north_m = (home.lat_deg - fleet.frame.origin_lat_deg) * 110_769.0
        east_m = (home.lon_deg - fleet.frame.origin_lon_deg) * 101_650.0
        craft = vehicle.craft
        places.append((north_m + craft.north_m, east_m + craft.east_m, fleet.amsl_m(k)))
    return math.dist(places[0][:2], places[1][:2]), abs(places[0][2] - places[1][2])


@both
@pytest.mark.parametrize("who", ["pilot", "failsafe", "silent", "released", "kept"])
def test_a_vehicle_that_somebody_else_has_is_avoided_at_every_altitude(
    autopilot: str, who: str
) -> None:
    stays = {"parameters": (("COM_OF_LOSS_T", 1e6),)} if autopilot == "px4" else {}
    fleet, search = following(autopilot, 2, at_end="hold", planner_timeout=0.0, vehicle=stays)
    other = fleet.flights[1]
    if who == "silent":
        other._put = lambda data, *, to_vehicle: None  # type: ignore[method-assign]
        other.vehicle.maneuver = CarriedAway(other.vehicle.craft.point, 0.0, 0.0)
    elif who == "failsafe":
        other.vehicle.failsafes.add("battery")
        other.vehicle.pilot_takes_over(pilots_mode(other))
    else:
        other.vehicle.pilot_takes_over(pilots_mode(other))
    fleet.wait(20.0)
    if who == "released":
        other.vehicle.request_mode(*((6, 0) if autopilot == "px4" else (4, 0)))
        fleet.wait(2.0)
    if who == "kept":
        other.vehicle.craft.up_m = 40.0
    # drone0 is sent through the place where the other one hovers.
    limit_m = UNKNOWN_FACTOR * separation_m(fleet.frame)
    nearest_m = math.inf
    search.lose(1)
    for _ in range(3):
        search.advance([1, 4])
        fleet.publish(search)
        for _ in range(300):
            fleet.step()
            nearest_m = min(nearest_m, apart_m(fleet, 0, 1)[0])
    assert nearest_m > limit_m - 15.0
    assert fleet.controller.followers[0].blocked == "waiting for drone1 to be out of the way"
    if who != "silent":
        # It goes on when the other one has left.
        other.vehicle.craft.north_m += 2000.0
        fleet.until(lambda: fleet.arrived(search), 200.0)


def test_one_that_is_flown_into_the_way_stops_who_is_on_it() -> None:
    frame = replace(FRAME, grid_size=8)
    fleet, search = following("ardupilot", 2, frame=frame, fence_margin=900.0, planner_timeout=0.0)
    pilot = fleet.flights[1].vehicle
    pilot.pilot_takes_over("LOITER")
    pilot.craft.north_m = 400.0
    fleet.wait(20.0)
    search.lose(1)
    search.cells[0] = (7, 3)
    search.step += 1
    search._reports.append(search.report([1, 4]))
    fleet.publish(search)
    fleet.wait(3.0)
    moving = fleet.flights[0].vehicle.craft
    assert moving.ground_speed_mps > 3.0
    ahead = moving.east_m + fleet.flights[0].vehicle.settings.home.lon_deg * 0.0 + 130.0
    pilot.craft.north_m, pilot.craft.east_m = moving.north_m, ahead - 20.0
    pilot.craft.up_m = moving.up_m
    nearest_m = math.inf
    for _ in range(600):
        fleet.step()
        nearest_m = min(nearest_m, apart_m(fleet, 0, 1)[0])
    assert nearest_m > 20.0
    assert "out of the way" in fleet.controller.followers[0].blocked
    pilot.craft.north_m += 1000.0
    fleet.until(lambda: fleet.arrived(search), 200.0)


# Operators


def test_what_an_operator_is_answered_is_what_happens() -> None:
    fleet, search = following("ardupilot", 2)
    controller = fleet.controller
    controller.operate(0, "hold")
    fleet.wait(5.0)
    fleet.end(search)
    fleet.wait(2.0)
    assert [fleet.custody(i) for i in range(2)] == ["held", "following"]
    for drone in range(2):
        done, text = controller.arm(drone, True)
        assert not done and "no search goes on" in text
    fleet.wait(20.0)
    assert fleet.custody(0) == "held" and fleet.flights[0].vehicle.craft.up_m > 35.0
    search = fleet.simulate(8)
    fleet.wait(2.0)
    done, text = controller.arm(1, True)
    assert not done and "no search goes on" in text
    controller.operate(None, "return")
    fleet.until(fleet.down)
    fleet.wait(5.0)
    assert "info: drone0: recalled -> taken over: recalled by the operator: return" in fleet.log
    done, text = controller.operate(0, "hold")
    assert not done and "drone0: it stays down, in " in text
    search.end()
    fleet.publish(search)
    fleet.wait(2.0)
    done, text = controller.arm(None, True)
    assert done and text == "cleared for the next search: drone0, drone1"


def test_a_clearance_without_a_search_is_not_one_for_a_later_bridge() -> None:
    fleet = VirtualFleet(1, arm="false")
    fleet.wait(10.0)
    done, text = fleet.controller.arm(None, True)
    assert done and text == "cleared for the next search: drone0"
    fleet.start()
    search = fleet.simulate(7)
    fleet.wait(60.0)
    assert not fleet.flights[0].commands(ARM)
    assert fleet.down() and not fleet.arrived(search)


def test_the_parameter_of_a_restarted_bridge_overrules_the_clearance_of_the_one_before() -> None:
    fleet = VirtualFleet(1, arm="true")
    search = fleet.simulate(7)
    search.commanded = False
    fleet.publish(search)
    fleet.wait(15.0)
    assert fleet.custody() == "cleared"
    fleet.settings = replace(fleet.settings, arm="false")
    fleet.start()
    search.commanded = True
    fleet.publish(search)
    fleet.wait(60.0)
    assert not fleet.flights[0].commands(ARM)
    assert fleet.down()


@both
@pytest.mark.parametrize("gone", ["for long", "another boot"])
def test_a_bridge_that_comes_back_late_moves_nothing_until_a_person_says_so(
    autopilot: str, gone: str
) -> None:
    fleet, _ = following(autopilot)
    if gone == "for long":
        for _ in range(1400):
            # Nobody turns the controller.
            for flight in fleet.flights:
                flight.vehicle.advance(flight.now + 0.05)
                flight.now += 0.05
    else:
        fleet.records.rebooted = True
    fleet.start()
    since_s = fleet.now
    fleet.wait(30.0)
    assert not sent_since(fleet.flights[0], since_s)
    assert fleet.custody() not in ("following", "ending", "cleared")
    if not fleet.down():
        done, _ = fleet.controller.operate(None, "land")
        assert done
        fleet.until(fleet.down, 200.0)


@both
def test_another_airframe_behind_a_system_id_has_its_own_record(autopilot: str) -> None:
    fleet, search = following(autopilot)
    fleet.controller.operate(None, "land")
    fleet.until(fleet.down)
    fleet.wait(5.0)
    assert fleet.custody() == "taken over"
    vehicle = fleet.flights[0].vehicle
    vehicle.power_cycle()
    vehicle.uid = 77
    fleet.until(lambda: fleet.custody() != "taken over", 30.0)
    assert any("another vehicle is connected" in line for line in fleet.log)
    # The parameter clears it for the first search, as one that nobody has flown.
    fleet.until(lambda: fleet.arrived(search))
    vehicle.pilot_takes_over("LAND")
    fleet.until(fleet.down)
    vehicle.uid = 1
    vehicle.power_cycle()
    fleet.wait(40.0)
    assert fleet.custody() == "taken over" and fleet.down()


@pytest.mark.parametrize("order", itertools.permutations(range(3)))
def test_messages_of_a_search_in_any_order_and_number_of_drones_end_no_turn(
    order: tuple[int, ...],
) -> None:
    fleet = VirtualFleet(2)
    search = fleet.simulate(7)
    fleet.wait(5.0)
    counts = [1, 2, 3]
    for k in order:
        info = search.agents()
        info = replace(info, agents=tuple(f"drone{i}" for i in range(counts[k])))
        fleet.controller.search.take_agents(info)
        fleet.controller.handle_news(fleet.now)
        fleet.wait(1.0)
    fleet.publish(search)
    fleet.until(lambda: fleet.arrived(search))
