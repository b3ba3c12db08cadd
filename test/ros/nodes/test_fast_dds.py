# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes are announced often and free their messages, unless their user has configured the DDS."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from rig import ENVIRONMENT, free_domain

from dsse_ros.ros.runtime.fast_dds import MEMORY_FROM_PROFILES, PROFILES, configure

VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


def test_a_process_that_nobody_has_configured_gets_the_profile(tmp_path: Path) -> None:
    environment = {"HOME": "/"}
    configure(environment, tmp_path)
    (name,) = environment.keys() - {"HOME", MEMORY_FROM_PROFILES}
    assert name in VARIABLES and environment[name] == str(PROFILES)
    assert environment[MEMORY_FROM_PROFILES] == "1"


def test_the_memory_stays_as_the_user_has_set_it(tmp_path: Path) -> None:
    environment = {MEMORY_FROM_PROFILES: "0"}
    configure(environment, tmp_path)
    assert environment[MEMORY_FROM_PROFILES] == "0"


@pytest.mark.parametrize("name", VARIABLES)
def test_a_profile_of_the_user_stays(name: str, tmp_path: Path) -> None:
    environment = {name: "mine.xml"}
    configure(environment, tmp_path)
    assert environment == {name: "mine.xml"}


@pytest.mark.parametrize("name", ["DEFAULT_FASTRTPS_PROFILES.xml", "DEFAULT_FASTDDS_PROFILES.xml"])
def test_a_default_file_of_fast_dds_stays_in_force(name: str, tmp_path: Path) -> None:
    (tmp_path / name).touch()
    environment: dict[str, str] = {}
    configure(environment, tmp_path)
    assert environment == {}


@pytest.mark.parametrize("damaged", [False, True])
def test_fast_dds_takes_the_profile_without_a_word(damaged: bool, tmp_path: Path) -> None:
    variables: dict[str, str] = {}
    configure(variables, tmp_path)
    (name,) = variables.keys() - {MEMORY_FROM_PROFILES}
    profile = tmp_path / "profile.xml"
    text = PROFILES.read_text(encoding="utf-8")
    profile.write_text(text.replace("leaseAnnouncement", "leaseNonsense") if damaged else text)
    program = "import rclpy; rclpy.init(); rclpy.create_node('bare').destroy_node()"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ
        | ENVIRONMENT
        | variables
        | {name: str(profile), "ROS_DOMAIN_ID": str(free_domain())},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert bool(done.stdout + done.stderr) == damaged
