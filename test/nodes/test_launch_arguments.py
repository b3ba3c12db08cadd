# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tables of launch arguments: what the nodes know, and what the nodes get."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import pytest

from dsse_ros.bridge.settings import BridgeSettings
from dsse_ros.cli.run_mission import PLANNER_PARAMETERS, SIM_PARAMETERS
from dsse_ros.nodes.launch_arguments import FLIGHT, MISSION, Argument, Start, starts
from dsse_ros.nodes.settings import (
    PlannerSettings,
    RecorderSettings,
    SimSettings,
    ViewerSettings,
)
from dsse_ros.scenario.fields import Spec, specs
from dsse_ros.search import Rules, Scenario

ROOT = Path(__file__).resolve().parents[2]
FILES: Mapping[str, Mapping[str, Argument]] = {"mission": MISSION, "flight": FLIGHT}
SETTINGS = {
    "sim_node": (SimSettings, Rules, Scenario),
    "planner_node": (PlannerSettings,),
    "mavlink_bridge": (BridgeSettings,),
    "recorder": (RecorderSettings,),
    "foxglove_viewer": (ViewerSettings,),
}
SPECS: dict[str, dict[str, Spec]] = {
    node: {name: spec for cls in classes for name, spec in specs(cls).items()}
    for node, classes in SETTINGS.items()
}
ARGUMENTS = [
    pytest.param(arguments[name], name, id=f"{file}-{name}")
    for file, arguments in FILES.items()
    for name in arguments
]
# Launch files for people go at a pace that can be watched, in a place; and they end.
OF_LAUNCH = {"scenario", "step_rate", "exit_at_end", "use_sim_time"}


EVERYTHING = {"record": "true", "rviz": "true", "viewer": "foxglove"}


def made(arguments: Mapping[str, Argument], **given: str) -> dict[str, Start]:
    texts = {name: one.default for name, one in arguments.items()} | given
    return starts(arguments, texts, given.keys(), str(ROOT))


def parameters(start: Start) -> dict[str, Any]:
    return {**start.before, **start.after}


@pytest.mark.parametrize(("argument", "name"), ARGUMENTS)
def test_an_argument_is_a_parameter_of_the_nodes_it_is_for(argument: Argument, name: str) -> None:
    of_all = {"use_sim_time"}
    for node in set(argument.to) - {"rviz2"}:
        parameter = argument.renamed.get(node, name)
        if parameter in of_all:
            continue
        spec = SPECS[node][parameter]
        assert argument.kind == spec.kind
        # Other packages add planners, which a launch file need not be able to import.
        assert set(argument.choices) == (set() if name == "planner" else set(spec.choices))
        if name != "seed":
            # Which may be -1 for the simulation alone.
            assert argument.low == spec.low
        assert argument.high <= spec.high
        if argument.default and name not in OF_LAUNCH:
            (cls,) = (c for c in SETTINGS[node] if parameter in specs(c))
            (default,) = (f.default for f in fields(cls) if f.name == parameter)
            assert default is not MISSING
            assert argument.value(name, argument.default) == default


@pytest.mark.parametrize(("argument", "name"), ARGUMENTS)
def test_an_argument_has_a_sentence_and_a_default_that_is_allowed(
    argument: Argument, name: str
) -> None:
    assert argument.doc.endswith(".")
    if argument.default:
        argument.value(name, argument.default)
    if argument.choices:
        assert argument.default in argument.choices


