# SPDX-License-Identifier: Apache-2.0
"""The files of the repository."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Parts that are being moved: neither their words nor their sizes are held yet.
BEING_MOVED: tuple[str, ...] = (
    "README.md",
    "config/mavlink_bridge.yml",
    "docs/flight.md",
    "docs/parameters.md",
    "docs/ros.md",
    "dsse_ros/cli/export_mission.py",
    "dsse_ros/flight/",
    "dsse_ros/nodes/bridge_publishers.py",
    "dsse_ros/nodes/launch_arguments.py",
    "dsse_ros/nodes/mavlink_bridge.py",
    "dsse_ros/nodes/mission_export.py",
    "dsse_ros/nodes/settings.py",
    "msg_adapters/vehicles.py",
    "test/cli/test_export_mission.py",
    "test/flight/",
    "test/nodes/test_mavlink_bridge.py",
    "test/nodes/test_px4_settings.py",
)


def files() -> list[Path]:
    """Files under version control, or about to be."""
    command = ["git", "-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others"]
    listed = subprocess.run(
        [*command, "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    if listed.returncode:
        pytest.skip("not a git checkout")
    paths = (ROOT / name for name in listed.stdout.split("\0") if name)
    return [path for path in paths if path.is_file()]


def text(path: Path) -> str:
    """Text of a file, or nothing for one that is not text."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return ""


def in_place(paths: list[Path]) -> dict[str, Path]:
    """Files by their names in the repository, without what is being moved."""
    named = {path.relative_to(ROOT).as_posix(): path for path in paths}
    return {name: path for name, path in named.items() if not name.startswith(BEING_MOVED)}
