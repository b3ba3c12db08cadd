# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Observations and infos of a step from its messages, equal to those of the environment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Float64MultiArray, Int32MultiArray

from dsse_ros.search.environments.agents import AgentObservation, Observation, agent_infos
from dsse_ros.search.environments.coverage_task import METRICS
from dsse_ros.search.environments.space import STRAIGHT_ON, number_of, states_from
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.fault_kernels import STATUSES
from dsse_ros.search.step.metres_paths import MOTION_STATES, airframes_of
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.agents_inbox import AgentsInbox
from msg_adapters.commands import joint_action_message, joint_command_message
from msg_adapters.images import image_to_probability
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import (
    finds_of,
    looked_of,
    path_of,
    step_report_from_message,
    wind_of,
)

StepId = tuple[int, int, int]
"""run_id, mission and step of a report: no two steps have all alike."""


def step_id_of(report: NDArray[Any]) -> StepId:
    """Return which step a report is of; it must have a drone."""
    run_id, mission, step = (int(report[name][0]) for name in ("run_id", "mission", "step"))
    return run_id, mission, step


@dataclass(frozen=True)
class ObservedStep:
    """All that is known of a step, on cells or in metres.

    Attributes:
        info: What is searched, and by whom.
        report: (N,) of a `step_report_dtype`.
        probability: (R, C) float32, read-only, row 0 north.
        stamp_ns: Stamp of its messages.
    """

    info: AgentsInfo
    report: NDArray[Any]
    probability: NDArray[np.float32]
    stamp_ns: int

    @property
    def step_id(self) -> StepId:
        """Which step it is."""
        return step_id_of(self.report)

    @property
    def live(self) -> NDArray[np.bool_]:
        """Which drones (N,) are still in the search."""
        live: NDArray[np.bool_] = (self.report["terminated"] | self.report["truncated"]) == 0
        return live

    @property
    def places(self) -> NDArray[np.float32]:
        """Where all drones are, (N, 2) as (x, y), m in the map frame."""
        return np.stack([self.report["x"], self.report["y"]], axis=1)

    @property
    def cells(self) -> NDArray[np.int64]:
        """Cells (N, 2) as (col, row) of all drones."""
        return np.stack([self.report["col"], self.report["row"]], axis=1).astype(np.int64)

    @property
    def in_metres(self) -> bool:
        """Whether actions are turns and speeds, not numbers."""
        return not self.info.actions

    def observations(self, drones: Sequence[int]) -> dict[str, AgentObservation]:
        """Return what these drones observe, by name."""
        places: NDArray[Any] = self._states() if self.in_metres else self.cells
        return {self.info.agents[i]: Observation(places[i], self.probability) for i in drones}

    def _states(self) -> NDArray[np.float32]:
        """Return the states (N, 5) of drones in metres, see `environments.space.STATE`."""
        assert self.info.definition is not None
        scenario = self.info.definition.scenario.resolve(self.info.definition.rules)
        flights = np.zeros(len(self.report), MOTION_STATES)
        flights["east"], flights["south"] = path_of(self.report)[:, -1].T
        flights["heading"], flights["speed"] = self.report["heading"], self.report["airspeed"]
        cruise = airframes_of(scenario.kinds)["cruise"][list(scenario.kind_of)]
        return states_from(flights, scenario.grid_size.extent(scenario.cell_size), cruise)

    def infos(self, drones: Sequence[int]) -> dict[str, dict[str, Any]]:
        """Return the infos of these drones, by name: those of `SearchEnv`."""
        report, definition = self.report[list(drones)], self.info.definition
        names = set(report.dtype.names or ())
        columns: dict[str, list[Any]] = {}
        if set(METRICS) <= names:
            columns |= {name: report[name].astype(float).tolist() for name in METRICS}
        # Where the number of persons is not known there may be several.
        elif definition is None or definition.scenario.person_amount > 1:
            columns["found_person"] = report["found"].astype(bool).tolist()
            if "finds" in names:
                columns["finds"] = finds_of(report).tolist()
        if "status" in names:
            columns["status"] = [STATUSES[number] for number in report["status"]]
            columns["action"] = report["action"].tolist()
            if not np.isnan(report["battery"]).all():
                columns["battery"] = report["battery"].astype(float).tolist()
        if "look_action" in names:
            looks = np.stack([report[f"look_{name}"] for name in ("action", "col", "row")], axis=1)
            columns["look"] = list(map(tuple, looks.tolist()))
        agents = [self.info.agents[i] for i in drones]
        found, masks = bool(self.report["all_found"].any()), None
        if "action_mask" in names:
            masks = report["action_mask"].astype(np.int8)
        else:
            columns["path"] = list(path_of(report))
            looked = looked_of(report)
            if looked is not None:
                columns["looked"] = list(looked)
                columns["wind"] = [wind_of(report)] * len(report)
        return agent_infos(agents, found, masks, columns)

    def answer(self, actions: Mapping[int, Any]) -> Int32MultiArray | Float64MultiArray:
        """Return the message that commands these actions, by number of the drone.

        Raises:
            TypeError, ValueError: If an action is none.
        """
        (_, mission, step), drones = self.step_id, range(len(self.report))
        if self.in_metres:
            # Two numbers each, or it raises.
            pairs = [(turn, speed) for turn, speed in (actions.get(i, STRAIGHT_ON) for i in drones)]
            return joint_command_message(mission, step, pairs)
        numbers = [number_of(actions.get(i, NO_ACTION)) for i in drones]
        return joint_action_message(mission, step, numbers)

    def applied(self, drone: int) -> Any:
        """Return the action that a drone has done in the step, a number or a turn and a speed."""
        entry = self.report[drone]
        if self.in_metres:
            return float(entry["turn_action"]), float(entry["speed_action"])
        return int(entry["action"])

    def deviates(self, drone: int, commanded: Any) -> bool:
        """Return whether a drone has obeyed another command than this action."""
        done = self.applied(drone)
        if self.in_metres:
            is_lost = self.report["terminated"][drone] and done == STRAIGHT_ON
            return bool(done != tuple(commanded) and not is_lost)
        # Drones with faults do what they can. One that was lost since does nothing.
        could = "status" not in (self.report.dtype.names or ()) and done != NO_ACTION
        return bool(done != commanded and (self.report["held"][drone] or could))


