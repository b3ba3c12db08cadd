# SPDX-License-Identifier: Apache-2.0
"""What `make sitl-demo` runs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

DEMO = Path(__file__).with_name("sitl_demo.py")


def test_three_vehicles_find_the_person_over_every_cell_and_come_home(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(DEMO), "--out", str(tmp_path), "--seed", "1"],
        capture_output=True, text=True, timeout=400,
    )  # fmt: skip
    logs = "\n".join(path.read_text(errors="replace") for path in tmp_path.glob("*.log"))
    assert done.returncode == 0, done.stdout + done.stderr + logs
    assert ": 8 steps, found; " in done.stdout
    assert (tmp_path / "flight.png").read_bytes().startswith(b"\x89PNG")
    for name in ("sim_node", "mavlink_bridge", "planner_node"):
        assert "Traceback" not in (tmp_path / f"{name}.log").read_text()
