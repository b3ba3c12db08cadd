# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The reports of a mission's last step and of all its steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.run.mission import HISTORY_DTYPE, Mission
from dsse_ros.mission.vehicles.flown import Flown
from dsse_ros.search.step.viewpoints import NO_LOOK
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from msg_adapters.mission_report import MISSION_REPORT_DTYPE
from msg_adapters.step_report import make_step_report


def step_report_of(mission: Mission, frame: GridFrame, run_id: int) -> NDArray[Any]:
    """Return the `step_report` of the last step, (N,) of a `step_report_dtype`."""
    result, world = mission.result, mission.env.world
    columns: dict[str, Any] = {
        "run_id": run_id,
        "mission": mission.number,
        "step": result.step,
        **place_columns(frame, result.cells, result.places),
        "action": result.actions,
        "reward": result.rewards,
        "terminated": result.terminated,
        "truncated": result.truncated,
        "found": result.found,
        "held": result.held,
        "all_found": world.worlds["num_missing"][0] == 0,
        **(
            {"action_mask": mission.env.action_masks()}
            if result.flown is None
            else _of_flown(result.flown)
        ),
        **mission.coverage,
    }
    if world.faults is not None and result.conditions is not None:
        columns["status"], columns["command"] = result.conditions["status"], result.commands
        columns["battery"] = result.conditions["battery"] if world.faults.has_battery else np.nan
        if mission.env.rules.vehicle_timed_actions:
            columns["work"] = result.conditions["work"]
    if mission.env.rules.vehicle_timed_actions:
        flown = result.flown
        metres = world.metres
        columns |= (
            _looks_of(mission)
            if flown is None or metres is None
            else {"looked": flown.looked, "wind": metres.wind_mps}
        )
    if world.looks.several:
        columns["finds"] = np.where(result.found, world.finds[0], 0)
    return make_step_report(columns)


def _looks_of(mission: Mission) -> dict[str, Any]:
    """Return the fields that state the viewpoints of vehicles; in coverage they have none."""
    viewpoints = mission.env.world.viewpoints
    if viewpoints is None:
        return {"look_action": NO_LOOK, "look_col": 0, "look_row": 0}
    looks = viewpoints.array[0]
    return {"look_action": looks["action"], "look_col": looks["x"], "look_row": looks["y"]}


def _of_flown(flown: Flown) -> dict[str, Any]:
    turns, speeds = flown.actions.T
    return {
        "heading": flown.flights["heading"],
        "airspeed": flown.flights["speed"],
        "turn_action": turns,
        "speed_action": speeds,
        "path": flown.paths,
    }


def mission_report_of(mission: Mission, frame: GridFrame, run_id: int) -> NDArray[Any]:
    """Return the `mission_report`, (K, N) of `MISSION_REPORT_DTYPE`; row 0 is the start."""
    history = mission.history
    report = np.zeros(history.shape, dtype=MISSION_REPORT_DTYPE)
    for name in HISTORY_DTYPE.names or ():
        report[name] = history[name]
    cells = np.stack([history["col"], history["row"]], axis=-1)
    places = history["place"] if "place" in (history.dtype.names or ()) else cells
    for name, values in place_columns(frame, cells, places).items():
        report[name] = values
    report["run_id"], report["mission"] = run_id, mission.number
    report["step"] = np.arange(len(history))[:, np.newaxis]
    return report


def place_columns(frame: GridFrame, cells: NDArray[Any], places: NDArray[Any]) -> dict[str, Any]:
    """Return the fields of a report that state where N drones are.

    Args:
        frame: The map frame, in which x, y and z are.
        cells: (..., N, 2) their cells (col, row).
        places: (..., N, 2) where they are; fractions lie between cells.
    """
    x_m, y_m = cell_to_map(frame, *np.moveaxis(places.astype(np.float64), -1, 0))
    altitudes_m = frame.altitudes_m(cells.shape[-2])
    return {"col": cells[..., 0], "row": cells[..., 1], "x": x_m, "y": y_m, "z": altitudes_m}