def test_the_names_of_the_nodes_are_theirs() -> None:
    for executable in SETTINGS:
        text = (ROOT / "dsse_ros" / "nodes" / f"{executable}.py").read_text()
        assert f'super().__init__("{executable}")' in text


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("seed", "6", 6),
        ("num_drones", "3", 3),
        ("step_rate", "5", 5.0),
        ("step_rate", "2.5", 2.5),
        ("auto_reset", "true", True),
        ("auto_reset", "False", False),
        ("record_file", "123", "123"),
        ("bag", "123", "123"),
        ("viewer_port", "0", 0),
        ("accept_commands", "true", True),
        ("map_frame", "no", "no"),
        ("connections", "[udpin:127.0.0.1:14550, '/dev/ttyUSB0,57600']",
         ["udpin:127.0.0.1:14550", "/dev/ttyUSB0,57600"]),
        ("connections", "/dev/ttyUSB0,57600", ["/dev/ttyUSB0,57600"]),
        ("system_ids", "[3, 4]", [3, 4]),
        ("system_ids", "3", [3]),
    ],
)  # fmt: skip
def test_a_text_becomes_a_value_of_the_type_of_the_parameter(
    name: str, text: str, value: Any
) -> None:
    for arguments in (a for a in FILES.values() if name in a):
        got = {}
        for node in arguments[name].to:
            start = made(arguments, **EVERYTHING | {name: text})[node]
            got[node] = start.after[arguments[name].renamed.get(node, name)]
            assert got[node] == value and type(got[node]) is type(value)
        assert got


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("seed", "six"), ("seed", "1.0"), ("seed", "-2"), ("num_drones", "0"),
        ("num_drones", "many"), ("step_rate", "nan"), ("step_rate", "-1"), ("auto_reset", "maybe"),
        ("rviz", "2"), ("viewer", "rerun"), ("viewer_port", "65536"),
        ("rules", "v9"), ("log_level", "loud"),
        ("params_file", "/no/such.yaml"), ("system_ids", "[1, x]"), ("system_ids", "[0]"),
        ("system_ids", "[]"), ("connections", "[a"), ("mode", "manual"), ("bridge", "/no/such.yml"),
    ],
)  # fmt: skip
def test_a_value_that_is_not_allowed_gets_one_line_that_names_it(name: str, text: str) -> None:
    for arguments in (a for a in FILES.values() if name in a):
        with pytest.raises(ValueError) as caught:
            made(arguments, **{name: text})
        line = str(caught.value)
        assert text in line and "\n" not in line
        assert name in line or text.startswith("/")


@pytest.mark.parametrize("arguments", FILES.values(), ids=FILES)
def test_nothing_that_is_left_empty_is_a_parameter(arguments: Mapping[str, Argument]) -> None:
    for start in made(arguments).values():
        assert "" not in parameters(start).values()
        assert not {"seed", "num_drones", "num_vehicles", "connections"} & parameters(start).keys()


@pytest.mark.parametrize("arguments", FILES.values(), ids=FILES)
def test_arguments_that_are_given_win_over_the_file_and_defaults_do_not(
    arguments: Mapping[str, Argument], tmp_path: Path
) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("/**: {ros__parameters: {step_rate: 2.0, rules: v1, planner: sweep}}")
    start = made(arguments, params_file=str(file), step_rate="5", planner="greedy")
    sim, planner = start["sim_node"], start["planner_node"]
    assert sim.files == planner.files == [str(file)]
    assert sim.after["step_rate"] == 5.0 and sim.before["rules"] == "paper"
    assert planner.after["planner"] == "greedy"


@pytest.mark.parametrize(
    ("text", "namespace", "waits"),
    [
        ("", "", True),
        ("mavlink_bridge: {ros__parameters: {mode: mission}}", "", False),
        ("/**: {ros__parameters: {mode: export}}", "", False),
        ("a: {mavlink_bridge: {ros__parameters: {mode: export}}}", "/a", False),
        ("a: {mavlink_bridge: {ros__parameters: {mode: export}}}", "/b", True),
        ("mavlink_bridge: {ros__parameters: {mode: guided}}", "", True),
    ],
)
@pytest.mark.parametrize("argument", ["params_file", "bridge"])
def test_the_simulation_waits_for_vehicles_that_follow_it_and_for_no_others(
    text: str, namespace: str, waits: bool, argument: str, tmp_path: Path
) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(text or "{}")
    given = {argument: str(file), "namespace": namespace}
    sim = made(FLIGHT, **given)["sim_node"]
    assert parameters(sim)["wait_for_vehicles"] is waits
    for mode, then in (("guided", True), ("mission", False), ("export", False)):
        start = made(FLIGHT, mode=mode, **given)
        assert parameters(start["sim_node"])["wait_for_vehicles"] is then
        assert start["mavlink_bridge"].after["mode"] == mode
    for mode in ("mission", "export"):
        # Nobody would ever come.
        file.write_text("/**: {ros__parameters: {wait_for_vehicles: true}}")
        assert made(FLIGHT, mode=mode, **given)["sim_node"].after["wait_for_vehicles"] is False


