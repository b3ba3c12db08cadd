# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `make sitl-demo` runs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

DEMO = Path(__file__).with_name("sitl_demo.py")


def test_three_vehicles_find_the_person_over_every_cell_and_come_home(tmp_path: Path) -> None:
    done = subprocess.run(
        [
            sys.executable, str(DEMO), "--out", str(tmp_path), "--seed", "1",
            # Else chance decides how many steps a leg takes.
            "--vehicle-time", "awaited",
        ],
        capture_output=True, text=True, timeout=400,
    )  # fmt: skip
    logs = "\n".join(path.read_text(errors="replace") for path in tmp_path.glob("*.log"))
    assert done.returncode == 0, done.stdout + done.stderr + logs
    assert ": 8 steps, found; " in done.stdout
    assert len(re.findall(r"down at z = 0\.0 m", done.stdout)) == 3
    assert (tmp_path / "flight.png").read_bytes().startswith(b"\x89PNG")
    for name in ("sim_node", "mavlink_bridge", "planner_node"):
        assert "Traceback" not in (tmp_path / f"{name}.log").read_text()


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("speedup", "nan"),
        ("autopilot", "foo"),
        ("num_drones", "0"),
    ],
)
def test_what_is_not_allowed_ends_it_with_one_line_and_code_2(
    tmp_path: Path, option: str, value: str
) -> None:
    done = subprocess.run(
        [sys.executable, str(DEMO), "--out", str(tmp_path), f"--{option.replace('_', '-')}", value],
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("sitl_demo: ") and done.stderr.count("\n") == 1
    assert option in done.stderr and value in done.stderr
