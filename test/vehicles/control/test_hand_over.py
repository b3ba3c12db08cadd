# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""On an orderly exit a vehicle that we lead holds by itself, and any other is left alone."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from autopilot.running import running_autopilot
from virtual_flight import VirtualFlight, mission

from dsse_ros.vehicles.control import vehicle as vehicle_module
from dsse_ros.vehicles.control.orders import FlyMission, GoTo, Hold, Land, Order, Return, TakeOff
from dsse_ros.vehicles.control.vehicle import CLOSE_S, Vehicle, VehicleFleet, VehicleSettings

AUTOPILOTS = ("ardupilot", "px4")
pytestmark = pytest.mark.slow

FAR = GoTo(-24.02, -46.3, 20.0, 5.0)
both = pytest.mark.parametrize("autopilot", AUTOPILOTS)


def flying(autopilot: str, order: Order | None = None) -> VirtualFlight:
    flight = VirtualFlight(autopilot)
    assert flight.fly(TakeOff(20.0)).status == "done"
    if order is not None:
        flight.give(order)
        flight.until(lambda: flight.vehicle.craft.ground_speed_mps > 3.0)
    return flight


def part(flight: VirtualFlight) -> None:
    """Have the program end as a vehicle's thread does."""
    flight._send(flight.controller.hand_over(Hold(), flight.now))
    end_s = flight.now + 4.0
    while flight.controller.handing_over and flight.now < end_s:
        flight.step()
    # From now on nobody is there.
    flight._put = lambda data, *, to_vehicle: None  # type: ignore[method-assign]


@both
def test_a_vehicle_on_its_way_stops_where_it_is(autopilot: str) -> None:
    flight = flying(autopilot)
    flight.give(GoTo(*flight.place(800.0, 0.0), 20.0, 3.0))
    flight.until(lambda: flight.vehicle.craft.north_m > 100.0)
    part(flight)
    assert flight.vehicle.mode.name == ("HOLD" if autopilot == "px4" else "GUIDED")
    flight.wait(60.0)
    craft = flight.vehicle.craft
    assert craft.ground_speed_mps < 0.5 and 80.0 < craft.north_m < 200.0
    assert craft.up_m == pytest.approx(20.0, abs=3.0)
    assert not flight.vehicle.failsafes
    assert flight.vehicle.mode.name == ("HOLD" if autopilot == "px4" else "GUIDED")


@both
def test_a_vehicle_that_waits_for_the_next_step_stays(autopilot: str) -> None:
    flight = flying(autopilot)
    assert flight.fly(GoTo(*flight.place(30.0, 0.0), 20.0, 3.0)).status == "done"
    part(flight)
    flight.wait(60.0)
    assert flight.off_m(30.0, 0.0) < 5.0 and not flight.vehicle.failsafes
    assert flight.vehicle.mode.name == ("HOLD" if autopilot == "px4" else "GUIDED")


@both
@pytest.mark.parametrize("what", ["return", "land", "mission", "pilot", "ground"])
def test_what_goes_on_without_us_is_not_interrupted(autopilot: str, what: str) -> None:
    if what == "ground":
        flight = VirtualFlight(autopilot)
        flight.wait(10.0)
    else:
        flight = flying(autopilot)
        orders: dict[str, Any] = {
            "return": Return(),
            "land": Land(),
            "mission": FlyMission(mission(flight, (200.0, 0.0, 20.0))),
            "pilot": GoTo(*flight.place(300.0, 0.0), 20.0, 3.0),
        }
        flight.give(orders[what])
        flight.wait(8.0)
    if what == "pilot":
        flight.vehicle.pilot_takes_over("POSCTL" if autopilot == "px4" else "LOITER")
        flight.until(lambda: flight.outcome.status == "taken_over")
    mode, sent = flight.vehicle.mode, len(flight.sent)
    part(flight)
    assert len(flight.sent) == sent
    flight.wait(5.0)
    assert flight.vehicle.mode is mode


def test_a_command_that_has_not_shown_yet_is_taken_back_before_the_setpoints_end() -> None:
    flight = flying("px4")
    flight.give(GoTo(*flight.place(300.0, 0.0), 20.0, 3.0))
    flight.until(lambda: flight.vehicle.mode.name == "OFFBOARD")
    assert flight.state.mode != "OFFBOARD"
    part(flight)
    flight.wait(20.0)
    assert flight.vehicle.mode.name == "HOLD" and not flight.vehicle.failsafes


def test_a_climb_goes_on_to_its_altitude() -> None:
    flight = VirtualFlight("ardupilot")
    flight.give(TakeOff(40.0))
    flight.until(lambda: flight.vehicle.craft.up_m > 5.0)
    part(flight)
    flight.wait(60.0)
    assert flight.vehicle.craft.up_m == pytest.approx(40.0, abs=2.0)


def until(condition: Any, timeout_s: float = 180.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, "not in time"
        time.sleep(0.02)


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_vehicle_that_is_closed_in_flight_is_found_at_rest(
    autopilot: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A busy machine may need longer.
    monkeypatch.setattr(vehicle_module, "_HAND_OVER_S", 100.0)
    monkeypatch.setattr(vehicle_module, "CLOSE_S", 120.0)
    patient = ("--param", "COM_OF_LOSS_T=300") if autopilot == "px4" else ()
    with running_autopilot(
        autopilot, link="udpin", speedup=5, ready_s=5.0, options=patient
    ) as simulated:
        settings = VehicleSettings(
            connection=simulated.connection, autopilot=autopilot, setpoint_hz=40.0
        )
        with Vehicle(settings) as vehicle:
            vehicle.give(TakeOff(20.0))
            until(lambda: vehicle.outcome.status == "done")
            vehicle.give(FAR)
            until(lambda: vehicle.state.speed_mps > 3.0)
            before = vehicle.state
        after = vehicle.state
        with Vehicle(settings) as found:
            until(lambda: found.state.has_position and found.state.mode)
            assert found.state.mode == ("HOLD" if autopilot == "px4" else "GUIDED")
            until(lambda: found.state.speed_mps < 0.5)
            # Where it began to hold, and its way to a stop.
            south, north = sorted((before.lat_deg, after.lat_deg))
            margin = 80.0 / 111_195
            assert south - margin < found.state.lat_deg < north + margin
            assert not found.state.failsafe


def test_twenty_vehicles_that_do_not_end_are_closed_in_the_time_of_one() -> None:
    """Each has a thread that is stuck, as in a call to the system that does not return."""
    fleet = VehicleFleet(
        [VehicleSettings(connection=f"udpin:127.0.0.1:{5 + k}") for k in range(20)]
    )
    over = threading.Event()
    for vehicle in fleet:
        vehicle._turn = over.wait  # type: ignore[method-assign, assignment]
    fleet.start()
    start_s = time.monotonic()
    fleet.close()
    # One after the other they would take twice as long.
    assert time.monotonic() - start_s < 10 * CLOSE_S
    assert all(vehicle._thread.is_alive() for vehicle in fleet)  # type: ignore[union-attr]
    over.set()
    fleet.close()


def test_vehicles_out_of_reach_are_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    # One that is waited for has not ended when closing gives up.
    monkeypatch.setattr(vehicle_module, "CLOSE_S", 120.0)
    monkeypatch.setattr(vehicle_module, "_HAND_OVER_S", 600.0)
    fleet = VehicleFleet(
        [VehicleSettings(connection=f"udpin:127.0.0.1:{5 + k}") for k in range(20)]
    )
    fleet.start()
    fleet.close()
    assert not any(vehicle._thread.is_alive() for vehicle in fleet)  # type: ignore[union-attr]
