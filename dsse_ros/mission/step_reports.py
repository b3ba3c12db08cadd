# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a mission's last step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.mission import Mission
from dsse_ros.scenario.frames import GridFrame
from msg_adapters.step_report import make_step_report


def step_report_of(mission: Mission, frame: GridFrame, run_id: int) -> NDArray[Any]:
    """Return the `step_report` of the last step, (N,) of a `step_report_dtype`.

    Args:
        mission: The mission.
        frame: Frame of its grid.
        run_id: Identity of the simulation.
    """
    result, faults = mission.result, mission.env.world.faults
    further: dict[str, Any] = {}
    if faults is not None and result.conditions is not None:
        further["status"], further["commands"] = result.conditions["status"], result.commands
        if faults.has_battery:
            further["battery"] = result.conditions["battery"]
    if mission.env.world.looks.several:
        further["finds"] = np.where(result.found, mission.env.world.finds[0], 0)
    return make_step_report(
        frame,
        run_id=run_id,
        mission=mission.number,
        step=result.step,
        cells=result.cells,
        actions=result.actions,
        rewards=result.rewards,
        terminated=result.terminated,
        truncated=result.truncated,
        found=result.found,
        held=result.held,
        action_mask=mission.env.action_masks(),
        all_found=bool(mission.env.world.worlds["num_missing"][0] == 0),
        coverage=mission.coverage or None,
        **further,
    )
