# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The mission files that `~/export_mission` of `sim_node` writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.mission import Mission
from dsse_ros.mission.vehicle_missions import layers, search_missions, write_missions
from dsse_ros.nodes.settings import SimSettings
from dsse_ros.search import FieldError
from msg_adapters.frames import GridFrame
from msg_adapters.tracks import steps


def export_tracks(mission: Mission, frame: GridFrame, settings: SimSettings) -> tuple[bool, str]:
    """Write the drones' tracks as vehicle missions; returns success and a line on what was done."""
    directory = Path(settings.export_directory)
    names = mission.env.possible_agents
    tracks = [_track(mission, i, settings.export_tracks) for i in range(len(names))]
    try:
        frames = layers(frame, settings, len(tracks))
    except FieldError as error:
        return False, str(error)
    flown = search_missions(frames, tracks, settings, [None] * len(tracks))
    missions = dict(zip(names, flown, strict=True))
    try:
        write_missions(directory, missions, settings.autopilot)
    except OSError as error:
        return False, f"export_directory: {str(directory)!r}: {error.strerror}"
    return True, f"{len(missions)} tracks in {directory.resolve()}"


def _track(mission: Mission, drone: int, which: str) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the flown or planned cells (K, 2), and flags of those searched."""
    if which == "flown":
        return steps(mission.tracks[drone], mission.searches[drone])
    col, row = mission.result.cells[drone].tolist()
    cells = np.array(mission.commands.route(drone, (col, row)))
    return cells, np.zeros(len(cells), bool)
