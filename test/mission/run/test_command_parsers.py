# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands from anyone: understood, or refused with a code and one clear line."""

import math
import re

import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Header

from dsse_ros.base.fields import shown
from dsse_ros.base.result import Accepted, Rejected
from dsse_ros.mission.run import command_parsers
from dsse_ros.world.scenario.frames import GridFrame, map_positions
from msg_adapters.commands import joint_action_message
from msg_adapters.poses import FramedPose, pose_from_message, pose_stamped
from msg_adapters.stamps import header, to_stamp

ACTIONS = ("left", "right", "up", "down", "search")
FRAME = GridFrame(8, 130.0, -24.04, -46.17, 0.0, 120.0)
STAMP = to_stamp(0)

INT32 = st.integers(-(2**31), 2**31 - 1)
CELLS = st.tuples(st.integers(0, 7), st.integers(0, 7))
# What DDS can carry in a string: any text without surrogates.
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=200)
FRAME_IDS = st.sampled_from(["map", "map", "map", "", "odom", "/map", "map "]) | TEXTS
FLOATS = st.floats() | st.floats(-100, 1200)
ORIENTATIONS = st.builds(Quaternion) | st.builds(Quaternion, x=FLOATS, w=FLOATS)
POSES = st.builds(
    Pose,
    position=st.builds(Point, x=FLOATS, y=FLOATS, z=FLOATS),
    orientation=ORIENTATIONS,
)
STAMPED = st.builds(PoseStamped, header=st.builds(Header, frame_id=FRAME_IDS), pose=POSES)


def goal(cell):
    return FramedPose("map", *map_positions(FRAME, [cell], 0), (0.0, 0.0, 0.0, 1.0))


def check(result, codes):
    """Check that a result is a value, or a refusal by one of the codes and in one line."""
    assert isinstance(result, Accepted | Rejected)
    if isinstance(result, Rejected):
        assert result.code in codes
        assert result.reason.isprintable() and len(result.reason) < 300
    return isinstance(result, Accepted)


@given(st.sampled_from(ACTIONS) | TEXTS)
def test_an_action_name_is_exactly_one_of_the_names_or_refused(name):
    result = command_parsers.parse_action_name(name, ACTIONS)
    if check(result, {"unknown_action"}):
        assert ACTIONS[result.value] == name
    else:
        assert name not in ACTIONS
        assert "left, right, up, down, search" in result.reason


@pytest.mark.parametrize("name", ["Search", "search ", "", "4", "ѕearch", "search\x00"])
def test_an_action_name_that_only_looks_right_is_refused(name):
    result = command_parsers.parse_action_name(name, ACTIONS)
    assert isinstance(result, Rejected) and result.code == "unknown_action"


@given(CELLS)
def test_a_goal_is_the_cell_it_was_made_from(cell):
    assert command_parsers.parse_goal(goal(cell), FRAME) == Accepted(cell)


@given(STAMPED)
def test_any_goal_is_a_cell_of_the_grid_or_refused(message):
    result = command_parsers.parse_goal(pose_from_message(message), FRAME)
    if check(result, {"foreign_frame", "not_finite", "outside_grid"}):
        assert message.header.frame_id == "map"
        assert all(0 <= part < 8 and type(part) is int for part in result.value)


@given(TEXTS)
def test_any_behavior_tree_is_refused(tree):
    refused = command_parsers.refuse_behavior_tree(tree)
    assert check(refused, {"behavior_tree"}) is False if tree else refused is None


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda m: setattr(m.header, "frame_id", "odom"), "foreign_frame", "'map', got 'odom'"),
        (lambda m: setattr(m.header, "frame_id", ""), "foreign_frame", "header.frame_id .* got ''"),
        (lambda m: setattr(m.pose.position, "x", math.nan), "not_finite", "position.x .* got nan"),
        (lambda m: setattr(m.pose.position, "z", math.inf), "not_finite", "position.z .* got inf"),
        (lambda m: setattr(m.pose.orientation, "w", math.nan), "not_finite", "orientation.w"),
        (lambda m: setattr(m.pose.position, "y", 1040.0), "outside_grid", "1040"),
        (lambda m: setattr(m.pose.position, "x", -1e-9), "outside_grid", "0 <= x, y < 1040 m"),
    ],
)
def test_a_bad_goal_is_refused_by_its_fault(change, code, words):
    message = pose_stamped(header("map", STAMP), (455.0, 585.0, 120.0))
    change(message)
    result = command_parsers.parse_goal(pose_from_message(message), FRAME)
    assert isinstance(result, Rejected) and result.code == code
    assert re.search(words, result.reason)


@given(
    st.integers(1, 2**31 - 1),
    st.integers(0, 2**31 - 1),
    st.lists(st.integers(0, 4), max_size=8),
)
def test_a_joint_action_comes_back(mission, step, actions):
    data = joint_action_message(mission, step, actions).data
    live = [True] * len(actions)
    result = command_parsers.parse_joint_action(data, mission, step, ACTIONS, live)
    assert result == Accepted(tuple(actions))


