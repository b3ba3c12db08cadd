# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros planner_node`: commands the drones, knowing nothing but the topics."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Int32MultiArray, String

from dsse_ros.nodes.parameters import declare, take_overrides
from dsse_ros.nodes.qos import COMPLETE, LATCHED, Endpoints
from dsse_ros.nodes.runtime import AlarmNode, run_node
from dsse_ros.nodes.settings import PlannerSettings
from dsse_ros.planners import PLANNERS, Planner, load_planner, make_planner, planner_for
from dsse_ros.search import HOLD, Observation
from dsse_ros.search.compiler import announced
from dsse_ros.search.fields import specs
from msg_adapters.agents import AgentsInfo, agents_from_message
from msg_adapters.commands import joint_action_message
from msg_adapters.images import image_to_probability
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message

Step = tuple[int, int, int]
"""run_id, mission and step of a report: no two steps have all alike."""

_RETRY_S = 1.0
"""Wall time after which a planner that failed is asked again, and what is waited for is logged."""
_SHARE = 0.8
"""Of the time that a step waits, a planner gets this: the rest is for the messages on their way."""
_PENDING_S = 10.0
"""Wall time after which a step that does not come is worth a line: vehicles take that long."""
_RUNS = 10
"""Runs whose `agents` are kept: more than there are simulations in a namespace by mistake."""


class PlannerNode(AlarmNode):
    """Answers every step with a joint action.

    A step is answered when its report, its map and the `agents` of its run are all here; report and
    map have the same stamp. Another mission gets a new planner.

    Raises:
        FieldError: If a parameter is not allowed, or the planner cannot be loaded.
    """

    def __init__(self) -> None:
        super().__init__("dsse_planner")
        known = specs(PlannerSettings)
        given, qos = take_overrides(self, known)
        self.settings = PlannerSettings(**given)
        # A planner that cannot be loaded is bad input, before any simulation is there.
        load_planner(self.settings.planner)
        declare(self, known, vars(self.settings))
        self._infos: dict[int, AgentsInfo] = {}  # by run_id, the latest last
        self._map: tuple[int, NDArray[np.float32]] | None = None
        self._report: tuple[int, NDArray[Any]] | None = None
        self._planner: Planner | None = None
        self._answered: Step | None = None
        self._map_used: object = None
        self._answer: Int32MultiArray | None = None
        self._answered_s = 0.0
        self._failed: Step | None = None
        self._late: tuple[NDArray[Any], list[int]] | None = None
        self._waits_for = ""
        endpoints = Endpoints(self, qos)
        # Latched, as a recorder may discover the planner later than the simulation does.
        self._publisher = endpoints.publisher(Int32MultiArray, "joint_action", COMPLETE)
        self._inputs = [
            endpoints.subscription(kind, topic, partial(self._on, topic, read), LATCHED)
            for kind, topic, read in (
                (String, "agents", self._on_agents),
                (Image, "probability", self._on_map),
                (PointCloud2, "step_report", self._on_report),
            )
        ]
        endpoints.check_all_used()
        # A command that was lost would stop a lockstep mission for good.
        self._resend_alarm = self.alarms.make(self._send)
        self._retry_alarm = self.alarms.make(self._plan)
        self.alarms.make(self._log_waiting).repeat(_RETRY_S)

    def _on(self, topic: str, read: Callable[[Any], None], message: Any) -> None:
        try:
            read(message)
        except ValueError as error:
            self.warn(topic, f"{topic}: {error}")
        else:
            self._plan()

    def _on_agents(self, message: String) -> None:
        info = agents_from_message(message)
        self._infos.pop(info.run_id, None)
        self._infos[info.run_id] = info
        if len(self._infos) > _RUNS:
            del self._infos[next(iter(self._infos))]
        self._leave_search(info.run_id, info.mission)

    def _leave_search(self, run_id: int, mission: int) -> None:
        """Stop sending an answer that was for another search than this one."""
        if self._answered is not None and self._answered[:2] != (run_id, mission):
            self._forget_answer()

    def _on_map(self, message: Image) -> None:
        self._map = (to_nanoseconds(message.header.stamp), image_to_probability(message))

    def _on_report(self, message: PointCloud2) -> None:
        report = step_report_from_message(message)
        if len(report):
            before = self._report and _step_of(self._report[1])
            self._report = (to_nanoseconds(message.header.stamp), report)
            step = _step_of(report)
            self._leave_search(*step[:2])
            if before and before[:2] == step[:2] and step[2] > before[2] + 1:
                self.get_logger().debug(f"steps {before[2] + 1} to {step[2] - 1} were not received")

    def _plan(self) -> None:
        """Answer the step if it is not answered yet and all about it is here."""
        if self._map is None or self._report is None:
            return
        (stamp, report), (map_stamp, probability) = self._report, self._map
        step, last = _step_of(report), self._answered
        info = self._infos.get(step[0])
        if info is None or stamp != map_stamp or not _fits(info, report, probability):
            return
        # A map names no search: one that was used for another may have this stamp too.
        if last is not None and last[:2] != step[:2] and self._map is self._map_used:
            return
        live = ~((report["terminated"] | report["truncated"]).astype(bool))
        if step == last:
            if not live.any():
                # The last drone was lost since: there is nobody to command any more.
                self._forget_answer()
            return
        self._forget_answer()
        answer = None
        if live.any():
            try:
                with announced(self.get_logger().info):
                    if last is None or step[:2] != last[:2] or step[2] < last[2]:
                        self._planner, self._late = self._make_planner(info), None
                    actions = self._decide(info, report, probability, live)
                answer = joint_action_message(step[2], actions, mission=step[1])
            except Exception as error:
                # Planners of others may raise anything.
                self._report_failure(step, error)
                self._retry_alarm.set(_RETRY_S)
                return
        self._answer = answer
        self._send()
        self._answered, self._map_used = step, self._map
        self._answered_s = time.monotonic()

    def _decide(
        self,
        info: AgentsInfo,
        report: NDArray[Any],
        probability: NDArray[np.float32],
        live: NDArray[np.bool_],
    ) -> list[int]:
        """Return the planner's actions for a step.

        A decision that took longer than its step has waited is for a later one, if the drones are
        still where they were.

        Raises:
            Exception: See `_ask`.
        """
        assert self._planner is not None
        places = np.stack([live, report["col"], report["row"]])
        late, self._late = self._late, None
        if late is not None and np.array_equal(late[0], places):
            return late[1]
        began_s, time_s = time.monotonic(), info.decision_time_s
        actions = _ask(self._planner, info, report, probability, live)
        took_s = time.monotonic() - began_s
        if time_s is not None and took_s > time_s:
            self._late = places, actions
            _, mission, step = _step_of(report)
            self.warn(
                "late",
                f"planner {self.settings.planner} is too slow: {took_s:.2f} s for step {step} of "
                f"mission {mission}, which waited {time_s:g} s",
            )
        return actions

    def _make_planner(self, info: AgentsInfo) -> Planner:
        """Return a planner for a mission.

        Raises:
            ValueError: If it needs to know more than `agents` contains.
        """
        name, seed = self.settings.planner, self.settings.seed
        if name in PLANNERS:
            return make_planner(name, info.actions, seed=seed, area=info.area_mask)
        if info.definition is None:
            raise ValueError("agents.definition: missing; this planner needs it")
        return planner_for(info.definition, name, seed=seed)

    def _report_failure(self, step: Step, error: Exception) -> None:
        """Log that the planner has failed, once for each step."""
        if step == self._failed:
            return
        self._failed = step
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        self.get_logger().error(
            f"planner {self.settings.planner} has failed in step {step[2]} of mission {step[1]}: "
            f"{reason}"
        )
        self.get_logger().debug("".join(traceback.format_exception(error)))

    def _log_waiting(self) -> None:
        """Log what is waited for, when that has changed."""
        before, self._waits_for = self._waits_for, self._missing()
        if self._waits_for and self._waits_for != before:
            self.get_logger().info(f"waiting for {self._waits_for}")

    def _missing(self) -> str:
        """Return what is waited for; "" for nothing worth a line."""
        received = (self._infos, self._map, self._report)
        silent = [
            subscription.topic_name
            for subscription, one in zip(self._inputs, received, strict=True)
            if not one
        ]
        if silent:
            return f"a simulation: nothing on {', '.join(silent)} yet"
        assert self._report is not None
        step = _step_of(self._report[1])
        if step == self._failed:
            return ""
        if step != self._answered:
            return "agents, probability and step_report of one and the same step"
        if self._answer is None:
            return f"a new mission: mission {step[1]} is over"
        if not self._publisher.get_subscription_count():
            return f"a simulation that listens to {self._publisher.topic_name}"
        if time.monotonic() - self._answered_s > _PENDING_S:
            return f"step {step[2] + 1} of mission {step[1]}: its joint_action is sent again"
        return ""

    def _forget_answer(self) -> None:
        self._answer = None
        self._resend_alarm.cancel()

    def _send(self) -> None:
        if self._answer is not None:
            self.get_logger().debug(f"joint_action {list(self._answer.data)}")
            self._publisher.publish(self._answer)
            self._resend_alarm.set(self.settings.resend_period)


