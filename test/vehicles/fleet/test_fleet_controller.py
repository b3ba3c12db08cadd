# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles follow searches for which a person has cleared them, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest
from virtual_fleet import FRAME, SEARCH, VirtualFleet, pilots_mode, with_settings

from dsse_ros.vehicles.mavlink.messages import CommandLong, SetPositionTarget

ARM, SET_MODE = 400, 176
both = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])


def commands(fleet: VirtualFleet, number: int, since_s: float = 0.0, i: int = 0) -> int:
    return sum(
        isinstance(message, CommandLong) and message.command == number
        for now_s, message in fleet.flights[i].sent
        if now_s > since_s
    )


def moved(fleet: VirtualFleet, since_s: float) -> bool:
    """Whether anything was sent that moves a vehicle or may."""
    return any(
        isinstance(message, SetPositionTarget)
        or (isinstance(message, CommandLong) and message.command in (ARM, SET_MODE, 22, 300))
        for flight in fleet.flights
        for now_s, message in flight.sent
        if now_s > since_s
    )


def flown(autopilot: str = "ardupilot", vehicles: int = 1, **options: object) -> VirtualFleet:
    """Return a fleet whose search is over and whose vehicles are down again."""
    fleet = VirtualFleet(vehicles, autopilot, **options)  # type: ignore[arg-type]
    search = fleet.simulate(7)
    fleet.fly(search, 2)
    fleet.until(lambda: fleet.arrived(search))
    fleet.finish(search)
    fleet.until(fleet.down)
    fleet.wait(10.0)
    assert fleet.controller.finished
    return fleet


@pytest.mark.slow
@both
def test_a_search_is_flown_to_its_end_and_the_vehicles_land(autopilot: str) -> None:
    fleet = flown(autopilot, 2)
    assert [fleet.custody(i) for i in range(2)] == ["grounded"] * 2
    assert not any(one.lost for one in fleet.controller.dispatchers)


@pytest.mark.slow
@both
@pytest.mark.parametrize("restart", ["sim", "reset", "bridge", "both"])
def test_a_second_search_waits_for_a_person(autopilot: str, restart: str) -> None:
    fleet = flown(autopilot)
    since_s = fleet.now
    (search,) = fleet.searches
    if restart in ("sim", "both"):
        fleet.end(search)
        fleet.wait(1.0)
    if restart in ("bridge", "both"):
        fleet.start()
    if restart in ("sim", "both"):
        search = fleet.simulate(8)
    elif restart == "reset":
        search.reset()
        fleet.publish(search)
    fleet.wait(40.0)
    assert not moved(fleet, since_s)
    assert fleet.down()
    if restart == "bridge":
        return
    assert "~/arm" in fleet.controller.dispatchers[0].blocked
    done, text = fleet.controller.arm(None, True)
    assert done and text == "cleared to fly: drone0"
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))


@both
@pytest.mark.parametrize("restart", ["sim", "bridge"])
def test_who_holds_after_a_search_holds_on_whatever_is_started_again(
    autopilot: str, restart: str
) -> None:
    fleet = VirtualFleet(1, autopilot, at_end="hold")
    search = fleet.simulate(7)
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    fleet.finish(search)
    fleet.wait(10.0)
    flight = fleet.flights[0]
    craft, starts = flight.vehicle.craft, [commands(fleet, number) for number in (ARM, 22)]
    place = (craft.north_m, craft.east_m)
    if restart == "sim":
        fleet.end(search)
        fleet.wait(1.0)
        fleet.simulate(8)
    else:
        fleet.start()
    fleet.wait(40.0)
    assert flight.off_m(*place) < 3.0 and craft.up_m > 35.0
    assert [commands(fleet, number) for number in (ARM, 22)] == starts


@pytest.mark.slow
@both
def test_with_arm_always_each_search_is_flown(autopilot: str) -> None:
    fleet = flown(autopilot, arm="always")
    (search,) = fleet.searches
    search.reset()
    fleet.publish(search)
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))


