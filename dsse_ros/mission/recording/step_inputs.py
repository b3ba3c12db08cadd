# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The inputs of a recorded step: with them a mission does the step again."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.step.viewpoints import viewpoints_at


class FlownPaths(NamedTuple):
    """The paths that vehicles have flown, see `dsse_ros.mission.vehicles.flown.Flown`.

    Attributes:
        paths: (..., N, P, 2) float64.
        looked: (..., N, P) bool.
    """

    paths: NDArray[np.float64]
    looked: NDArray[np.bool_]


class StepInputs(NamedTuple):
    """The inputs of a step: all else follows from the search and its seed.

    Attributes:
        commands: For `Mission.command_all`.
        work: (N,) int8 of `WORKS`, what the vehicles still had to do; None without vehicles whose
            actions last as long as they need.
        viewpoints: (N,) of `VIEWPOINTS`, those of the vehicles; None with `work`.
        flown: The paths of vehicles in metres; else None.
    """

    commands: list[Any]
    work: NDArray[np.int8] | None = None
    viewpoints: NDArray[np.void] | None = None
    flown: FlownPaths | None = None

    def repeat(self, mission: Mission) -> None:
        """Do the step again.

        Raises:
            ValueError: If a path has more or fewer points than those of the mission.
        """
        mission.command_all(self.commands)
        if self.work is not None:
            mission.set_work(self.work)
        if self.viewpoints is not None:
            mission.set_viewpoints(self.viewpoints)
        if self.flown is not None:
            for drone in mission.live:
                mission.set_flown(drone, self.flown.paths[drone], self.flown.looked[drone])
        mission.advance("hold")


def commands_in_metres(
    turns: NDArray[np.float64], held: NDArray[np.bool_]
) -> list[list[float] | None]:
    """Return turns and speeds (N, 2) as commands: None for drones that had none."""
    return [None if h else turn for turn, h in zip(turns.tolist(), held.tolist(), strict=True)]


def viewpoints_in_report(report: NDArray[Any]) -> NDArray[np.void]:
    """Return the viewpoints in a report of vehicles on cells, of `VIEWPOINTS`."""
    return viewpoints_at(*(report[name] for name in ("look_action", "look_col", "look_row")))
