# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles fly a search in metres without a stop, and what they fly is what is searched."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from metres_search import MetresSearch
from numpy.typing import NDArray
from virtual_fleet import VirtualFleet

from dsse_ros.vehicles.mavlink.messages import CommandLong
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map, flip_y
from dsse_ros.world.scenario.geodesy import geodetic_to_map

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 0.0, 40.0)
STARTS = ((9, 9), (10, 12))
TURNS = ((0.0, 0.3), (0.25, -0.3), (0.5, 0.0), (-0.5, 0.1), (0.0, 0.4), (0.1, -0.5))
"""Of each step, the turns of both drones."""
VEHICLES = {"px4plane": {"parameters": (("FW_AIRSPD_TRIM", 22.0),)}}
"""With the speed of a drone that is a fixed wing, as ArduPlane has it by default."""


def fly(
    autopilot: str, steps: int = 6, limits: Mapping[str, float] | None = None, **fields: Any
) -> tuple[MetresSearch, VirtualFleet]:
    homes = [(65.0 + 130.0 * col, 130.0 * (19 - row) + 65.0) for col, row in STARTS]
    fleet = VirtualFleet(
        2, autopilot, homes_m=homes, frame=FRAME, altitude_step=5.0, vehicle=VEHICLES.get(autopilot)
    )
    search = MetresSearch(
        FRAME, limits=limits, grid_size=20, drones_positions=STARTS, person_motion="constant_drift",
        person_initial_position=(12, 7), particles=2000, vector=(0.0, 0.0), sigma=3.0,
        probability_of_detection=0.7, **fields,
    )  # fmt: skip
    fleet.searches.append(search)  # type: ignore[arg-type]
    search.publish(fleet)
    done = 0

    def command() -> Any:
        return [(turn, 1.0) for turn in TURNS[done % len(TURNS)]]

    end_s = fleet.now + 600.0
    while done < steps and not search.over:
        assert fleet.now < end_s, fleet.shown()
        fleet.step()
        done += search.turn(fleet, command)
    # What turns and circles is no vehicle that strays.
    assert not any("its leg" in line for line in fleet.log)
    return search, fleet


def speeds(flown: list[tuple[float, float, float]]) -> NDArray[np.float64]:
    t, x, y = np.array(flown).T
    return np.hypot(np.diff(x), np.diff(y)) / np.diff(t)


def away_m(flown: list[tuple[float, float, float]], way: NDArray[np.float64]) -> float:
    """Return the mean distance of positions from the legs of a track (P, 2)."""
    away = []
    for _, x, y in flown:
        a, b = way[:-1], way[1:]
        along = b - a
        squared = np.maximum((along**2).sum(axis=1), 1e-9)
        share = np.clip((((x, y) - a) * along).sum(axis=1) / squared, 0.0, 1.0)
        away.append(np.hypot(*(a + share[:, None] * along - (x, y)).T).min())
    return float(np.mean(away))


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_vehicles_fly_their_tracks_at_speed_without_a_stop_by_the_clock_of_the_sea(
    autopilot: str,
) -> None:
    search, fleet = fly(autopilot)
    assert not any(one.lost or one.refused for one in fleet.controller.dispatchers), fleet.shown()
    cell_m, side_m = FRAME.cell_size_m, FRAME.extent.height
    for i, flown in enumerate(search.flown):
        # The first seconds are the start from a hover.
        assert flown[-1][0] == pytest.approx(6 * search.step_s, abs=1.0)
        under_way = [one for one in flown if one[0] > 6.0]
        assert speeds(under_way).min() > 2.0
        assert np.mean(speeds(under_way)) == pytest.approx(10.0, abs=1.0)
        ways = [(way[i] + 0.5) * cell_m * (1, -1) + (0.0, side_m) for way in search.ways]
        assert away_m(under_way, np.concatenate(ways)) < 8.0


