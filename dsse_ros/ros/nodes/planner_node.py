# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros planner_node`: commands the drones, from the topics alone."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64MultiArray, Int32MultiArray, String

from dsse_ros.base.defects import describe
from dsse_ros.base.fields import FieldError
from dsse_ros.base.work import work_told_to
from dsse_ros.mission.live.history import FollowedHistory
from dsse_ros.planners.planner import OnBelief, Planner, Planning
from dsse_ros.planners.registry import (
    PLANNERS,
    check_options,
    make_planner,
    planner_with,
    read_options,
)
from dsse_ros.ros.nodes.node_diagnostics import PERIOD_S, NodeDiagnostics
from dsse_ros.ros.nodes.plan_publishers import PLAN, PLAN_PERIOD_S, PlanPublishers
from dsse_ros.ros.nodes.settings import PlannerSettings
from dsse_ros.ros.runtime.observed_step import ObservedStep, StepId, StepInbox, step_id_of
from dsse_ros.ros.runtime.qos import read_settings
from dsse_ros.ros.runtime.run_node import AlarmNode, run_node
from dsse_ros.search.belief.protocol import TargetBelief
from dsse_ros.search.environments.compiler import announced
from dsse_ros.world.scenario.agents import AgentsInfo
from msg_adapters.diagnostics import Level

_RETRY_S = 1.0
"""Wall time after which the node retries a failed planner, and logs what it is waiting for."""
_SHARE = 0.8
"""Share of a step's waiting time for the planner; the rest is for the transport of messages."""
_PENDING_S = 10.0
"""Wall time after which the node logs that a step has not come: vehicles take that long."""


