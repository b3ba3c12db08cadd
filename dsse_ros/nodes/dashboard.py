# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros dashboard`: a page in the browser that shows missions as they run."""

from __future__ import annotations

import os
import re
import sys
import time
from dataclasses import dataclass, field
from functools import partial
from operator import itemgetter
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

from dsse_ros.dashboard.inbox import Command, Inbox, Received
from dsse_ros.dashboard.missions import MAX_MISSIONS
from dsse_ros.dashboard.server import PageServer
from dsse_ros.dashboard.settings import DashboardSettings
from dsse_ros.nodes.parameters import declare, take_overrides
from dsse_ros.nodes.polling import polling_node, spun_by_nobody, take_all
from dsse_ros.nodes.qos import COMPLETE, LATCHED, RELIABLE, Endpoints
from dsse_ros.nodes.runtime import AlarmNode, run_node
from dsse_ros.search.fields import specs

_NICENESS = 10
"""Of the process: where cores are busy, the nodes of the missions come first."""
_LOOK_S = 0.5
"""Wall time between looks for simulations and vehicles."""
_COMMANDS_S = 0.05
"""Wall time between looks for commands of the page."""
_TAKE_S = 0.05
"""Wall time between looks for messages."""
_SILENCE_S = 3.0
"""Wall time without a message after which a simulation is taken to be gone: its diagnostics come
once a second, and one that was killed has publishers for 20 s more."""
_GONE_S = 10.0
"""Wall time without a message after which a simulation without publishers is given up: nothing of
it is subscribed to until it is back."""
_MAX_TOPICS = 2000
"""Of one simulation with its vehicles."""
_ANSWER_S = 5.0
"""Wall time that a service has to answer."""

TOPICS = {
    "agents": (String, LATCHED),
    "step_report": (PointCloud2, COMPLETE),
    "mission_report": (PointCloud2, LATCHED),
    "probability_of_success": (Float64MultiArray, COMPLETE),
    "probability_grid": (OccupancyGrid, LATCHED),
    "belief_grid": (OccupancyGrid, LATCHED),
}
"""Of each simulation, relative to its namespace."""
OF_VEHICLE = {"vehicle_state": (DiagnosticArray, LATCHED), "vehicle_pose": (PoseStamped, RELIABLE)}
"""Of each vehicle, relative to the name of its drone."""
_EVERY_MESSAGE = ("agents", "step_report", "probability_of_success", "answer")
"""Topics of which the page needs more than the last message."""
_REPORTS = re.compile(r"(?P<namespace>.*)/step_report")
_VEHICLES = re.compile(r"(?P<namespace>.*)/(?P<topic>[^/]+/(?P<kind>vehicle_state|vehicle_pose))")
_SERVICES: dict[str, tuple[str, Any, dict[str, bool]]] = {
    "pause": ("pause", SetBool, {"data": True}),
    "resume": ("pause", SetBool, {"data": False}),
    "step": ("step", Trigger, {}),
    "reset": ("reset", Trigger, {}),
}
"""Of each command the service, its type and what the request contains."""


@dataclass
class Simulation:
    """A simulation that is or was there.

    Attributes:
        node: Full name of its node, "" before it is known.
        publishers: How many publish its reports, as the page knows it.
        heard_s: When the last message of it came, on a steady clock.
        topics: Subscriptions by topic, relative to its namespace.
    """

    node: str = ""
    publishers: int = -1
    heard_s: float = field(default_factory=time.monotonic)
    topics: dict[str, Subscription] = field(default_factory=dict)


