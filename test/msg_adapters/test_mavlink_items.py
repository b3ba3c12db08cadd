# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Items and targets as the fields of MAVLink messages."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_strategies import ITEMS, MISSIONS

from dsse_ros.mavlink.mission_messages import WireItem
from msg_adapters.mavlink_items import (
    item_fields,
    item_from_fields,
    mission_fields,
)
from msg_adapters.mission_items import FRAME_MISSION, MissionItem

DEGREES = st.tuples(st.floats(-90, 90), st.floats(-180, 180))
INTS = st.integers(-1_800_000_000, 1_800_000_000)


@given(DEGREES)
def test_a_place_keeps_its_seventh_decimal(place):
    lat_deg, lon_deg = place
    fields = item_fields(MissionItem(16, lat_deg=lat_deg, lon_deg=lon_deg), 3)
    assert abs(fields["x"] - lat_deg * 1e7) <= 0.500001
    assert abs(fields["y"] - lon_deg * 1e7) <= 0.500001
    assert {type(fields["x"]), type(fields["y"])} == {int}


@given(INTS, INTS, st.integers(0, 65535))
def test_what_was_on_the_wire_goes_over_it_again_unchanged(x, y, command):
    fields = {**item_fields(MissionItem(command), 7), "x": x, "y": y}
    assert item_fields(item_from_fields(fields), 7) == fields


@given(ITEMS)
def test_an_item_comes_back_from_its_fields(item):
    again = item_from_fields(item_fields(item, 0))
    if item.frame in (5, 6, 11):
        item = dataclasses.replace(item, frame={5: 0, 6: 3, 11: 10}[item.frame])
    if item.command == 19 and math.isnan(item.param4):
        item = dataclasses.replace(item, param4=0.0)
    most = 0.51 if item.frame == FRAME_MISSION else 0.51e-7
    assert dataclasses.astuple(again) == pytest.approx(
        dataclasses.astuple(item), rel=0, abs=most, nan_ok=True
    )


@given(MISSIONS)
def test_the_fields_of_a_mission_are_items_for_the_wire(mission):
    items = [WireItem(**fields) for fields in mission_fields(mission.numbered("ardupilot"))]
    assert [item.seq for item in items] == list(range(len(mission.items) + 1))
    assert [item.current for item in items] == [1, *[0] * len(mission.items)]


@pytest.mark.parametrize(("frame", "wire"), [(0, 5), (3, 6), (10, 11), (2, 2), (6, 6), (1, 1)])
def test_frames_on_the_wire_are_the_integer_ones(frame, wire):
    assert item_fields(MissionItem(16, frame), 1)["frame"] == wire


def test_a_yaw_that_is_left_open_is_sent_as_each_command_wants_it():
    def yaw(command):
        return item_fields(MissionItem(command, param4=math.nan), 1)["param4"]

    assert math.isnan(yaw(16)) and math.isnan(yaw(22))
    assert yaw(19) == 0.0


def test_numbers_that_are_no_place_are_not_scaled():
    fields = item_fields(MissionItem(178, FRAME_MISSION, lat_deg=5.0, lon_deg=-6.0), 1)
    assert (fields["x"], fields["y"]) == (5, -6)
    assert item_from_fields(fields).lat_deg == 5.0


@pytest.mark.parametrize("value", [math.nan, math.inf, 215.0, -1e300])
def test_a_place_that_does_not_fit_is_refused(value):
    with pytest.raises(ValueError, match="^latitude: .* is not allowed"):
        item_fields(MissionItem(16, lat_deg=value), 1)
    with pytest.raises(ValueError, match="^longitude: .* is not allowed"):
        item_fields(MissionItem(16, lon_deg=value), 1)
