# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Ground stations that were written elsewhere accept the autopilot as a real one."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from autopilot.running import FOLDER, Running, running_autopilot

pytestmark = pytest.mark.slow

TIMEOUT_S = 240.0
HOME = (-24.0, -46.3, 100.0)
URLS = {"udpin": "udpin", "udpout": "udpout", "tcp": "tcpout"}


def needs(module: str) -> pytest.MarkDecorator:
    missing = importlib.util.find_spec(module) is None
    return pytest.mark.skipif(missing, reason=f"{module} is not installed: the extra `sitl` has it")


def fly_with_mavsdk(autopilot: Running, scene: str) -> dict[str, Any]:
    """Return what the client has seen."""
    kind = URLS[autopilot.connection.split(":")[0]]
    command = [sys.executable, str(FOLDER / "mavsdk_client.py"), scene]
    done = subprocess.run(
        [*command, f"{kind}://{autopilot.host}:{autopilot.port}"],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
    )
    if "LibraryNotFoundError" in done.stderr:
        pytest.skip(done.stderr.splitlines()[-1])
    assert done.returncode == 0, done.stdout + done.stderr
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def is_home(seen: dict[str, Any]) -> bool:
    lat_deg, lon_deg = seen["position"]
    return abs(lat_deg - HOME[0]) < 1e-5 and abs(lon_deg - HOME[1]) < 1e-5


@needs("mavsdk")
class TestMavsdk:
    def test_it_uploads_reads_back_and_flies_a_mission_with_px4(self) -> None:
        with running_autopilot("px4", link="udp", speedup=20, home=HOME) as autopilot:
            seen = fly_with_mavsdk(autopilot, "px4_mission")
        assert seen["autopilot"] == "PX4"
        for sent, got in zip(seen["uploaded"], seen["downloaded"], strict=True):
            assert got == pytest.approx(sent, rel=1e-7, abs=1e-7, nan_ok=True)
        assert seen["finished"]
        assert seen["modes"] == ["HOLD", "MISSION", "RETURN_TO_LAUNCH", "HOLD"]
        assert seen["highest_m"] > 34
        assert is_home(seen) and seen["height_m"] == 0

    def test_it_flies_px4_by_hand(self) -> None:
        # Not faster: MAVSDK repeats a setpoint at 20 Hz of wall time.
        with running_autopilot("px4", link="udpin", speedup=3, home=HOME) as autopilot:
            seen = fly_with_mavsdk(autopilot, "px4_setpoints")
        assert seen["went_to"]["height_m"] == pytest.approx(8, abs=0.6)
        assert seen["modes"][:4] == ["HOLD", "TAKEOFF", "HOLD", "OFFBOARD"]
        assert seen["modes"][-2:] == ["LAND", "HOLD"]
        assert seen["highest_m"] == pytest.approx(10, abs=0.5)
        assert not is_home(seen) and seen["height_m"] == 0

    def test_it_uploads_reads_back_and_flies_a_mission_with_ardupilot(self) -> None:
        with running_autopilot(link="tcp", speedup=20, home=HOME) as autopilot:
            seen = fly_with_mavsdk(autopilot, "ardupilot_mission")
        assert seen["autopilot"] == "ARDUPILOT"
        home, *way = seen["downloaded"]
        assert (home["x"], home["y"], home["z"]) == (-240000000, -463000000, 100)
        for sent, got in zip(seen["uploaded"][1:], way, strict=True):
            assert (got["seq"], got["command"], got["z"]) == (
                sent["seq"], sent["command"], sent["z"],
            )  # fmt: skip
            assert abs(got["x"] - sent["x"]) <= 1 and abs(got["y"] - sent["y"]) <= 1
        assert seen["finished"]
        assert seen["modes"][-1] == "MISSION"
        assert seen["highest_m"] == pytest.approx(30, abs=0.5)
        assert is_home(seen) and seen["height_m"] == 0


class Console:
    """A program that is typed into."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.output: list[str] = []
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line.rstrip())

    def type(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def until(self, text: str) -> str:
        """Return the next line that has this in it."""
        deadline_s = time.monotonic() + TIMEOUT_S
        while time.monotonic() < deadline_s:
            with contextlib.suppress(queue.Empty):
                self.output.append(self._lines.get(timeout=0.2))
                if text in self.output[-1]:
                    return self.output[-1]
        raise AssertionError(f"no {text!r} in\n" + "\n".join(self.output))


@contextlib.contextmanager
def running_mavproxy(autopilot: Running, folder: Path) -> Iterator[Console]:
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", "MAVProxy.mavproxy", f"--master={autopilot.connection}",
         "--mav20", "--no-state", "--default-modules=wp,param,mode,arm"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=folder,
        env=os.environ | {"HOME": str(folder)},
    )  # fmt: skip
    try:
        yield Console(process)
    finally:
        process.kill()
        process.communicate(timeout=TIMEOUT_S)


WAYPOINTS = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-24.00000000\t-46.30000000\t0.000000\t1
1\t0\t3\t22\t0\t0\t0\t0\t-24.00000000\t-46.30000000\t20.000000\t1
2\t0\t3\t16\t3\t2\t0\t0\t-23.99970000\t-46.30000000\t20.000000\t1
3\t0\t3\t16\t0\t2\t0\t0\t-23.99940000\t-46.29960000\t25.000000\t1
4\t0\t3\t20\t0\t0\t0\t0\t0.00000000\t0.00000000\t0.000000\t1
"""


@needs("MAVProxy")
@needs("future")
def test_mavproxy_loads_a_waypoint_file_lists_it_and_reads_a_parameter(tmp_path: Path) -> None:
    file = tmp_path / "mission.waypoints"
    file.write_text(WAYPOINTS)
    with (
        running_autopilot(link="udp", speedup=10, home=HOME) as autopilot,
        running_mavproxy(autopilot, tmp_path) as console,
    ):
        console.until("online system 1")
        console.until("Received")
        console.type(f"wp load {file}")
        console.until("TYPE_MISSION: ACCEPTED")
        console.type("wp list")
        console.until("Requesting 5 waypoints")
        listed = [console.until("cur=").split() for _ in range(5)]
        console.type("param show WPNAV_SPEED")
        assert console.until("WPNAV_SPEED").split()[-1] == "1000.0"
        console.type("mode GUIDED")
        console.until("Mode GUIDED")
    sent = [line.split("\t") for line in WAYPOINTS.splitlines()[1:]]
    assert [(line[0], line[1]) for line in listed] == [
        ("16", "0"), ("22", "3"), ("16", "3"), ("16", "3"), ("20", "0"),
    ]  # fmt: skip
    assert float(listed[0][4]) == HOME[2]
    for line, item in zip(listed, sent, strict=True):
        assert float(line[2]) == pytest.approx(float(item[8]), abs=1.1e-7)
        assert float(line[3]) == pytest.approx(float(item[9]), abs=1.1e-7)
