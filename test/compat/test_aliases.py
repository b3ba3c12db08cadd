# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`python -m dsse_ros.compat` runs a script as if the package were installed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dsse_ros import compat
from dsse_ros.compat.aliases import COLOURS, VERSIONS

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

TESTS_OF_DSSE = """
import importlib.util
import sys
from DSSE import DroneSwarmSearch
from DSSE.environment.constants import BLACK, GREEN, RED
from DSSE.environment.entities.drone import DroneData
from DSSE.environment.entities.person import Person
from DSSE.environment.simulation.dynamic_probability import ProbabilityMatrix
from DSSE.tests.drone_policy import ACTION

def test_a_step():
    env = DroneSwarmSearch(probability_of_detection=0)
    env.reset()
    env.step({"drone0": ACTION})
    assert isinstance(env.get_persons().pop(), Person)
    assert isinstance(env.probability_matrix, ProbabilityMatrix)
    assert importlib.util.find_spec("DSSE").origin is None
"""

RECORDER = """
import numpy as np
import pygame
from DSSE import DroneSwarmSearch

env = DroneSwarmSearch(grid_size=8, render_mode="human", fps=1000)
frames = []
for step in range(3):
    if step == 0:
        env.reset(seed=1)
    else:
        env.step({"drone0": 1})
    frames.append(pygame.surfarray.array3d(pygame.display.get_surface()))
assert all(frame.std() > 5 for frame in frames)
print([bool((frame != frames[0]).any()) for frame in frames])
env.close()
"""


@pytest.fixture(autouse=True)
def neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let programs find the modules of their working directory."""
    monkeypatch.delenv("PYTHONSAFEPATH")


def run(folder: Path, script: str, *options: str) -> subprocess.CompletedProcess[str]:
    (folder / "helper.py").write_text("", encoding="utf-8")
    (folder / "script.py").write_text(script, encoding="utf-8")
    command = [sys.executable, "-m", "dsse_ros.compat", *options]
    return subprocess.run(
        command,
        cwd=folder,
        env=os.environ | {"SDL_VIDEODRIVER": "dummy"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.slow
def test_a_script_finds_the_package_its_arguments_and_its_neighbours(tmp_path: Path) -> None:
    done = run(tmp_path, SCRIPT, str(tmp_path / "script.py"), "--fast", "1")
    assert (done.stdout, done.returncode) == (
        "__main__ ['--fast', '1'] [4, 4, 3, 3]\n",
        0,
    ), done.stderr


@pytest.mark.slow
def test_a_script_for_the_first_version_finds_that(tmp_path: Path) -> None:
    done = run(tmp_path, SCRIPT_V1, "--dsse", "0.1.13", str(tmp_path / "script.py"))
    assert (done.stdout, done.returncode) == ("['drone0', 'drone1']\n", 0), done.stderr


@pytest.mark.slow
def test_pytest_runs_the_packages_own_tests(tmp_path: Path) -> None:
    tests = tmp_path / "DSSE" / "tests"
    tests.mkdir(parents=True)
    for package in (tests, tests.parent):
        (package / "__init__.py").write_text("", encoding="utf-8")
    (tests / "drone_policy.py").write_text("ACTION = 8", encoding="utf-8")
    (tests / "test_env.py").write_text(TESTS_OF_DSSE, encoding="utf-8")
    done = run(tmp_path, "", "-m", "pytest", "-q", "-p", "no:cacheprovider", "DSSE/tests")
    assert done.returncode == 0 and "1 passed" in done.stdout, done.stdout + done.stderr


@pytest.mark.slow
def test_a_module_finds_its_arguments_and_its_neighbours(tmp_path: Path) -> None:
    done = run(tmp_path, SCRIPT, "-m", "script", "-m", "--dsse")
    assert done.stdout == "__main__ ['-m', '--dsse'] [4, 4, 3, 3]\n", done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("other.py",), "script must be a Python file, got 'other.py'"),
        ((), "script must be a Python file, got ''"),
        (("-m",), "module must be one that Python finds, got ''"),
        (("-m", "nothing.there"), "module must be one that Python finds, got 'nothing.there'"),
        (("-m", "email.nothing"), "module must be one that Python finds, got 'email.nothing'"),
        (("-m", ".script"), "module must be one that Python finds, got '.script'"),
    ],
)
def test_what_is_not_there_is_named(options: tuple[str, ...], line: str, tmp_path: Path) -> None:
    done = run(tmp_path, "", *options)
    assert done.returncode == 2 and done.stderr.endswith(f"error: {line}\n")


def test_a_script_that_records_the_pygame_screen_gets_the_pictures(tmp_path: Path) -> None:
    pytest.importorskip("pygame")
    done = run(tmp_path, RECORDER, str(tmp_path / "script.py"))
    assert done.stdout.endswith("[False, True, True]\n"), done.stderr


def test_every_alias_names_something_of_this_package() -> None:
    for modules in VERSIONS.values():
        for names in modules.values():
            for each in names.values():
                assert each in COLOURS.values() or each.__module__.startswith("dsse_ros.compat")
    assert VERSIONS["1.1.9"]["DSSE"]["DroneSwarmSearch"] is compat.DroneSwarmSearch
