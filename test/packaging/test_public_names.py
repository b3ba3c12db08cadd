# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`import dsse_ros` offers the public names, and imports nothing before one is asked for."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import dsse_ros

SOURCE = Path(__file__).resolve().parents[2] / "dsse_ros" / "__init__.py"
NEEDS_ROS = {"DsseRosEnv", "read_bag"}


@pytest.mark.parametrize("name", dsse_ros.__all__)
def test_a_public_name_is_importable(name: str) -> None:
    if name in NEEDS_ROS:
        pytest.importorskip("rclpy")
    assert getattr(dsse_ros, name).__name__ == name if name != "PROFILES" else dsse_ros.PROFILES


def test_a_type_checker_sees_the_same_names_in_the_same_modules() -> None:
    seen = {
        alias.name: node.module
        for node in ast.walk(ast.parse(SOURCE.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dsse_ros.")
        for alias in node.names
    }
    assert seen == dsse_ros._MODULES
    assert dir(dsse_ros) == sorted(seen)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'dsse_ros' has no attribute 'paralel_env'"):
        dsse_ros.paralel_env  # noqa: B018


@pytest.mark.slow
def test_the_package_alone_imports_no_library() -> None:
    code = "import sys, dsse_ros; print(*{'numpy', 'numba', 'rclpy'} & sys.modules.keys())"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "\n"