@pytest.mark.parametrize("autopilot", ["arduplane", "px4plane"])
@pytest.mark.parametrize("phase", ["track", "hold", "return"])
def test_a_fixed_wing_of_which_the_motor_stops_has_crashed_though_it_glides(
    autopilot: str, phase: str
) -> None:
    kinds = ("fixed_wing", "fixed_wing")
    _, fleet = fly(autopilot, 3, {"acceptance_radius": 150.0}, searchers=kinds)
    flight, dispatcher = fleet.flights[0], fleet.controller.dispatchers[0]
    if phase != "track":
        fleet.controller.operate(0, phase)
        fleet.wait(8.0)
    up_m = flight.vehicle.craft.up_m
    flight.send_from_station(CommandLong(1, 1, 400, 0, 0.0, 21196.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    fleet.until(lambda: fleet.custody() == "crashed", 9.0)
    assert dispatcher.lost.startswith("crashed: its motors stopped ")
    assert float(dispatcher.lost.split()[4]) == pytest.approx(up_m, abs=4.0)
    assert flight.vehicle.craft.up_m > 10.0
    fleet.wait(60.0)
    assert fleet.custody() == "crashed" and flight.vehicle.craft.up_m == 0.0


def test_a_copter_that_has_lost_its_gps_on_its_track_gets_nothing_once_it_lands() -> None:
    _, fleet = fly("ardupilot", 2)
    flight, dispatcher = fleet.flights[0], fleet.controller.dispatchers[0]
    flight.vehicle.lose_gps()
    fleet.until(lambda: flight.vehicle.mode.name == "LAND", 8.0)
    sent = len(flight.setpoints())
    fleet.until(lambda: fleet.custody() == "failsafe", 1.5)
    fleet.wait(10.0)
    assert dispatcher.lost == "ekf failsafe" and len(flight.setpoints()) == sent


def test_px4_that_cannot_use_setpoints_for_lack_of_a_position_gets_none() -> None:
    kinds = ("fixed_wing", "fixed_wing")
    _, fleet = fly("px4plane", 2, {"acceptance_radius": 150.0}, searchers=kinds)
    flight = fleet.flights[0]
    flight.vehicle.dead_reckons_s = 5.0
    flight.vehicle.lose_gps()
    fleet.until(lambda: flight.state.mode == "RTL", 8.0)
    fleet.step()
    sent = len(flight.setpoints())
    fleet.until(lambda: fleet.custody() == "failsafe", 8.0)
    fleet.wait(10.0)
    assert len(flight.setpoints()) == sent and flight.vehicle.mode.name == "RTL"


@pytest.mark.parametrize("autopilot", ["arduplane", "px4plane"])
def test_a_fixed_wing_that_flies_on_without_gps_is_named(autopilot: str) -> None:
    kinds = ("fixed_wing", "fixed_wing")
    _, fleet = fly(autopilot, 2, {"acceptance_radius": 150.0}, searchers=kinds)
    blind, other = fleet.controller.dispatchers
    fleet.flights[0].vehicle.lose_gps()
    fleet.wait(15.0)
    assert (blind.off_plan, other.off_plan) == ("flies by dead reckoning, without GPS", None)
    assert sum("dead reckoning" in line for line in fleet.log) == 1
    assert fleet.custody() == "following" and not blind.lost


@pytest.mark.slow
@pytest.mark.parametrize(("autopilot", "rests"), [("arduplane", "LOITER"), ("px4plane", "HOLD")])
def test_a_fixed_wing_takes_off_climbs_in_a_circle_and_flies_its_tracks(
    autopilot: str, rests: str
) -> None:
    kinds = ("fixed_wing", "fixed_wing")
    search, fleet = fly(autopilot, limits={"acceptance_radius": 150.0}, searchers=kinds)
    assert not any(one.lost or one.refused for one in fleet.controller.dispatchers), fleet.shown()
    result = search.flight.result
    assert result.flown is not None and result.flown.looked[:, 1:].all()
    for i, (flown, flight) in enumerate(zip(search.flown, fleet.flights, strict=True)):
        # The last step may find the person.
        assert flown[-1][0] == pytest.approx(len(search.ways) * search.step_s, abs=1.0)
        assert speeds(flown) == pytest.approx(np.full(len(flown) - 1, 22.0), abs=0.5)
        assert flight.vehicle.craft.up_m == pytest.approx(40.0 - 5.0 * i, abs=3.5)
        # It turns where a drone of the kind would have.
        ways = [(way[i] + 0.5) * FRAME.cell_size_m * (1, -1) for way in search.ways]
        assert away_m(flown, np.concatenate(ways) + (0.0, FRAME.extent.height)) < 80.0
    # It holds, and returns, in circles.
    fleet.controller.operate(0, "hold")
    answer = "ordered to return, and to circle over home until a pilot lands it: drone1"
    assert fleet.controller.operate(1, "land") == (True, answer)
    fleet.wait(20.0)
    assert [one.vehicle.mode.name for one in fleet.flights] == [rests, "RTL"]
    assert not any(one.vehicle.landed for one in fleet.flights)


def test_a_fixed_wing_does_not_fly_from_cell_to_cell() -> None:
    fleet = VirtualFleet(1, "arduplane")
    fleet.simulate(7)
    fleet.wait(5.0)
    assert fleet.controller.trouble(fleet.now) == (
        "autopilot must be one that hovers with space cells, got 'arduplane': nothing is flown"
    )
    assert not fleet.flights[0].vehicle.armed


@pytest.mark.slow
def test_what_the_vehicles_have_flown_is_what_the_mission_has() -> None:
    search, _ = fly("ardupilot", 4)
    result = search.flight.result
    assert result.flown is not None and result.flown.looked[:, 1:].all()
    begin_s, end_s = 3 * search.step_s, 4 * search.step_s
    for i, path in enumerate(result.flown.paths):
        t, x, y = np.array(search.flown[i]).T
        at_s = np.linspace(begin_s, end_s, len(path))
        flown = np.stack(
            [np.interp(at_s, t, x), flip_y(FRAME.extent.height, np.interp(at_s, t, y))], axis=1
        )
        # A position comes every quarter of a second.
        assert np.hypot(*(path - flown).T).max() < 0.5 * 10.0
        east, south = path[-1] - path[-2]
        assert result.flown.flights["heading"][i] == pytest.approx(math.atan2(east, -south))


@pytest.mark.slow
def test_a_vehicle_that_is_not_at_its_altitude_looks_at_nothing() -> None:
    # The second one flies 5 m lower.
    search, _ = fly("ardupilot", 2, limits={"look_altitude_error": 3.0})
    flown = search.flight.result.flown
    assert flown is not None and flown.looked.any(axis=1).tolist() == [True, False]


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_without_a_next_leg_stops_behind_the_end_once_and_goes_on_with_it(
    autopilot: str,
) -> None:
    search, fleet = fly(autopilot, 2)
    ends, dispatchers = search.flight.result.places, fleet.controller.dispatchers
    fleet.wait(12.0)
    for _ in range(18):
        # Not past the place where it is to stop, and back.
        assert all(flight.vehicle.craft.ground_speed_mps < 2.0 for flight in fleet.flights)
        fleet.wait(1.0)
    for end, flight in zip(ends.tolist(), fleet.flights, strict=True):
        assert flight.vehicle.craft.ground_speed_mps < 0.5
        x, y, _ = geodetic_to_map(FRAME, flight.state.lat_deg, flight.state.lon_deg, 0.0)
        assert 20.0 < math.dist((x, y), cell_to_map(FRAME, *end)) < 60.0
    before = [one.progress.number for one in dispatchers]
    search.turn(fleet, lambda: [(0.5, 1.0)] * 2)
    fleet.wait(8.0)
    assert all(flight.vehicle.craft.ground_speed_mps > 5.0 for flight in fleet.flights)
    assert all(a.progress.number > b for a, b in zip(dispatchers, before, strict=True))
