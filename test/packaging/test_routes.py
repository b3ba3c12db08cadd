# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Each documented route of installation, in an empty environment, flies a mission.

The commands are those of the page on installation, in a copy of the sources. Only a new environment
comes with what pip and rosdep would have downloaded for this route, and nothing else.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import pytest
from domains import free_domain
from empty_environment import bring_compiled

from dsse_ros.results.report.logs import read_csv

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not any(metadata.distributions(name="ros-rclpy")), reason="ROS 2 is not from wheels"
    ),
]

ROOT = Path(__file__).resolve().parents[2]
BLOCKS = re.findall(
    r"^```sh\n(.*?)^```$", (ROOT / "docs" / "install.md").read_text(), re.MULTILINE | re.DOTALL
)
(OF_MAKE,) = re.findall(r"^OF_SIM := ([a-z,]+)", (ROOT / "Makefile").read_text(), re.MULTILINE)
ROS = ["ros-rclpy[fastrtps]", "ros-common-interfaces"]
OF_ROSDEP = ["matplotlib", "numpy", "pymap3d", "shapely", "tqdm", "pyyaml", "setuptools"]
"""Python packages that package.xml names, and setuptools, with which colcon builds."""
STEPS = 4
SCENARIO = (
    f"grid_size: 8\nnum_drones: 2\ntimestep_limit: {STEPS}\nperson_initial_position: [7, 7]\n"
)

# A machine's `python3`, which brings into a new environment what would be downloaded.
PYTHON = """#!/bin/bash
[ "$1 $2" = "-m venv" ] && exec {python} {helper} "${{@: -1}}" {requirements}
exec {base} "$@"
"""
# `ros2 run`, which does not come as a wheel.
ROS2 = """
ros2() {
    prefix=$(python3 -c "import ament_index_python as i; print(i.get_package_prefix('$2'))")
    exec "$prefix/lib/$2/$3" "${@:4}"
}
"""
MISSION = """
ros2 run dsse_ros sim_node --ros-args -p scenario:=few.yaml -p record_file:=out/mission.csv &
nodes=$!
ros2 run dsse_ros planner_node --ros-args -p planner:=sweep > planner.log 2>&1 &
nodes="$nodes $!"
until grep -q 'mission 1 is over' planner.log; do kill -0 $nodes || exit 1; sleep .1; done
kill -INT $nodes
wait
"""


def block(command: str) -> list[str]:
    """Return the lines of the page's block that has a command, without the lines it continues."""
    (text,) = (text for text in BLOCKS if command in text)
    return text.replace("\\\n", "").splitlines()


def of_pip(line: str) -> list[str]:
    """Return the requirements of a line with `pip install`, each without its version."""
    words = [word.strip("'") for word in line.partition("pip install ")[2].split()]
    return [re.sub(r"^\.", "dsse_ros", word).partition("==")[0] for word in words]


@dataclass(frozen=True)
class Route:
    """What a route needs, how it installs the package, and how it flies."""

    requirements: list[str]
    install: list[str]
    fly: str
    beside: tuple[str, ...] = ()
    """Modules that not every route brings."""


def route_of_make() -> Route:
    options = "SCENARIO=few.yaml PLANNER=sweep RATE=0"
    extras = OF_MAKE.replace(",", "-")
    (command,) = block("make sim")
    install = [f"make .venv/.sim-{extras}"]
    return Route([f"dsse_ros[{OF_MAKE}]", *ROS], install, f"{command} {options}", ("mcap",))


def route_of_pip() -> Route:
    *install, fly = block("pip install '.[viz")
    requirements = [name for line in install for name in of_pip(line)]
    # The page has the versions of Jazzy.
    install = [re.sub("==[0-9.]+", "", line) for line in install]
    return Route(requirements, install, f"{fly} --scenario few.yaml --rate 0")


