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

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from domains import free_domain
from launch import LaunchContext
from launch.actions import Shutdown

from dsse_ros.base.fields import FieldError
from dsse_ros.ros.nodes import launching
from dsse_ros.ros.runtime.run_node import overrides_of

ROOT = Path(__file__).resolve().parents[3]
FILES = ("mission", "flight")
OTHERS = ("recorder", "foxglove_viewer")


@pytest.fixture(autouse=True)
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launching, "_share", lambda: ROOT)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))


def expand(file: str, **given: str) -> dict[str, list[str]]:
    """Return the command lines of the nodes that a launch file makes of these arguments."""
    names = runpy.run_path(str(ROOT / "launch" / f"{file}.launch.py"))
    context = LaunchContext(argv=[f"{name}:={value}" for name, value in given.items()])
    context.launch_configurations.update(given)
    nodes: list[Any] = []
    for entity in names["generate_launch_description"]().entities:
        nodes += entity.execute(context) or []
    lines = {}
    for node in nodes:
        node._perform_substitutions(context)
        name = node.node_name.rpartition("/")[2]
        lines[name] = ["".join(getattr(p, "text", "") for p in word) for word in node.cmd[1:]]
        # launch knows name and namespace only once it has started a node.
        lines[name] = [word for word in lines[name] if word]
        while "-r" in lines[name]:
            lines[name].remove("-r")
    return lines


def parameters(line: list[str], name: str, namespace: str = "") -> dict[str, Any]:
    """Return the parameters that a node of this name gets from its command line."""
    ros = line[line.index("--ros-args") + 1 :]
    ros = [word for word in ros if word != "--ros-args"]
    return overrides_of((name,), [*ros, "-r", f"__ns:={namespace or '/'}"])


def test_a_launch_without_arguments_takes_the_defaults_of_its_file() -> None:
    mission, flight = expand("mission"), expand("flight")
    assert list(mission) == ["sim_node", "planner_node"]
    assert list(flight) == ["sim_node", "planner_node", "mavlink_bridge"]
    assert parameters(mission["sim_node"], "sim_node") == {
        "scenario.file": "santos", "step_rate": 5.0, "exit_at_end": True,
    }  # fmt: skip
    assert parameters(flight["sim_node"], "sim_node") == {
        "scenario.file": "sitl", "vehicle_time": "followed",
    }  # fmt: skip
    bridge = parameters(flight["mavlink_bridge"], "mavlink_bridge")
    assert (bridge["exit_at_end"], bridge["num_vehicles"]) == (True, 3)


@pytest.mark.parametrize("file", FILES)
def test_values_reach_the_nodes_with_their_types(file: str) -> None:
    lines = expand(file, seed="6", num_drones="3", rules="v1", scenario="paper_zone")
    sim, planner = (parameters(lines[name], name) for name in ("sim_node", "planner_node"))
    assert (sim["seed"], sim["scenario.num_drones"], planner["seed"]) == (6, 3, 6)
    assert (sim["rules.profile"], sim["scenario.file"]) == ("v1", "paper_zone")


@pytest.mark.parametrize("namespace", ["", "/a", "/a/b"])
@pytest.mark.parametrize("node", ["/**", "/**/sim_node", "{}/sim_node"])
def test_arguments_win_over_the_file_and_the_file_wins_over_the_defaults(
    node: str, namespace: str, tmp_path: Path
) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(
        f"{node.format(namespace)}: {{ros__parameters: "
        "{step_rate: 2.0, seed: 1, scenario.file: sitl}}"
    )
    line = expand("mission", params_file=str(file), seed="6", namespace=namespace)["sim_node"]
    sim = parameters(line, "sim_node", namespace)
    assert (sim["step_rate"], sim["seed"], sim["scenario.file"]) == (2.0, 6, "sitl")


def test_the_vehicles_get_what_the_flight_gives_them() -> None:
    lines = expand(
        "flight", connections="['tcp:a:1', 'tcp:b:2']", num_drones="2", arm="true", autopilot="px4"
    )
    bridge = parameters(lines["mavlink_bridge"], "mavlink_bridge")
    assert bridge["connections"] == ["tcp:a:1", "tcp:b:2"]
    assert (bridge["num_vehicles"], bridge["arm"], bridge["autopilot"]) == (2, True, "px4")
    assert parameters(lines["sim_node"], "sim_node")["autopilot"] == "px4"


