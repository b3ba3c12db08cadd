# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros planner_node`: commands the drones, knowing nothing but the topics."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Int32MultiArray, String

from dsse_ros.nodes.parameters import declare, take_overrides
from dsse_ros.nodes.qos import LATCHED, RELIABLE, Endpoints
from dsse_ros.nodes.restarts import may_be_restarted, same_cells
from dsse_ros.nodes.runtime import AlarmNode, run_node
from dsse_ros.nodes.settings import PlannerSettings
from dsse_ros.planners import Planner, make_planner
from dsse_ros.search import HOLD, Observation
from dsse_ros.search.fields import specs
from msg_adapters.agents import AgentsInfo, agents_from_message
from msg_adapters.commands import joint_action_message
from msg_adapters.images import image_to_probability
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message


class PlannerNode(AlarmNode):
    """Answers every step with a joint action.

    A step is answered when its report and its map are both here, which their common stamp tells.
    A report of an earlier step than the last one opens a new mission and gets a new planner.

    Raises:
        FieldError: If a parameter is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("dsse_planner")
        known = specs(PlannerSettings)
        given, qos = take_overrides(self, known)
        self.settings = PlannerSettings(**given)
        declare(self, known, vars(self.settings))
        self._info: AgentsInfo | None = None
        self._map: tuple[int, NDArray[np.float32]] | None = None
        self._report: tuple[int, NDArray[Any]] | None = None
        self._planner: Planner | None = None
        self._answered: tuple[int, int] | None = None  # (stamp, step)
        self._used: tuple[object, object] = (None, None)  # the map and the report answered
        self._ahead: object = None  # a report of a simulation whose agents are still to come
        self._answer: Int32MultiArray | None = None
        endpoints = Endpoints(self, qos)
        self._publisher = endpoints.publisher(Int32MultiArray, "joint_action", RELIABLE)
        for kind, topic, read in (
            (String, "agents", self._on_agents),
            (Image, "probability", self._on_map),
            (PointCloud2, "step_report", self._on_report),
        ):
            endpoints.subscription(kind, topic, partial(self._on, topic, read), LATCHED)
        endpoints.check_all_used()
        # A command that was lost would stop a lockstep mission for good.
        self._resend_alarm = self.alarms.make(self._send)

    def _on(self, topic: str, read: Callable[[Any], None], message: Any) -> None:
        try:
            read(message)
            self._plan()
        except ValueError as error:
            self.warn(topic, f"{topic}: {error}")

    def _on_agents(self, message: String) -> None:
        before, self._info = self._info, agents_from_message(message)
        if before is not None and _search_of(before) != _search_of(self._info):
            # Another simulation has taken over; its first step may have come before this.
            self._answered = None
        elif before is not None and self._answered is not None:
            restarted = may_be_restarted(before, self._info, self._answered[0])
            if restarted and self._report is not self._ahead:
                self._forget()

    def _forget(self) -> None:
        """Take back the answer, and leave what it was about; what has come since is news."""
        self._answered = self._answer = None
        self._resend_alarm.cancel()
        if self._map is self._used[0]:
            self._map = None
        if self._report is self._used[1]:
            self._report = None

    def _on_map(self, message: Image) -> None:
        self._map = (to_nanoseconds(message.header.stamp), image_to_probability(message))

    def _on_report(self, message: PointCloud2) -> None:
        report = step_report_from_message(message)
        if len(report):
            before, self._report = self._report, (to_nanoseconds(message.header.stamp), report)
            if before and _key(before) == _key(self._report) and not same_cells(before[1], report):
                # The same step, and elsewhere: it is of another simulation.
                self._forget()
                self._ahead = self._report

    def _plan(self) -> None:
        """Answer the step if it is not answered yet and all about it is here.

        Raises:
            ValueError: If no planner can be made for these actions.
        """
        if self._info is None or self._map is None or self._report is None:
            return
        (stamp, report), (map_stamp, probability) = self._report, self._map
        key = _key(self._report)
        step = key[1]
        if stamp != map_stamp or key == self._answered:
            return
        if not _fits(self._info, report, probability):
            return
        live = ~((report["terminated"] | report["truncated"]).astype(bool))
        if self._planner is None or self._answered is None or step <= self._answered[1]:
            settings = self.settings
            self._planner = make_planner(settings.planner, self._info.actions, seed=settings.seed)
        self._answered, self._used = key, (self._map, self._report)
        self._answer = None
        self._resend_alarm.cancel()
        if not live.any():
            return
        agents = {name: i for i, name in enumerate(self._info.agents) if live[i]}
        cells = np.stack([report["col"], report["row"]], axis=1).astype(np.int64)
        masks = report["action_mask"].astype(np.int8)
        actions = self._planner(
            {name: Observation(cells[i], probability) for name, i in agents.items()},
            {name: {"Found": False, "action_mask": masks[i]} for name, i in agents.items()},
        )
        joint = [HOLD] * len(report)
        for name, action in actions.items():
            joint[agents[name]] = int(action)
        self._answer = joint_action_message(step, joint)
        self._send()

    def _send(self) -> None:
        if self._answer is not None:
            self._publisher.publish(self._answer)
            self._resend_alarm.set(self.settings.resend_period)


def _key(report: tuple[int, NDArray[Any]]) -> tuple[int, int]:
    """Return stamp and step of a report."""
    return report[0], int(report[1]["step"][0])


def _search_of(info: AgentsInfo) -> AgentsInfo:
    """Return what stays the same from mission to mission."""
    return dataclasses.replace(info, mission=0, seed=None)


def _fits(info: AgentsInfo, report: NDArray[Any], probability: NDArray[np.float32]) -> bool:
    """Return whether all three can be of the same search."""
    return (
        len(report) == len(info.agents)
        and report["action_mask"].shape[1] == len(info.actions)
        and probability.shape == (info.grid_size, info.grid_size)
    )


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""
    return run_node("planner_node", PlannerNode, argv)


if __name__ == "__main__":
    sys.exit(main())