@pytest.mark.slow
@both
@pytest.mark.parametrize("restart", ["sim", "bridge", "both", ""])
@pytest.mark.parametrize("arm", ["true", "always"])
def test_who_was_landed_by_a_pilot_stays_down(autopilot: str, restart: str, arm: str) -> None:
    fleet = VirtualFleet(1, autopilot, arm=arm)
    search = fleet.simulate(7)
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    fleet.flights[0].vehicle.pilot_takes_over("LAND")
    fleet.until(lambda: fleet.controller.dispatchers[0].lost, 5.0)
    assert fleet.controller.dispatchers[0].lost.startswith("taken over: in LAND")
    assert "info: drone0: following -> taken over: in LAND" in fleet.log
    fleet.until(fleet.down)
    fleet.wait(5.0)
    since_s = fleet.now
    if restart in ("sim", "both"):
        fleet.end(search)
        fleet.wait(1.0)
    if restart in ("bridge", "both"):
        fleet.start()
    if restart in ("sim", "both"):
        fleet.simulate(8)
    else:
        search.reset()
        fleet.publish(search)
    fleet.wait(40.0)
    assert not moved(fleet, since_s) and fleet.custody() == "taken over"


@both
def test_a_disarm_by_a_person_before_the_take_off_is_theirs(autopilot: str) -> None:
    fleet = VirtualFleet(1, autopilot)
    fleet.simulate(7)
    vehicle = fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.armed)
    vehicle.disarm()
    armings = commands(fleet, ARM)
    fleet.wait(60.0)
    assert commands(fleet, ARM) == armings and fleet.down()
    assert fleet.custody() == "taken over"
    assert "disarmed on the ground" in fleet.controller.dispatchers[0].lost


@pytest.mark.slow
@both
@pytest.mark.parametrize("found", [True, False])
def test_a_mode_that_a_pilot_holds_on_the_ground_is_kept(autopilot: str, found: bool) -> None:
    fleet = VirtualFleet(1, autopilot, vehicle={"ready_s": 20.0})
    vehicle = fleet.flights[0].vehicle
    mode = pilots_mode(fleet.flights[0])
    if found:
        vehicle.pilot_takes_over(mode)
    fleet.simulate(7)
    fleet.wait(12.0)
    vehicle.pilot_takes_over(mode)
    fleet.wait(60.0)
    assert vehicle.mode.name == mode and not vehicle.armed
    assert not commands(fleet, ARM)


@pytest.mark.slow
@both
def test_a_flight_of_somebody_else_after_the_end_is_left_alone(autopilot: str) -> None:
    for again in (False, True):
        fleet = flown(autopilot)
        if again:
            fleet.start()
            fleet.wait(5.0)
        vehicle, since_s = fleet.flights[0].vehicle, fleet.now
        if autopilot == "px4":
            vehicle.request_mode(4, 3)
        else:
            vehicle.request_mode(4, 0)
        assert vehicle.arm(force=False) == 0
        vehicle.maneuver = vehicle.take_off(30.0)
        fleet.wait(60.0)
        assert vehicle.craft.up_m > 25.0
        assert not moved(fleet, since_s)


@both
def test_a_pilots_hold_in_the_climb_is_his(autopilot: str) -> None:
    if autopilot == "ardupilot":
        pytest.skip("ArduCopter climbs in the mode in which it waits")
    fleet = VirtualFleet(1, autopilot)
    fleet.simulate(7)
    vehicle = fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.craft.up_m > 15.0)
    vehicle.pilot_takes_over("HOLD")
    fleet.until(lambda: fleet.custody() == "taken over", 5.0)
    since_s = fleet.now
    fleet.wait(60.0)
    assert not moved(fleet, since_s) and vehicle.mode.name == "HOLD"


