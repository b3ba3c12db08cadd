# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""ROS arguments read without ROS: as rcl reads them."""

from __future__ import annotations

from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from dsse_ros.runtime.ros_arguments import (
    UnreadableFileError,
    namespace_of,
    parameters_for,
    split_ros_arguments,
)

OF_EVERY_NODE = {"use_sim_time", "start_type_description_service"}
FILES = {
    "all": "/**: {ros__parameters: {seed: 1, other: 2}}",
    "own": "sim_node: {ros__parameters: {seed: 3}}",
    "deep": "a: {b: {sim_node: {ros__parameters: {seed: 4}}}}",
    "full": "/a/b/sim_node: {ros__parameters: {seed: 5}}",
    "any": "/**/sim_node: {ros__parameters: {seed: 6}}",
    "one": "/*/sim_node: {ros__parameters: {seed: 7}}\n/*: {ros__parameters: {seed: 8}}",
    "else": "/c/**: {ros__parameters: {seed: 9}}\ndsse_planner: {ros__parameters: {seed: 10}}",
    "nested": "/**: {ros__parameters: {part: {of: 11, list: [1, 2]}, text: on its own}}",
    "two": "sim_node: {ros__parameters: {other: 12}}\n/**: {ros__parameters: {other: 13}}",
}
LINES = [
    "--params-file {all}",
    "--params-file {own} --params-file {all}",
    "--params-file {all} --params-file {own}",
    "--params-file {deep}",
    "--params-file {full} -p seed:=20",
    "-p seed:=20 --params-file {full}",
    "--params-file {any}",
    "--params-file {one}",
    "--params-file {else} --params-file {nested}",
    "--params-file {two}",
    "-p sim_node:seed:=21 -p other:=true --param half:=0.5",
    "--log-level info -p text:=word -r x:=y -p list:=[1.0,2.0] --disable-rosout-logs",
]


def given(line: str, folder: Path) -> list[str]:
    for name, text in FILES.items():
        (folder / name).write_text(text)
    return line.format(**{name: folder / name for name in FILES}).split()


@pytest.mark.parametrize("namespace", ["", "/a", "/a/b"])
@pytest.mark.parametrize("line", LINES)
def test_a_node_is_given_what_rcl_gives_it(line: str, namespace: str, tmp_path: Path) -> None:
    ros = [*given(line, tmp_path), "-r", f"__ns:={namespace or '/'}"]
    context = Context()
    rclpy.init(args=["--ros-args", *ros], context=context, domain_id=0)
    node = Node(
        "sim_node", context=context, enable_rosout=False, start_parameter_services=False,
        automatically_declare_parameters_from_overrides=True,
    )  # fmt: skip
    try:
        of_rcl = {
            name: value.value
            for name, value in node.get_parameters_by_prefix("").items()
            if name not in OF_EVERY_NODE
        }
    finally:
        node.destroy_node()
        context.try_shutdown()
    ours = parameters_for(f"{namespace_of(ros)}/sim_node", ros)
    as_lists = {k: list(v) if hasattr(v, "typecode") else v for k, v in of_rcl.items()}
    assert {name: one.value for name, one in ours.items()} == as_lists


@pytest.mark.parametrize(
    ("line", "shared"),
    [
        ("--params-file {all}", {"seed", "other"}),
        ("--params-file {all} --params-file {own}", {"other"}),
        ("--params-file {own} --params-file {all}", {"other"}),
        ("--params-file {two}", set()),
        ("--params-file {all} -p seed:=3", {"other"}),
        ("-p seed:=3", set()),
        ("--params-file {any}", set()),
    ],
)
def test_shared_is_what_no_one_gives_to_the_node_alone(
    line: str, shared: set[str], tmp_path: Path
) -> None:
    found = parameters_for("/sim_node", given(line, tmp_path))
    assert {name for name, one in found.items() if one.shared} == shared


def test_a_command_line_is_split_where_ros_arguments_begin_and_end() -> None:
    line = [
        "--seed",
        "3",
        "--ros-args",
        "-p",
        "a:=1",
        "--",
        "--out",
        "x",
        "--ros-args",
        "-r",
        "b:=c",
    ]
    own, ros = split_ros_arguments(line)
    assert own == ["--seed", "3", "--out", "x"]
    assert ros == ["-p", "a:=1", "-r", "b:=c"]
    assert split_ros_arguments(["--", "--seed"]) == (["--", "--seed"], [])


@pytest.mark.parametrize("text", [None, "a: [1, 2", "- 1", "\udcff"])
def test_a_file_that_is_none_of_parameters_is_refused_by_name(
    text: str | None, tmp_path: Path
) -> None:
    file = tmp_path / "file.yaml"
    if text is not None:
        file.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(UnreadableFileError, match=r"file\.yaml: ") as caught:
        parameters_for("/sim_node", ["--params-file", str(file)])
    assert "\n" not in str(caught.value)