@given(
    st.lists(st.integers(0, 6) | INT32, max_size=6),
    st.integers(1, 2),
    st.integers(0, 3),
    st.lists(st.booleans(), max_size=4),
)
def test_any_joint_action_is_for_all_live_drones_or_for_none(data, mission, step, live):
    result = command_parsers.parse_joint_action(data, mission, step, ACTIONS, live)
    if check(result, {"wrong_size", "stale_mission", "stale_step", "unknown_action"}):
        head, sent = data[: -len(live) or None], data[len(data) - len(live) :]
        assert head == [mission, step] and len(sent) == len(result.value)
        for value, number, takes_part in zip(result.value, sent, live, strict=True):
            assert value == (number if takes_part else command_parsers.NO_ACTION)
            assert not takes_part or 0 <= value < len(ACTIONS)


def parsed(data, live=(True, True)):
    """Parse for step 5 of mission 3."""
    return command_parsers.parse_joint_action(data, 3, 5, ACTIONS, live)


@pytest.mark.parametrize("step", [4, 6, -1])
def test_a_stale_or_future_joint_action_is_refused(step):
    result = parsed([3, step, 0, 1])
    assert isinstance(result, Rejected) and result.code == "stale_step"
    assert result.reason == f"data[1] must be step 5, got {step}"


@pytest.mark.parametrize("mission", [2, 4, 0])
def test_a_joint_action_of_another_mission_is_refused_whatever_its_step(mission):
    for step in (4, 5):
        result = parsed([mission, step, 0, 1])
        assert isinstance(result, Rejected) and result.code == "stale_mission"
        assert result.reason == f"data[0] must be mission 3, got {mission}"


@pytest.mark.parametrize("data", [[], [3, 5], [5, 0, 0], [3, 5, 0], [3, 5, 0, 0, 0]])
def test_a_joint_action_of_the_wrong_length_is_refused(data):
    result = parsed(data)
    assert isinstance(result, Rejected) and result.code == "wrong_size"


def test_an_unknown_action_refuses_all_but_only_of_a_live_drone():
    message = [3, 5, 0, 9]
    refused = parsed(message)
    assert isinstance(refused, Rejected) and refused.code == "unknown_action"
    assert refused.reason.startswith("drone1: data[3] must be one of ")
    assert parsed(message, (True, False)) == Accepted((0, command_parsers.NO_ACTION))


NUMBERED = "0 left, 1 right, 2 up, 3 down, 4 search"


def moved(frame_id="map", **position):
    pose = goal((3, 3))
    x, y, z = pose.position
    return pose._replace(
        frame_id=frame_id, position=(position.get("x", x), position.get("y", y), z)
    )


@pytest.mark.parametrize(
    ("parse", "reason"),
    [
        (
            lambda: command_parsers.parse_action_name("fly", ACTIONS),
            "data must be one of left, right, up, down, search, got 'fly'",
        ),
        (
            lambda: command_parsers.parse_goal(moved("odom"), FRAME),
            "header.frame_id must be 'map', got 'odom'",
        ),
        (
            lambda: command_parsers.parse_goal(moved(y=1040.0), FRAME),
            "pose.position must be 0 <= x, y < 1040 m, got (455, 1040)",
        ),
        (
            lambda: command_parsers.refuse_behavior_tree("tree.xml"),
            "behavior_tree must be empty, got 'tree.xml'",
        ),
        (
            lambda: command_parsers.parse_place(moved(x=math.nan), FRAME),
            "pose.position must be finite, got (nan, 585.0)",
        ),
        (
            lambda: parsed([5]),
            "data must be mission, step and 2 actions, got 1 numbers",
        ),
        (
            lambda: parsed([2, 5, 0, 1]),
            "data[0] must be mission 3, got 2",
        ),
        (
            lambda: parsed([3, 4, 0, 1]),
            "data[1] must be step 5, got 4",
        ),
        (
            lambda: parsed([3, 5, 0, 5]),
            f"drone1: data[3] must be one of {NUMBERED}, got 5",
        ),
    ],
)
def test_a_refusal_says_the_field_its_value_and_what_is_allowed(parse, reason):
    assert parse().reason == reason


@given(st.text() | st.binary() | st.integers() | st.floats() | st.lists(st.text()))
def test_a_value_in_a_reason_is_short_and_printable(value):
    text = shown(value)
    assert len(text) <= 80 and text.isprintable()


def test_a_vehicle_may_be_anywhere_in_the_frame_of_the_map():
    assert command_parsers.parse_place(moved(x=-7.5, y=1e5), FRAME) == Accepted((-7.5, 1e5))


@pytest.mark.parametrize(
    ("pose", "code"), [(moved("odom"), "foreign_frame"), (moved(x=math.inf), "not_finite")]
)
def test_a_vehicle_that_is_nowhere_is_refused(pose, code):
    result = command_parsers.parse_place(pose, FRAME)
    assert isinstance(result, Rejected) and result.code == code