def _ask(
    planner: Planner,
    info: AgentsInfo,
    report: NDArray[Any],
    probability: NDArray[np.float32],
    live: NDArray[np.bool_],
) -> list[int]:
    """Return a planner's actions in the order of the drones; `HOLD` for those out of the search.

    Raises:
        Exception: Whatever the planner raises, or its answer is not made of.
    """
    agents = {name: i for i, name in enumerate(info.agents) if live[i]}
    cells = np.stack([report["col"], report["row"]], axis=1).astype(np.int64)
    masks = report["action_mask"].astype(np.int8)
    time_s = info.decision_time_s
    limit = {} if time_s is None else {"decision_time_s": _SHARE * time_s}
    actions = planner(
        {name: Observation(cells[i], probability) for name, i in agents.items()},
        {
            name: {
                "Found": False,
                "found_person": bool(report["found"][i]),
                "action_mask": masks[i],
                "step": int(report["step"][i]),
                "action": int(report["action"][i]),
                **limit,
            }
            for name, i in agents.items()
        },
    )
    joint = [HOLD] * len(report)
    for name, action in actions.items():
        joint[agents[name]] = int(action)
    return joint


def _step_of(report: NDArray[Any]) -> Step:
    run_id, mission, step = (int(report[name][0]) for name in ("run_id", "mission", "step"))
    return run_id, mission, step


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
