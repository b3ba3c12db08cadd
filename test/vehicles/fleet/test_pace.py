# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A speed that a vehicle cannot fly is refused before the search; one that it misses is seen."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from metres_search import MetresSearch
from virtual_fleet import FRAME, VirtualFleet

from dsse_ros.vehicles.control.orders import FlyTrack, GoTo
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.fleet_wind import FleetWind, InFlight
from dsse_ros.vehicles.fleet.pace_watch import PaceWatch

STEP_S = 13.0
START = (-24.0, -46.0)


def state_at(north_m: float, boot_s: float) -> VehicleState:
    lat_deg = START[0] + math.degrees(north_m / 6.35e6)
    return VehicleState(lat_deg=lat_deg, lon_deg=START[1], alt_m=40.0, boot_s=boot_s)


def track(speed_mps: float) -> FlyTrack:
    there = (START[0] + 0.01, START[1])
    return FlyTrack((START, there), there, 40.0, speed_mps)


def watched(flown_mps: float, order: Any, seconds: float = 60.0) -> PaceWatch:
    watch, boot_s = PaceWatch(), 0.0
    while boot_s <= seconds:
        watch.update(order, state_at(flown_mps * boot_s, boot_s), STEP_S)
        boot_s += 0.25
    return watch


@given(st.floats(1.0, 30.0), st.floats(0.0, 1.3))
def test_a_vehicle_is_slow_if_it_flies_less_than_planned(planned: float, share: float) -> None:
    watch = watched(share * planned, track(planned))
    assert watch.pace is not None
    assert watch.pace.planned == pytest.approx(planned)
    assert watch.pace.flown == pytest.approx(share * planned, rel=0.01, abs=0.02)
    if abs(share - 0.7) > 0.02:
        assert bool(watch.slow) == (share < 0.7)


def test_a_vehicle_that_stands_on_its_way_to_a_place_is_slow() -> None:
    there = GoTo(START[0] + 0.01, START[1], 40.0, 3.0)
    assert watched(0.0, there).slow == "flies 0.0 m/s on its way"
    assert not watched(2.0, there).slow and not watched(0.0, replace(there, lat_deg=START[0])).slow


def test_the_time_in_which_it_waits_for_its_next_leg_does_not_count() -> None:
    watch, order, north_m = PaceWatch(), track(10.0), 0.0
    for k in range(2000):
        waits = k % 100 >= 50
        north_m += 0.0 if waits else 2.5
        watch.update(None if waits else order, state_at(north_m, 0.25 * k), STEP_S)
    assert not watch.slow and watch.pace is not None
    assert watch.pace.flown == pytest.approx(10.0, rel=0.01)


@pytest.mark.parametrize(
    ("autopilot", "parameters", "planned", "named"),
    [
        ("ardupilot", {"WPNAV_SPEED": 500.0}, 10.0, "at most 5 m/s, the vehicle's WPNAV_SPEED"),
        ("ardupilot", {}, 10.0, ""),
        ("px4", {"MPC_XY_VEL_MAX": 8.0}, 10.0, "at most 8 m/s, the vehicle's MPC_XY_VEL_MAX"),
        ("px4", {"MPC_XY_CRUISE": 5.0}, 10.0, ""),
        ("arduplane", {"TRIM_ARSPD_CM": 1450.0}, 22.0, "14.5 m/s, the vehicle's TRIM_ARSPD_CM"),
        ("arduplane", {"ARSPD_FBW_MAX": 20.0}, 22.0, "at most 20 m/s, the vehicle's ARSPD_FBW_MAX"),
        ("px4plane", {}, 22.0, "15 m/s, the vehicle's FW_AIRSPD_TRIM"),
        ("px4plane", {"FW_AIRSPD_MIN": 18.0}, 16.0, "at least 18 m/s, the vehicle's FW_AIRSPD_MIN"),
        ("px4plane", {"FW_AIRSPD_TRIM": 22.0}, 22.0, ""),
    ],
)
def test_a_planned_speed_that_cannot_be_flown_keeps_the_vehicle_on_the_ground(
    autopilot: str, parameters: dict[str, float], planned: float, named: str
) -> None:
    fleet = VirtualFleet(
        1, autopilot, vehicle={"parameters": tuple(parameters.items())}, min_altitude=5.0
    )
    search = fleet.simulate(7, speeds_mps=(planned,))
    if autopilot.endswith("plane"):
        # A fixed wing flies in metres only: there are no actions.
        agents = search.agents
        search.agents = lambda: replace(agents(), actions=())  # type: ignore[method-assign]
        fleet.publish(search)
    for _ in range(400):
        fleet.step()
    dispatcher = fleet.controller.dispatchers[0]
    assert fleet.flights[0].state.armed is not bool(named), fleet.shown()
    if named:
        assert named in dispatcher.refused and f"got {planned:g}" in dispatcher.refused
        assert "\n" not in dispatcher.refused


