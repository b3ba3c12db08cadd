# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What other packages register, installed by pip, is found by name."""

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
    name="third-party",
    version="1.0",
    py_modules=["stay_and_search", "defective", "low_flyers"],
    entry_points={
        "dsse_ros.sensors": [
            "narrow = low_flyers:NARROW",
            "own_cell = defective:SENSOR",
            "defective = defective:SENSOR",
            "no_sensor = low_flyers:LOW",
        ],
        "dsse_ros.searchers": ["low = low_flyers:LOW", "defective = defective:KIND"],
        "dsse_ros.ensembles": ["anchored = low_flyers:ANCHORED", "defective = defective:TRACKS"],
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
LOW_FLYERS = """
import numpy as np
from dsse_ros import Ensemble, Look, Searcher, Sensor, WeightedTracks

def looks(scenario, searcher, action, heading):
    return [Look(0, 0, (0.25,) * scenario.person_amount)] if action == "search" else []

def tracks(scenario, steps, rng, count):
    place = (np.array(scenario.person_initial_position) + 0.5) * scenario.cell_size
    return WeightedTracks(np.tile(place, (steps + 1, count, 1)), np.full(count, 1 / count))

NARROW = Sensor("sees a quarter of what is in the cell", looks)
LOW = Searcher(doc="flies low", altitude=30.0, sensor="narrow")
ANCHORED = Ensemble("stays", tracks)
"""
MOTION_SETUP = """
from setuptools import setup
setup(
    name="third-party-motion",
    version="1.0",
    py_modules=["still"],
    entry_points={
        "dsse_ros.motions": ["still = still:STILL", "not a name = still:STILL", "lost = lost:LOST"]
    },
)
"""
STILL = """
from dsse_ros import PersonMotion
from dsse_ros.base.compiled.jit import part

@part
def stay(constants, world, sea, person, direction):
    pass

@part
def chances(constants, sea, x, y, window, out, scratch):
    for k in range(10):
        out[k] = k == 4

STILL = PersonMotion("stays", stay, chances)
"""
DEFECTIVE = 'raise RuntimeError("two\\nlines")\n'


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Variables of processes that see the package; the environment of the tests does not."""
    source, target = (tmp_path_factory.mktemp(name) for name in ("source", "target"))
    return install(
        source,
        target,
        {
            "setup": SETUP,
            "stay_and_search": STAY_AND_SEARCH,
            "low_flyers": LOW_FLYERS,
            "defective": DEFECTIVE,
        },
    )


def install(source: Path, target: Path, modules: dict[str, str]) -> dict[str, str]:
    """Install a package of modules; return the variables of processes that see it."""
    for name, text in modules.items():
        (source / f"{name}.py").write_text(text)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--no-index"]
    options = ["--no-deps", "--no-build-isolation", "--no-compile", "--target", str(target)]
    done = subprocess.run(
        [*pip, *options, "."], cwd=source, capture_output=True, text=True, timeout=180
    )
    assert done.returncode == 0, done.stderr
    paths = [str(target), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)}


def run(
    environment: dict[str, str], folder: Path, *arguments: str | Path, timeout: float = 180
) -> subprocess.CompletedProcess[str]:
    """Run Python, with the installed package rather than the checkout."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=timeout,
    )  # fmt: skip


def test_a_planner_of_another_package_is_found_by_name(
    environment: dict[str, str], tmp_path: Path
) -> None:
    code = (
        "from dsse_ros import parallel_env, planner_for\n"
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
        ("no_factory", "stay_and_search:NAME is of the type str, not Callable"),
    ],
)
def test_a_defective_package_gets_one_clear_line_from_the_node(
    environment: dict[str, str], tmp_path: Path, name: str, reason: str
) -> None:
    done = run(
        environment, tmp_path, "-m", "dsse_ros.ros.nodes.planner_node",
        "--ros-args", "-p", f"planner:={name}",
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert f"planner: '{name}' cannot be loaded" in line
    assert reason in line


def test_a_sensor_a_kind_of_drone_and_an_ensemble_of_another_package_are_found_by_name(
    environment: dict[str, str], tmp_path: Path
) -> None:
    code = (
        "from dsse_ros import *\n"
        "from low_flyers import ANCHORED, LOW, NARROW\n"
        "from dsse_ros.search.step.looks import looks_of\n"
        "env = parallel_env(rules='v2', searchers=['low'], person_motion='anchored')\n"
        "env.reset(seed=1)\n"
        "pods = looks_of(env.scenario, env.rules).pods\n"
        "print(env.scenario.altitudes[0], pods.max())\n"
        "sensor_test(NARROW)\n"
        "print(parallel_env(rules='v2', sensor='own_cell').scenario.kinds[0].sensor)\n"
        "for fields in ({'sensor': 'defective'}, {'searchers': ['defective']},"
        " {'person_motion': 'defective'}, {'sensor': 'no_sensor'}):\n"
        "    try:\n"
        "        parallel_env(rules='v2', **fields)\n"
        "    except FieldError as error:\n"
        "        print(error)\n"
    )
    done = run(environment, tmp_path, "-c", code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "30.0 0.25",
        "own_cell",
        "sensor: 'defective' cannot be loaded: RuntimeError: two lines",
        "searcher: 'defective' cannot be loaded: RuntimeError: two lines",
        "ensemble: 'defective' cannot be loaded: RuntimeError: two lines",
        "sensor: 'no_sensor' cannot be loaded: low_flyers:LOW is of the type Searcher, not Sensor",
    ]


def test_a_motion_of_another_package_is_compiled_into_the_search(tmp_path: Path) -> None:
    source, target, cache = (tmp_path / name for name in ("source", "target", "cache"))
    source.mkdir()
    modules = {"setup": MOTION_SETUP, "still": STILL}
    # What is compiled for this test alone is not worth optimising.
    environment = install(source, target, modules) | {
        "NUMBA_CACHE_DIR": str(cache), "NUMBA_OPT": "0",
    }  # fmt: skip
    code = (
        "from dsse_ros import FieldError, parallel_env, target_model_test\n"
        "from still import STILL\n"
        "target_model_test(STILL)\n"
        "try:\n"
        "    parallel_env(person_motion='lost')\n"
        "except FieldError as error:\n"
        "    print(error)\n"
    )
    done = run(environment, tmp_path, "-c", code, timeout=600)
    assert done.returncode == 0, done.stderr
    assert done.stdout == (
        "motion: 'lost' cannot be loaded: ModuleNotFoundError: No module named 'lost'\n"
    )
