# SPDX-License-Identifier: Apache-2.0
"""Searches as missions of vehicles, and their files; without ROS."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import cast

from numpy.typing import ArrayLike

from dsse_ros.flight.flight_settings import FlightSettings
from dsse_ros.search.fields import FieldError
from msg_adapters.frames import GridFrame
from msg_adapters.mission_files import Firmware, Home, Mission, plan_text, qgc_wpl, track_mission

ALTITUDE_STEP_M = 5.0
"""Between the altitudes of two vehicles, where there is room for it."""
LOWEST_LAYER_M = 10.0


def search_mission(
    frame: GridFrame,
    cells: ArrayLike,
    searched: ArrayLike,
    settings: FlightSettings,
    home: Home | None = None,
) -> Mission:
    """Return what one vehicle has to fly: see `track_mission`.

    Args:
        frame: The grid; vehicles fly at its altitude.
        cells: (K, 2) of (col, row).
        searched: (K,) flags of the cells that were searched rather than moved to.
        settings: How it is flown.
        home: Where it takes off; if not given, below the first cell.
    """
    return track_mission(
        frame,
        cells,
        searched,
        home=home,
        merge_legs=settings.merge_legs,
        acceptance_radius_m=acceptance_radius_m(frame, settings),
        search_alt_m=min(settings.search_altitude, frame.alt_m),
        search_hold_s=settings.search_hold,
    )


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
            f"altitude_step: {step_m:g} is not allowed; {vehicles} vehicles from {frame.alt_m:g} m "
            f"down to {lowest_m:g} m have room for {math.floor(100 * room_m) / 100:g} m"
        )
    return [replace(frame, alt_m=frame.alt_m - i * step_m) for i in range(vehicles)]


def acceptance_radius_m(frame: GridFrame, settings: FlightSettings) -> float:
    """Return the distance from a cell's centre at which a vehicle is there."""
    return min(settings.acceptance_radius, frame.cell_size_m / 2)


def write_missions(directory: Path, missions: Mapping[str, Mission], dialect: str) -> list[Path]:
    """Write missions, by the names of their drones, as `.waypoints` and as `.plan` files.

    Raises:
        OSError: If that is not possible.
    """
    firmware = cast(Firmware, dialect)
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    for name, mission in missions.items():
        for suffix, text in (
            (".waypoints", qgc_wpl(mission.numbered(firmware))),
            (".plan", plan_text(mission, firmware=firmware)),
        ):
            path = directory / f"{name}{suffix}"
            path.write_text(text, encoding="utf-8")
            written.append(path)
    return written
