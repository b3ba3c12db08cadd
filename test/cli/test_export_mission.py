# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions as files, from the command line and without ROS."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import mission_reader
import pytest

from dsse_ros.cli.export_gis import main as export_gis
from dsse_ros.cli.export_mission import main, search
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.vehicles.mission_items.items import (
    DO_CHANGE_SPEED,
    FRAME_MISSION,
    NAV_RETURN_TO_LAUNCH,
    NAV_TAKEOFF,
    NAV_WAYPOINT,
)
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "config" / "sitl.yaml"
# The package is the installed one, also where the sources are.
WITH_ROS = """
import sys
del sys.path[0]
from dsse_ros.cli.start import export_mission
sys.exit(export_mission())
"""
WITHOUT_ROS = """
import sys
del sys.path[0]
class Nothing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "rclpy" or name.endswith("_msgs"):
            raise ModuleNotFoundError(name, name=name)
sys.meta_path.insert(0, Nothing())
from dsse_ros.cli.start import export_mission
sys.exit(export_mission())
"""


def export(*arguments: str | Path, code: int = 0) -> str:
    """Run the program and return what it prints; ROS is only there for --ros-args."""
    program = WITH_ROS if "--ros-args" in arguments else WITHOUT_ROS
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


def test_every_drone_gets_a_mission_with_all_its_searches(tmp_path: Path) -> None:
    options = ("--planner", "greedy", "--seed", "2", "--every-cell")
    printed = export("--scenario", SCENARIO, "--out", tmp_path, *options)
    env = SearchEnv(Scenario.from_yaml(SCENARIO), profile("paper"))
    cells, searched, found = search(env, "greedy", 2, {})
    assert found and printed.startswith(f"found after {len(cells) - 1} steps; 6 files")
    for i in range(3):
        items = mission_reader.waypoints((tmp_path / f"drone{i}.waypoints").read_text())
        plan = mission_reader.plan((tmp_path / f"drone{i}.plan").read_text())
        assert len(plan.items) == len(items) - 1
        assert [item.command for item in items[1:]] == [item.command for item in plan.items]
        assert items[1].command == NAV_TAKEOFF and items[-1].command == NAV_RETURN_TO_LAUNCH
        speed, *inner = items[2:-1]
        assert (speed.command, speed.param1, speed.param2) == (DO_CHANGE_SPEED, 1.0, 10.0)
        assert {item.command for item in inner} == {NAV_WAYPOINT}
        # Where a lower vehicle passes, a cell is searched from the layer.
        held_s = sum(item.param1 for item in inner)
        assert held_s == 5.0 * searched[:, i].sum()
        moves = (cells[1:, i] != cells[:-1, i]).any(axis=1).sum()
        stops = sum(item.alt_m == 30.0 for item in inner)
        assert len(inner) == 1 + moves + 2 * stops


def test_a_recorded_mission_is_written_as_the_search_that_it_was(tmp_path: Path) -> None:
    pytest.importorskip("gpxpy")
    options = ["--scenario", str(SCENARIO), "--seed", "2"]
    assert export_gis([*options, "--out", str(tmp_path / "gis")]) == 0
    log = tmp_path / "gis" / "mission.csv"
    printed = export(log, "--out", tmp_path / "recorded")
    assert printed == export(*options, "--out", tmp_path / "played").replace("played", "recorded")
    for name in ("drone0.plan", "drone2.waypoints"):
        recorded, played = (tmp_path / folder / name for folder in ("recorded", "played"))
        assert recorded.read_bytes() == played.read_bytes()