def test_a_vehicle_that_stands_for_lack_of_an_uplink_is_not_following_well() -> None:
    fleet = VirtualFleet(1)
    search = fleet.simulate(7)
    flight, dispatcher = fleet.flights[0], fleet.controller.dispatchers[0]
    while not dispatcher.progress.arrived:
        fleet.step()
    flight.uplink = False
    search.advance([0 if search.cells[0][0] else 1])
    fleet.publish(search)
    for _ in range(900):
        fleet.step()
    assert flight.state.connected and "on its way" in dispatcher.pace_watch.slow
    assert sum("on its way" in line for line in fleet.log) == 1
    flight.uplink = True
    for _ in range(900):
        fleet.step()
    assert dispatcher.progress.arrived and not dispatcher.lost, fleet.shown()


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_wind_that_a_vehicle_reports_is_known(autopilot: str) -> None:
    fleet = VirtualFleet(1, autopilot, vehicle={"wind_mps": (-3.0, 4.0)})
    fleet.simulate(7)
    for _ in range(300):
        fleet.step()
    assert fleet.flights[0].state.wind == pytest.approx((4.0, -3.0), abs=1e-3)


# The wind that reaches the search

WINDS = st.tuples(st.floats(-7.0, 7.0), st.floats(-7.0, 7.0)).filter(
    lambda wind: 2.0 < math.hypot(*wind) < 8.0
)


def in_flight(
    ground: tuple[float, float], boot_s: float, wind: tuple[float, float] | None, planned: float
) -> InFlight:
    """Return a vehicle whose drone flies at 10 m/s, as it says."""
    state = VehicleState(
        boot_s=boot_s, velocity_mps=(ground[1], ground[0]), wind=wind, speed_limit_mps=10.0
    )
    return InFlight(state, track(planned), 10.0)


def against(wind: tuple[float, float], toward: float) -> tuple[float, float]:
    """Return the velocity over ground of one that flies at most 10 m/s, also through the air."""
    east, north = math.sin(toward), math.cos(toward)
    along, across = wind[0] * east + wind[1] * north, wind[0] * north - wind[1] * east
    speed = min(10.0, along + math.sqrt(100.0 - across**2))
    return speed * east, speed * north


@settings(max_examples=10, deadline=None)
@given(WINDS, st.sets(st.integers(0, 1)))
def test_the_wind_that_vehicles_report_reaches_the_search_once(
    wind: tuple[float, float], silent: set[int]
) -> None:
    fleet, found = FleetWind(), []
    flown_in = (0.0, 0.0)
    for k in range(120):
        # Some report none, and one is wrong.
        winds = {n: wind if n not in silent else (0.0, 0.0) for n in range(5)} | {5: (-9.0, 9.0)}
        flying = {n: in_flight((3.0, 0.0), float(k), each, 10.0) for n, each in winds.items()}
        fleet.update(flying, float(k))
        news = fleet.news(flown_in, float(k))
        if news is not None:
            found.append(news)
            flown_in = news
    assert len(found) == 1 and found[0] == pytest.approx(wind, abs=0.051)