def test_a_mission_ends_the_launch_unless_another_follows(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("sim_node: {ros__parameters: {auto_reset: true}}")
    for arguments, node in ((MISSION, "sim_node"), (FLIGHT, "mavlink_bridge")):
        for given, ends in (
            ({}, True),
            ({"auto_reset": "true"}, False),
            ({"params_file": str(file)}, False),
            ({"auto_reset": "true", "exit_at_end": "true"}, True),
            ({"exit_at_end": "false"}, False),
        ):
            assert parameters(made(arguments, **given)[node])["exit_at_end"] is ends
    # Vehicles are still on their way home then, and need what it has latched.
    assert "exit_at_end" not in parameters(made(FLIGHT)["sim_node"])


def test_who_takes_the_time_from_the_clock_does_so_only_if_there_is_one(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("sim_node: {ros__parameters: {publish_clock: false}}")
    for given, uses in (
        ({}, True),
        ({"publish_clock": "false"}, False),
        ({"params_file": str(file)}, False),
        ({"publish_clock": "false", "use_sim_time": "true"}, True),
        ({"use_sim_time": "false"}, False),
    ):
        start = made(MISSION, **EVERYTHING | given)
        assert "use_sim_time" not in parameters(start["sim_node"])
        for node in ("planner_node", "foxglove_viewer", "rviz2"):
            assert parameters(start[node])["use_sim_time"] is uses


def test_a_recorder_is_started_where_it_is_wanted_and_before_what_it_records() -> None:
    for arguments in FILES.values():
        assert "recorder" not in made(arguments)
        assert next(iter(made(arguments, record="true"))) == "recorder"


def test_foxglove_is_served_where_it_is_wanted() -> None:
    for arguments in FILES.values():
        assert "foxglove_viewer" not in made(arguments)
        assert parameters(made(arguments, viewer="foxglove")["foxglove_viewer"]) == {
            "use_sim_time": True, "accept_commands": False,
        }  # fmt: skip


def test_a_drawn_seed_is_the_simulation_s_alone() -> None:
    start = made(MISSION, seed="-1")
    assert start["sim_node"].after["seed"] == -1
    assert "seed" not in parameters(start["planner_node"])


def test_the_frames_of_rviz_and_the_logs_have_the_names_of_the_mission() -> None:
    start = made(MISSION, rviz="true", namespace="/a/b", map_frame="sea", frame_prefix="one/",
                 log_level="debug")  # fmt: skip
    rviz = list(start["rviz2"].arguments)
    assert rviz[rviz.index("-f") + 1] == "one/sea"
    assert "a.b.sim_node:=debug" in start["sim_node"].arguments
    assert "a.b.planner_node:=debug" in start["planner_node"].arguments


@pytest.mark.parametrize("accepts", ["true", "false"])
def test_each_node_gets_an_enclave_of_its_own_and_people_that_of_people(accepts: str) -> None:
    start = made(FLIGHT, **EVERYTHING, enclaves="/dsse_ros", accept_commands=accepts)
    enclaves = {}
    for name, one in start.items():
        arguments = list(one.arguments)
        enclaves[name] = arguments[arguments.index("--enclave") + 1].removeprefix("/dsse_ros/")
    people = {"rviz2": "operator"} | ({"foxglove_viewer": "operator"} if accepts == "true" else {})
    assert enclaves == {name: name for name in start} | people
    assert not any("--enclave" in one.arguments for one in made(FLIGHT, **EVERYTHING).values())


@pytest.mark.parametrize("arguments", FILES.values(), ids=FILES)
def test_the_nodes_know_all_that_they_get(arguments: Mapping[str, Argument]) -> None:
    known = {
        "sim_node": {*SIM_PARAMETERS},
        "planner_node": {*PLANNER_PARAMETERS},
        "mavlink_bridge": {*SPECS["mavlink_bridge"]},
        "recorder": {*SPECS["recorder"]},
        "foxglove_viewer": {*SPECS["foxglove_viewer"], "use_sim_time"},
    }
    every = {
        name: one.default or {"int": "2", "names": "[a, b]", "ints": "[1, 2]"}.get(one.kind, "")
        for name, one in arguments.items()
    }
    for executable, start in made(arguments, **every | EVERYTHING | {"rviz": "false"}).items():
        assert parameters(start).keys() <= known[executable]


def test_the_tables_need_nothing_that_the_nodes_need() -> None:
    code = (
        "import sys; sys.path.insert(0, '.'); import dsse_ros.nodes.launch_arguments; "
        "print({'numpy', 'numba', 'rclpy', 'pettingzoo', 'dsse_ros.search'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True,
        timeout=180)  # fmt: skip
    assert done.stdout == "set()\n", done.stderr
