# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What befalls vehicles in flight: moved homes, foreign missions, dead motors, winds, doubles."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import pytest
from autopilot.maneuvers import CarriedAway, GoTo
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from virtual_fleet import FRAME, SEARCH, VirtualFleet, pilots_mode
from virtual_flight import VirtualFlight

from dsse_ros.vehicles.autopilots import ARDUPILOT
from dsse_ros.vehicles.control.orders import FlyTrack, SearchPlace
from dsse_ros.vehicles.control.orders import GoTo as GoToPlace
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.airspace import UNKNOWN_FACTOR
from dsse_ros.vehicles.fleet.flight_record import FlightRecord
from dsse_ros.vehicles.fleet.place_watch import AWAY_M, BESIDE_M, PlaceWatch
from dsse_ros.vehicles.mavlink.messages import CommandLong, SetPositionTarget
from dsse_ros.vehicles.mission_items.separation import separation_m

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
    refused = fleet.controller.dispatchers[0].refused
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
    refused = fleet.controller.dispatchers[0].refused
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
    assert fleet.controller.dispatchers[0].lost == "taken over: its home was moved"
    since_s, highest_m = fleet.now, 0.0
    for _ in range(400):
        fleet.step()
        highest_m = max(highest_m, vehicle.craft.up_m)
    assert highest_m < 42.0
    # PX4 is left in HOLD, as without setpoints it would return.
    assert not sent_since(flight, since_s + 3.0)


# Somebody else


def send_items(flight: VirtualFlight, first: int, *, part: bool) -> None:
    """Have another ground station replace the items from a number on by as many 25 m lower."""
    items = flight.vehicle.mission.items
    lower = [replace(item, z=item.z - 25.0) for item in items[first:]]
    if part:
        begin = mavlink.MAVLink_mission_write_partial_list_message(1, 1, first, len(items) - 1)
    else:
        begin = mavlink.MAVLink_mission_count_message(1, 1, len(items))
    flight.send_from_station(begin)
    for seq, item in enumerate(lower if part else items[:first] + lower, first if part else 0):
        flight.send_from_station(item.message(seq, 0, (1, 1), current=False, floats=False))


@pytest.mark.slow
@both
@pytest.mark.parametrize("act", ["clear", "shorter", "set current", "as long", "part"])
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
    elif act == "clear":
        vehicle.mission.items.clear()
    elif autopilot == "ardupilot":
        send_items(flight, 4, part=act == "part")
    else:
        # It goes on from the item that it flies.
        vehicle.mission.items[-2] = replace(vehicle.mission.items[-2], z=15.0)
    fleet.until(lambda: fleet.custody() == "taken over", 10.0)
    since_s = fleet.now
    fleet.wait(30.0)
    assert not sent_since(flight, since_s + 0.5)


@pytest.mark.slow
@both
@pytest.mark.parametrize("restarted", [False, True])
@pytest.mark.parametrize("where", ["beside", "below"])
def test_a_vehicle_that_leaves_its_leg_or_its_layer_does_not_follow_its_drone(
    autopilot: str, where: str, restarted: bool
) -> None:
    fleet = VirtualFleet(1, autopilot, mode="mission", merge_legs=False)
    search = fleet.simulate(7, [(0, 3)])
    for action in (1, 1, SEARCH, 1, 0, 0, SEARCH, 0, 1, 1, 1):
        search.advance([action])
    fleet.finish(search)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.mission.current >= 6 and vehicle.craft.up_m > 39.0)
    if restarted:
        fleet.start()
        fleet.wait(3.0)
    assert fleet.custody() == "following"
    # No counter and no text shows it.
    here = vehicle.craft.point
    beside = here._replace(north_m=here.north_m + 60.0, up_m=40.0)
    vehicle.maneuver = GoTo(beside if where == "beside" else here._replace(up_m=15.0))
    fleet.until(lambda: fleet.custody() == "taken over", 20.0)
    assert " its leg" in fleet.controller.dispatchers[0].lost
    since_s = fleet.now
    fleet.wait(10.0)
    assert not sent_since(flight, since_s + 0.5)