@pytest.mark.slow
@both
@pytest.mark.parametrize("seconds", [4.0, 12.0, 40.0])
def test_after_a_silence_a_vehicle_goes_on_or_is_left_on_its_own_way_home(
    autopilot: str, seconds: float
) -> None:
    fleet = VirtualFleet(1, autopilot, lost_timeout=30.0)
    search = fleet.simulate(7)
    fleet.fly(search, 2)
    fleet.until(lambda: fleet.arrived(search))
    flight = fleet.flights[0]
    put = flight._put
    flight._put = lambda data, *, to_vehicle: None  # type: ignore[method-assign]
    fleet.wait(seconds)
    flight._put = put  # type: ignore[method-assign]
    since_s, up_m = fleet.now, [flight.vehicle.craft.up_m]
    for _ in range(900):
        fleet.step()
        up_m.append(flight.vehicle.craft.up_m)
    lost = fleet.controller.dispatchers[0].lost
    if seconds > 30.0:
        where = "nothing from system 1 on udpin:127.0.0.1:14541"
        assert lost == f"link lost: no heartbeat for 30 s: {where}"
        assert not flight.setpoints() or all(
            now_s < since_s or not isinstance(message, SetPositionTarget)
            for now_s, message in flight.sent
        )
        # It only ever comes down.
        assert max(up_m) < up_m[0] + 5.0 or autopilot == "px4"
        fleet.until(fleet.down)
    else:
        assert not lost
        fleet.fly(search, 1)
        fleet.until(lambda: fleet.arrived(search))


def test_a_vehicle_that_is_never_heard_is_waited_for_and_lost_by_its_connection() -> None:
    fleet = VirtualFleet(1, "ardupilot", join_timeout=30.0)
    fleet.flights[0]._put = lambda data, *, to_vehicle: None  # type: ignore[method-assign]
    fleet.simulate(7)
    fleet.wait(10.0)
    where = "nothing from system 1 on udpin:127.0.0.1:14541"
    dispatcher = fleet.controller.dispatchers[0]
    assert dispatcher.blocked == f"no heartbeat: {where}"
    fleet.wait(30.0)
    assert dispatcher.lost == f"no heartbeat within 30 s: {where}"


@both
def test_an_order_from_before_a_lost_link_is_not_taken_up_after_it(autopilot: str) -> None:
    fleet = VirtualFleet(1, autopilot, lost_timeout=10.0)
    search = fleet.simulate(7)
    fleet.fly(search, 2)
    fleet.wait(1.0)
    flight = fleet.flights[0]
    put = flight._put
    flight._put = lambda data, *, to_vehicle: None  # type: ignore[method-assign]
    fleet.wait(12.0)
    flight._put = put  # type: ignore[method-assign]
    since_s = flight.now
    # The program looks at its vehicles late.
    flight.wait(5.0)
    assert flight.state.connected and flight.state.flying
    assert not [
        message
        for now_s, message in flight.sent
        if now_s > since_s and isinstance(message, SetPositionTarget)
    ]
    fleet.until(fleet.down)


@both
def test_a_battery_failsafe_is_left_alone_and_named(autopilot: str) -> None:
    faults = (fault("battery", 30.0),)
    fleet = VirtualFleet(1, autopilot, vehicle={"faults": faults})
    search = fleet.simulate(7)
    fleet.until(lambda: fleet.flights[0].vehicle.failsafes)
    since_s = fleet.now
    fleet.until(lambda: fleet.controller.dispatchers[0].lost, 20.0)
    fleet.until(lambda: fleet.controller.dispatchers[0].lost == "battery failsafe", 5.0)
    fleet.until(fleet.down)
    assert not commands(fleet, SET_MODE, since_s) and search.over


def fault(kind: str, at_s: float, value: str = "") -> object:
    from autopilot.faults import Fault

    return Fault(kind, at_s, value=value, since_airborne=True)


@both
@pytest.mark.parametrize("what", ["hold", "return", "land"])
def test_an_answer_does_not_say_that_a_vehicle_on_the_ground_was_ordered_to_move(
    autopilot: str, what: str
) -> None:
    fleet = VirtualFleet(2, autopilot)
    fleet.wait(3.0)
    answer = fleet.controller.operate(None, what)
    assert answer == (True, "kept on the ground: drone0, drone1")


