# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The reports of a mission's last step and of all its steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.mission import Mission
from dsse_ros.scenario.frames import GridFrame, cell_to_map
from msg_adapters.mission_report import MISSION_REPORT_DTYPE
from msg_adapters.step_report import make_step_report


def step_report_of(mission: Mission, frame: GridFrame, run_id: int) -> NDArray[Any]:
    """Return the `step_report` of the last step, (N,) of a `step_report_dtype`.

    Args:
        mission: The mission.
        frame: Frame of its grid.
        run_id: Identity of the simulation.
    """
    result, world = mission.result, mission.env.world
    columns: dict[str, Any] = {
        "run_id": run_id,
        "mission": mission.number,
        "step": result.step,
        **place_columns(frame, result.cells[:, 0], result.cells[:, 1]),
        "action": result.actions,
        "reward": result.rewards,
        "terminated": result.terminated,
        "truncated": result.truncated,
        "found": result.found,
        "held": result.held,
        "all_found": world.worlds["num_missing"][0] == 0,
        "action_mask": mission.env.action_masks(),
        **mission.coverage,
    }
    if world.faults is not None and result.conditions is not None:
        columns["status"], columns["command"] = result.conditions["status"], result.commands
        columns["battery"] = result.conditions["battery"] if world.faults.has_battery else np.nan
        if mission.env.rules.vehicle_timed_actions:
            columns["work"] = result.conditions["work"]
    if world.looks.several:
        columns["finds"] = np.where(result.found, world.finds[0], 0)
    return make_step_report(columns)


def mission_report_of(mission: Mission, frame: GridFrame, run_id: int) -> NDArray[Any]:
    """Return the `mission_report`, (K, N) of `MISSION_REPORT_DTYPE`; row 0 is the start.

    Args:
        mission: The mission.
        frame: Frame of its grid.
        run_id: Identity of the simulation.
    """
    history = mission.history
    report = np.zeros(history.shape, dtype=MISSION_REPORT_DTYPE)
    for name in history.dtype.names or ():
        report[name] = history[name]
    for name, values in place_columns(frame, history["col"], history["row"]).items():
        report[name] = values
    report["run_id"], report["mission"] = run_id, mission.number
    report["step"] = np.arange(len(history))[:, np.newaxis]
    return report


def place_columns(frame: GridFrame, col: NDArray[Any], row: NDArray[Any]) -> dict[str, Any]:
    """Return the fields of a report that state where N drones are.

    Args:
        frame: Frame of the grid.
        col: (..., N) columns of the cells.
        row: (..., N) rows of the cells.
    """
    x_m, y_m = cell_to_map(frame, col.astype(np.float64), row.astype(np.float64))
    altitudes_m = frame.altitudes_m(col.shape[-1])
    return {"col": col, "row": row, "x": x_m, "y": y_m, "z": altitudes_m}
