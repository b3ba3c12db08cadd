# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which vehicle it is: its own id, its restarts, and two vehicles behind one system id."""

from __future__ import annotations

import pytest
from autopilot.local_frame import Place
from virtual_flight import VirtualFlight

from dsse_ros.vehicles.control.orders import GoTo, TakeOff

both = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
HOME = Place(-24.0, -46.3, 0.0)
BESIDE = Place(-24.0, -46.29995, 0.0)
"""5 m away."""
ELSEWHERE = Place(-24.0, -46.297, 0.0)
"""300 m away."""


@both
def test_the_vehicle_s_own_id_is_known_soon_after_the_first_heartbeat(autopilot: str) -> None:
    flight = VirtualFlight(autopilot, loss=0.3, seed=3)
    flight.until(lambda: flight.state.identity.uid is not None, limit_s=15.0)
    assert flight.state.identity.uid == f"{1:016x}"


@both
def test_a_vehicle_that_reports_no_id_is_one_without(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    flight.vehicle.builders = {
        number: builder for number, builder in flight.vehicle.builders.items() if number != 148
    }
    flight.wait(20.0)
    assert flight.state.identity.uid == ""
    assert flight.fly(TakeOff(10.0)).status == "done"


@both
def test_a_power_cycle_is_one_restart_and_no_other_vehicle(autopilot: str) -> None:
    flight = VirtualFlight(autopilot)
    flight.wait(30.0)
    flight.vehicle.power_cycle()
    flight.wait(20.0)
    identity = flight.state.identity
    assert (identity.restarts, identity.has_double) == (1, False)
    assert identity.uid == f"{1:016x}"


@both
@pytest.mark.parametrize("known", ["by boot", "by place", "by id"])
def test_two_vehicles_with_one_system_id_are_noticed(autopilot: str, known: str) -> None:
    flight = VirtualFlight(autopilot)
    flight.wait(20.0)
    twin = flight.add_twin(home=ELSEWHERE if known == "by place" else BESIDE)
    if known != "by boot":
        twin.boot_s = flight.vehicle.boot_s
    if known != "by id":
        twin.uid = flight.vehicle.uid
        for number in (33, 0):
            # As if it had been there when the bridge asked for positions.
            flight._channels[1].stream(number, 0.25, flight.now)
    flight.until(lambda: flight.state.identity.has_double, limit_s=25.0)
    flight.wait(60.0)
    assert flight.state.identity.has_double
    assert flight.state.identity.restarts <= 1


def test_a_double_that_has_gone_is_forgotten() -> None:
    flight = VirtualFlight()
    flight.wait(20.0)
    flight.add_twin(home=BESIDE)
    flight.until(lambda: flight.state.identity.has_double, limit_s=25.0)
    flight._vehicles.pop()
    flight._channels.pop()
    flight.wait(100.0)
    assert not flight.state.identity.has_double
    assert flight.fly(TakeOff(10.0)).status == "done"


@both
@pytest.mark.parametrize("speed", [1, 5])
def test_a_flight_on_a_bad_link_is_one_vehicle_s(autopilot: str, speed: int) -> None:
    flight = VirtualFlight(autopilot, loss=0.2, delay_s=0.4, seed=speed)
    assert flight.fly(TakeOff(30.0)).status == "done"
    for north_m in (100.0, -100.0, 50.0):
        assert flight.fly(GoTo(*flight.place(north_m, 20.0), 30.0, 5.0)).status == "done"
    identity = flight.state.identity
    assert (identity.restarts, identity.has_double) == (0, False)


def test_a_jump_of_the_gps_and_back_is_no_second_vehicle() -> None:
    flight = VirtualFlight()
    flight.fly(TakeOff(20.0))
    for north_m in (111.0, 0.0):
        flight.vehicle.craft.north_m = north_m
        flight.wait(5.0)
    assert not flight.state.identity.has_double