@pytest.mark.slow
@both
@pytest.mark.parametrize("what", ["hold", "return", "land"])
def test_an_operator_is_obeyed_also_when_the_search_is_gone(autopilot: str, what: str) -> None:
    fleet = VirtualFleet(1, autopilot)
    search = fleet.simulate(7)
    fleet.fly(search, 1)
    fleet.wait(3.0)
    fleet.end(search)
    done, text = fleet.controller.operate(0, what)
    assert done and text == f"ordered to {what}: drone0"
    if what == "hold":
        fleet.wait(30.0)
        vehicle = fleet.flights[0].vehicle
        assert vehicle.craft.ground_speed_mps < 0.5 and vehicle.armed
        assert fleet.custody() == "held"
        return
    fleet.until(fleet.down)
    fleet.wait(5.0)
    since_s = fleet.now
    fleet.simulate(8)
    fleet.wait(30.0)
    assert not moved(fleet, since_s) and fleet.custody() == "taken over"


@pytest.mark.slow
@both
def test_a_search_of_another_simulation_is_not_followed_in_the_air(autopilot: str) -> None:
    fleet = VirtualFleet(1, autopilot)
    search = fleet.simulate(7)
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    other = fleet.simulate(8, [(0, 0)])
    fleet.wait(20.0)
    assert fleet.controller.trouble(fleet.now).startswith("2 nodes publish step_report")
    assert fleet.controller.search.info.run_id == 7
    fleet.end(search)
    fleet.wait(60.0)
    assert "in the air for run 7" in fleet.controller.trouble(fleet.now)
    why = "warning: drone0 is in the air for run 7: another one waits until it is down"
    assert fleet.log.count(why) == 1
    assert fleet.controller.search.info.run_id == 7
    assert fleet.controller.holding
    fleet.controller.operate(None, "land")
    fleet.until(fleet.down)
    fleet.until(lambda: fleet.controller.search.info.run_id == 8)
    assert fleet.controller.arm(None, True)[0]
    fleet.fly(other, 1)
    fleet.until(lambda: fleet.arrived(other))


@both
@pytest.mark.parametrize("restarted", [False, True])
def test_a_search_far_away_is_never_flown_to(autopilot: str, restarted: bool) -> None:
    from dataclasses import replace

    fleet = VirtualFleet(1, autopilot)
    search = fleet.simulate(7)
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    fleet.end(search)
    if restarted:
        fleet.start()
        fleet.records.written.clear()
        fleet.start()
    far = replace(fleet.frame, origin_lat_deg=-22.99, origin_lon_deg=-43.99)
    fleet.simulate(8, frame=far)
    fleet.controller.arm(0, True)
    since_s = fleet.now
    fleet.wait(60.0)
    north_m = fleet.flights[0].vehicle.craft.north_m
    assert abs(north_m) < 500.0
    assert all(
        abs(message.lat_deg + 24.04) < 0.1
        for now_s, message in fleet.flights[0].sent
        if now_s > since_s and isinstance(message, SetPositionTarget)
    )


@both
@pytest.mark.parametrize("up_m", [12.0, 30.0])
def test_a_bridge_started_again_in_the_climb_goes_on_straight_up(
    autopilot: str, up_m: float
) -> None:
    fleet = VirtualFleet(1, autopilot)
    search = fleet.simulate(7, [(3, 0)])
    vehicle = fleet.flights[0].vehicle
    fleet.until(lambda: vehicle.craft.up_m > up_m)
    fleet.start()
    while not fleet.arrived(search):
        fleet.step()
        craft = vehicle.craft
        away_m = (craft.north_m**2 + craft.east_m**2) ** 0.5
        assert away_m < 3.0 or craft.up_m > 35.0
        assert fleet.now < 300.0


