# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Plans of QGroundControl."""

import dataclasses
import json
import math

import mission_reader
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_strategies import MISSIONS

from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, Home, MissionItem, VehicleMission
from dsse_ros.vehicles.mission_items.plan_files import plan_text
from dsse_ros.vehicles.mission_items.track_missions import track_mission
from dsse_ros.world.scenario.frames import GridFrame

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 0.0, 120.0)
MISSION = track_mission(FRAME, [(0, 0), (1, 0)], [False, True], home=Home(-24.1, -46.2, 3.0))


def same(mission, other):
    return mission.home == other.home and all(
        dataclasses.astuple(item) == pytest.approx(dataclasses.astuple(again), abs=0, nan_ok=True)
        for item, again in zip(mission.items, other.items, strict=True)
    )


@given(MISSIONS, st.sampled_from([3, 12]))
def test_a_plan_has_every_number_exactly(mission, firmware):
    text = plan_text(mission, firmware, 2)
    assert same(mission_reader.plan(text), mission)
    document = json.loads(text)["mission"]
    assert document["firmwareType"] == firmware


def test_a_plan_is_laid_out_as_the_format_says():
    plan = json.loads(plan_text(MISSION, 12, 2))
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    assert (plan["geoFence"]["version"], plan["rallyPoints"]["version"]) == (2, 2)
    mission = plan["mission"]
    assert (mission["version"], mission["vehicleType"], mission["firmwareType"]) == (2, 2, 12)
    assert mission["plannedHomePosition"] == [-24.1, -46.2, 3.0]
    assert [item["doJumpId"] for item in mission["items"]] == [1, 2, 3, 4, 5, 6]
    assert [item["command"] for item in mission["items"]] == [22, 16, 16, 16, 16, 20]
    assert {item["type"] for item in mission["items"]} == {"SimpleItem"}
    assert {item["autoContinue"] for item in mission["items"]} == {True}
    waypoint = mission["items"][1]
    assert waypoint["params"][:4] == [0.0, 0.0, 0.0, None] and waypoint["frame"] == 3


@pytest.mark.parametrize(
    ("item", "words"),
    [
        (MissionItem(16, lat_deg=100.0), "item 1: latitude must be .* got 100.0"),
        (MissionItem(16, alt_m=math.nan), "item 1: altitude must be .* got nan"),
        (MissionItem(20, FRAME_MISSION, param1=math.inf), "item 1: param1 must .* got inf"),
    ],
)
def test_an_item_off_the_earth_is_not_planned(item, words):
    with pytest.raises(ValueError, match=f"^{words}$"):
        plan_text(VehicleMission(MISSION.home, (item,)), 3, 2)


def test_home_must_be_on_the_earth():
    with pytest.raises(ValueError, match="^home: longitude must be -180 to 180, got 181.0$"):
        plan_text(VehicleMission(Home(0.0, 181.0, 0.0), ()), 3, 2)
