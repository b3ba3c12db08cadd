# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search on cells that follows the positions of one vehicle, which the test makes up."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import step_report_of
from dsse_ros.mission.run.step_scheduler import StepScheduler, Timing
from dsse_ros.mission.vehicles.vehicle_steps import VehicleSteps
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.fault_kernels import ACTING, DONE
from dsse_ros.vehicles.fleet.vehicle_time import VehicleTimeSettings
from dsse_ros.world.scenario.frames import cell_to_map
from dsse_ros.world.scenario.scenario import scenario_frame
from msg_adapters.poses import FramedPose
from msg_adapters.vehicles import Progress

RUN = 7
CELL_M = 130.0
START = (6, 6)


class At(NamedTuple):
    """Where a vehicle is, besides over its track: metres to the east, to the south and up."""

    east: float = 0.0
    south: float = 0.0
    up: float = 0.0
    tilt_deg: float = 0.0
    silent: bool = False


OnTrack = At()
Moved = Callable[[float], At]
"""Moved(share) returns where a vehicle is when a share of its step has passed."""


class CellSearch:
    """A search of one drone, whose vehicle flies from cell to cell in a step, and reports.

    Args:
        looks: Whether the vehicle's positions count; else the drone looks in its own cell.
        belief: Whether a belief follows.
        start: Where the vehicle is at first.
        fields: Of scenario and rules.
    """

    def __init__(
        self, *, looks: bool = True, belief: bool = True, start: At = OnTrack, **fields: Any
    ) -> None:
        scenario = {
            "rules": "sea", "grid_size": 12, "cell_size": CELL_M, "drones_positions": [START],
            "person_initial_position": (6, 6), "person_motion": "constant_drift",
            "vector": (0.0, 0.0), "timestep_limit": 60, "sigma_x": 1.5,
            "sigma_y": 1.5, "particles": 4000, "probability_of_detection": 0.1,
        }  # fmt: skip
        env = parallel_env(**{**scenario, "vehicle_timed_actions": True, **fields})
        self.mission, self.looks = Mission(env, 1, belief=belief), looks
        self.frame, self.step_s = scenario_frame(env.scenario), env.scenario.step_duration_s
        timing = Timing(step_duration_s=self.step_s, by_vehicles=True)
        self.scheduler = StepScheduler(timing, 0.0)
        self.steps = VehicleSteps(
            self.mission, self.frame, self.scheduler, VehicleTimeSettings(vehicle_time="followed")
        )
        self.steps.restart()
        self.scheduler.begin(0.0, done=False)
        self.stamp, self.time_s = 0, 50.0
        for _ in range(3):
            self.hear(self.mission.env.positions[0].tolist(), start, 0.5)

    def hear(
        self, place: tuple[float, float], at: At, passed_s: float, *, arrived: bool = True
    ) -> None:
        """Let time pass, and the vehicle report that it is beside (col, row)."""
        self.time_s += passed_s
        self.stamp += 1
        task = int(self.steps.tasks.numbers[0])
        done = task if arrived else -1
        self.steps.vehicles.set_progress(0, Progress(task, done, done, run_id=RUN), RUN)
        x, y = cell_to_map(self.frame, *place)
        half = math.radians(at.tilt_deg) / 2
        up_m = self.frame.alt_of(0) + at.up
        position = (x + at.east, y - at.south, up_m)
        turn = (math.sin(half), 0.0, 0.0, math.cos(half))
        if not at.silent:
            self.steps.set_pose(0, self.stamp, FramedPose("map", position, turn))
        self.steps.set_time(0, self.stamp, round(self.time_s * 1e3))

    def step(
        self,
        name: str,
        moved: Moved = lambda _: OnTrack,
        *,
        takes: int = 1,
        until: int | None = None,
    ) -> NDArray[Any]:
        """Do an action; return the report of its last step.

        Args:
            name: Name of the action.
            moved: Where the vehicle is meanwhile.
            takes: Steps that the vehicle needs for it.
            until: Steps of it that are done; all by default.
        """
        mission, actions = self.mission, self.mission.env.rules.action_set
        action = actions.names.index(name)
        before = mission.env.positions[0]
        way, pieces = np.array(actions.moves[action]), 2 * round(self.step_s)
        for part in range(takes if until is None else until):
            mission.command_all([action])
            self.steps.begin("hold")
            arrives = part == takes - 1
            for k in range(1, pieces + 1):
                share = (part + k / pieces) / takes
                col, row = (before + way * share).tolist()
                self.hear((col, row), moved(share), self.step_s / pieces, arrived=arrives)
            if self.looks:
                # Offsets from its track do not keep it from having done its task.
                self.steps.vehicles.set_place(0, cell_to_map(self.frame, *(before + way).tolist()))
                self.steps.end()
            else:
                mission.set_work(np.full(1, DONE if arrives else ACTING, np.int8))
            mission.advance("hold")
            self.scheduler.begin(0.0, done=mission.done)
        return step_report_of(mission, self.frame, RUN)

    def fly(self, names: Iterable[str], moved: Moved = lambda _: OnTrack) -> list[Any]:
        """Do steps; return the cells looked at in them, in order."""
        looked: list[Any] = []
        for name in names:
            self.step(name, moved)
            actions = self.mission.env.world.faults.applied[0]  # type: ignore[union-attr]
            looked += self.mission.env.world.looks_done(actions)[2].tolist()
        return looked