def test_nothing_takes_off_before_everything_can_fly() -> None:
    fleet = VirtualFleet(2)
    fleet.flights[1].vehicle.settings = fleet.flights[1].vehicle.settings.__class__(
        **{**vars(fleet.flights[1].vehicle.settings), "ready_s": 40.0}
    )
    search = fleet.simulate(7)
    search.commanded = False
    fleet.publish(search)
    fleet.wait(30.0)
    assert not any(commands(fleet, ARM, i=i) for i in range(2))
    assert "waiting for drone1" in fleet.controller.dispatchers[0].blocked or (
        "planner" in fleet.controller.dispatchers[0].blocked
    )
    fleet.wait(30.0)
    assert not any(commands(fleet, ARM, i=i) for i in range(2))
    assert fleet.controller.dispatchers[0].blocked == "waiting for the first commands of a planner"
    search.commanded = True
    fleet.publish(search)
    fleet.until(lambda: all(one.vehicle.armed for one in fleet.flights), 10.0)


def test_vehicles_that_get_ready_together_never_wait_for_each_other() -> None:
    fleet = VirtualFleet(2)
    fleet.publish(fleet.simulate(7))
    fleet.until(lambda: all(one.vehicle.armed for one in fleet.flights), 10.0)
    assert "info: drone0 waits: waiting for drone1: not ready" in "\n".join(fleet.log)
    assert not any("waiting for drone0: waiting for" in line for line in fleet.log)


@pytest.mark.slow
def test_latched_reports_are_drained_before_one_is_followed() -> None:
    fleet = VirtualFleet(2)
    search = fleet.simulate(7)
    fleet.fly(search, 3)
    fleet.until(lambda: fleet.arrived(search))
    fleet.start()
    controller = fleet.controller
    # A thousand steps that were kept, a few in each turn.
    for step in range(300):
        search.advance()
        controller.search.take_report(search.stamp_ns, search.last, fleet.now)
        controller.handle_news(fleet.now)
        if step % 3 == 0:
            fleet.step()
    fleet.log.clear()
    fleet.until(lambda: fleet.arrived(search))
    # After a search comes the climb.
    searched = int((search.last["action"] == SEARCH).sum())
    assert sum(": order " in line for line in fleet.log) == 2 + searched


@both
@pytest.mark.parametrize("after_s", [0.05, 0.2, 0.5, 1.0, 1.5, 2.0])
def test_a_bridge_started_again_as_motors_start_abandons_nobody_in_the_air(
    autopilot: str, after_s: float
) -> None:
    fleet = VirtualFleet(1, autopilot)
    fleet.simulate(7)
    flight = fleet.flights[0]
    fleet.until(lambda: bool(flight.commands(ARM)))
    fleet.wait(after_s)
    fleet.start()
    fleet.wait(60.0)
    flies = fleet.custody() == "following" and flight.vehicle.craft.up_m > 30.0
    assert flies or (flight.vehicle.landed and not flight.vehicle.armed)


@both
def test_who_disarms_what_was_to_take_off_while_no_bridge_is_there_is_obeyed(
    autopilot: str,
) -> None:
    fleet = VirtualFleet(1, autopilot)
    fleet.simulate(7)
    flight = fleet.flights[0]
    fleet.until(lambda: flight.vehicle.armed)
    flight.vehicle.disarm()
    fleet.start()
    since = len(flight.commands(ARM))
    fleet.wait(60.0)
    assert len(flight.commands(ARM)) == since and not flight.vehicle.armed
    assert fleet.custody() == "taken over"


