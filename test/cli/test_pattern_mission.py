# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Search patterns as missions of one vehicle, from the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import mission_reader
import numpy as np
import pytest
from autopilot.local_frame import Place
from pymap3d.vincenty import vdist
from virtual_flight import VirtualFlight

from dsse_ros.cli.export_mission import main
from dsse_ros.planners.patterns import SearchPattern
from dsse_ros.vehicles.control.orders import FlyMission
from dsse_ros.vehicles.mission_items.items import (
    DO_CHANGE_SPEED,
    NAV_RETURN_TO_LAUNCH,
    NAV_TAKEOFF,
    NAV_WAYPOINT,
)

PS = ("--pattern", "PS", "--length", "2000", "--width", "1000", "--track-spacing", "200")


@pytest.mark.parametrize("pattern", ["PS", "CS", "SS", "VS"])
def test_the_vehicle_flies_from_turning_point_to_turning_point(
    pattern: str, tmp_path: Path
) -> None:
    values: dict[str, Any] = {"length": 2000, "heading": 30, "first_turn": "port"}
    values |= {} if pattern == "VS" else {"track_spacing": 250}
    values |= {"width": 1000} if pattern in ("PS", "CS") else {}
    options = [f"--{name.replace('_', '-')}={value}" for name, value in values.items()]
    assert (
        main(["--pattern", pattern, *options, "--datum", "-24.1,-46.3", "--out", str(tmp_path)])
        == 0
    )
    items = mission_reader.plan((tmp_path / "drone0.plan").read_text()).items
    assert items[0].command == NAV_TAKEOFF and items[-1].command == NAV_RETURN_TO_LAUNCH
    assert items[1].command == DO_CHANGE_SPEED and items[1].param2 == 10.0
    assert {item.command for item in items[2:-1]} == {NAV_WAYPOINT}
    # Distances and azimuths on the ellipsoid, by other formulas than those of the mission.
    lats, lons = np.array([(item.lat_deg, item.lon_deg) for item in items[2:-1]]).T
    distance_m, azimuth_deg = vdist(-24.1, -46.3, lats, lons)
    points = SearchPattern(pattern=pattern, **values).track.points_m
    assert distance_m == pytest.approx(np.hypot(*points.T), abs=0.01)
    off_deg = azimuth_deg - np.degrees(np.arctan2(*points.T))
    assert (off_deg[distance_m > 1] + 180) % 360 == pytest.approx(180, abs=0.001)


def test_the_numbers_are_those_by_hand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # Five lanes of 1800 m and four cross legs of 200 m; a degree is 110 574 m and 111 320 m.
    main([*PS, "--datum", "0,0", "--sweep-width", "200", "--out", str(tmp_path)])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[-1].strip() for line in lines[:-1]] == [
        "-0.008139, -0.003593",
        "9",
        "9800 m, 16 min 20 s at 10 m/s",
        "2.000 km2",
        "200 m",
        "0.98, W / S = 1.00",
        "62.5% random search, 78.1% inverse cube",
    ]
    main(["--pattern", "VS", "--errors", "300,400,1200", "--search", "2", "--out", str(tmp_path)])
    # E is 1300 m, and the factor of the second search 1.6.
    printed = capsys.readouterr().out
    assert "2080 m\n" in printed and "18720 m" in printed and "13.592 km2" in printed


def test_the_sweep_width_is_that_of_the_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fields = ["sensor:=sweep_width", "search_object:=raft_4_person", "platform:=helicopter"]
    fields += [
        "zone_size:=10000.0",
        "altitude:=91.44",
        "drone_speed:=46.3",
        "visibility:=9260.0",
        "cell_size:=500.0",
    ]
    ros = [part for field in fields for part in ("-p", f"scenario.{field}")]
    main([*PS, "--out", str(tmp_path), "--ros-args", *ros])
    # 1.6 nm from 300 ft at 90 kt with a visibility of 5 nm.
    assert "sweep width             2963 m" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--pattern", "SS", "--length", "1000"), "track_spacing must be a finite number > 0 m"),
        (("--pattern", "VS"), "length must be a finite number > 0"),
        ((*PS, "--datum", "1"), "datum must be LAT,LON up to 85 and 360 degrees, or such as"),
        ((*PS, "--errors", "1,2"), "errors must be X,DE,Y from 0 to 1e+06 m, got '1,2'"),
        ((*PS, "--errors", "1,2,3", "--search", "6"), "search must be from 1 to 5, got 6"),
        ((*PS, "--search", "1"), "search must be given with errors, got 1"),
        ((*PS, "--sweep-width", "0"), "sweep_width must be > 0 and <= 1000000 m, got 0.0"),
        (("--heading", "3"), "heading must be given with pattern, got no pattern"),
    ],
)
def test_what_is_not_allowed_gets_one_line(
    arguments: tuple[str, ...], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith(f"export_mission: {line}") and printed.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_mission_is_flown_at_the_speed_that_was_printed(
    autopilot: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--pattern", "VS", "--length", "300", "--datum", "-24.1,-46.3"]
    speed = ["--ros-args", "-p", "scenario.drone_speed:=8.0"]
    main([*options, "--autopilot", autopilot, "--out", str(tmp_path), *speed])
    assert " at 8 m/s" in capsys.readouterr().out
    written = mission_reader.waypoints((tmp_path / "drone0.waypoints").read_text())
    plan = json.loads((tmp_path / "drone0.plan").read_text())["mission"]
    assert plan["hoverSpeed"] == plan["cruiseSpeed"] == 8.0
    # A plain ground station sends the items as they are, and no other command.
    home = Place(-24.1, -46.3, 0.0)
    flight = VirtualFlight(autopilot, vehicle={"home": home, "endurance_s": 1e5})
    # ArduPilot stores no radius.
    items = (
        replace(item, param2=0.0) if item.command == NAV_WAYPOINT else item for item in written
    )
    flight.give(FlyMission(tuple(items)))
    speeds = []
    while flight.outcome.status == "under_way":
        flight.step()
        if flight.vehicle.mission.current > 5:
            speeds.append(flight.vehicle.craft.ground_speed_mps)
    assert flight.outcome.status == "done"
    assert not flight.commands(DO_CHANGE_SPEED)
    assert max(speeds) == pytest.approx(8.0, abs=0.2)
