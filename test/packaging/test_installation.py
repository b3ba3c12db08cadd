# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `pip install .` and `colcon build`, plain and with symbolic links, leave behind."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
EXECUTABLES = sorted(path.name for path in (ROOT / "scripts").iterdir())
SHARED = sorted(
    str(path.relative_to(ROOT))
    for path in (ROOT / "package.xml", *(ROOT / "config").iterdir(), *(ROOT / "launch").iterdir())
)


def test_the_executables_are_the_nodes_and_the_mission() -> None:
    programs = {"dashboard", "export_mission", "run_mission"}
    assert programs | {"mavlink_bridge", "planner_node", "sim_node"} <= set(EXECUTABLES)


@pytest.mark.parametrize("name", EXECUTABLES)
def test_ros2_run_finds_each_executable(installation: Any, name: str) -> None:
    executable = installation.prefix / "lib" / "dsse_ros" / name
    assert executable.is_file()
    assert os.access(executable, os.X_OK)
    assert executable.read_text().startswith("#!/usr/bin/env python3\n")


def test_pip_puts_each_executable_into_bin_and_colcon_none(installation: Any) -> None:
    bin_ = installation.prefix / "bin"
    programs = [name for name in EXECUTABLES if os.access(bin_ / name, os.X_OK)]
    assert programs == (EXECUTABLES if installation.tool == "pip" else [])


def test_the_mission_starts_from_where_ros2_run_looks(installation: Any) -> None:
    executable = installation.prefix / "lib" / "dsse_ros" / "run_mission"
    assert "--scenario" in installation.execute(sys.executable, executable, "--help")


def test_the_ament_index_finds_the_package(installation: Any) -> None:
    code = "from ament_index_python.packages import get_package_share_directory as share\n"
    code += "print(share('dsse_ros'))"
    share = Path(installation.execute(sys.executable, "-c", code).strip())
    assert share == installation.prefix / "share" / "dsse_ros"
    installed = (path for path in share.rglob("*") if path.is_file())
    assert set(SHARED) <= {str(path.relative_to(share)) for path in installed}


def test_the_package_imports_from_the_installation(installation: Any) -> None:
    code = "import dsse_ros, msg_adapters; print(dsse_ros.__file__, msg_adapters.__file__)"
    for file in installation.execute(sys.executable, "-c", code).split():
        assert installation.folder in Path(file).parents


def test_the_page_of_the_report_is_installed_with_its_module(installation: Any) -> None:
    code = "import dsse_ros.results.report as r; print(r.__path__[0])"
    folder = Path(installation.execute(sys.executable, "-c", code).strip())
    assert (folder / "page.html").is_file()