def route_of_colcon(build: str) -> Route:
    lines = block("colcon build")
    first, last = (
        i for i, line in enumerate(lines) if line.startswith(("python3 -m", ". install"))
    )
    assert lines[0].startswith("rosdep install")
    assert "ros2 run dsse_ros sim_node" in lines
    either = re.compile("colcon build +# or: (colcon build --.*)")
    install = [either.sub(build, line) for line in lines[first : last + 1]]
    assert build in install
    return Route([*of_pip(install[1]), *OF_ROSDEP, *ROS], install, ROS2 + MISSION)


ROUTES: dict[str, Callable[[], Route]] = {
    "make": route_of_make,
    "colcon": lambda: route_of_colcon("colcon build"),
    "colcon with links": lambda: route_of_colcon("colcon build --symlink-install"),
    "pip": route_of_pip,
}


@dataclass(frozen=True)
class Machine:
    """A machine that has Python and colcon, in a folder with the sources."""

    folder: Path
    environment: dict[str, str]

    def run(self, *lines: str) -> str:
        """Run lines of a shell, each only if those before have worked; return what they print."""
        done = subprocess.run(
            ["bash", "-e", "-c", "\n".join(lines)], cwd=self.folder, env=self.environment,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout
        return done.stdout


def machine(folder: Path, requirements: list[str]) -> Machine:
    programs = folder.parent / "programs"
    programs.mkdir()
    python = programs / "python3"
    helper = Path(__file__).with_name("empty_environment.py")
    quoted = " ".join(f"'{requirement}'" for requirement in requirements)
    python.write_text(
        PYTHON.format(
            python=sys.executable,
            helper=helper,
            requirements=quoted,
            base=sys._base_executable,  # type: ignore[attr-defined]
        )
    )
    python.chmod(0o755)
    ours = Path(sys.executable).parent
    (programs / "colcon").symlink_to(ours / "colcon")
    others = [part for part in os.environ["PATH"].split(os.pathsep) if Path(part) != ours]
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    for name in ("VIRTUAL_ENV", "AMENT_PREFIX_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE", "MAKEFLAGS"):
        kept.pop(name, None)
    return Machine(
        folder,
        kept
        | {
            "PATH": os.pathsep.join([str(programs), *others]),
            "PIP_NO_INDEX": "1",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": str(free_domain()),
            "COLCON_EXTENSION_BLOCKLIST": "colcon_core.event_handler.desktop_notification",
        },
    )


@pytest.mark.parametrize("name", ROUTES)
def test_a_documented_route_flies_a_mission_from_an_empty_environment(
    tmp_path: Path, copy_sources: Callable[[Path], Path], name: str
) -> None:
    route = ROUTES[name]()
    folder = tmp_path / "clone"
    copy_sources(folder / "src" / "dsse_ros" if "colcon" in name else folder)
    for lock in ROOT.glob("requirements*.lock"):
        shutil.copy(lock, folder)
    (folder / "few.yaml").write_text(SCENARIO)
    (folder / "out").mkdir()
    here = machine(folder, route.requirements)
    install = [
        line.replace("pip install", "pip install --no-build-isolation") for line in route.install
    ]
    here.run(*install)
    bring_compiled(folder)
    # What the tests have and the route does not bring.
    has = {path.name for path in folder.glob("*/lib/python3*/site-packages/*")}
    assert "numba" in has and not has & {"hypothesis", "pyarrow", "mcap"} - set(route.beside)
    enter = [line for line in install if re.match(r"python3 -m venv|export|\. ", line)]
    enter = [line.rpartition("&& ")[2] for line in enter]
    here.run(*enter, route.fly)
    (mission,) = read_csv(folder / "out" / "mission.csv")
    assert mission.truncated[-1].all() and mission.steps[-1] in (STEPS, STEPS + 1)
    if name == "pip":
        (lacking,) = here.run(*enter, "! recorder --ros-args -p bag:=x.mcap").splitlines()
        assert "[record]" in lacking
