# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Searches as missions of vehicles, and their files: how they are flown, and in which layers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, check_all, field
from dsse_ros.base.whole_files import write_whole
from dsse_ros.vehicles.autopilots import AUTOPILOTS
from dsse_ros.vehicles.fleet.vehicle_time import ArrivalSettings
from dsse_ros.vehicles.mission_items.items import Home, VehicleMission
from dsse_ros.vehicles.mission_items.plan_files import plan_text
from dsse_ros.vehicles.mission_items.reduced_tracks import without_repeats
from dsse_ros.vehicles.mission_items.separation import level_cells
from dsse_ros.vehicles.mission_items.track_missions import (
    TrackStyle,
    acceptance_radius_m,
    track_mission,
)
from dsse_ros.vehicles.mission_items.waypoint_files import qgc_wpl
from dsse_ros.world.scenario.frames import GridFrame

Track = tuple[NDArray[Any], NDArray[np.bool_]]
"""(K, 2) cells (col, row), and (K,) flags of searched cells; the others are moves."""

ALTITUDE_STEP_M = 5.0
"""Vertical separation of two vehicles, if there is room for it."""
LOWEST_LAYER_M = 10.0


@dataclass(frozen=True, kw_only=True)
class FlightSettings(ArrivalSettings):
    """Settings for flying a drone's moves and searches.

    Raises:
        FieldError: If a value is not allowed.
    """

    autopilot: str = field("str", "Autopilot of the vehicles.", "ardupilot",
        choices=tuple(AUTOPILOTS),
    )  # fmt: skip
    search_altitude: float = field(
        "float", "Altitude to which a vehicle descends to search a cell, measured as the flight "
        "altitude is; that one if it is lower.", 30.0, low=1, high=20000, unit="m",
    )  # fmt: skip
    search_hold: float = field(
        "float", "Time that a vehicle holds at the search altitude.", 5.0, low=0, high=600, unit="s"
    )
    altitude_step: float = field(
        "float", "Altitude of each vehicle below the previous one, so that paths do not cross; 0 "
        "for the same altitude, negative for 5 or, without room for that, less.",
        -1.0, low=-1, high=1000, unit="m",
    )  # fmt: skip
    merge_legs: bool = field(
        "bool", "Whether missions fly a straight leg without a waypoint in each cell.", True
    )

    def __post_init__(self) -> None:
        check_all(self)


def search_missions(
    frames: Sequence[GridFrame],
    tracks: Sequence[Track],
    settings: FlightSettings,
    homes: Sequence[Home | None],
    speeds_mps: Sequence[float],
    home_hold_s: float = 0.0,
    datum_amsl_m: float | None = None,
) -> list[VehicleMission]:
    """Return what each vehicle has to fly: see `track_mission`.

    Their tracks are flown at the same time, but their timing is not coordinated. A vehicle
    descends to search only over cells that no other one passes at its altitude or below: see
    `level_cells`. The others it searches from its altitude.

    Args:
        frames: The grid at each vehicle's altitude.
        tracks: What each drone has done.
        settings: How it is flown.
        homes: Where each vehicle takes off; None below its first cell.
        speeds_mps: Speed of each vehicle, 0 for its own.
        home_hold_s: See `TrackStyle`.
        datum_amsl_m: See `TrackStyle`.
    """
    paths = [[tuple(cell) for cell in without_repeats(cells).tolist()] for cells, _ in tracks]
    searched = [[tuple(cell) for cell in cells[flags].tolist()] for cells, flags in tracks]
    level = level_cells(frames, paths, searched, homes)
    return [
        track_mission(
            frame,
            *track,
            home=home,
            level_cells=cells,
            style=TrackStyle(
                merge_legs=settings.merge_legs,
                acceptance_radius_m=acceptance_radius_m(frame, settings.acceptance_radius),
                search_alt_m=min(settings.search_altitude, frame.alt_m),
                search_hold_s=settings.search_hold,
                home_hold_s=home_hold_s,
                datum_amsl_m=datum_amsl_m,
                speed_mps=speed_mps,
                airspeed=AUTOPILOTS[settings.autopilot].circles,
            ),
        )
        for frame, track, home, cells, speed_mps in zip(
            frames, tracks, homes, level, speeds_mps, strict=True
        )
    ]


def layers(
    frame: GridFrame, settings: FlightSettings, vehicles: int, lowest_m: float = LOWEST_LAYER_M
) -> list[GridFrame]:
    """Return the grid at each vehicle's altitude, so that paths do not cross.

    Args:
        frame: The grid at the altitude of the first one, the highest.
        settings: How it is flown.
        vehicles: How many there are.
        lowest_m: Altitude that none may be below.

    Raises:
        FieldError: If there is not room for all.
    """
    room_m = max(frame.alt_m - lowest_m, 0.0) / max(vehicles - 1, 1)
    step_m = settings.altitude_step
    if step_m < 0:
        step_m = min(ALTITUDE_STEP_M, room_m)
    elif step_m > room_m and vehicles > 1:
        raise FieldError(
            f"altitude_step must be at most {math.floor(100 * room_m) / 100:g} m for {vehicles} "
            f"vehicles from {frame.alt_m:g} m down to {lowest_m:g} m, got {step_m:g}"
        )
    return [replace(frame, alt_m=frame.alt_m - i * step_m) for i in range(vehicles)]


def write_missions(
    directory: Path, missions: Mapping[str, VehicleMission], autopilot: str
) -> list[Path]:
    """Write missions, by the names of their drones, as `.waypoints` and as `.plan` files.

    Args:
        directory: Folder; created if it does not exist.
        missions: The missions, by name.
        autopilot: One of `AUTOPILOTS`.

    Raises:
        OSError: If a file cannot be written.
    """
    chosen = AUTOPILOTS[autopilot]
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    for name, mission in missions.items():
        for suffix, text in (
            (".waypoints", qgc_wpl(mission.numbered(home_first=chosen.home_first))),
            (".plan", plan_text(mission, chosen.number, chosen.kinds[0])),
        ):
            path = directory / f"{name}{suffix}"
            write_whole(path, text.encode())
            written.append(path)
    return written
