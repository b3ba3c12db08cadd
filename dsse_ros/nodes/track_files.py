# SPDX-License-Identifier: Apache-2.0
"""Searches as missions of vehicles, and their files; without ROS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import cast

from numpy.typing import ArrayLike

from dsse_ros.nodes.flight_settings import FlightSettings
from msg_adapters.frames import GridFrame
from msg_adapters.mission_files import Firmware, Home, Mission, plan_text, qgc_wpl, track_mission


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