@pytest.mark.slow
@both
@pytest.mark.parametrize("restarted", [False, True])
def test_a_mission_that_is_uploaded_again_unchanged_goes_on(
    autopilot: str, restarted: bool
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
    vehicle.send_text("Flight plan received")
    # Silence may hide what somebody does.
    fleet.until(lambda: fleet.flights[0].state.mission, 20.0)
    flight.loss = 1.0
    fleet.wait(7.0)
    flight.loss = 0.0
    fleet.until(lambda: flight.state.connected and flight.state.mission, 20.0)
    assert fleet.custody() == "following"
    fleet.until(fleet.down, 400.0)
    assert fleet.controller.dispatchers[0].lost is None


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


DELAYS = {"ardupilot": "DISARM_DELAY", "px4": "COM_DISARM_PRFLT"}


def losing_take_off(autopilot: str, mode: str, delay_s: int) -> VirtualFleet:
    """Return a vehicle that hears no command to take off, and disarms itself after that time."""
    options = {"parameters": ((DELAYS[autopilot], delay_s),)}
    fleet = VirtualFleet(1, autopilot, mode=mode, vehicle=options)
    vehicle = fleet.flights[0].vehicle
    commands = vehicle._handlers["COMMAND_LONG"]
    begins = {TAKE_OFF, mavlink.MAV_CMD_MISSION_START}

    def all_but_take_off(message: Any, sender: Any) -> None:
        starts = message.command == SET_MODE and vehicle.armed and mode == "mission"
        if message.command not in begins and not starts:
            commands(message, sender)

    vehicle.add_handlers({"COMMAND_LONG": all_but_take_off})
    return fleet


@both
@pytest.mark.parametrize("delay_s", [0, 60])
def test_a_person_disarms_a_vehicle_that_does_not_disarm_itself_so_soon(
    autopilot: str, delay_s: int
) -> None:
    fleet = losing_take_off(autopilot, "guided", delay_s)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    fleet.simulate(7)
    fleet.until(lambda: vehicle.armed, 60.0)
    fleet.wait(9.0)
    flight.send_from_station(CommandLong(1, 1, ARM, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    fleet.wait(3.0)
    assert fleet.custody() == "taken over"
    assert "disarmed" in fleet.controller.dispatchers[0].lost


@both
@pytest.mark.parametrize("mode", ["guided", "mission"])
@pytest.mark.parametrize("delay_s", [3, 10, 13])
def test_a_vehicle_whose_take_off_is_lost_disarms_itself_and_nobody_has_taken_it_over(
    autopilot: str, mode: str, delay_s: int
) -> None:
    fleet = losing_take_off(autopilot, mode, delay_s)
    vehicle = fleet.flights[0].vehicle
    search = fleet.simulate(7)
    if mode == "mission":
        search.advance()
        fleet.finish(search)
    fleet.until(lambda: vehicle.armed, 60.0)
    fleet.until(lambda: not vehicle.armed, 40.0)
    fleet.wait(5.0)
    assert fleet.custody() == "grounded"
    assert "it disarmed itself: its take-off was lost" in fleet.controller.dispatchers[0].lost
    assert fleet.controller.arm(None, True)[0]
    assert fleet.custody() == "cleared"


@both
def test_the_speed_of_the_bridge_is_an_item_of_its_missions(autopilot: str) -> None:
    frame = replace(FRAME, cell_size_m=200.0)
    fleet = VirtualFleet(1, autopilot, mode="mission", speed=7.0, frame=frame)
    search = fleet.simulate(7, [(0, 3)])
    for _ in range(3):
        search.advance([1])
    fleet.finish(search)
    flight = fleet.flights[0]
    vehicle, fastest_mps = flight.vehicle, 0.0

    def down() -> bool:
        nonlocal fastest_mps
        if vehicle.mode.name in ("AUTO", "MISSION"):
            fastest_mps = max(fastest_mps, vehicle.craft.ground_speed_mps)
        return fleet.down()

    fleet.until(lambda: vehicle.craft.up_m > 30.0)
    fleet.until(down, 400.0)
    assert fastest_mps == pytest.approx(7.0, abs=0.2)
    assert not flight.commands(mavlink.MAV_CMD_DO_CHANGE_SPEED)


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
    fleet.until(lambda: flight.state.identity.has_double, 25.0)
    fleet.wait(30.0)
    dispatcher = fleet.controller.dispatchers[0]
    text = "two vehicles have its system id"
    assert text in (dispatcher.lost, dispatcher.blocked)
    if when == "before":
        assert not flight.commands(ARM)
        done, why = fleet.controller.arm(None, True)
        assert not done and why == f"drone0: {text}"
        return
    assert not twin.armed
    # The one in the air comes down by itself, and nobody is taken to have taken it over.
    assert not any("taken over" in line for line in fleet.log)
    fleet.until(fleet.down, 200.0)


@pytest.mark.slow
@both
@pytest.mark.parametrize("later_s", [0.0, 0.3, 0.75])
def test_what_a_double_reports_of_its_own_mission_takes_over_nobody_on_one(
    autopilot: str, later_s: float
) -> None:
    fleet = VirtualFleet(1, autopilot, mode="mission", merge_legs=False)
    search = fleet.simulate(7, [(0, 3)])
    for _ in range(10):
        search.advance([1])
    fleet.finish(search)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.mission.current >= 3)
    fleet.wait(later_s)
    flight.add_twin(home=replace(vehicle.settings.home, lon_deg=-46.1695))
    for number in (33, 30, 42, 245, 24):
        flight._channels[1].stream(number, 0.25 if number == 33 else 1.0, flight.now)
    fleet.until(lambda: vehicle.landed and not vehicle.armed, 100.0)
    assert fleet.controller.dispatchers[0].lost == "two vehicles have its system id"


@both
@pytest.mark.parametrize("what", ["hold", "land"])
def test_an_operator_stops_the_one_in_the_air_of_two_with_one_system_id(
    autopilot: str, what: str
) -> None:
    fleet, _ = following(autopilot)
    flight = fleet.flights[0]
    flight.add_twin(home=replace(flight.vehicle.settings.home, lon_deg=-46.1695))
    fleet.until(lambda: flight.state.identity.has_double, 25.0)
    done, why = fleet.controller.operate(None, what)
    assert done and why == f"ordered to {what}: drone0"
    if what == "land":
        fleet.until(fleet.down, 200.0)
        return
    fleet.wait(30.0)
    assert fleet.custody() == "held" and flight.vehicle.craft.up_m > 30.0


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
    fleet.until(lambda: fleet.controller.dispatchers[0].lost, 20.0)
    assert fleet.controller.dispatchers[0].lost.startswith("fell to ")
    assert fleet.controller.dispatchers[0].arrived_number == -1
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
    dispatcher, vehicle = fleet.controller.dispatchers[0], fleet.flights[0].vehicle
    assert dispatcher.arrived_number == search.stamp_ns
    vehicle.craft.north_m += 80.0
    vehicle.craft.up_m -= 6.0
    fleet.until(lambda: dispatcher.arrived_number == -1, 5.0)
    fleet.until(lambda: dispatcher.arrived_number == search.stamp_ns, 60.0)
    assert not dispatcher.lost


@both
def test_one_that_the_wind_carries_off_is_out_at_once_and_the_others_go_on(autopilot: str) -> None:
    fleet, search = following(autopilot, 2, fence_margin=60.0)
    search.advance([2, 1])
    fleet.publish(search)
    fleet.wait(1.0)
    vehicle = fleet.flights[0].vehicle
    begun_s = fleet.now
    while not fleet.controller.dispatchers[0].lost:
        target = vehicle.maneuver.target or vehicle.craft.point
        vehicle.maneuver = CarriedAway(target, 6.0, 0.0)
        fleet.step()
        assert fleet.now - begun_s < 80.0, fleet.shown()
    assert fleet.controller.dispatchers[0].lost.startswith(
        "outside the fence: place must be within"
    )
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    assert not fleet.controller.dispatchers[1].lost


@both
@pytest.mark.parametrize("where", ["beside", "above"])
def test_a_vehicle_that_strays_from_its_leg_or_layer_in_guided_is_warned_of(
    autopilot: str, where: str
) -> None:
    fleet, search = following(autopilot, frame=replace(FRAME, cell_size_m=130.0))
    search.advance([1])
    fleet.publish(search)
    fleet.wait(3.0)
    vehicle, dispatcher = fleet.flights[0].vehicle, fleet.controller.dispatchers[0]
    begun_s, here = fleet.now, vehicle.craft.point
    while not dispatcher.strays:
        assert fleet.now - begun_s < 20.0, fleet.shown()
        fleet.step()
        if where == "beside":
            vehicle.craft.north_m, vehicle.craft.east_m = here.north_m - 90.0, here.east_m
        else:
            vehicle.craft.up_m = 58.0
    assert f" m {where} its leg" in dispatcher.off_plan
    assert any(f"warning: drone0 {dispatcher.strays.split()[0]}" in line for line in fleet.log)
    # A wind may have done it.
    assert fleet.custody() == "following" and not dispatcher.lost


ABOUT = (-24.0, -46.0)


@settings(max_examples=300)
@given(
    st.sampled_from(["goto", "track", "search"]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 150.0),
    st.floats(-30.0, 30.0),
    st.floats(0.0, 12.0),
)
def test_who_is_how_far_off_its_leg_strays_and_not_before_that_lasts(
    kind: str, along: float, beside_m: float, above_m: float, speed_mps: float
) -> None:
    def place(north_m: float, east_m: float) -> tuple[float, float]:
        return ABOUT[0] + north_m / 110_745.0, ABOUT[1] + east_m / 101_750.0

    end = place(400.0, 0.0)
    order: Order = {
        "goto": GoToPlace(*end, 40.0, 10.0),
        "track": FlyTrack((ABOUT, end), place(430.0, 0.0), 40.0, max(speed_mps, 0.1)),
        "search": SearchPlace(*end, 40.0, 15.0, 5.0, 10.0),
    }[kind]
    watch = PlaceWatch()
    begin = VehicleState(
        mode="GUIDED", lat_deg=ABOUT[0], lon_deg=ABOUT[1], alt_amsl_m=40.0, speed_mps=speed_mps
    )
    assert watch.strays(order, begin, 0.0, ARDUPILOT) is None
    lat_deg, lon_deg = place(60.0 + 280.0 * along, beside_m)
    there = replace(begin, lat_deg=lat_deg, lon_deg=lon_deg, alt_amsl_m=40.0 + above_m)
    assert watch.strays(order, there, 1.0, ARDUPILOT) is None
    strays = watch.strays(order, there, 7.0, ARDUPILOT)
    limit_m = BESIDE_M + speed_mps**2 / 4.0
    if abs(beside_m - limit_m) > 1.0 and abs(abs(above_m) - AWAY_M) > 0.1:
        assert bool(strays) == (beside_m > limit_m or abs(above_m) > AWAY_M)


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
    assert orders and not fleet.controller.dispatchers[0].lost


def test_a_look_that_is_done_is_not_done_again_by_a_restarted_bridge() -> None:
    fleet, search = following("ardupilot", search_altitude=15.0)
    search.advance([4])
    fleet.publish(search)
    dispatcher = fleet.controller.dispatchers[0]
    fleet.until(lambda: dispatcher.custody.record.looked == search.stamp_ns)
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
    assert fleet.controller.dispatchers[0].blocked == "waiting for drone1 to be out of the way"
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
    assert "out of the way" in fleet.controller.dispatchers[0].blocked
    pilot.craft.north_m += 1000.0
    fleet.until(lambda: fleet.arrived(search), 200.0)


# Motors that stop in the air


PHASES = ("climb", "arrived", "mission", "return", "hold", "pilot", "free")


@both
@pytest.mark.parametrize("phase", PHASES)
def test_motors_that_stop_in_the_air_are_a_crash_whoever_controls_the_vehicle(
    autopilot: str, phase: str
) -> None:
    fleet = VirtualFleet(1, autopilot, mode="mission" if phase == "mission" else "guided")
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    search = fleet.simulate(7)
    if phase == "mission":
        for _ in range(6):
            search.advance()
        fleet.finish(search)
    fleet.until(lambda: vehicle.craft.up_m > (20.0 if phase == "climb" else 37.0))
    dispatcher = fleet.controller.dispatchers[0]
    if phase not in ("climb", "mission"):
        fleet.until(lambda: fleet.arrived(search))
    if phase in ("return", "hold"):
        fleet.controller.operate(None, phase)
    elif phase == "pilot":
        vehicle.pilot_takes_over(pilots_mode(fleet.flights[0]))
    elif phase == "free":
        dispatcher.custody.record = FlightRecord(search=dispatcher.custody.search)
    fleet.wait(3.0)
    stopped_up_m = vehicle.craft.up_m
    flight.send_from_station(CommandLong(1, 1, ARM, 0, 0.0, 21196.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    fleet.until(lambda: fleet.custody() == "crashed", 2.0)
    assert vehicle.craft.up_m > 1.0
    assert dispatcher.lost.startswith("crashed: ")
    # PX4 moves its home to where it is disarmed.
    height_m = float(dispatcher.lost.removesuffix(" m above home").split()[-1])
    assert abs(height_m - stopped_up_m) < 6.0
    assert any(f"drone0 is lost: {dispatcher.lost}" in line for line in fleet.log)
    assert flight.outcome.status != "done" or phase in ("arrived", "hold", "free")
    assert (
        phase in ("arrived", "return", "hold", "pilot", "free") or dispatcher.arrived_number == -1
    )
    fleet.wait(10.0)
    since_s = fleet.now
    assert fleet.custody() == "crashed"
    # PX4 arms in OFFBOARD as long as setpoints come, and climbs to them.
    flight.send_from_station(CommandLong(1, 1, ARM, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    fleet.wait(20.0)
    assert not sent_since(flight, since_s)
    # In MISSION, whoever arms it has it fly.
    assert vehicle.craft.up_m < 1.0 or phase == "mission"
    assert fleet.custody() == ("taken over" if vehicle.armed else fleet.custody())


@both
@pytest.mark.parametrize("later_s", [0.4, 0.8, 1.8])
def test_a_vehicle_that_is_armed_again_as_it_falls_says_so_and_not_that_its_home_was_moved(
    autopilot: str, later_s: float
) -> None:
    fleet, _ = following(autopilot)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    flight.send_from_station(CommandLong(1, 1, ARM, 0, 0.0, 21196.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    # The next heartbeat shows it; both move their homes along.
    fleet.until(lambda: not flight.state.armed, 2.0)
    fleet.wait(later_s)
    since_s = fleet.now
    flight.send_from_station(CommandLong(1, 1, ARM, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    fleet.until(lambda: flight.state.armed, 2.0)
    assert vehicle.craft.up_m > 10.0
    fleet.wait(5.0)
    assert fleet.custody() == "taken over"
    lost = fleet.controller.dispatchers[0].lost
    mode = "HOLD" if autopilot == "px4" else "GUIDED"
    assert lost.startswith("crashed: its motors stopped ")
    assert lost.endswith(f" m above home; armed by somebody else, in {mode}")
    assert not sent_since(flight, since_s)
    if autopilot == "px4":
        # It has noticed that it flies again.
        assert fleet.controller.operate(None, "hold")[0] and fleet.custody() == "held"


def test_a_crashed_vehicle_is_cleared_alone_and_not_with_the_fleet() -> None:
    fleet, _ = following("ardupilot")
    fleet.flights[0].vehicle.disarm()
    fleet.until(lambda: fleet.custody() == "crashed", 3.0)
    fleet.wait(10.0)
    done, text = fleet.controller.arm(None, True)
    assert not done and text == "drone0: it has crashed: drone<i>/arm alone clears it"
    assert fleet.controller.arm(0, True)[0] and fleet.custody() == "cleared"


@both
def test_a_person_who_flies_a_grounded_vehicle_has_it(autopilot: str) -> None:
    fleet, search = following(autopilot)
    vehicle = fleet.flights[0].vehicle
    fleet.finish(search)
    fleet.until(lambda: fleet.custody() == "grounded")
    fleet.wait(5.0)
    vehicle.set_mode(type(vehicle.mode)["HOLD" if autopilot == "px4" else "GUIDED"])
    vehicle.arm(force=True)
    fleet.until(lambda: fleet.custody() == "taken over", 2.0)


# Modes


@pytest.mark.parametrize("later_s", [0.05, 0.3, 0.55])
def test_a_hold_by_a_pilot_counts_before_a_heartbeat_has_shown_the_bridges_mode(
    later_s: float,
) -> None:
    fleet = VirtualFleet(1, "px4")
    fleet.simulate(7)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.mode.name == "OFFBOARD")
    fleet.wait(later_s)
    vehicle.pilot_takes_over("HOLD")
    since_s = fleet.now
    fleet.wait(15.0)
    assert vehicle.mode.name == "HOLD" and fleet.custody() == "taken over"
    modes = [message for message in sent_since(flight, since_s) if isinstance(message, CommandLong)]
    assert not modes


@pytest.mark.parametrize("planner_timeout", [5.0, 11.0])
def test_a_vehicle_that_is_to_hold_as_its_link_comes_back_holds(planner_timeout: float) -> None:
    fleet, _ = following("px4", planner_timeout=planner_timeout)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    fleet.wait(2.0)
    flight.loss = 1.0
    fleet.wait(10.0)
    assert vehicle.mode.name == "RTL"
    flight.loss = 0.0
    fleet.until(lambda: vehicle.mode.name == "HOLD", 10.0)
    fleet.wait(5.0)
    assert fleet.custody() == "following" and not fleet.controller.dispatchers[0].lost


@pytest.mark.slow
@pytest.mark.parametrize("only_uplink", [False, True])
@pytest.mark.parametrize("cut_s", [3.0, 10.0])
@pytest.mark.parametrize("does", ["leg", "place", "hold", "holds", "to hold"])
def test_a_cut_link_has_the_same_end_for_one_that_holds_as_for_one_on_its_way(
    does: str, cut_s: float, only_uplink: bool
) -> None:
    frame = replace(FRAME, cell_size_m=200.0)
    fleet, search = following("px4", frame=frame, planner_timeout=0.0)
    flight, vehicle = fleet.flights[0], fleet.flights[0].vehicle
    if does == "leg":
        search.advance([1])
        fleet.publish(search)
        fleet.wait(4.0)
    elif does in ("hold", "holds"):
        # As the link is cut, it has just been ordered to, or does.
        fleet.controller.operate(None, "hold")
        fleet.wait(0.1 if does == "hold" else 8.0)
    if only_uplink:
        flight.uplink = False
    else:
        flight.loss = 1.0
    fleet.wait(1.0)
    if does == "to hold":
        fleet.controller.operate(None, "hold")
    fleet.wait(cut_s - 1.0)
    flight.uplink, flight.loss = True, 0.0
    fleet.wait(15.0)
    # What lacks setpoints for longer than 5 s while it is heard is in its own failsafe.
    gone = only_uplink and cut_s > 5.0 and does not in ("hold", "holds")
    if gone:
        assert fleet.custody() == "failsafe" and vehicle.mode.name == "RTL"
        return
    assert not fleet.controller.dispatchers[0].lost
    holds = does in ("hold", "holds", "to hold")
    assert vehicle.mode.name == ("HOLD" if holds else "OFFBOARD")
    assert fleet.custody() == ("held" if holds else "following")


# Operators


@both
@pytest.mark.parametrize("what", ["hold", "return", "land"])
def test_an_operator_stops_what_a_pilot_flies(autopilot: str, what: str) -> None:
    fleet, _ = following(autopilot)
    vehicle = fleet.flights[0].vehicle
    vehicle.pilot_takes_over(pilots_mode(fleet.flights[0]))
    fleet.until(lambda: fleet.custody() == "taken over", 5.0)
    done, text = fleet.controller.operate(0, what)
    assert done and text == f"ordered to {what}: drone0"
    if what != "hold":
        fleet.until(fleet.down)
        return
    fleet.until(lambda: fleet.flights[0].outcome.status == "done", 20.0)
    assert fleet.custody() == "held"
    # The pilot has the last word.
    vehicle.pilot_takes_over(pilots_mode(fleet.flights[0]))
    fleet.until(lambda: fleet.custody() == "taken over", 5.0)
    since_s = fleet.now
    fleet.wait(20.0)
    assert not sent_since(fleet.flights[0], since_s)


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
    assert done and text == "kept on the ground: drone0"
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
