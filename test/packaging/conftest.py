# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Copies of the source tree, and the package installed from them in each supported way."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = (
    "LICENSE",
    "Makefile",
    "config",
    "dsse_ros",
    "launch",
    "msg_adapters",
    "package.xml",
    "pyproject.toml",
    "resource",
    "rviz",
    "scripts",
    "setup.cfg",
    "setup.py",
    "viewers",
)


def run(*command: str | Path, cwd: Path, env: dict[str, str] | None = None) -> str:
    """Run a command to its end and return what it prints; fail with all of it otherwise."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=os.environ | (env or {}),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def copy_sources(target: Path) -> Path:
    """Copy what an installation reads, and nothing that an earlier one has built."""
    target.mkdir(parents=True)
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, target / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, target / name)
    return target


@pytest.fixture(name="copy_sources")
def fixture_of_copy_sources() -> Callable[[Path], Path]:
    return copy_sources


@dataclass(frozen=True)
class Installation:
    """Where the package went, how, and how a program is started so that it finds it."""

    tool: str
    folder: Path
    prefix: Path
    execute: Callable[..., str]


def pip_installation(folder: Path) -> Installation:
    tree = copy_sources(folder / "tree")
    prefix = folder / "prefix"
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install"]
    # Without --ignore-installed pip removes the package from the environment that runs the tests.
    options = ["--no-deps", "--no-build-isolation", "--ignore-installed", "--prefix", prefix]
    run(*pip, *options, ".", cwd=tree)
    paths = sysconfig.get_paths(vars={"base": str(prefix), "platbase": str(prefix)})
    path = [paths["purelib"], *filter(None, [os.environ.get("PYTHONPATH")])]
    env = {"AMENT_PREFIX_PATH": str(prefix), "PYTHONPATH": os.pathsep.join(path)}
    return Installation("pip", folder, prefix, lambda *command: run(*command, cwd=folder, env=env))


def colcon_installation(folder: Path, *options: str) -> Installation:
    copy_sources(folder / "src" / "dsse_ros")
    colcon = Path(sys.executable).with_name("colcon")
    env = {"COLCON_EXTENSION_BLOCKLIST": "colcon_core.event_handler.desktop_notification"}
    run(colcon, "build", *options, cwd=folder, env=env)

    def execute(*command: str | Path) -> str:
        sourced = '. install/local_setup.bash && exec "$@"'
        return run("bash", "-c", sourced, "bash", *command, cwd=folder)

    return Installation("colcon", folder, folder / "install" / "dsse_ros", execute)


@pytest.fixture(scope="session", params=["pip", "colcon", "colcon --symlink-install"])
def installation(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Installation:
    folder = tmp_path_factory.mktemp("installation")
    tool, *options = request.param.split()
    if tool == "pip":
        return pip_installation(folder)
    return colcon_installation(folder, *options)