@pytest.mark.slow
def test_on_a_mission_each_starts_when_those_above_are_up_and_lands_after_those_below() -> None:
    fleet = VirtualFleet(3, mode="mission")
    search = fleet.simulate(7)
    for _ in range(4):
        search.advance()
    search.advance([SEARCH] * 3)
    fleet.finish(search)
    armed: list[int] = []
    landed: list[int] = []
    fleet.until(lambda: fleet.flights[0].vehicle.armed)
    while len(landed) < 3:
        fleet.step()
        for i, flight in enumerate(fleet.flights):
            if flight.vehicle.armed and i not in armed:
                armed.append(i)
                above = [other.vehicle.craft.up_m for other in fleet.flights[:i]]
                assert all(up_m > 30.0 for up_m in above)
            if i in armed and not flight.vehicle.armed and i not in landed:
                landed.append(i)
        assert fleet.now < 900.0, fleet.shown()
    assert armed == [0, 1, 2]
    fleet.wait(2.0)
    assert fleet.controller.finished
    assert not any(one.lost for one in fleet.controller.dispatchers)


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_mission_that_was_held_does_not_go_on_and_no_answer_says_that_it_does(
    autopilot: str,
) -> None:
    fleet = VirtualFleet(1, autopilot, mode="mission")
    search = fleet.simulate(7)
    for _ in range(4):
        search.advance()
    fleet.finish(search)
    flight = fleet.flights[0]
    fleet.until(lambda: flight.vehicle.craft.up_m > 20.0)
    for what, custody in (("hold", "held"), ("return", "recalled")):
        assert fleet.controller.operate(0, what)[0]
        fleet.wait(20.0)
        refused = "drone0: in the air, and its mission does not go on: clear it once it is down"
        assert fleet.controller.arm(0, data=True) == (False, refused)
        fleet.wait(5.0)
        assert fleet.custody() == custody
    fleet.until(lambda: not flight.vehicle.armed)
    fleet.wait(5.0)
    assert fleet.controller.finished
    assert fleet.controller.arm(0, data=True) == (True, "cleared for the next search: drone0")
    fleet.wait(20.0)
    assert fleet.custody() == "cleared" and not flight.vehicle.armed
    fleet.end(search)
    fleet.finish(fleet.simulate(8))
    fleet.until(lambda: flight.vehicle.armed)


@pytest.mark.slow
@pytest.mark.parametrize(("autopilot", "alt_m"), [("ardupilot", 20.0), ("px4", 35.0)])
def test_a_layer_is_left_on_the_way_home_only_after_a_warning(autopilot: str, alt_m: float) -> None:
    fleet = VirtualFleet(3, autopilot, frame=replace(FRAME, alt_m=alt_m), search_altitude=10.0)
    search = fleet.simulate(7, [(1, 1), (2, 2), (3, 1)])
    fleet.until(lambda: fleet.arrived(search))
    fleet.controller.operate(None, "return")
    tops_m = fleet.tops_m_until_down()
    warned = [line for line in fleet.log if "altitude must be at least" in line]
    lowest_m, return_m = alt_m - 10.0, alt_m - 5.0
    assert len(warned) == 1
    assert (
        f"drone2: altitude must be at least {return_m:g} m above home, the vehicle's RTL_"
        in warned[0]
    )
    assert warned[0].endswith(f"got {lowest_m:g} m")
    leaves = [dispatcher.leaves_layer for dispatcher in fleet.controller.dispatchers]
    assert leaves[:2] == [None, None] and leaves[2] and leaves[2] in warned[0]
    assert tops_m == pytest.approx([alt_m, return_m, return_m], abs=1.0)


@pytest.mark.slow
def test_a_climb_that_begins_every_return_is_warned_of_in_any_layer() -> None:
    fleet = VirtualFleet(3, search_altitude=10.0)
    fleet.flights[1].vehicle.parameters["RTL_CLIMB_MIN"] = 700.0
    search = fleet.simulate(7, [(1, 1), (2, 2), (3, 1)])
    fleet.until(lambda: fleet.arrived(search))
    fleet.controller.operate(None, "return")
    top_m = fleet.tops_m_until_down()[1]
    assert [line for line in fleet.log if "to return in" in line] == [
        "warning: drone1: the vehicle's RTL_CLIMB_MIN or RTL_CLIMB_MIN_M must be 0 to return in "
        "its own layer, got 7 m"
    ]
    assert top_m == pytest.approx(FRAME.alt_m - 5.0 + 7.0, abs=1.0)


def test_one_vehicle_alone_may_return_above_its_altitude() -> None:
    fleet = VirtualFleet(1, "px4", frame=replace(FRAME, alt_m=20.0), search_altitude=10.0)
    search = fleet.simulate(7)
    fleet.until(lambda: fleet.arrived(search))
    assert fleet.flights[0].state.return_alt_m == 30.0
    assert not any("altitude must be" in line for line in fleet.log)


