# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search that runs in a `sim_node`, as a PettingZoo parallel environment."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeVar

import numpy as np
import rclpy
from numpy.typing import NDArray
from pettingzoo import ParallelEnv
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier
from std_srvs.srv import Trigger

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.ros.runtime import security
from dsse_ros.ros.runtime.observed_step import ObservedStep, StepInbox, step_id_of
from dsse_ros.ros.runtime.qos import offered, requested
from dsse_ros.search.environments.agents import (
    AgentObservation,
    AgentSpaces,
    Started,
    Stepped,
)
from dsse_ros.search.environments.space import (
    action_space,
    number_of,
    observation_space,
    turn_and_speed_of,
)
from dsse_ros.world.scenario.env_options import IGNORED_OPTION, check_seed
from dsse_ros.world.scenario.limits import MAX_SEED

T = TypeVar("T")

TIMEOUT_S = 9.0
"""Wall time that a node has for an answer, by default."""

_RESEND_S = 0.5
"""Wall time after which an action that nothing has answered is sent again."""
_NEEDED = {"step_mode": "lockstep", "auto_reset": False}
"""Parameters of the node with which it waits for each action, and for a reset."""


class SearchLostError(RuntimeError):
    """The mission is no longer the one that was reset; another reset starts a new one."""


class DsseRosEnv(AgentSpaces, ParallelEnv[str, AgentObservation, Any]):
    """The search of a running `sim_node`, commanded over its topics.

    Spaces, observations, rewards, flags and infos are those of `parallel_env`, bit for bit. It has
    a ROS context of its own, so that it works beside other nodes of the process and without any;
    what it waits for it receives in the calling thread.

    Args:
        namespace: Of the simulation's topics.
        node_name: Name of the simulation's node.
        timeout_s: Wall time that the node has to appear, to reset and for each step. Where steps
            wait for vehicles, they take as long as those fly.
        domain_id: ROS domain, by default that of ROS_DOMAIN_ID.

    Attributes:
        info: What the node says of the search: rules, scenario, seed, place.

    Raises:
        TimeoutError: If there is no such node in time.
        FieldError: If the node does not wait for each action, or does not state its search, or if
            security is asked for in a way that would start unprotected.
    """

    metadata = {"name": "dsse_ros_v1", "render_modes": [], "is_parallelizable": True}
    render_mode = None

    def __init__(
        self,
        namespace: str = "",
        *,
        node_name: str = "sim_node",
        timeout_s: float = TIMEOUT_S,
        domain_id: int | None = None,
    ) -> None:
        if not timeout_s > 0:
            raise FieldError(f"timeout_s must be above 0, got {shown(timeout_s)}")
        self.timeout_s = timeout_s
        self.agents: list[str] = []
        self._live: list[int] = []
        self._last: ObservedStep | None = None
        self._inbox = StepInbox()
        self._refused = ""
        self._draws = np.random.default_rng()
        self._context = Context()
        security.enforce(os.environ)
        security.check_middleware(os.environ, get_rmw_implementation_identifier())
        rclpy.init(
            args=[],
            context=self._context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        try:
            self._connect(namespace, node_name)
        except BaseException:
            self.close()
            raise

    def _connect(self, namespace: str, node_name: str) -> None:
        """Find the node, and read its search and its drones.

        Raises:
            TimeoutError: If there is none.
            FieldError: If it cannot be used.
        """
        node = rclpy.create_node(
            "ros_env", namespace=namespace, context=self._context, enable_rosout=False,
            start_parameter_services=False,
        )  # fmt: skip
        self._node = node
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        inbox = self._inbox
        topics: dict[str, Callable[[Any], Any]] = {
            "agents": lambda message: inbox.infos.take(message.data),
            "probability": inbox.take_map,
            "step_report": inbox.take_report,
        }
        for topic, take in topics.items():
            kind, qos = requested(topic, "ros_env")
            node.create_subscription(kind, topic, partial(self._on, topic, take), qos)
        self._reset: Client = node.create_client(Trigger, f"{node_name}/reset")
        self._set: Client = node.create_client(SetParameters, f"{node_name}/set_parameters")
        get: Client = node.create_client(GetParameters, f"{node_name}/get_parameters")
        deadline_s = time.monotonic() + self.timeout_s
        answer = self._call(get, GetParameters.Request(names=list(_NEEDED)), deadline_s, again=True)
        for (name, needed), value in zip(_NEEDED.items(), answer.values, strict=True):
            if (found := parameter_value_to_python(value)) != needed:
                raise FieldError(f"{name} of {node_name} must be {needed!r}, got {found!r}")
        self.info = self._wait(lambda: inbox.infos.last, "agents", deadline_s)
        definition = self.info.definition
        if definition is None:
            raise FieldError("agents.definition: missing; the environment needs it")
        grid, in_metres = self.info.frame.grid_size, definition.rules.in_metres
        topic = "joint_command" if in_metres else "joint_action"
        kind, qos = offered(topic, "ros_env")
        self._publisher = node.create_publisher(kind, topic, qos)
        self._wait(self._publisher.get_subscription_count, f"a listener to {topic}", deadline_s)
        self.possible_agents = list(self.info.agents)
        seen = observation_space(grid, definition.rules)
        self.observation_spaces = dict.fromkeys(self.possible_agents, seen)
        self._action_of = turn_and_speed_of if in_metres else self._number_of
        self.action_spaces = {
            agent: action_space(definition.rules) for agent in self.possible_agents
        }

    def reset(self, seed: int | None = None, options: Mapping[str, Any] | None = None) -> Started:
        """Have the node start a new mission.

        Args:
            seed: Of the mission, which the node's parameter `seed` becomes. Without one it is
                drawn: by a generator that the last seed has seeded, or the system.
            options: None but the name `options`, which PettingZoo's tests pass and which is
                ignored: the scenario is that of the node.

        Raises:
            FieldError: If the seed or an option is not allowed; the mission under way stays as it
                is.
            TimeoutError: If the node does not answer in time.
        """
        for name in {} if options is None else options:
            if name != IGNORED_OPTION:
                raise FieldError(f"options must be empty over ROS, got {shown(name)}")
        if seed is not None:
            seed = check_seed(seed)
            if seed > MAX_SEED:
                raise FieldError(f"seed must be 0 to {MAX_SEED} over ROS, got {seed}")
            self._draws = np.random.default_rng(seed)
        else:
            seed = int(self._draws.integers(MAX_SEED))
        self._leave()
        deadline_s = time.monotonic() + self.timeout_s
        parameter = Parameter("seed", value=seed).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        for result in self._call(self._set, request, deadline_s, again=True).results:
            if not result.successful:
                raise FieldError(f"seed: the node refuses it: {result.reason}")
        self._inbox.forget_step()
        answer = self._call(self._reset, Trigger.Request(), deadline_s)
        if not answer.success:
            raise FieldError(f"reset: the node refuses it: {answer.message}")

        def begun() -> ObservedStep | None:
            step = self._inbox.step()
            if step is None or step.step_id[1:] != (step.info.mission, 0):
                return None
            return step if step.info.seed == seed else None

        step = self._wait(begun, f"step 0 of a mission with seed {seed}", deadline_s)
        if step.info.agents != self.info.agents or step.info.actions != self.info.actions:
            raise SearchLostError("the node was restarted with a different search")
        self.info = step.info
        drones = list(range(len(self.possible_agents)))
        self._note(step, drones)
        return step.observations(drones), step.infos(drones)

    def step(self, actions: Mapping[str, Any]) -> Stepped:
        """Have the node advance the mission by one step.

        A drone whose vehicle is lost is terminated in the step that follows, as one withdrawn
        from `SearchEnv`. If it was the last one, no step follows: the map stays as it was.

        Args:
            actions: One action per live agent, a number or, in metres, a turn and a speed; those of
                other agents are ignored.

        Raises:
            FieldError: If an action is missing or not allowed; the mission stays as it is.
            TimeoutError: If the step is not done in time.
            SearchLostError: If the mission is no longer the one that was reset: the node was
                started again, or somebody else commands or resets it.
        """
        if self._last is None or not self.agents:
            return {}, {}, {}, {}, {}
        if not isinstance(actions, Mapping):
            raise FieldError(f"actions must be one per live agent, got {shown(actions)}")
        live = self._live
        joint = {
            i: self._action_of(agent, actions) for agent, i in zip(self.agents, live, strict=True)
        }
        _, mission, number = self._last.step_id
        message = self._last.answer(joint)
        self._publisher.publish(message)
        deadline_s = time.monotonic() + self.timeout_s
        what = f"step_report and probability of step {number + 1} of mission {mission}"
        try:
            step = self._wait(
                self._next_step, what, deadline_s, partial(self._publisher.publish, message)
            )
            self._check_applied(step, joint)
        except (TimeoutError, SearchLostError):
            self._leave()
            raise
        # Without a step, drones that were left have been lost since the last one.
        earned = step.report["reward"] * (step.step_id != self._last.step_id)
        rewards = dict(zip(self.agents, earned[live].tolist(), strict=True))
        terminated, truncated = (
            dict(zip(self.agents, step.report[name][live].astype(bool).tolist(), strict=True))
            for name in ("terminated", "truncated")
        )
        self._note(step, np.flatnonzero(step.live).tolist())
        return step.observations(live), rewards, terminated, truncated, step.infos(live)

    def close(self) -> None:
        """Leave ROS; the node keeps waiting for commands."""
        self._leave()
        for name in ("_executor", "_node"):
            entity = self.__dict__.pop(name, None)
            with contextlib.suppress(Exception):
                if entity is not None:
                    (entity.shutdown if name == "_executor" else entity.destroy_node)()
        self._context.try_shutdown()

    def _leave(self) -> None:
        self.agents, self._live, self._last = [], [], None

    def _note(self, step: ObservedStep, live: list[int]) -> None:
        self._last, self._live = step, live
        self.agents = [self.possible_agents[i] for i in live]

    def _number_of(self, agent: str, actions: Mapping[str, int]) -> int:
        """Return an agent's action number."""
        if agent not in actions:
            raise FieldError(f"actions: {agent} is missing; one action per live agent")
        names = self.info.actions
        try:
            return range(len(names)).index(number_of(actions[agent]))
        except (TypeError, ValueError):
            known = ", ".join(f"{number} {name}" for number, name in enumerate(names))
            raise FieldError(
                f"action of {agent} must be one of {known}, got {shown(actions[agent])}"
            ) from None

    # What the node says

    def _on(self, topic: str, take: Callable[[Any], Any], message: Any) -> None:
        try:
            take(message)
        except ValueError as error:
            self._refused = f"; refused: {topic}: {error}"

    def _next_step(self) -> ObservedStep | None:
        """Return the step after the last one, or None while it is not here."""
        assert self._last is not None
        if self._inbox.report is None:
            return None
        report: NDArray[Any] = self._inbox.report[1]
        run_id, mission, number = self._last.step_id
        found = step_id_of(report)
        if found[0] != run_id:
            raise SearchLostError(
                f"the node was restarted: its run is {found[0]}, was {run_id}; reset it"
            )
        if found[1] != mission:
            raise SearchLostError(
                f"mission {mission} was cut short: the node is in mission {found[1]}; reset it"
            )
        if found[2] > number + 1:
            raise SearchLostError(
                f"step {found[2]} of mission {mission} is done, instead of {number + 1}; "
                "another node commands the simulation"
            )
        step = self._inbox.step()
        if step is None or (found[2] == number and step.live.any()):
            return None
        return step

    def _check_applied(self, step: ObservedStep, joint: Mapping[int, Any]) -> None:
        """Check that the drones have done the commanded actions."""
        assert self._last is not None
        if step.step_id == self._last.step_id:
            return
        for i, asked in joint.items():
            if step.deviates(i, asked):
                raise SearchLostError(
                    f"step {step.step_id[2]}: {self.possible_agents[i]} did action "
                    f"{step.applied(i)}, not {asked}: another node commands it, or its "
                    "command_timeout has passed"
                )

    # Waiting

    def _call(self, client: Client, request: Any, deadline_s: float, *, again: bool = False) -> Any:
        """Return the answer of a service.

        Args:
            client: Of the service.
            request: Of the service.
            deadline_s: On the steady clock.
            again: Whether to repeat the request until there is an answer. A killed node seems ready
                for some seconds, so that its successor may not get the first request.
        """
        name = self._node.resolve_service_name(client.srv_name)
        self._wait(client.service_is_ready, f"service {name}", deadline_s)
        futures: list[Any] = []

        def send() -> None:
            futures.append(client.call_async(request))

        def answered() -> Any:
            return next((future for future in futures if future.done()), None)

        send()
        try:
            done = self._wait(
                answered, f"answer of service {name}", deadline_s, send if again else None
            )
        finally:
            for future in futures:
                client.remove_pending_request(future)
        return done.result()

    def _wait(
        self,
        look: Callable[[], T | None],
        what: str,
        deadline_s: float,
        again: Callable[[], None] | None = None,
    ) -> T:
        """Return the first result of `look` that is true, and call `again` now and then."""
        resend_s = time.monotonic() + _RESEND_S
        while not (found := look()):
            now_s = time.monotonic()
            if now_s >= deadline_s:
                raise TimeoutError(
                    f"no {what} within {self.timeout_s:g} s: is the simulation in namespace "
                    f"{self._node.get_namespace()} running?{self._refused}"
                )
            if again is not None and now_s >= resend_s:
                again()
                resend_s = now_s + _RESEND_S
            self._executor.spin_once(timeout_sec=min(deadline_s - now_s, _RESEND_S / 10))
        return found