@pytest.mark.parametrize(("mode", "time"), [("guided", "followed"), ("mission", "ignored")])
def test_the_sea_follows_vehicles_that_follow_it_and_no_others(mode: str, time: str) -> None:
    sim = parameters(expand("flight", mode=mode)["sim_node"], "sim_node")
    assert sim["vehicle_time"] == time


@pytest.mark.parametrize("file", FILES)
def test_recorder_and_viewer_start_where_they_are_wanted(file: str) -> None:
    assert not set(OTHERS) & set(expand(file))
    lines = expand(file, record="true", viewer="foxglove", bag="a.mcap")
    assert next(iter(lines)) == "recorder" and "foxglove_viewer" in lines
    assert parameters(lines["recorder"], "recorder") == {"bag": "a.mcap"}
    # Who names a bag wants one.
    lines = expand(file, bag="a.mcap")
    assert parameters(lines["recorder"], "recorder") == {"bag": "a.mcap"}


@pytest.mark.parametrize("file", FILES)
def test_an_unknown_argument_of_the_command_line_is_refused_with_the_nearest_one(
    file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"{file}.launch.py"
    for started in (["ros2", "launch", "dsse_ros", name], ["ros2", "launch", f"launch/{name}"]):
        monkeypatch.chdir(ROOT)
        monkeypatch.setattr("sys.argv", [*started, "drones:=8"])
        with pytest.raises(FieldError, match="'drones' is not .*; did you mean num_drones\\?"):
            expand(file, drones="8")
    # It may be an argument of a file that includes this one.
    monkeypatch.setattr("sys.argv", ["ros2", "launch", "others", "all.launch.py", "drones:=8"])
    assert "sim_node" in expand(file, drones="8")


def test_logs_and_enclaves_have_the_names_of_the_nodes() -> None:
    line = expand("mission", namespace="/a/b", log_level="debug")["sim_node"]
    assert line[line.index("--log-level") + 1] == "a.b.sim_node:=debug"
    assert line[line.index("--enclave") + 1] == "/dsse_ros/sim_node"


def test_nothing_is_started_where_rviz_is_wanted_and_missing() -> None:
    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError:
        with pytest.raises(PackageNotFoundError, match="rviz2"):
            expand("mission", rviz="true")
    else:
        assert len(expand("mission", rviz="true")) == 3


class Exited:
    def __init__(self, name: str, code: int) -> None:
        self.process_name, self.returncode = name, code


@pytest.mark.parametrize("code", [1, 2, -9, -11])
def test_a_node_that_has_failed_makes_the_launch_fail(code: int) -> None:
    with pytest.raises(RuntimeError, match=f"sim_node-1 ended with code {code}"):
        launching._end(Exited("sim_node-1", code), LaunchContext())


@pytest.mark.parametrize("code", [0, -2])
def test_a_node_that_has_finished_or_was_interrupted_does_not(code: int) -> None:
    assert isinstance(launching._end(Exited("sim_node-1", code), LaunchContext()), Shutdown)


@pytest.mark.parametrize("code", [0, 1, -9, -11])
def test_the_bridge_of_a_flight_outlives_planner_and_simulation(code: int) -> None:
    context = LaunchContext()
    assert launching.leave_to_bridge(Exited("planner_node-2", code), context) is None
    if code:
        with pytest.raises(RuntimeError, match=f"planner_node-2 ended with code {code}"):
            launching._end(Exited("mavlink_bridge-3", 0), context)
    else:
        assert isinstance(launching._end(Exited("mavlink_bridge-3", 0), context), Shutdown)


def test_a_node_of_a_flight_that_refuses_its_parameters_ends_it() -> None:
    with pytest.raises(RuntimeError, match="planner_node-2 ended with code 2"):
        launching.leave_to_bridge(Exited("planner_node-2", 2), LaunchContext())


def test_a_recorder_that_has_failed_makes_the_launch_fail_at_its_end() -> None:
    context = LaunchContext()
    assert launching._note_failure(Exited("recorder-1", 2), context) is None
    with pytest.raises(RuntimeError, match="recorder-1 ended with code 2"):
        launching._end(Exited("sim_node-2", 0), context)
