# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What follows --ros-args, and which parameters a node takes from it."""

from __future__ import annotations

from pathlib import Path

import pytest
from domains import free_domain

from dsse_ros.runtime.ros_arguments import known_parameters, split_ros_arguments, typed_names
from dsse_ros.runtime.run_node import overrides_of
from dsse_ros.scenario.fields import FieldError

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