@settings(max_examples=10, deadline=None)
@given(WINDS, st.floats(0.0, 7.0))
def test_vehicles_that_report_no_wind_show_it_by_how_slow_they_are(
    wind: tuple[float, float], turned: float
) -> None:
    fleet, last, boot_s = FleetWind(), None, 0.0
    for leg in range(12):
        # Each leg of 30 s has another direction.
        for _ in range(60):
            boot_s += 0.5
            flying = {
                n: in_flight(against(wind, turned + leg + 2.0 * n), boot_s, (0.0, 0.0), 10.0)
                for n in range(3)
            }
            fleet.update(flying, boot_s)
            last = fleet.news(last or (0.0, 0.0), boot_s) or last
    assert last is not None and math.dist(last, wind) < 1.2


def test_no_wind_is_seen_where_vehicles_fly_as_planned_turn_start_or_stand() -> None:
    fleet = FleetWind()
    for k in range(400):
        time_s = k * 0.5
        start = min(10.0, 2.0 * (time_s % 40.0))
        grounds = {
            0: (10.0 * math.sin(time_s / 5), 10.0 * math.cos(time_s / 5)),
            1: (4.0 * math.sin(time_s / 3), 4.0 * math.cos(time_s / 3)),
            2: (0.0, start),
            3: (0.0, 0.1),
            # Downwind it is planned faster than its parameters allow.
            4: (10.0, 0.0),
        }
        flying = {
            n: in_flight(ground, time_s, None, 18.0 if n == 4 else 10.0)
            for n, ground in grounds.items()
        }
        fleet.update(flying, time_s)
        assert fleet.news((0.0, 0.0), time_s) is None


def test_a_wind_that_hardly_changes_is_no_news_and_one_that_is_not_taken_comes_again() -> None:
    fleet, sent = FleetWind(), []
    for k in range(200):
        time_s = 0.5 * k
        wind = (4.0 + 0.8 * math.sin(k / 10), 0.0)
        fleet.update({0: in_flight((3.0, 0.0), time_s, wind, 10.0)}, time_s)
        assert fleet.news((4.0, 0.0), time_s) is None
        if fleet.news((0.0, 0.0), time_s) is not None:
            sent.append(time_s)
    assert len(sent) == 3 and min(b - a for a, b in pairwise(sent)) >= 30.0


@pytest.mark.slow
@pytest.mark.parametrize("estimates", [True, False])
def test_in_a_wind_the_next_tracks_are_planned_so_that_vehicles_can_fly_them(
    estimates: bool,
) -> None:
    vehicle = {"wind_mps": (0.0, 8.0), "estimates_wind": estimates, "endurance_s": 1e6}
    fleet = VirtualFleet(
        1, homes_m=[(1235.0, 1365.0)], frame=replace(FRAME, grid_size=20), vehicle=vehicle
    )
    search = MetresSearch(
        fleet.frame, grid_size=20, drones_positions=[(9, 9)], person_motion="constant_drift",
        person_initial_position=(19, 0), particles=500, vector=(0.0, 0.0), sigma=1.0,
        probability_of_detection=0.0,
    )  # fmt: skip
    fleet.searches.append(search)  # type: ignore[arg-type]
    search.publish(fleet)
    shares, steps, end_s = [], 0, fleet.now + 1500.0
    while steps < 16:
        assert fleet.now < end_s, fleet.shown()
        fleet.step()
        # To the west, against the wind.
        turn = -0.5 if steps == 0 else 0.0
        if search.turn(fleet, lambda turn=turn: [(turn, 1.0)]):
            steps += 1
            drones = search.flight.env.world.metres
            assert drones is not None
            path = drones.paths[0, 0]
            planned = np.diff(search.ways[-1][0], axis=0) * fleet.frame.cell_size_m
            lengths = [np.hypot(*np.diff(path, axis=0).T).sum(), np.hypot(*planned.T).sum()]
            shares.append(lengths[0] / lengths[1])
    # Where no vehicle estimates a wind, only what slows it down is known.
    assert search.winds and (not estimates or math.dist(search.winds[-1], (8.0, 0.0)) < 1.0)
    assert min(shares[-5:]) > 0.8, shares
