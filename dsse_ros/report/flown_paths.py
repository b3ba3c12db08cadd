# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The paths of drones in metres from a record, flown again unless vehicles have flown them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.flights import wind_of
from dsse_ros.step.flight import path_of_action
from dsse_ros.step.flight_paths import FLIGHTS, flyers_of, pieces_of

if TYPE_CHECKING:
    from dsse_ros.report.record import RecordedMission

Floats = NDArray[np.float64]


def paths_in(record: RecordedMission) -> Floats:
    """Return the path of each drone in each step, (K, N, P + 1, 2) at equal times.

    Positions are as in `step.flight_paths`. Paths of drones are flown again; where that is not
    possible, as after a step that was not recorded, they are straight. Those of vehicles are
    recorded.
    """
    if record.flown is not None:
        return record.flown.paths
    scenario = record.scenario
    flyers, wind = flyers_of(scenario.kinds), wind_of(scenario)
    ends = (record.places + 0.5) * scenario.cell_size
    before = np.concatenate([ends[:1], ends[:-1]])
    shares = np.linspace(0.0, 1.0, pieces_of(flyers, wind.step_s) + 1)
    paths: Floats = before[:, :, None] + shares[:, None] * (ends - before)[:, :, None]
    if record.courses is None or record.turns is None:
        return paths
    flies = record.acted[1:] & (np.diff(record.steps) == 1)[:, None]
    state, side_m = np.zeros(1, FLIGHTS), scenario.grid_size * scenario.cell_size
    for k, n in np.argwhere(flies).tolist():
        state[0] = *ends[k, n], *record.courses[k, n]
        path, turn = paths[k + 1, n], record.turns[k + 1, n]
        path_of_action(flyers, scenario.kind_of[n], wind, state, turn, path)
        # A drone stops at the edge of the grid.
        np.clip(path, 0.0, side_m, out=path)
    # A log rounds positions and headings.
    paths[:, :, -1] = ends
    return paths


def tracks_in(record: RecordedMission, num_steps: int) -> NDArray[Any]:
    """Return the places of each drone in the first recorded steps, (N, M, 2) (col, row).

    In metres they are those on its paths, P for each step after the first.
    """
    if record.in_cells is None:
        return record.cells[:num_steps].swapaxes(0, 1)
    paths = record.paths[:num_steps].swapaxes(0, 1)
    later = paths[:, 1:, 1:].reshape(len(paths), -1, 2)
    tracks: Floats = np.concatenate([paths[:, 0, -1:], later], axis=1)
    return tracks / record.scenario.cell_size - 0.5


def looked_in(record: RecordedMission, num_steps: int) -> NDArray[np.bool_] | None:
    """Return whether each drone looked on each leg of `tracks_in`, (N, M - 1).

    None if all did, as they do without vehicles.
    """
    if record.flown is None:
        return None
    looked = record.flown.looked[1:num_steps, :, 1:].swapaxes(0, 1)
    return looked.reshape(len(looked), -1)
