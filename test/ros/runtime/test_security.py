# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where DDS security is asked for, programs start protected or not at all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from rig import ENVIRONMENT, free_domain

from dsse_ros.base.fields import FieldError
from dsse_ros.ros.runtime import security

ASKED = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_KEYSTORE": "keys"}
# A node of ROS alone, without the package.
BARE = "import rclpy; rclpy.init(); rclpy.create_node('bare'); print('started')"


def run(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    env = os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": str(free_domain())} | variables
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=env, capture_output=True, text=True,
        timeout=180,
    )  # fmt: skip


@pytest.fixture(scope="module")
def has_security(tmp_path_factory: pytest.TempPathFactory) -> bool:
    """Whether the DDS that the tests run with was built with security."""
    folder = tmp_path_factory.mktemp("bare")
    (folder / "keys" / "enclaves").mkdir(parents=True)
    done = run(folder, "-c", BARE, **ASKED, ROS_SECURITY_STRATEGY="Enforce")
    assert done.returncode != 0
    return "security libraries" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("variables", "line"),
    [
        ({}, "was built without security"),
        ({"ROS_SECURITY_STRATEGY": "Permissive"}, "was built without security"),
        ({"ROS_SECURITY_KEYSTORE": "nowhere"}, "directory 'nowhere/enclaves' does not exist"),
    ],
)
def test_a_node_does_not_start_unprotected_where_security_is_asked_for(
    variables: dict[str, str], line: str, has_security: bool, tmp_path: Path
) -> None:
    (tmp_path / "keys" / "enclaves").mkdir(parents=True)
    node = ("-m", "dsse_ros.ros.nodes.planner_node")
    done = run(tmp_path, *node, **ASKED | variables)
    assert done.returncode == 2 and done.stdout == ""
    if not has_security or "nowhere" in line:
        (only,) = done.stderr.splitlines()
        assert only.startswith("planner_node: ") and line in only


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ROS_SECURITY_ENABLE", "True"),
        ("ROS_SECURITY_ENABLE", "1"),
        ("ROS_SECURITY_ENABLE", "true "),
        ("ROS_SECURITY_STRATEGY", "enforce"),
    ],
)
def test_a_request_that_ros_2_would_take_for_no_is_refused(name: str, value: str) -> None:
    environment = {**ASKED, name: value}
    with pytest.raises(FieldError, match=f"{name} must be .*, got '{value}'"):
        security.enforce(environment)


def test_a_request_without_keys_is_refused() -> None:
    with pytest.raises(FieldError, match="ROS_SECURITY_KEYSTORE must be .*, got none"):
        security.enforce({"ROS_SECURITY_ENABLE": "true"})


@pytest.mark.parametrize("strategy", [None, "", "Permissive", "Enforce"])
def test_security_that_is_asked_for_is_enforced(strategy: str | None) -> None:
    environment = dict(ASKED)
    if strategy is not None:
        environment["ROS_SECURITY_STRATEGY"] = strategy
    assert security.enforce(environment)
    assert environment["ROS_SECURITY_STRATEGY"] == "Enforce"


@pytest.mark.parametrize("enable", [None, "", "false"])
def test_nothing_changes_where_nobody_asks(enable: str | None) -> None:
    environment = {} if enable is None else {"ROS_SECURITY_ENABLE": enable}
    before = dict(environment)
    assert not security.enforce(environment)
    security.check_middleware(environment, "rmw_zenoh_cpp")
    assert environment == before


def test_a_middleware_that_does_not_heed_it_is_refused() -> None:
    security.check_middleware(ASKED, "rmw_fastrtps_cpp")
    with pytest.raises(FieldError, match="RMW_IMPLEMENTATION must be .*, got 'rmw_zenoh_cpp'"):
        security.check_middleware(ASKED, "rmw_zenoh_cpp")
