# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Plans of QGroundControl."""

import dataclasses
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_strategies import MISSIONS, NUMBERS

from msg_adapters.frames import GridFrame
from msg_adapters.mission_items import FRAME_MISSION, Home, Mission, MissionItem
from msg_adapters.plan_files import Plan, parse_plan, plan_text
from msg_adapters.track_missions import track_mission

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 0.0, 120.0)
MISSION = track_mission(FRAME, [(0, 0), (1, 0)], [False, True], home=Home(-24.1, -46.2, 3.0))


def same(mission, other):
    return mission.home == other.home and all(
        dataclasses.astuple(item) == pytest.approx(dataclasses.astuple(again), abs=0, nan_ok=True)
        for item, again in zip(mission.items, other.items, strict=True)
    )


@given(MISSIONS, st.sampled_from(["ardupilot", "px4"]), NUMBERS, NUMBERS)
def test_a_plan_comes_back_exactly(mission, firmware, cruise, hover):
    text = plan_text(mission, firmware=firmware, cruise_speed_mps=cruise, hover_speed_mps=hover)
    plan = parse_plan(text)
    assert same(plan.mission, mission)
    assert plan == Plan(plan.mission, firmware, cruise, hover)


def test_a_plan_is_laid_out_as_the_format_says():
    plan = json.loads(plan_text(MISSION, firmware="px4"))
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
    assert json.loads(plan_text(MISSION))["mission"]["firmwareType"] == 3


def test_what_ground_stations_add_is_ignored():
    document = json.loads(plan_text(MISSION))
    document["mission"]["firmwareType"] = 0
    document["mission"]["globalPlanAltitudeMode"] = 0
    document["mission"]["items"][1] |= {
        "AMSLAltAboveTerrain": None,
        "Altitude": 120,
        "AltitudeMode": 1,
    }
    document["mission"]["items"].append(
        {"command": 530, "frame": 2, "params": [0, 2, *[None] * 5], "type": "SimpleItem"}
    )
    plan = parse_plan(json.dumps(document))
    assert plan.firmware is None
    *items, camera = plan.mission.items
    assert same(Mission(plan.mission.home, tuple(items)), MISSION)
    assert camera.command == 530 and math.isnan(camera.lat_deg)


def broken(path, value):
    document = json.loads(plan_text(MISSION))
    inner = document
    for key in path[:-1]:
        inner = inner[key]
    if value is ...:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return json.dumps(document)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (["fileType"], "Waypoints", "plan.fileType: 'Waypoints' is not allowed; 'Plan'"),
        (["version"], 2, "plan.version: 2 is not allowed; at most 1"),
        (["mission"], [], "plan.mission: .* an object"),
        (["mission"], ..., "plan.mission: missing"),
        (["mission", "version"], 1, "plan.mission.version: 1 is not allowed; at least 2"),
        (["mission", "items"], {}, "plan.mission.items: .* a list"),
        (["mission", "plannedHomePosition"], [1, 2], "plan.*HomePosition: .* a list of 3"),
        (["mission", "plannedHomePosition"], [91, 0, 0], "plan.*HomePosition: latitude 91"),
        (["mission", "hoverSpeed"], "fast", "plan.mission.hoverSpeed: 'fast'"),
        (["mission", "items", 1, "type"], "ComplexItem", r"plan.mission.items\[1\].type: "),
        (["mission", "items", 1, "params"], [0] * 6, r"plan.mission.items\[1\].params: .* of 7"),
        (["mission", "items", 1, "params", 2], "x", r"plan.mission.items\[1\].params: .* finite"),
        (["mission", "items", 1, "params", 4], 100, r"plan.mission.items\[1\]: latitude 100"),
        (["mission", "items", 1, "params", 4], None, r"plan.mission.items\[1\]: latitude nan"),
        (["mission", "items", 1, "command"], 16.5, r"plan.mission.items\[1\].command: 16.5"),
        (["mission", "items", 1, "command"], 10**30, r"plan.mission.items\[1\].command: 1000"),
        (["mission", "items", 1, "frame"], True, r"plan.mission.items\[1\].frame: True"),
    ],
)
def test_a_broken_plan_is_refused_by_its_key(path, value, words):
    with pytest.raises(ValueError, match=f"^{words}") as error:
        parse_plan(broken(path, value))
    assert len(str(error.value)) < 300


@pytest.mark.parametrize("text", ["", "QGC WPL 110", "[" * 100_000, "{}", "NaN", '{"a": Infinity}'])
def test_a_file_of_another_kind_is_refused_in_one_line(text):
    with pytest.raises(ValueError, match="^plan") as error:
        parse_plan(text)
    assert str(error.value).isprintable()


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=7) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=10,
)
PATHS = st.sampled_from(
    [
        ["mission"],
        ["version"],
        ["mission", "items"],
        ["mission", "firmwareType"],
        ["mission", "plannedHomePosition"],
        ["mission", "items", 0],
        ["mission", "items", 0, "params"],
        ["mission", "items", 0, "params", 5],
        ["mission", "items", 0, "frame"],
    ]
)


@given(PATHS, JSON)
def test_a_hostile_plan_is_read_or_refused_in_one_line(path, value):
    try:
        plan = parse_plan(broken(path, value))
    except ValueError as error:
        assert str(error).startswith("plan") and str(error).isprintable()
    else:
        assert same(parse_plan(plan_text(plan.mission)).mission, plan.mission)


@pytest.mark.parametrize(
    ("item", "words"),
    [
        (MissionItem(16, lat_deg=100.0), "item 1: latitude 100.0"),
        (MissionItem(16, alt_m=math.nan), "item 1: altitude nan"),
        (MissionItem(20, FRAME_MISSION, param1=math.inf), "item 1: an infinite parameter"),
    ],
)
def test_an_item_off_the_earth_is_not_planned(item, words):
    with pytest.raises(ValueError, match=f"^{words} is not allowed"):
        plan_text(Mission(MISSION.home, (item,)))


def test_home_must_be_on_the_earth():
    with pytest.raises(ValueError, match="^home: longitude 181.0 is not allowed"):
        plan_text(Mission(Home(0.0, 181.0, 0.0), ()))
