# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""From where drones on cells looked, as a report of their vehicles has it, to be repeated."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.mission import Mission
from dsse_ros.step.viewpoints import viewpoints_at


def looks_of(report: NDArray[Any]) -> NDArray[np.void]:
    """Return from where drones looked by a step report of vehicles on cells; see `give_looks`."""
    return viewpoints_at(*(report[name] for name in ("look_action", "look_col", "look_row")))


def give_looks(mission: Mission, looks: NDArray[np.void]) -> None:
    """Set from where the drones look in the next step, (N,) of `VIEWPOINTS`; see `Viewpoints`."""
    if mission.env.world.viewpoints is not None:
        mission.env.world.viewpoints.give(looks)
