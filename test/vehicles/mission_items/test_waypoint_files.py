# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files of waypoints."""

import dataclasses
import math

import mission_reader
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_strategies import ITEMS

from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, MissionItem
from dsse_ros.vehicles.mission_items.track_missions import track_mission
from dsse_ros.vehicles.mission_items.waypoint_files import qgc_wpl
from dsse_ros.world.scenario.frames import GridFrame

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 0.0, 120.0)


@given(st.lists(ITEMS, max_size=6))
def test_items_come_back_from_a_file_to_eight_decimals(items):
    read = mission_reader.waypoints(qgc_wpl(items))
    assert len(read) == len(items)
    for item, again in zip(items, read, strict=True):
        assert dataclasses.astuple(again) == pytest.approx(
            dataclasses.astuple(item), rel=0, abs=0.51e-8, nan_ok=True
        )


def test_a_file_is_laid_out_as_the_format_says():
    text = qgc_wpl(track_mission(FRAME, [(0, 0)]).numbered(home_first=True))
    header, *lines = text.removesuffix("\n").split("\n")
    assert header == "QGC WPL 110"
    rows = [line.split("\t") for line in lines]
    assert [len(row) for row in rows] == [12] * 4
    assert [row[0] for row in rows] == ["0", "1", "2", "3"]
    assert [row[1] for row in rows] == ["1", "0", "0", "0"]
    assert [row[3] for row in rows] == ["16", "22", "16", "20"]
    assert {row[11] for row in rows} == {"1"}
    assert all(len(row[column].split(".")[1]) == 8 for row in rows for column in (8, 9))


@pytest.mark.parametrize(
    ("field", "value"), [("lat_deg", 100.0), ("lon_deg", math.nan), ("alt_m", math.inf)]
)
def test_an_item_off_the_earth_is_not_written(field, value):
    with pytest.raises(ValueError, match="^item 1: .* must be "):
        qgc_wpl([MissionItem(16), MissionItem(16, **{field: value})])


@pytest.mark.parametrize("field", ["param1", "param4", "lon_deg"])
def test_an_infinite_number_is_not_written(field):
    with pytest.raises(ValueError, match="^item 0: .* must be a number, got "):
        qgc_wpl([MissionItem(20, FRAME_MISSION, **{field: math.inf})])


def test_numbers_that_are_no_place_are_kept():
    item = MissionItem(178, FRAME_MISSION, param2=8.0, lat_deg=1000.0, lon_deg=-2000.5)
    assert mission_reader.waypoints(qgc_wpl([item])) == [item]
