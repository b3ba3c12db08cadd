# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`python -m dsse_ros.compat` runs a script as if the package were installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from dsse_ros import compat
from dsse_ros.compat.aliases import VERSIONS

SCRIPT = """
import sys
import helper
import DSSE.environment.env
from DSSE import Actions, CoverageDroneSwarmSearch, DroneSwarmSearch
from DSSE.environment.constants import Reward
from DSSE.environment.wrappers import AllPositionsWrapper, RetainDronePosWrapper
from DSSE.environment.wrappers.communication_wrapper import CommunicationWrapper

env = AllPositionsWrapper(DroneSwarmSearch(drone_amount=2))
observations, _ = RetainDronePosWrapper(env, [(3, 3), (4, 4)]).reset()
assert DSSE.environment.env.DroneSwarmSearch is DroneSwarmSearch
print(__name__, sys.argv[1:], observations["drone1"][0].tolist())
"""

SCRIPT_V1 = """
from DSSE.env import DroneSwarmSearch
print(DroneSwarmSearch(n_drones=2).get_agents())
"""


def run(folder: Path, script: str, *options: str) -> subprocess.CompletedProcess[str]:
    (folder / "helper.py").write_text("", encoding="utf-8")
    (folder / "script.py").write_text(script, encoding="utf-8")
    command = [sys.executable, "-m", "dsse_ros.compat", *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_a_script_finds_the_package_its_arguments_and_its_neighbours(tmp_path: Path) -> None:
    done = run(tmp_path, SCRIPT, str(tmp_path / "script.py"), "--fast", "1")
    assert (done.stdout, done.returncode) == (
        "__main__ ['--fast', '1'] [4, 4, 3, 3]\n",
        0,
    ), done.stderr


def test_a_script_for_the_first_version_finds_that(tmp_path: Path) -> None:
    done = run(tmp_path, SCRIPT_V1, "--dsse", "0.1.13", str(tmp_path / "script.py"))
    assert (done.stdout, done.returncode) == ("['drone0', 'drone1']\n", 0), done.stderr


def test_a_script_that_is_not_there_is_named(tmp_path: Path) -> None:
    done = run(tmp_path, "", str(tmp_path / "other.py"))
    assert done.returncode == 2 and "must be a Python file" in done.stderr


def test_every_alias_names_something_of_this_package() -> None:
    for modules in VERSIONS.values():
        for names in modules.values():
            assert all(each.__module__.startswith("dsse_ros.compat") for each in names.values())
    assert VERSIONS["1.1.9"]["DSSE"]["DroneSwarmSearch"] is compat.DroneSwarmSearch