class StepInbox:
    """Puts together what the topics `agents`, `probability` and `step_report` have of a step.

    Attributes:
        infos: The last `agents` of each run.
        map: Stamp in nanoseconds and values (R, C) of the last map.
        report: Stamp in nanoseconds and entries (N,) of the last report.
    """

    def __init__(self) -> None:
        self.infos = AgentsInbox()
        self.map: tuple[int, NDArray[np.float32]] | None = None
        self.report: tuple[int, NDArray[Any]] | None = None

    def take_map(self, message: Image) -> None:
        """Take a `probability`.

        Raises:
            ValueError: If it is malformed; the last one stays.
        """
        self.map = (to_nanoseconds(message.header.stamp), image_to_probability(message))

    def take_report(self, message: PointCloud2) -> NDArray[Any]:
        """Take a `step_report`, unless it is empty, and return its entries.

        Raises:
            ValueError: If it is malformed; the last one stays.
        """
        report = step_report_from_message(message)
        if len(report):
            self.report = (to_nanoseconds(message.header.stamp), report)
        return report

    def forget_step(self) -> None:
        """Wait for another step than the last one."""
        self.map = self.report = None

    def step(self) -> ObservedStep | None:
        """Return the last step if all about it is here: report and map have the same stamp."""
        if self.map is None or self.report is None:
            return None
        (stamp, report), (map_stamp, probability) = self.report, self.map
        info = self.infos.info_of(report)
        if info is None or stamp != map_stamp:
            return None
        fits = (
            len(report) == len(info.agents)
            and _num_actions(report) == len(info.actions)
            and probability.shape == info.frame.grid_size.matrix
            and (info.actions or info.definition is not None)
        )
        return ObservedStep(info, report, probability, stamp) if fits else None


def _num_actions(report: NDArray[Any]) -> int:
    """Return the number of actions of a report; 0 in metres."""
    names = report.dtype.names or ()
    return report["action_mask"].shape[1] if "action_mask" in names else 0
