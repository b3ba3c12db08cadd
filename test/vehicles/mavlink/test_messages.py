# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages with invalid coordinates are dropped and counted."""

from __future__ import annotations

import math
from typing import Any

import pytest
from autopilot.wire import Codec as VehicleCodec
from autopilot.wire import mavlink
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.vehicles.control.commands import ControllerSettings
from dsse_ros.vehicles.control.vehicle_controller import VehicleController
from dsse_ros.vehicles.mavlink.codec import Codec
from dsse_ros.vehicles.mavlink.messages import Address, enum_name

VEHICLE, OURSELVES = Address(7, 1), Address(245, 191)
ONLY_POSITION, NO_POSITION = 0x0DF8, 0x0DFF
GOOD: dict[str, dict[str, Any]] = {
    "global_position_int": {
        "time_boot_ms": 5, "lat": -240000000, "lon": -463000000, "alt": 30000,
        "relative_alt": 20000, "vx": 1, "vy": 2, "vz": 3, "hdg": 4,
    },
    "home_position": {
        "latitude": -240000000, "longitude": -463000000, "altitude": 30000, "x": 0.0, "y": 0.0,
        "z": 0.0, "q": [1.0, 0.0, 0.0, 0.0], "approach_x": 0.0, "approach_y": 0.0,
        "approach_z": 0.0,
    },
    "position_target_global_int": {
        "time_boot_ms": 5, "coordinate_frame": 0, "type_mask": ONLY_POSITION,
        "lat_int": -240000000, "lon_int": -463000000, "alt": 30.0, "vx": 0.0, "vy": 0.0, "vz": 0.0,
        "afx": 0.0, "afy": 0.0, "afz": 0.0, "yaw": 0.0, "yaw_rate": 0.0,
    },
}  # fmt: skip
POLE, DATE_LINE, HIGHEST = 900_000_000, 1_800_000_000, 100_000_000
BAD = [
    ("global_position_int", "lat", 2_000_000_000),
    ("global_position_int", "lat", -POLE - 1),
    ("global_position_int", "lon", DATE_LINE + 1),
    ("global_position_int", "alt", HIGHEST + 1),
    ("global_position_int", "relative_alt", -HIGHEST - 1),
    ("home_position", "latitude", POLE + 1),
    ("home_position", "longitude", -DATE_LINE - 1),
    ("home_position", "altitude", -(2**31)),
    ("position_target_global_int", "lat_int", POLE + 1),
    ("position_target_global_int", "lon_int", 2**31 - 1),
    ("position_target_global_int", "alt", math.nan),
    ("position_target_global_int", "alt", math.inf),
    ("position_target_global_int", "alt", -1e30),
]


def frame(name: str, **fields: Any) -> bytes:
    message = getattr(mavlink, f"MAVLink_{name}_message")(**GOOD[name] | fields)
    return bytes(VehicleCodec(7).encode(message))


@pytest.mark.parametrize(("name", "field", "value"), BAD)
def test_an_invalid_position_is_counted_and_changes_nothing(
    name: str, field: str, value: float
) -> None:
    codec = Codec(OURSELVES, VEHICLE)
    controller = VehicleController(VEHICLE, OURSELVES, ControllerSettings())
    for good in GOOD:
        for message in codec.decode(frame(good), 1.0, datagram=True):
            controller.receive(message, 1.0)
    before = controller.state
    assert before.lat_deg == -24.0 and before.home == (-24.0, -46.3, 30.0)
    assert before.target == (-24.0, -46.3, 30.0)
    assert codec.decode(frame(name, **{field: value}), 2.0, datagram=True) == []
    assert codec.counts == {"accepted": 3, "invalid": 1}
    assert controller.state == before


@given(
    lat=st.integers(-POLE, POLE),
    lon=st.integers(-DATE_LINE, DATE_LINE),
    alt=st.integers(-HIGHEST, HIGHEST),
)
def test_every_position_on_earth_is_valid(lat: int, lon: int, alt: int) -> None:
    codec = Codec(OURSELVES, VEHICLE)
    position = frame("global_position_int", lat=lat, lon=lon, alt=alt, relative_alt=-alt)
    home = frame("home_position", latitude=lat, longitude=lon, altitude=alt)
    target = frame("position_target_global_int", lat_int=lat, lon_int=lon, alt=alt * 0.99e-3)
    for one in (position, home, target):
        assert len(codec.decode(one, 0.0, datagram=True)) == 1
    assert codec.counts == {"accepted": 3}


def test_a_target_without_a_position_is_valid_with_any_coordinates() -> None:
    codec = Codec(OURSELVES, VEHICLE)
    data = frame("position_target_global_int", type_mask=NO_POSITION, alt=math.nan)
    assert len(codec.decode(data, 0.0, datagram=True)) == 1


def test_results_of_a_transfer_have_the_names_of_the_protocol() -> None:
    numbers = (0, 14, 99, mavlink.MAV_MISSION_RESULT_ENUM_END)
    names = [enum_name("MAV_MISSION_RESULT", number, "MAV_MISSION_") for number in numbers]
    # The last number of the enumeration only marks its end.
    assert names == ["ACCEPTED", "DENIED", "99", str(mavlink.MAV_MISSION_RESULT_ENUM_END)]
    assert enum_name("MAV_RESULT", mavlink.MAV_RESULT_DENIED) == "DENIED"
