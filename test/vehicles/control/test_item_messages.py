# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Items as MAVLink's messages, which survive the wire."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_strategies import ITEMS, MISSIONS
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.control.item_messages import item_message, mission_messages
from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, MissionItem

DEGREES = st.tuples(st.floats(-90, 90), st.floats(-180, 180))


def over_the_wire(message):
    frame = message.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1))
    (received,) = mavlink.MAVLink(None).parse_buffer(frame)
    return received


@given(DEGREES)
def test_a_place_keeps_its_seventh_decimal(place):
    lat_deg, lon_deg = place
    message = item_message(MissionItem(16, lat_deg=lat_deg, lon_deg=lon_deg), 3)
    assert abs(message.x - lat_deg * 1e7) <= 0.500001
    assert abs(message.y - lon_deg * 1e7) <= 0.500001
    assert {type(message.x), type(message.y)} == {int}


@given(ITEMS, st.integers(0, 65535), st.tuples(st.integers(0, 255), st.integers(0, 255)))
def test_an_item_comes_over_the_wire(item, seq, target):
    read = over_the_wire(item_message(item, seq, target))
    assert (read.target_system, read.target_component, read.seq) == (*target, seq)
    assert (read.command, read.autocontinue, read.current) == (item.command, 1, seq == 0)
    assert read.frame == {0: 5, 3: 6, 10: 11}.get(item.frame, item.frame)
    scale = 1 if item.frame == FRAME_MISSION else 1e7
    assert (read.x / scale, read.y / scale) == pytest.approx(
        (item.lat_deg, item.lon_deg), rel=0, abs=0.51 / scale
    )
    yaw = 0.0 if item.command == 19 and math.isnan(item.param4) else item.param4
    assert (read.param1, read.param2, read.param3, read.param4, read.z) == pytest.approx(
        (item.param1, item.param2, item.param3, yaw, item.alt_m), rel=1e-6, nan_ok=True
    )


@given(MISSIONS)
def test_the_items_of_a_mission_are_numbered(mission):
    items = mission_messages(mission.numbered(home_first=True))
    assert [item.seq for item in items] == list(range(len(mission.items) + 1))
    assert [item.current for item in items] == [1, *[0] * len(mission.items)]


@pytest.mark.parametrize(("frame", "wire"), [(0, 5), (3, 6), (10, 11), (2, 2), (6, 6), (1, 1)])
def test_frames_on_the_wire_are_the_integer_ones(frame, wire):
    assert item_message(MissionItem(16, frame), 1).frame == wire


def test_a_yaw_that_is_left_open_is_sent_as_each_command_wants_it():
    def yaw(command):
        return item_message(MissionItem(command, param4=math.nan), 1).param4

    assert math.isnan(yaw(16)) and math.isnan(yaw(22))
    assert yaw(19) == 0.0


def test_numbers_that_are_no_place_are_not_scaled():
    message = item_message(MissionItem(178, FRAME_MISSION, lat_deg=5.0, lon_deg=-6.0), 1)
    assert (message.x, message.y) == (5, -6)


@pytest.mark.parametrize("value", [math.nan, math.inf, 215.0, -1e300])
def test_a_place_that_does_not_fit_is_refused(value):
    with pytest.raises(ValueError, match="^latitude must be .*, got "):
        item_message(MissionItem(16, lat_deg=value), 1)
    with pytest.raises(ValueError, match="^longitude must be .*, got "):
        item_message(MissionItem(16, lon_deg=value), 1)


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"command": -1}, "command"),
        ({"command": 65536}, "command"),
        ({"frame": 256}, "frame"),
        ({"param1": 3.5e38}, "param1"),
        ({"param4": -3.5e38}, "param4"),
        ({"alt_m": 3.5e38}, "altitude"),
    ],
)
def test_a_value_that_does_not_fit_its_field_is_refused(fields, name):
    with pytest.raises(ValueError, match=f"^{name} must be .*, got "):
        item_message(MissionItem(**{"command": 16} | fields), 1)


@pytest.mark.parametrize("seq", [-1, 65536])
def test_a_number_that_does_not_fit_its_field_is_refused(seq):
    with pytest.raises(ValueError, match="^seq must be 0 to 65535, got "):
        item_message(MissionItem(16), seq)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3.4e38, 0])
def test_whatever_float32_holds_is_kept(value):
    kept = item_message(MissionItem(16, param4=value), 1).param4
    assert kept == value or math.isnan(kept) and math.isnan(value)
