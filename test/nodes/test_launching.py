# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The launch files, described and expanded by launch itself, where a full ROS 2 has it."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("launch.actions", reason="launch comes with a full ROS 2, not with wheels")
pytest.importorskip("launch_ros.actions", reason="launch_ros comes with a full ROS 2")

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import LaunchContext
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

from dsse_ros.nodes.launch_arguments import FLIGHT, MISSION

ROOT = Path(__file__).resolve().parents[2]
FILES = {"mission": MISSION, "flight": FLIGHT}


def expand(file: str, **given: str) -> list[Any]:
    """Return the nodes that a launch file makes of these arguments."""
    made = runpy.run_path(str(ROOT / "launch" / f"{file}.launch.py"))
    context = LaunchContext()
    context.launch_configurations.update(given)
    nodes: list[Any] = []
    for entity in made["generate_launch_description"]().entities:
        assert isinstance(entity, DeclareLaunchArgument | OpaqueFunction)
        nodes += entity.execute(context) or []
    for node in nodes:
        node._perform_substitutions(context)
    return nodes


def parameters(node: Any) -> dict[str, Any]:
    """Return what the files that launch writes for a node have, the last one first."""
    found: dict[str, Any] = {}
    words = ["".join(getattr(part, "text", "") for part in word) for word in node.cmd[1:]]
    for flag, value in zip(words, words[1:], strict=False):
        if flag == "--params-file":
            for section in yaml.safe_load(Path(value).read_text()).values():
                found |= section["ros__parameters"]
    return found


@pytest.mark.parametrize("file", FILES)
def test_the_arguments_are_declared_with_their_defaults_and_choices(file: str) -> None:
    made = runpy.run_path(str(ROOT / "launch" / f"{file}.launch.py"))
    declared = {
        one.name: one for one in made["generate_launch_description"]().get_launch_arguments()
    }
    assert declared.keys() == FILES[file].keys()
    for name, argument in FILES[file].items():
        assert "".join(part.text for part in declared[name].default_value) == argument.default
        assert (declared[name].choices or ()) == (list(argument.choices) or ())
        assert declared[name].description.startswith(argument.doc)


@pytest.mark.parametrize("file", FILES)
def test_values_reach_the_nodes_with_their_types(file: str) -> None:
    nodes = expand(file, seed="6", num_drones="3", step_rate="2", record_file="1e3", arm="true")
    assert all(isinstance(node, Node) for node in nodes)
    sim, planner = map(parameters, nodes[:2])
    assert (sim["seed"], sim["num_drones"], sim["step_rate"]) == (6, 3, 2.0)
    assert isinstance(sim["step_rate"], float) and sim["record_file"] == "1e3"
    assert planner["seed"] == 6 and planner["planner"] == "greedy"


def test_lists_reach_the_bridge() -> None:
    bridge = parameters(expand("flight", connections="[tcp:a:1, tcp:b:2]", system_ids="[4, 5]")[2])
    assert bridge["connections"] == ["tcp:a:1", "tcp:b:2"] and bridge["system_ids"] == [4, 5]


def test_nothing_is_started_where_rviz_is_wanted_and_missing() -> None:
    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError:
        with pytest.raises(PackageNotFoundError, match="rviz2"):
            expand("mission", rviz="true")
    else:
        assert len(expand("mission", rviz="true")) == 3
