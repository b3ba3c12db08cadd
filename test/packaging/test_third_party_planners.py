# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners of other packages, installed by pip, are found by name."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

SETUP = """
from setuptools import setup
setup(
    name="third-party-planners",
    version="1.0",
    py_modules=["stay_and_search", "defective"],
    entry_points={
        "dsse_ros.planners": [
            "stay_and_search = stay_and_search:StayAndSearch",
            "greedy = defective:greedy",
            "defective = defective:make",
            "nowhere = no_such_module:make",
            "no_factory = stay_and_search:NAME",
        ],
    },
)
"""
STAY_AND_SEARCH = """
NAME = "stay_and_search"

class StayAndSearch:
    def __init__(self, search, *, seed=0):
        self.search = search.rules.action_set.search
        self.limit = search.scenario.resolve(search.rules).timestep_limit

    def __call__(self, observations, infos):
        return {agent: self.search for agent in observations}
"""
DEFECTIVE = 'raise RuntimeError("two\\nlines")\n'


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Variables of processes that see the package; the environment of the tests does not."""
    source = tmp_path_factory.mktemp("source")
    target = tmp_path_factory.mktemp("target")
    (source / "setup.py").write_text(SETUP)
    (source / "stay_and_search.py").write_text(STAY_AND_SEARCH)
    (source / "defective.py").write_text(DEFECTIVE)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--no-index"]
    options = ["--no-deps", "--no-build-isolation", "--no-compile", "--target", str(target)]
    done = subprocess.run(
        [*pip, *options, "."], cwd=source, capture_output=True, text=True, timeout=180
    )
    assert done.returncode == 0, done.stderr
    paths = [str(target), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)}


def run(
    environment: dict[str, str], folder: Path, *arguments: str | Path
) -> subprocess.CompletedProcess[str]:
    """Run Python, with the installed package rather than the checkout."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=180,
    )  # fmt: skip


def test_a_planner_of_another_package_is_found_by_name(
    environment: dict[str, str], tmp_path: Path
) -> None:
    code = (
        "from dsse_ros.planners import planner_for\n"
        "from dsse_ros.search import parallel_env\n"
        "env = parallel_env(num_drones=2)\n"
        "planner = planner_for(env, 'stay_and_search', seed=3)\n"
        "print(planner(*env.reset(seed=1)), planner.limit)\n"
        "print(type(planner_for(env, 'greedy')).__module__)\n"
    )
    done = run(environment, tmp_path, "-c", code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "{'drone0': 4, 'drone1': 4} 100",
        "dsse_ros.planners.greedy",
    ]


def test_a_mission_over_ros_is_flown_by_a_planner_of_another_package(
    environment: dict[str, str], tmp_path: Path
) -> None:
    from rig import ENVIRONMENT, free_domain

    over_ros = environment | ENVIRONMENT | {"ROS_DOMAIN_ID": str(free_domain())}
    arguments = ("--scenario", "paper_zone", "--rate", "0", "--out", tmp_path)
    done = run(
        over_ros, tmp_path, "-m", "dsse_ros.cli.run_mission",
        "--planner", "stay_and_search", *arguments,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    rows = (tmp_path / "mission.csv").read_text().splitlines()
    assert any(",search," in row for row in rows)
    assert not any(f",{move}," in row for row in rows for move in ("left", "right", "up", "down"))


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("defective", "RuntimeError: two lines"),
        ("nowhere", "No module named 'no_such_module'"),
        ("no_factory", "is not a factory"),
    ],
)
def test_a_defective_package_gets_one_clear_line_from_the_node(
    environment: dict[str, str], tmp_path: Path, name: str, reason: str
) -> None:
    done = run(
        environment, tmp_path, "-m", "dsse_ros.nodes.planner_node",
        "--ros-args", "-p", f"planner:={name}",
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert f"planner: '{name}' cannot be loaded" in line
    assert reason in line