class PlannerNode(AlarmNode):
    """Answers every step with a joint action.

    The node answers a step once it has the step's report, its map and the `agents` of its run;
    report and map have the same stamp. Each mission gets a new planner.

    Raises:
        FieldError: If a parameter is not allowed, or the planner cannot be loaded.
    """

    def __init__(self) -> None:
        super().__init__("planner_node")
        self.settings, endpoints = read_settings(self, PlannerSettings)
        # Fail at once, without a simulation, if the planner cannot be loaded.
        check_options(self.settings.planner, read_options(self.settings.planner_options))
        if self.settings.planner == "onnx":
            from dsse_ros.planners.onnx import read_model

            read_model(self.settings.model)
        elif self.settings.model:
            raise FieldError(
                f"model must be empty with planner {self.settings.planner}, "
                f"got {self.settings.model!r}; only onnx has one"
            )
        self._inbox = StepInbox()
        # In a live search, its looks and inputs.
        self._history = FollowedHistory()
        self._planner: Planner | None = None
        self._answered: StepId | None = None
        self._map_used: object = None
        self._answer: Int32MultiArray | Float64MultiArray | None = None
        self._answered_s = 0.0
        self._failed: StepId | None = None
        self._late: tuple[NDArray[Any], dict[int, Any]] | None = None
        self._waits_for = ""
        # Whether it has decided without the compiler, which the second step may need again.
        self._ready = self._says_compiling = self._compiled = False
        # For drones that move from cell to cell, and in metres.
        self._publishers_of = {
            Int32MultiArray: endpoints.publisher("joint_action"),
            Float64MultiArray: endpoints.publisher("joint_command"),
        }
        self._inputs = [
            endpoints.subscription(topic, partial(self._on, read))
            for topic, read in (
                ("agents", self._on_agents),
                ("probability", self._inbox.take_map),
                ("step_report", self._on_report),
            )
        ]
        endpoints.subscription("live/history", partial(self._on, self._on_history))
        self._diagnostics = NodeDiagnostics(self, endpoints)
        self._plans = PlanPublishers(endpoints)
        self._planned: ObservedStep | None = None
        endpoints.check_all_used(later=PLAN)
        # A lost command would stop a lockstep mission forever.
        self._resend_alarm = self.alarms.make(self._send)
        self._retry_alarm = self.alarms.make(self._plan)
        self.alarms.make(self._log_waiting).repeat(_RETRY_S)
        self.alarms.make(self._publish_diagnostics).repeat(PERIOD_S)
        publish_plans = self.isolated("plans", self._publish_plans)
        self.alarms.make(publish_plans).repeat(PLAN_PERIOD_S)

    def _on(self, read: Callable[[Any], None], message: Any) -> None:
        read(message)
        self._plan()

    def _on_agents(self, message: String) -> None:
        info = self._inbox.infos.take(message.data)
        self._leave_search(info.run_id, info.mission)

    def _on_history(self, message: String) -> None:
        self._history.take(message.data)

    def _leave_search(self, run_id: int, mission: int) -> None:
        """Stop sending an answer that was for a different search."""
        if self._answered is not None and self._answered[:2] != (run_id, mission):
            self._forget_answer()

    def _on_report(self, message: PointCloud2) -> None:
        last = self._inbox.report
        report = self._inbox.take_report(message)
        if len(report):
            before, step = last and step_id_of(last[1]), step_id_of(report)
            self._leave_search(*step[:2])
            if before and before[:2] == step[:2] and step[2] > before[2] + 1:
                self.get_logger().debug(f"steps {before[2] + 1} to {step[2] - 1} were not received")

    def _plan(self) -> None:
        """Answer the step if all its messages are here and it is not answered yet."""
        observed = self._inbox.step()
        if observed is None:
            return
        step, last = observed.step_id, self._answered
        # A map names no search: a map of another search may have the same stamp.
        if last is not None and last[:2] != step[:2] and self._inbox.map is self._map_used:
            return
        if is_live(observed.info) and (self._history.search, self._history.steps) != (
            step[:2], step[2],
        ):  # fmt: skip
            return
        live = observed.live
        if step == last:
            if not live.any():
                # The last drone was lost since the answer: no drone is left to command.
                self._forget_answer()
            return
        self._forget_answer()
        answer, self._compiled = None, False
        if live.any():
            try:
                with (
                    announced(self._on_compiler, f"planner {self.settings.planner}"),
                    work_told_to(self.get_logger().info),
                ):
                    if last is None or step[:2] != last[:2] or step[2] < last[2]:
                        self._planner, self._late = self._make_planner(observed.info), None
                    answer = observed.answer(self._decide(observed))
            except Exception as error:
                # Third-party planners may raise anything.
                self._report_failure(step, error)
                self._retry_alarm.set(_RETRY_S)
                return
        self._answer, self._planned = answer, observed
        self._send()
        if answer is not None and not self._ready and not self._compiled:
            self._ready = True
            self.get_logger().info(f"planner {self.settings.planner} is ready")
        self._answered, self._map_used = step, self._inbox.map
        self._answered_s = time.monotonic()

    def _on_compiler(self, line: str) -> None:
        """Log the compiler's line once; a separate line later logs that the planner is ready."""
        self._compiled = True
        if not self._says_compiling:
            self.get_logger().info(line)
        self._says_compiling = True

    def _decide(self, observed: ObservedStep) -> dict[int, Any]:
        """Return the planner's actions for a step, by number of the drone.

        A decision that took longer than its step waited counts for a later step, if the drones have
        not moved.
        """
        assert self._planner is not None
        places = np.column_stack([observed.live, observed.places])
        late, self._late = self._late, None
        if late is not None and np.array_equal(late[0], places):
            return late[1]
        began_s, time_s = time.monotonic(), observed.info.decision_time_s
        actions = _ask(self._planner, observed, self._belief(observed.info))
        took_s = time.monotonic() - began_s
        if time_s is not None and took_s > time_s:
            self._late = places, actions
            _, mission, step = observed.step_id
            self.warn(
                "late",
                f"planner {self.settings.planner} is too slow: {took_s:.2f} s for step {step} of "
                f"mission {mission}, which waited {time_s:g} s",
            )
        return actions

    def _belief(self, info: AgentsInfo) -> TargetBelief | None:
        """Return the belief of a live search for a planner on a belief, else None.

        Raises:
            ValueError: If a record of the search is damaged.
        """
        if not is_live(info) or not isinstance(self._planner, OnBelief):
            return None
        assert info.definition is not None
        rules = info.definition.rules
        scenario = info.definition.scenario.resolve(rules)
        return self._history.live_search(scenario, rules, self._planner.forecasts).belief

    def _publish_plans(self) -> None:
        """Publish the plans of the last decision; none once its mission is over or replaced."""
        if isinstance(self._planner, Planning) and self._planned is not None:
            plans = {} if self._answer is None else self._planner.plans()
            self._plans.publish(self._planned, plans)

    def _make_planner(self, info: AgentsInfo) -> Planner:
        """Return a planner for a mission.

        Raises:
            ValueError: If the planner needs more than `agents` contains.
        """
        name, seed = self.settings.planner, self.settings.seed
        texts = self.settings.planner_options
        if info.definition is not None:
            options = {"model": self.settings.model} if self.settings.model else {}
            return planner_with(info.definition, name, texts, seed=seed, **options)
        if name in PLANNERS and not texts:
            return make_planner(name, info.actions, seed=seed, area=info.area_mask)
        raise ValueError("agents.definition: missing; this planner needs it")

    def _report_failure(self, step: StepId, error: Exception) -> None:
        """Log that the planner has failed, once for each step."""
        if step == self._failed:
            return
        self._failed = step
        reason = describe(error)
        self.get_logger().error(
            f"planner {self.settings.planner} failed in step {step[2]} of mission {step[1]}: "
            f"{reason}"
        )
        self.get_logger().debug("".join(traceback.format_exception(error)))

    def _log_waiting(self) -> None:
        """Log what the node is waiting for, if that has changed."""
        before, self._waits_for = self._waits_for, self._missing()
        if self._waits_for and self._waits_for != before:
            self.get_logger().info(f"waiting for {self._waits_for}")

    def _publish_diagnostics(self) -> None:
        level: Level = "ok"
        message = f"waiting for {missing}" if (missing := self._missing()) else "running"
        report = self._inbox.report
        if report is not None and step_id_of(report[1]) == self._failed:
            level, message = "error", f"the planner failed in step {self._failed[2]}"
        self._diagnostics.publish((level, message), {"planner": self.settings.planner})

    def _missing(self) -> str:
        """Return what the node is waiting for; "" for nothing worth logging."""
        received = (self._inbox.infos, self._inbox.map, self._inbox.report)
        silent = [
            subscription.topic_name
            for subscription, content in zip(self._inputs, received, strict=True)
            if not content
        ]
        if silent:
            return f"a simulation: nothing on {', '.join(silent)} yet"
        assert self._inbox.report is not None
        step = step_id_of(self._inbox.report[1])
        if step == self._failed:
            return ""
        if step != self._answered:
            of_live = " and live/history" if self._history else ""
            return f"agents, probability, step_report{of_live} of one and the same step"
        if self._answer is None:
            return f"a new mission: mission {step[1]} is over"
        publisher = self._publishers_of[type(self._answer)]
        if not publisher.get_subscription_count():
            return f"a simulation that listens to {publisher.topic_name}"
        if time.monotonic() - self._answered_s > _PENDING_S:
            name = publisher.topic_name.rpartition("/")[2]
            return f"step {step[2] + 1} of mission {step[1]}: its {name} is sent again"
        return ""

    def _forget_answer(self) -> None:
        self._answer = None
        self._resend_alarm.cancel()

    def _send(self) -> None:
        if self._answer is not None:
            publisher = self._publishers_of[type(self._answer)]
            self.get_logger().debug(f"{publisher.topic_name} {list(self._answer.data)}")
            publisher.publish(self._answer)
            self._resend_alarm.set(self.settings.resend_period)


def is_live(info: AgentsInfo) -> bool:
    """Return whether nobody simulates the truth of a search."""
    return info.definition is not None and not info.definition.scenario.has_persons


def _ask(planner: Planner, observed: ObservedStep, belief: TargetBelief | None) -> dict[int, Any]:
    """Return a planner's actions by number of the drone.

    Args:
        planner: The planner.
        observed: The step.
        belief: For the planner; None if it keeps its own.

    Raises:
        Exception: Whatever the planner raises, or an error for an invalid answer.
    """
    drones = np.flatnonzero(observed.live).tolist()
    infos, report, time_s = observed.infos(drones), observed.report, observed.info.decision_time_s
    for i, info in zip(drones, infos.values(), strict=True):
        info |= {"step": int(report["step"][i]), "action": int(report["action"][i])}
        if time_s is not None:
            info["decision_time_s"] = _SHARE * time_s
        if belief is not None:
            info["belief"] = belief
    numbers = dict(zip(infos, drones, strict=True))
    actions = planner(observed.observations(drones), infos)
    return {numbers[name]: action for name, action in actions.items()}


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""
    return run_node("planner_node", PlannerNode, argv)


if __name__ == "__main__":
    sys.exit(main())
