# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A setpoint leads a vehicle along its track at the speed that is asked for."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dsse_ros.vehicles.control.paced_setpoint import PacedSetpoint
from dsse_ros.vehicles.mavlink.messages import Address, SetPositionTarget

METRE_DEG = 1 / 111_195.0
START, START_S = (0.0, 179.999), 100.0
TARGET = SetPositionTarget(Address(1, 1), 0.002, -179.998, 30.0)
LENGTH_M = math.hypot(0.002, 0.003) / METRE_DEG


def place_m(lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """Return metres north and east of the start."""
    east_deg = (lon_deg - START[1] + 180) % 360 - 180
    return lat_deg / METRE_DEG, east_deg / METRE_DEG


def braking_m(speed_mps: float) -> float:
    """Return how far before its end a setpoint may be slower: at 2 m/s2, and a step of it."""
    return speed_mps**2 / 4.0 + speed_mps / 4.0


def on_the_leg(metres: float) -> tuple[float, float]:
    """Return the place of a vehicle that has flown so far."""
    share = metres / LENGTH_M
    return share * 0.002, (START[1] + share * 0.003 + 180) % 360 - 180


@pytest.mark.slow
@given(speed_mps=st.floats(0.5, 30.0), lag_s=st.floats(0.0, 0.7))
def test_a_vehicle_that_follows_is_led_at_the_speed_to_the_target(
    speed_mps: float, lag_s: float
) -> None:
    paced = PacedSetpoint(TARGET, speed_mps, [START], START_S)
    flown_m, boot_s, leads = 0.0, START_S, []
    for _ in range(10_000):
        setpoint = paced.advance(on_the_leg(flown_m), boot_s)
        if setpoint == TARGET:
            break
        north_m, east_m = place_m(setpoint.lat_deg, setpoint.lon_deg)
        # On the leg, never past its end.
        assert abs(north_m * 3 - east_m * 2) < 1e-3 * LENGTH_M
        at_m = math.hypot(north_m, east_m)
        assert at_m <= LENGTH_M
        assert setpoint.velocity_mps is not None
        led_mps = math.hypot(*setpoint.velocity_mps)
        brakes = LENGTH_M - at_m < braking_m(speed_mps)
        assert led_mps <= speed_mps * 1.001 and (brakes or led_mps >= speed_mps * 0.999)
        leads.append(at_m - flown_m)
        gap_m = max(at_m - flown_m - lag_s * speed_mps, 0.0)
        flown_m, boot_s = flown_m + min(led_mps + gap_m, speed_mps) * 0.25, boot_s + 0.25
    assert setpoint == TARGET
    took_s = boot_s - START_S
    assert max(leads) <= speed_mps * 1.01
    # To brake takes twice as long as to fly on.
    braking_s = braking_m(speed_mps) / speed_mps
    least_s = (LENGTH_M - speed_mps) / speed_mps
    assert least_s * 0.9 - 1.0 < took_s < least_s * 1.1 + 1.0 + braking_s


def test_it_waits_for_a_vehicle_that_does_not_come() -> None:
    paced = PacedSetpoint(TARGET, 5.0, [START], START_S)
    for second in range(60):
        setpoint = paced.advance(START, 100.0 + second)
    assert math.hypot(*place_m(setpoint.lat_deg, setpoint.lon_deg)) < 5.1


def test_a_vehicle_that_is_there_gets_the_target() -> None:
    here = (TARGET.lat_deg, TARGET.lon_deg)
    assert PacedSetpoint(TARGET, 5.0, [here], START_S).advance(here, START_S) == TARGET


def test_a_clock_that_goes_back_does_no_harm() -> None:
    paced = PacedSetpoint(TARGET, 5.0, [START], START_S)
    before = paced.advance(START, 100.4)
    assert paced.advance(START, 3.0) == before


@given(
    st.lists(st.tuples(st.floats(-500, 500), st.floats(-500, 500)), min_size=1, max_size=6),
    st.floats(2.0, 20.0),
)
def test_along_a_track_it_moves_at_the_speed_from_leg_to_leg_and_stops_at_the_end(
    points_m: list[tuple[float, float]], speed_mps: float
) -> None:
    places = [START, *((n * METRE_DEG, START[1] + e * METRE_DEG) for n, e in points_m)]
    target = replace(TARGET, lat_deg=places[-1][0] + 0.001, lon_deg=places[-1][1])
    assume(all(math.dist(a, b) > METRE_DEG for a, b in itertools.pairwise(places)))
    paced, boot_s, here, setpoints = PacedSetpoint(target, speed_mps, places, 0.0), 0.0, START, []
    while boot_s < 60.0 + 2 * paced.length_m / speed_mps:
        # A vehicle that follows without a lag, by the velocity.
        setpoints.append(paced.advance(here, boot_s))
        north_mps, east_mps = setpoints[-1].velocity_mps or (0.0, 0.0)
        here = (
            setpoints[-1].lat_deg + north_mps * 0.25 * METRE_DEG,
            setpoints[-1].lon_deg + east_mps * 0.25 * METRE_DEG,
        )
        boot_s += 0.25
    assert setpoints[-1] == target
    moving = [one for one in setpoints if one.velocity_mps is not None]
    until_s = max((paced.length_m - braking_m(speed_mps)) / speed_mps, 0.0)
    for number, one in enumerate(moving):
        led_mps = math.hypot(*one.velocity_mps)
        assert led_mps <= speed_mps * 1.002
        assert led_mps >= speed_mps * 0.998 or number * 0.25 > until_s - 0.5
    # A track may cross itself, where the vehicle is on two of its legs.
    least_s = (paced.length_m - 2 * speed_mps) / speed_mps
    braking_s = braking_m(speed_mps) / speed_mps
    assert len(moving) * 0.25 <= paced.length_m / speed_mps + braking_s + 1.0
    assert least_s - 1.0 <= len(moving) * 0.25 or len(points_m) > 1


def test_a_track_begins_where_the_setpoint_was_on_the_last_one() -> None:
    places = [START, (0.001, START[1])]
    paced = PacedSetpoint(TARGET, 5.0, places, START_S, at=(0.0004, START[1]))
    assert paced.at_m == pytest.approx(0.0004 / METRE_DEG, rel=1e-2)
