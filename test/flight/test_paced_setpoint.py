# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A setpoint leads a vehicle along its leg at the speed that is asked for."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.flight.setpoints import PacedSetpoint
from dsse_ros.mavlink.messages import Address, SetPositionTarget

METRE_DEG = 1 / 111_195.0
START, START_S = (0.0, 179.999), 100.0
TARGET = SetPositionTarget(Address(1, 1), 0.002, -179.998, 30.0)
LENGTH_M = math.hypot(0.002, 0.003) / METRE_DEG


def place_m(lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """Return metres north and east of the start."""
    east_deg = (lon_deg - START[1] + 180) % 360 - 180
    return lat_deg / METRE_DEG, east_deg / METRE_DEG


def on_the_leg(metres: float) -> tuple[float, float]:
    """Return the place of a vehicle that has flown so far."""
    share = metres / LENGTH_M
    return share * 0.002, (START[1] + share * 0.003 + 180) % 360 - 180


@pytest.mark.slow
@given(speed_mps=st.floats(0.5, 30.0), lag_s=st.floats(0.0, 0.7))
def test_a_vehicle_that_follows_is_led_at_the_speed_to_the_target(
    speed_mps: float, lag_s: float
) -> None:
    paced = PacedSetpoint(TARGET, speed_mps, START, START_S)
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
        assert math.isclose(math.hypot(*setpoint.velocity_mps), speed_mps, rel_tol=1e-3)
        leads.append(at_m - flown_m)
        flown_m, boot_s = max(flown_m, at_m - lag_s * speed_mps), boot_s + 0.25
    assert setpoint == TARGET
    took_s = boot_s - START_S
    assert max(leads) <= speed_mps * 1.01
    assert abs(took_s - (LENGTH_M - speed_mps) / speed_mps) < 0.1 * LENGTH_M / speed_mps + 1.0


def test_it_waits_for_a_vehicle_that_does_not_come() -> None:
    paced = PacedSetpoint(TARGET, 5.0, START, START_S)
    for second in range(60):
        setpoint = paced.advance(START, 100.0 + second)
    assert math.hypot(*place_m(setpoint.lat_deg, setpoint.lon_deg)) < 5.1


def test_a_vehicle_that_is_there_gets_the_target() -> None:
    here = (TARGET.lat_deg, TARGET.lon_deg)
    assert PacedSetpoint(TARGET, 5.0, here, START_S).advance(here, START_S) == TARGET


def test_a_clock_that_goes_back_does_no_harm() -> None:
    paced = PacedSetpoint(TARGET, 5.0, START, START_S)
    before = paced.advance(START, 100.4)
    assert paced.advance(START, 3.0) == before
