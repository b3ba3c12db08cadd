# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Somebody who sends the vehicle elsewhere in its guided mode has taken it over."""

from __future__ import annotations

import math

import pytest
from autopilot.maneuvers import CarriedAway
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from virtual_flight import VirtualFlight

from dsse_ros.vehicles.control.orders import FlyTrack, GoTo, Hold, TakeOff


def flying(**options: object) -> VirtualFlight:
    flight = VirtualFlight(**options)  # type: ignore[arg-type]
    assert flight.fly(TakeOff(20.0)).status == "done"
    return flight


def go_to(flight: VirtualFlight, north_m: float) -> GoTo:
    return GoTo(*flight.place(north_m, 0.0), 20.0, 3.0)


def reposition(flight: VirtualFlight, north_m: float, east_m: float) -> object:
    lat_deg, lon_deg = flight.place(north_m, east_m)
    return mavlink.MAVLink_command_int_message(
        1, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_CMD_DO_REPOSITION, 0, 0,
        -1.0, 0.0, 0.0, math.nan, round(lat_deg * 1e7), round(lon_deg * 1e7), 20.0,
    )  # fmt: skip


@pytest.mark.parametrize("order", ["leg", "arrived", "hold"])
@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_a_foreign_target_takes_it_over_and_is_not_fought(order: str, loss: float) -> None:
    flight = flying(loss=loss, seed=1)
    flight.give(Hold() if order == "hold" else go_to(flight, 300.0 if order == "leg" else 10.0))
    flight.wait(15.0)
    flight.send_from_station(reposition(flight, 0.0, 100.0))
    flight.until(lambda: flight.outcome.status == "taken_over", limit_s=10.0)
    sent = len(flight.setpoints())
    flight.wait(40.0)
    assert flight.off_m(0.0, 100.0) < 1.0
    assert len(flight.setpoints()) == sent
    assert flight.outcome.reason == "sent elsewhere by somebody else"


@pytest.mark.parametrize("phase", range(16))
def test_a_foreign_target_is_not_fought_whenever_it_comes(phase: int) -> None:
    flight = flying(seed=phase)
    flight.give(go_to(flight, 300.0))
    flight.wait(15.0 + 0.13 * phase)
    flight.send_from_station(reposition(flight, 0.0, 100.0))
    sent = len(flight.setpoints())
    flight.until(lambda: flight.outcome.status == "taken_over", limit_s=5.0)
    assert len(flight.setpoints()) == sent


def test_velocities_of_somebody_else_take_over_a_vehicle_that_has_arrived() -> None:
    flight = flying()
    assert flight.fly(go_to(flight, 10.0)).status == "done"
    flight.wait(5.0)
    for _ in range(12):
        flight.send_from_station(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 0x0DC7, 0, 0, 0, 3.0, 0, 0, 0, 0, 0, 0, 0
            )
        )
        flight.wait(1.0)
    assert flight.outcome.status == "taken_over"


def test_a_wind_that_carries_it_away_takes_nothing_over() -> None:
    flight = flying()
    assert flight.fly(go_to(flight, 10.0)).status == "done"
    target = flight.vehicle.maneuver.target
    assert target is not None
    flight.vehicle.maneuver = CarriedAway(target, 5.0, 0.0)
    flight.wait(30.0)
    assert flight.outcome.status == "done"


def test_its_own_next_leg_is_nobody_elses_target() -> None:
    flight = flying(loss=0.3, delay_s=0.4, seed=5)
    for north_m in range(20, 200, 20):
        flight.give(go_to(flight, float(north_m)))
        flight.wait(1.7)
    flight.until(lambda: flight.outcome.status == "done", limit_s=60.0)
    assert "taken_over" not in flight.statuses()


@pytest.mark.parametrize("cut_s", [8.0, 46.0])
def test_a_target_of_before_a_cut_of_the_uplink_is_nobody_elses(cut_s: float) -> None:
    flight = flying()
    assert flight.fly(go_to(flight, 10.0)).status == "done"
    flight.wait(5.0)
    flight.uplink = False
    end_s, north_m = flight.now + cut_s, 10.0
    while flight.now < end_s:
        # The vehicle stands, and the search goes on.
        places = tuple(flight.place(north_m + m, 0.0) for m in (0.0, 130.0))
        north_m += 130.0
        flight.give(FlyTrack(places, flight.place(north_m + 30.0, 0.0), 20.0, 10.0))
        flight.wait(13.0)
    assert flight.off_m(10.0, 0.0) < 1.0 and flight.state.connected
    flight.uplink = True
    flight.until(lambda: flight.outcome.status == "done", limit_s=120.0)
    assert "taken_over" not in flight.statuses()
