# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What follows --ros-args, and which parameters a node takes from it."""

from __future__ import annotations

from pathlib import Path

import pytest
from domains import free_domain

from dsse_ros.base.fields import FieldError
from dsse_ros.ros.runtime.ros_arguments import (
    check_reached,
    full_name,
    known_parameters,
    reaching,
    split_ros_arguments,
    typed_names,
)
from dsse_ros.ros.runtime.run_node import overrides_of

KNOWN = ("seed", "step_rate", "scenario.sigma")
FULL_NAMES = {"sigma": "scenario.sigma"}


def test_a_command_line_is_split_where_ros_arguments_begin_and_end() -> None:
    line = "--seed 3 --ros-args -p a:=1 -- --out x --ros-args -r b:=c"
    own, ros = split_ros_arguments(line.split())
    assert own == ["--seed", "3", "--out", "x"]
    assert ros == ["-p", "a:=1", "-r", "b:=c"]
    assert split_ros_arguments(["--", "--seed"]) == (["--", "--seed"], [])


def test_typed_are_the_parameters_of_the_command_line_for_any_node() -> None:
    line = "--log-level info -p seed:=1 -r x:=-p --param sim_node:scenario.sigma:=2 --params-file f"
    assert typed_names(line.split()) == {"seed", "scenario.sigma"}


def test_a_file_may_have_parameters_of_other_nodes() -> None:
    stated = {"seed": 1, "planner": "sweep", "controller.gain": 2.0}
    assert known_parameters("x", stated, KNOWN, typed=()) == {"seed": 1}


@pytest.mark.parametrize(
    ("name", "typed", "says"),
    [
        ("sed", {"sed"}, "'sed' is not a field of x; did you mean seed?"),
        ("scenario.sgma", (), "did you mean scenario.sigma?"),
        ("sigmma", {"sigmma"}, "did you mean scenario.sigma?"),
        ("sigma", (), "'sigma' is not a field of x; did you mean scenario.sigma?"),
    ],
)
def test_an_unknown_name_of_the_command_line_or_of_a_group_is_refused(
    name: str, typed: set[str], says: str
) -> None:
    with pytest.raises(FieldError) as caught:
        known_parameters("x", {name: 1}, KNOWN, typed, FULL_NAMES)
    assert says in str(caught.value)


def test_parameters_for_nodes_are_those_that_they_would_get(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    file = tmp_path / "parameters.yaml"
    file.write_text(
        "/**: {ros__parameters: {seed: 1, use_sim_time: true, empty: []}}\n"
        "/a/sim_node: {ros__parameters: {scenario: {cells: [1, 2]}}}\n"
        "/a/planner_node: {ros__parameters: {seed: 3, planner: sweep}}\n"
        "/b/**: {ros__parameters: {seed: 4}}"
    )
    ros = ["--params-file", str(file), "-r", "__ns:=/a", "-p", "step_rate:=2.5"]
    found = overrides_of(("planner_node", "sim_node"), ros)
    assert list(found.pop("scenario.cells")) == [1, 2]
    assert found == {"seed": 1, "planner": "sweep", "empty": [], "step_rate": 2.5}
    with pytest.raises(FieldError, match="no_such") as caught:
        overrides_of(("sim_node",), ["--params-file", str(tmp_path / "no_such")])
    assert "\n" not in str(caught.value)


FILES = {
    "simnode": False, "sim_node": True, "/sim_node": True, "/**": True, "'**'": True, "/*": True,
    "/**/sim_node": True, "/a/sim_node": False, "/*/*": False, "/a/**": False,
    "planner_node": False,
}  # fmt: skip
"""Names of nodes in a file, and whether rcl gives its parameters to /sim_node."""


@pytest.mark.parametrize("name", FILES)
def test_a_file_whose_parameters_reach_no_node_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    file = tmp_path / "p.yaml"
    file.write_text(f"{name}: {{ros__parameters: {{seed: 7}}}}")
    ros = ["--params-file", str(file)]
    if FILES[name]:
        assert overrides_of(("sim_node",), ros) == {"seed": 7}
        assert reaching(["/sim_node"], ros) == ros
        return
    with pytest.raises(FieldError, match="must have parameters of /sim_node, got those of /"):
        overrides_of(("sim_node",), ros)
    assert reaching(["/sim_node"], ros) == []


@pytest.mark.parametrize(
    ("ros", "line"),
    [
        (["-p", "simnode:seed:=3"], "must be for /sim_node, got a parameter of /simnode"),
        (["-p", "sim_node:seed:=3", "-r", "__ns:=/a"], "must be for /a/sim_node, got a parameter"),
        (["-p", "seed:=010"], "seed: line 1: a whole number must not begin with 0, got '010'"),
        (["-p", "cells:=[1, -07]"], "a whole number must not begin with 0, got '-07'"),
    ],
)
def test_an_argument_that_reaches_nobody_or_is_read_in_two_ways_is_refused(
    ros: list[str], line: str
) -> None:
    with pytest.raises(FieldError, match=line):
        check_reached([full_name("sim_node", ros)], ros)


def test_a_number_of_a_file_that_ros_would_read_as_octal_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("/**: {ros__parameters: {seed: 010}}")
    with pytest.raises(FieldError, match="a whole number must not begin with 0, got '010'"):
        check_reached(["/sim_node"], ["--params-file", str(file)])
    file.write_text("/**: {ros__parameters: {name: '010', seed: 10.5, width: 0x10}}")
    check_reached(["/sim_node"], ["--params-file", str(file)])
