# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Why a step waits, in words."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.status import of_drones, reasons_without_commands
from dsse_ros.search.environments.factories import parallel_env

NAMES = ("cmd_action_name", "command_pose")
counts = st.integers(0, 2)


def mission(drones: int) -> Mission:
    return Mission(parallel_env(grid_size=12, num_drones=drones), 0)


def publishers(drones: int, **counted: int) -> dict[str, int]:
    topics = ["joint_action", *(f"drone{i}/{name}" for i in range(drones) for name in NAMES)]
    return {topic: counted.get(topic.replace("/", "_"), 0) for topic in topics}


def test_without_a_publisher_the_topics_that_it_may_use_are_named() -> None:
    why = reasons_without_commands(mission(1), publishers(1), ["joint_action"])
    assert why == "no publisher on joint_action or drone0/cmd_action_name"


def test_a_command_from_before_the_discovery_is_the_reason_where_there_is_a_publisher() -> None:
    found = publishers(2, drone0_cmd_action_name=1)
    assert reasons_without_commands(mission(2), found, ["joint_action"]) == (
        "no publisher on joint_action or drone1/cmd_action_name; a publisher on "
        "drone0/cmd_action_name, but no command for step 0 since it was discovered"
    )


def test_of_many_drones_the_first_are_named_and_the_others_counted() -> None:
    why = reasons_without_commands(mission(30), publishers(30), ["joint_action"])
    assert "drone7/cmd_action_name and 22 more" in why and "drone8" not in why


@given(st.lists(st.tuples(counts, counts), min_size=1, max_size=5), counts)
def test_each_drone_without_a_command_has_one_reason(
    own: list[tuple[int, int]], joint: int
) -> None:
    found = publishers(len(own)) | {"joint_action": joint}
    for i, drone in enumerate(own):
        found |= {f"drone{i}/{name}": count for name, count in zip(NAMES, drone, strict=True)}
    why = reasons_without_commands(mission(len(own)), found, ["joint_action"])
    silent, _, heard = why.rpartition("a publisher on ") if "a publisher" in why else (why, "", "")
    for i, drone in enumerate(own):
        assert (f"drone{i}/" in silent) == (not joint and not any(drone))
        assert (f"drone{i}/" in heard) == (not joint and any(drone))
    assert ("a publisher on joint_action" in why) == bool(joint)


def test_each_drone_has_a_status_of_its_own() -> None:
    flown = mission(3)
    flown.lose(1)
    states = {name: (level, line) for name, level, line, _ in of_drones(flown, {}, waits=True)}
    assert states == {
        "drone0": ("ok", "in flight, waiting for a command"),
        "drone1": ("error", "lost"),
        "drone2": ("ok", "in flight, waiting for a command"),
    }
    (_, *blind, _) = list(of_drones(flown, {}, waits=False, blind={0: "25 m below its altitude"}))[
        0
    ]
    line = "in flight; its vehicle does not look: 25 m below its altitude"
    assert blind == ["warning", line]
    (_, *lost, values) = list(of_drones(flown, {1: "link lost"}, waits=False))[1]
    assert lost == ["error", "lost: link lost"]
    col, row = flown.result.cells[1].tolist()
    assert values == {"cell": f"{col} {row}", "action": "none"}


def test_the_status_of_a_drone_has_its_condition_and_battery() -> None:
    flown = Mission(parallel_env(grid_size=12, num_drones=1, battery_move=1.0), 0)
    ((_, level, line, values),) = of_drones(flown, {}, waits=False)
    assert (level, line, values["battery"]) == ("ok", "searching", "100.0")