def test_the_flight_is_as_asked_for(tmp_path: Path) -> None:
    export(
        "--scenario", "sitl", "--out", tmp_path, "--autopilot", "px4", "--search-altitude", "20",
        "--search-hold", "2.5", "--home", "-24.05,-46.18,3", "--num-drones", "1",
    )  # fmt: skip
    plan = mission_reader.plan((tmp_path / "drone0.plan").read_text())
    items = mission_reader.waypoints((tmp_path / "drone0.waypoints").read_text())
    assert plan.home == (-24.05, -46.18, 3.0)
    assert items[0].command == NAV_TAKEOFF
    assert {item.alt_m for item in items[:-1] if item.frame != FRAME_MISSION} <= {20.0, 120.0}
    assert sorted(tmp_path.iterdir()) == [tmp_path / "drone0.plan", tmp_path / "drone0.waypoints"]


def test_ros_arguments_count_as_the_options_of_their_names(tmp_path: Path) -> None:
    parameters = tmp_path / "parameters.yaml"
    parameters.write_text(
        "/**: {ros__parameters: {search_altitude: 20.0, autopilot: px4, of_others: 1}}"
    )
    named, ros = tmp_path / "named", tmp_path / "ros"
    short = ["-p", "scenario.timestep_limit:=20", "-p", "scenario.drones_positions:=[3,3]"]
    arguments = [
        "-p",
        "scenario:=sitl",
        "-p",
        "seed:=2",
        "-p",
        "merge_legs:=false",
        "-r",
        "__ns:=/a",
    ]
    options = ["--scenario", "sitl", "--seed", "2", "--every-cell", "--autopilot", "px4"]
    options += ["--search-altitude", "20"]
    export("--out", ros, "--ros-args", "--params-file", parameters, *arguments, *short)
    export("--out", named, *options, "--ros-args", *short)
    files = sorted(path.name for path in named.iterdir())
    assert files == ["drone0.plan", "drone0.waypoints"]
    for name in files:
        assert (ros / name).read_bytes() == (named / name).read_bytes()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--ros-args", "-p", "scenario.sigmma:=1.0"), "did you mean scenario.sigma?"),
        (("--scenario", "nowhere"), "scenario: 'nowhere' is not a file or a known scenario"),
    ],
)
def test_the_program_ends_with_one_line_and_code_2(arguments: tuple[str, ...], line: str) -> None:
    printed = export("--scenario", SCENARIO, *arguments, code=2)
    assert printed.startswith("export_mission: ") and printed.count("\n") == 1
    assert line in printed


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--ros-args", "-p", "search_hold:=-1.0"), "search_hold must be a finite number >= 0"),
        (("--home", "1,2"), "home must be LAT,LON,ALT up to 85 and 360 degrees and 100000 m, got"),
        (("--home", "nan,0,0"), "home must be LAT,LON,ALT up to 85 and 360 degrees"),
        (("--home=-46.18,-24.05,0",), "home must be at most 500 km from the search at -24."),
        (("--home=24.05,133.82,0",), "home must be at most 500 km from the search at -24."),
        (
            (
                "--pattern=PS",
                "--length=500",
                "--width=500",
                "--track-spacing=100",
                "--datum=-24,-46",
                "--home=-46,-24,0",
            ),
            "home must be at most 500 km from the search at -24, -46, got -46, -24",
        ),
        (("--search-hold", "-1"), "search_hold must be a finite number >= 0"),
        (("--seed", "-1"), "seed must be an integer >= 0"),
        (("--planner", "nobody"), "--planner"),
        (("--num-drones", "0"), "num_drones must be an integer >= 1"),
        (("--out", "/dev/null/here"), "out: '/dev/null/here'"),
        (("nowhere.csv",), "file: 'nowhere.csv'"),
        (("nowhere.csv", "--pattern", "PS"), "file must not be given with pattern"),
    ],
)
def test_what_is_not_allowed_gets_one_line(
    arguments: tuple[str, ...], line: str, capfd: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(["--scenario", str(SCENARIO), *arguments])
    except SystemExit as end:
        code = int(end.code or 0)
    output, printed = capfd.readouterr()
    assert (code, output) == (2, "")
    assert printed.startswith("export_mission: ") and printed.count("\n") == 1
    assert line in printed