def test_a_search_that_cannot_be_flown_ends_the_flights_of_the_one_before() -> None:
    fleet = VirtualFleet(1)
    search = fleet.simulate(7)
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    search.reset()
    search.frame = replace(search.frame, grid_size=500)
    fleet.publish(search)
    fleet.wait(2.0)
    assert "fence_radius" in fleet.controller.trouble(fleet.now)
    fleet.until(fleet.down)


def test_a_defect_about_one_vehicle_leaves_the_others_flying() -> None:
    fleet = VirtualFleet(2)
    search = fleet.simulate(7)
    fleet.until(lambda: fleet.arrived(search))

    def fail(*_: object) -> None:
        raise RuntimeError("broken")

    fleet.controller.dispatchers[0]._wanted = fail  # type: ignore[method-assign, assignment]
    fleet.until(lambda: search.terminated[0], 5.0)
    assert fleet.controller.dispatchers[0].lost == "defect: RuntimeError: broken"
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    assert sum("broken" in line for line in fleet.log if line.startswith("error")) <= 2


def test_a_state_directory_that_fails_is_reported_until_it_works_again() -> None:
    fleet = VirtualFleet(1)
    search = fleet.simulate(7)
    update = fleet.records.update
    full = OSError(28, "No space left on device", "/state")

    def fail(*_: object) -> None:
        raise full

    fleet.records.update = fail  # type: ignore[method-assign]
    fleet.until(lambda: fleet.arrived(search))
    trouble = "state_directory: '/state': No space left on device"
    assert fleet.controller.trouble(fleet.now).startswith(f"{trouble}; a restarted bridge")
    assert [line.split(";")[0] for line in fleet.log if trouble in line] == [f"warning: {trouble}"]
    fleet.records.update = update  # type: ignore[method-assign]
    fleet.wait(1.0)
    assert fleet.controller.trouble(fleet.now) is None


@pytest.mark.slow
@both
def test_without_steps_the_vehicles_hold_until_the_next_one(autopilot: str) -> None:
    fleet = VirtualFleet(2, autopilot, planner_timeout=20.0)
    search = fleet.simulate(7)
    fleet.until(lambda: fleet.arrived(search))
    assert not fleet.controller.holding
    fleet.until(lambda: fleet.controller.holding, 30.0)
    assert fleet.log.count("warning: no step within 20 s: the vehicles hold") == 1
    fleet.fly(search, 1)
    fleet.until(lambda: fleet.arrived(search))
    assert not fleet.controller.holding


def test_parameters_of_the_next_program_count() -> None:
    fleet = VirtualFleet(1, arm="false")
    search = fleet.simulate(7)
    fleet.wait(30.0)
    assert not commands(fleet, ARM) and not commands(fleet, SET_MODE)
    with_settings(fleet, arm="true")
    fleet.start()
    fleet.until(lambda: fleet.arrived(search))


def test_a_warning_that_comes_and_goes_or_jitters_is_logged_once_in_a_while() -> None:
    fleet = VirtualFleet(1)
    member = fleet.controller._fleet[0]
    text = "altitude must be at least 50 m above home, got {} m"

    def logged() -> int:
        return sum("must be at least 50 m" in line for line in fleet.log)

    for k in range(400):
        member.dispatcher.leaves_layer = text.format(39.9 + k % 5 / 10) if k % 3 else None
        member.log_news(member.dispatcher.custody.state, 0.1 * k)
    assert logged() == 1
    member.dispatcher.leaves_layer = None
    member.log_news(member.dispatcher.custody.state, 70.0)
    member.dispatcher.leaves_layer = text.format(39.9)
    member.log_news(member.dispatcher.custody.state, 75.0)
    assert logged() == 2


def test_a_problem_of_a_link_that_flaps_is_logged_once() -> None:
    fleet = VirtualFleet(1)
    vehicle = fleet.controller._fleet[0].vehicle
    for k in range(100):
        vehicle.trouble = "tcp:127.0.0.1:5760: Connection refused" if k % 2 else None
        fleet.wait(0.1)
    assert sum("Connection refused" in line for line in fleet.log) == 1
