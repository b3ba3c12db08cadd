# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A vehicle flies on behind the end of its track only where it may be."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from dsse_ros.base.result import Accepted
from dsse_ros.vehicles.control.orders import FlyTrack
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.airspace import AirborneVehicle
from dsse_ros.vehicles.fleet.fence import Fence, check_place
from dsse_ros.vehicles.fleet.layer import Layer
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.mission_items.separation import place_of
from dsse_ros.vehicles.mission_items.track_missions import VehicleLeg
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import geodetic_to_map

FRAME = GridFrame(10, 130.0, -24.04, -46.17, 0.0, 40.0)
SPEED_MPS, STEP_S = 10.0, 13.0
AHEAD_M = {False: 30.0, True: 250.0}
"""How far vehicles fly on, by whether they circle."""


def track_to(x_m: float, y_m: float, heading: float, fence: Fence, *, circles: bool) -> FlyTrack:
    """Return the order of a leg that ends at a place of the map frame."""
    start = x_m - 130.0 * math.sin(heading), y_m - 130.0 * math.cos(heading)
    leg = VehicleLeg(0, (0, 0), False, False, False, (start, (x_m, y_m)))
    settings = BridgeSettings(autopilot="arduplane" if circles else "ardupilot")
    task = Layer(fence, settings, STEP_S).leg_task(leg)
    assert isinstance(task, Accepted), task
    (order,) = task.value
    assert isinstance(order, FlyTrack)
    return order


@given(
    x_m=st.floats(0.0, 1300.0),
    y_m=st.floats(0.0, 1300.0),
    heading=st.floats(-math.pi, math.pi),
    circles=st.booleans(),
)
def test_behind_its_end_a_track_ends_in_the_fence(
    x_m: float, y_m: float, heading: float, *, circles: bool
) -> None:
    fence = Fence(FRAME, 150.0, 0.0, 120.0)
    order = track_to(x_m, y_m, heading, fence, circles=circles)
    beyond = geodetic_to_map(FRAME, *order.beyond, 0.0)[:2]
    ahead_m = AHEAD_M[circles]
    wanted = x_m + ahead_m * math.sin(heading), y_m + ahead_m * math.cos(heading)
    # The track is laid on a sphere.
    assume(all(min(abs(one + 150.0), abs(one - 1450.0)) > 1.5 for one in wanted))
    inside = all(-150.0 <= one <= 1450.0 for one in wanted)
    np.testing.assert_allclose(beyond, wanted if inside else (x_m, y_m), atol=1.5)
    assert isinstance(check_place(*order.beyond, 40.0, fence), Accepted)


@given(heading=st.floats(-math.pi, math.pi), circles=st.booleans())
def test_others_are_kept_off_the_place_behind_the_end(heading: float, *, circles: bool) -> None:
    order = track_to(650.0, 650.0, heading, Fence(FRAME, 150.0, 0.0, 120.0), circles=circles)
    vehicle = AirborneVehicle(
        "drone0", VehicleState(), place_of(FRAME, *order.places[0]), order, FRAME
    )
    last = vehicle.spaces(order)[-1].end
    np.testing.assert_allclose(last, place_of(FRAME, *order.beyond), atol=1e-6)
