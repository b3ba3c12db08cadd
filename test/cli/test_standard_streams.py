# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Output that is closed, full or abandoned: the work is done, and what is lost is said."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from rig import ENVIRONMENT, TIMEOUT_S, free_domain

from dsse_ros.ros.runtime.exit_codes import FAILED

PROGRAMS = sorted(path.name for path in (Path(__file__).parents[2] / "scripts").iterdir())
FULL = "standard output: No space left on device"
CLOSED = "standard output is closed"
BACKTRACK = (
    "backtrack --found=-24.013,-46.36 --time 2026-01-18T13:00Z --until 2026-01-18T12:30Z"
    " --particles 9 --out back.csv"
)
GIS = "export_gis --planner sweep --out gis"


@pytest.fixture
def shell(tmp_path: Path) -> object:
    """Run a command line in which programs are called by their names; as `sh` does it."""
    for name in PROGRAMS:
        program = tmp_path / "bin" / name
        program.parent.mkdir(exist_ok=True)
        code = f"from dsse_ros.cli.start import {name}; raise SystemExit({name}())"
        program.write_text(f"#!/bin/sh\nexec {sys.executable} -c '{code}' \"$@\"\n")
        program.chmod(0o755)

    def run(line: str) -> tuple[int, list[str], list[str]]:
        path = f"{tmp_path / 'bin'}:{os.environ['PATH']}"
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", line], cwd=tmp_path, capture_output=True, text=True,
            env=os.environ | ENVIRONMENT | {"PATH": path, "ROS_DOMAIN_ID": str(free_domain())},
            timeout=TIMEOUT_S, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        return done.returncode, done.stdout.splitlines(), done.stderr.splitlines()

    return run


LOST = (
    (">/dev/full", FAILED, FULL),
    (">&-", FAILED, CLOSED),
    ("| true", 0, ""),
    ("2>&-", 0, ""),
    (">/dev/full 2>&1", FAILED, ""),
    (">&- 2>&- <&-", FAILED, ""),
)


@pytest.mark.parametrize(
    ("program", "to", "code", "says"),
    [(name, *LOST[i % len(LOST)]) for i, name in enumerate(PROGRAMS)],
)
def test_help_that_is_lost_is_reported_and_a_reader_may_leave(
    shell: object, program: str, to: str, code: int, says: str
) -> None:
    assert callable(shell)
    status, output, errors = shell(f"{program} --help {to}")
    assert status == code
    assert errors == ([f"{program}: {says}"] if says else [])
    assert bool(output) == (to == "2>&-")


@pytest.mark.parametrize(
    ("command", "to", "code", "says"),
    [
        (BACKTRACK, "| head -1", 0, ""),
        (BACKTRACK, ">&-", FAILED, CLOSED),
        (GIS, "| true", 0, ""),
        (GIS, ">/dev/full", FAILED, FULL),
    ],
)
def test_files_are_written_whole_whatever_becomes_of_the_output(
    shell: object, tmp_path: Path, command: str, to: str, code: int, says: str
) -> None:
    assert callable(shell)
    status, _, errors = shell(f"{command} {to}")
    errors = [line for line in errors if "compiling" not in line]
    assert (status, errors) == (code, [f"{command.split()[0]}: {says}"] if says else [])
    if command == GIS:
        assert (tmp_path / "gis" / "mission.kml").read_text().rstrip().endswith("</kml>")
    else:
        assert len((tmp_path / "back.csv").read_text().splitlines()) == 10


def test_a_mission_is_flown_without_output_and_its_files_are_whole(
    shell: object, tmp_path: Path
) -> None:
    assert callable(shell)
    (tmp_path / "small.yaml").write_text("grid_size: 6\ntimestep_limit: 4\n")
    fly = "run_mission --scenario small.yaml --rules paper --planner sweep --rate 0"
    status, _, errors = shell(f"{fly} --out m >&-")
    assert (status, errors) == (FAILED, [f"run_mission: {CLOSED}"])
    # No file has taken the place of the output.
    text = (tmp_path / "m" / "mission.csv").read_text()
    assert text.startswith("mission,")
    assert (tmp_path / "m" / "mission.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("node", ["sim_node", "mavlink_bridge"])
def test_a_node_needs_no_streams(shell: object, node: str) -> None:
    assert callable(shell)
    # It refuses the parameter, so it has come to its own code.
    assert shell(f"{node} --ros-args -p nonesuch:=1 >&- 2>&- <&-")[0] == 2