class DashboardNode(AlarmNode):
    """Hands what the topics bring to the page, unread, and the page's commands to the services.

    Raises:
        FieldError: If a parameter is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("dsse_dashboard")
        known = specs(DashboardSettings)
        given, qos = take_overrides(self, known)
        self.settings = DashboardSettings(**given)
        declare(self, known, vars(self.settings))
        Endpoints(self, qos).check_all_used()
        self.inbox = Inbox(_EVERY_MESSAGE)
        self._server: PageServer | None = None
        self._listener = polling_node(self)
        self._simulations: dict[str, Simulation] = {}
        self._callers: dict[str, Any] = {}
        self._waiting: list[tuple[Command, float]] = []
        self._pending: dict[Future, tuple[Command, float]] = {}
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, RELIABLE)
        self.alarms.make(self._look).repeat(_LOOK_S)
        self.alarms.make(self._take).repeat(_TAKE_S)
        self.alarms.make(self._serve_commands).repeat(_COMMANDS_S)

    def serve(self) -> None:
        """Open the page.

        Raises:
            FieldError: If it cannot be bound, or a setting is not allowed.
        """
        self._server = PageServer(self.inbox, self.settings, self.context.get_domain_id())
        self._server.start()
        self.get_logger().info(f"page at {self._server.url}")
        self._look()

    # Missions

    def _look(self) -> None:
        """Subscribe to what is new."""
        names = [name for name, _ in self.get_topic_names_and_types()]
        for name in names:
            if match := _REPORTS.fullmatch(name):
                self._join(match["namespace"])
        for name in names:
            if match := _VEHICLES.fullmatch(name):
                simulation = self._simulations.get(match["namespace"])
                if simulation is None or match["topic"] in simulation.topics:
                    continue
                # Without a publisher only somebody else waits for it.
                if len(simulation.topics) < _MAX_TOPICS and self.count_publishers(name):
                    self._subscribe(match["namespace"], match["topic"], *OF_VEHICLE[match["kind"]])
        self._unsubscribe()

    def _unsubscribe(self) -> None:
        """Give up what has gone: simulations after a while, vehicles at once."""
        for namespace, simulation in list(self._simulations.items()):
            silent_s = time.monotonic() - simulation.heard_s
            if silent_s > _GONE_S and not self.count_publishers(f"{namespace}/step_report"):
                self._leave(namespace)
                continue
            for topic in [name for name in simulation.topics if name not in TOPICS]:
                if not self.count_publishers(f"{namespace}/{topic}"):
                    self._listener.destroy_subscription(simulation.topics.pop(topic))

    def _leave(self, namespace: str) -> None:
        """Give up a simulation; what is known of its mission stays on the page."""
        simulation = self._simulations.pop(namespace)
        for subscription in simulation.topics.values():
            self._listener.destroy_subscription(subscription)
        for name in [name for name in self._callers if name.rpartition("/")[0] == simulation.node]:
            self.destroy_client(self._callers.pop(name))
        if simulation.publishers:
            self._put(namespace, "publishers", 0)
        self.get_logger().info(f"the simulation in {namespace or '/'} is gone")

    def _join(self, namespace: str) -> None:
        simulation = self._simulations.get(namespace)
        publishers = self.get_publishers_info_by_topic(f"{namespace}/step_report")
        if simulation is None:
            if not publishers:
                # Only somebody else who waits for it.
                return
            if len(self._simulations) >= MAX_MISSIONS:
                self.warn("missions", f"{MAX_MISSIONS} missions are shown: not {namespace or '/'}")
                return
            simulation = self._simulations[namespace] = Simulation()
            self.get_logger().info(f"showing the mission in {namespace or '/'}")
            for topic, (kind, qos) in TOPICS.items():
                self._subscribe(namespace, topic, kind, qos)
        if publishers:
            node = publishers[0]
            simulation.node = f"{node.node_namespace.rstrip('/')}/{node.node_name}"
        silent = time.monotonic() - simulation.heard_s > _SILENCE_S
        count = 0 if silent else len(publishers)
        if simulation.publishers != count:
            simulation.publishers = count
            self._put(namespace, "publishers", count)

    def _subscribe(self, namespace: str, topic: str, kind: Any, qos: Any) -> None:
        self._simulations[namespace].topics[topic] = self._listener.create_subscription(
            kind, f"{namespace}/{topic}", spun_by_nobody, qos, raw=True
        )

    def _take(self) -> None:
        """Hand on what has come, in the order in which it was received."""
        came: list[tuple[int, Received]] = []
        for namespace, simulation in self._simulations.items():
            before = len(came)
            for topic, subscription in simulation.topics.items():
                for one in take_all(subscription):
                    read = partial(deserialize_message, one.data, subscription.msg_type)
                    came.append((one.received_ns, Received(namespace, topic, read)))
            if len(came) > before:
                simulation.heard_s = time.monotonic()
        for _, received in sorted(came, key=itemgetter(0)):
            self.inbox.put(received)

    def _put(self, namespace: str, topic: str, value: Any) -> None:
        self.inbox.put(Received(namespace, topic, lambda: value))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            for namespace, simulation in self._simulations.items():
                if simulation.node.lstrip("/") == status.name.lstrip("/"):
                    simulation.heard_s = time.monotonic()
                    self._put(namespace, "diagnostics", status)

    # Commands

    def _serve_commands(self) -> None:
        now_s = time.monotonic()
        self._waiting += [(command, now_s + _ANSWER_S) for command in self.inbox.take_commands()]
        # A request that is sent before the service is known would be lost.
        waiting, self._waiting = self._waiting, []
        for command, deadline_s in waiting:
            client = self._client(command)
            if client is not None and client.service_is_ready():
                request = client.srv_type.Request(**_SERVICES[command.name][2])
                self._pending[client.call_async(request)] = command, deadline_s
            elif now_s > deadline_s:
                self._answer(command, f"no simulation serves it in {command.namespace or '/'}")
            else:
                self._waiting.append((command, deadline_s))
        for future, (command, deadline_s) in list(self._pending.items()):
            if future.done():
                del self._pending[future]
                self._on_answer(command, future.result())
            elif now_s > deadline_s:
                del self._pending[future]
                self._answer(command, f"no answer within {_ANSWER_S:g} s")

    def _client(self, command: Command) -> Any:
        """Return the client of the service for a command, None where there is no simulation."""
        simulation = self._simulations.get(command.namespace)
        if simulation is None or not simulation.node:
            return None
        service, kind, _ = _SERVICES[command.name]
        name = f"{simulation.node}/{service}"
        if name not in self._callers:
            self._callers[name] = self.create_client(kind, name)
        return self._callers[name]

    def _on_answer(self, command: Command, response: Any) -> None:
        text = response.message if response.success else f"refused: {response.message}"
        self._answer(command, text)
        if command.name in ("pause", "resume") and response.success:
            self._put(command.namespace, "paused", command.name == "pause")

    def _answer(self, command: Command, text: str) -> None:
        self.get_logger().info(f"{command.name} in {command.namespace or '/'}: {text}")
        self._put(command.namespace, "answer", f"{command.name}: {text}")

    def destroy_node(self) -> None:
        """Close the page and the node."""
        if self._server is not None:
            self._server.stop()
        self._listener.destroy_node()
        super().destroy_node()


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""

    def make() -> DashboardNode:
        # A mission does not wait for who looks at it.
        os.nice(_NICENESS)
        node = DashboardNode()
        node.serve()
        return node

    return run_node("dashboard", make, argv)


if __name__ == "__main__":
    sys.exit(main())
