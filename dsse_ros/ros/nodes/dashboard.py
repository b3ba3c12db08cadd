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
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from std_srvs.srv import SetBool, Trigger

from dsse_ros.ros.nodes.live_door import ANSWERS, INPUTS, Awaited, InputDoor, take_answer
from dsse_ros.ros.nodes.operator_services import (
    OPERATOR_SERVICES,
    FoundBridge,
    find_bridges,
    full_name,
    service_name,
)
from dsse_ros.ros.runtime.arrivals import Arrivals, MachineClocks
from dsse_ros.ros.runtime.polling import polling_node, spun_by_nobody, take_all
from dsse_ros.ros.runtime.qos import read_settings, requested
from dsse_ros.ros.runtime.run_node import AlarmNode, run_node
from dsse_ros.screens.dashboard.inbox import Inbox, Received
from dsse_ros.screens.dashboard.live_forms import change_of
from dsse_ros.screens.dashboard.missions import MAX_MISSIONS
from dsse_ros.screens.dashboard.search_history import EXACT_LAYERS, LAYERS
from dsse_ros.screens.dashboard.server import PageServer
from dsse_ros.screens.dashboard.service_calls import Command, ServiceCalls
from dsse_ros.screens.dashboard.settings import DashboardSettings
from msg_adapters.diagnostics import node_of_status
from msg_adapters.topics import EACH_DRONE, subscribed_by

_NICENESS = 10
"""Niceness of the process: on a busy machine, the nodes of the missions come first."""
_DISCOVERY_S = 0.5
"""Wall time between scans for simulations and vehicles."""
_COMMANDS_S = 0.05
"""Wall time after which commands of the page are published."""
_TAKE_S = 0.05
"""Wall time after which messages are taken."""
_SILENCE_S = 3.0
"""Wall time without a message after which a simulation or a bridge counts as gone. Diagnostics and
states come once a second; the publishers of a killed node remain visible for 20 s more."""
_GONE_S = 10.0
"""Wall time without a message after which the node unsubscribes from a simulation without
publishers, until it is back."""
_MAX_TOPICS = 2000
"""Limit of subscriptions for one simulation with its vehicles."""

_SUBSCRIBED = tuple(subscribed_by("dashboard"))
TOPICS = tuple(
    name
    for name in _SUBSCRIBED
    if not name.startswith(("/", EACH_DRONE)) and name not in EXACT_LAYERS
)
"""Topics of each simulation, relative to its namespace; those of `EXACT_LAYERS` only if the maps
are small."""
_MAX_EXACT_BYTES = 10_500
"""Size of a display map, at one byte per cell, up to which the exact map is read too: on grids of
at most 10 000 cells."""
OF_VEHICLE = tuple(
    name.removeprefix(EACH_DRONE) for name in _SUBSCRIBED if name.startswith(EACH_DRONE)
)
"""Topics of each vehicle, relative to the name of its drone."""
_EVERY_MESSAGE = ("agents", "step_report", "probability_of_success", "answer", ANSWERS)
"""Topics whose every message the page needs, not only the last."""
_COMMANDS = ("joint_action", "drone0/cmd_action_name")
"""Topics whose publishers are the planners of a simulation, relative to its namespace."""
_REPORTS = re.compile(r"(?P<namespace>.*)/step_report")
_VEHICLES = re.compile(rf"(?P<namespace>.*)/(?P<topic>drone\d+/(?:{'|'.join(OF_VEHICLE)}))")
_SERVICES: dict[str, tuple[str, Any, dict[str, bool]]] = {
    "pause": ("pause", SetBool, {"data": True}),
    "resume": ("pause", SetBool, {"data": False}),
    "step": ("step", Trigger, {}),
    "reset": ("reset", Trigger, {}),
    "seed": ("set_parameters", SetParameters, {}),
}
"""Service, service type and request fields, for each command."""
_OPERATIONS: dict[str, tuple[str, dict[str, bool]]] = {
    "arm": ("arm", {"data": True}),
    "ground": ("arm", {"data": False}),
    "hold": ("hold", {}),
    "return": ("return", {}),
    "land": ("land", {}),
}
"""Service and request fields, for each command for vehicles."""


@dataclass
class Shown:
    """A namespace on the page: a present or past simulation, bridge or both.

    Attributes:
        node: Full name of the simulation's node, "" before it is known.
        publishers: Number of publishers of its reports, as shown on the page.
        planners: Full names of the nodes that command its drones, and the name of the planner of
            each, which its diagnostics have; by default that of the node.
        planner: The planners, as shown on the page.
        exact: Whether its exact maps are small enough to be read.
        heard_s: When the last message of the simulation came, on a steady clock.
        bridge: The bridge; None while there is none.
        drones: Drones of the bridge, as shown on the page; none while the bridge is silent.
        bridge_heard_s: When the last message of the bridge came, on a steady clock.
        topics: Subscriptions by topic, relative to the namespace.
        callers: Clients by name of the service.
        doors: Publishers of inputs by kind.
    """

    node: str = ""
    publishers: int = -1
    planners: dict[str, str] = field(default_factory=dict)
    planner: str = ""
    exact: bool = False
    heard_s: float = field(default_factory=time.monotonic)
    bridge: FoundBridge | None = None
    drones: tuple[str, ...] = ()
    bridge_heard_s: float = field(default_factory=time.monotonic)
    topics: dict[str, Subscription] = field(default_factory=dict)
    callers: dict[str, Any] = field(default_factory=dict)
    doors: dict[str, InputDoor] = field(default_factory=dict)


class DashboardNode(AlarmNode):
    """Passes messages to the page without reading them, and the page's commands to the services.

    Raises:
        FieldError: If a parameter is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("dashboard")
        self.settings, endpoints = read_settings(self, DashboardSettings)
        endpoints.check_all_used()
        self.inbox = Inbox(_EVERY_MESSAGE)
        self._server: PageServer | None = None
        self._listener = polling_node(self)
        self.at_end(self._listener.destroy_node)
        self._shown: dict[str, Shown] = {}
        self._arrivals = Arrivals()
        # Namespace, topic and type by the topic's whole name.
        self._topics: dict[str, tuple[str, str, Any]] = {}
        self._awaited: Awaited = {}
        self._calls = ServiceCalls(self._client, self._request, self._on_answer, self._answer)
        kind, qos = requested("/diagnostics", self.program)
        self.create_subscription(kind, "/diagnostics", self._on_diagnostics, qos)
        self.alarms.make(self._discover).repeat(_DISCOVERY_S)
        self.alarms.make(self._take).repeat(_TAKE_S)
        self.alarms.make(self._serve_commands).repeat(_COMMANDS_S)

    def serve(self) -> None:
        """Open the page.

        Raises:
            FieldError: If the address cannot be bound, or a setting is not allowed.
        """
        self._server = PageServer(self.inbox, self.settings, self.context.get_domain_id())
        self.at_end(self._server.stop)
        self._server.start()
        # Loggers of ROS write to /rosout and to a file that others can read too.
        print(f"page at {self._server.url}", flush=True)
        self._discover()

    # Missions

    def _discover(self) -> None:
        """Subscribe to new topics."""
        names = [name for name, _ in self.get_topic_names_and_types()]
        for name in names:
            if match := _REPORTS.fullmatch(name):
                self._join(match["namespace"])
        bridges = find_bridges(self)
        for namespace in bridges.keys() | self._shown.keys():
            self._join_bridge(namespace, bridges.get(namespace))
        for name in names:
            if match := _VEHICLES.fullmatch(name):
                shown = self._shown.get(match["namespace"])
                if shown is None or match["topic"] in shown.topics:
                    continue
                # A topic without a publisher exists because somebody else subscribes to it.
                if len(shown.topics) < _MAX_TOPICS and self.count_publishers(name):
                    self._subscribe(match["namespace"], match["topic"])
        for namespace, shown in self._shown.items():
            self._find_planners(namespace, shown)
            self._open_doors(namespace, shown)
            for topic in EXACT_LAYERS if shown.exact else ():
                if topic not in shown.topics and self.count_publishers(f"{namespace}/{topic}"):
                    self._subscribe(namespace, topic)
        self._unsubscribe()

    def _open_doors(self, namespace: str, shown: Shown) -> None:
        """Make the publishers of inputs of a live search, so that they are known when used."""
        if not shown.doors and self.count_publishers(f"{namespace}/{ANSWERS}"):
            shown.doors = {kind: InputDoor(self, namespace, kind, self._awaited) for kind in INPUTS}

    def _find_planners(self, namespace: str, shown: Shown) -> None:
        """Find the nodes that command the drones."""
        found = {
            full_name(endpoint): endpoint.node_name
            for topic in _COMMANDS
            for endpoint in self.get_publishers_info_by_topic(f"{namespace}/{topic}")
        }
        shown.planners = found | {
            node: name for node, name in shown.planners.items() if node in found
        }
        planner = ", ".join(sorted({*shown.planners.values()}))
        if planner != shown.planner:
            shown.planner = planner
            self._put(namespace, "planner", planner)

    def _unsubscribe(self) -> None:
        """Unsubscribe from what is gone, from simulations after a while, and from large maps."""
        for namespace, shown in list(self._shown.items()):
            for topic in [name for name in shown.topics if name not in TOPICS]:
                large = topic in EXACT_LAYERS and not shown.exact
                if large or not self.count_publishers(f"{namespace}/{topic}"):
                    self._listener.destroy_subscription(shown.topics.pop(topic))
            silent_s = time.monotonic() - shown.heard_s
            gone = silent_s > _GONE_S and not self.count_publishers(f"{namespace}/step_report")
            if gone and shown.bridge is None:
                self._leave(namespace)

    def _leave(self, namespace: str) -> None:
        """Unsubscribe from a namespace; the page keeps showing its mission."""
        shown = self._shown.pop(namespace)
        for subscription in shown.topics.values():
            self._listener.destroy_subscription(subscription)
        for caller in shown.callers.values():
            self.destroy_client(caller)
        for door in shown.doors.values():
            self.destroy_publisher(door.publisher)
        if shown.publishers:
            self._put(namespace, "publishers", 0)
        self.get_logger().info(f"the simulation in {namespace or '/'} is gone")

    def _show(self, namespace: str) -> Shown | None:
        """Return the entry of a namespace, which may be new; None if there is no room."""
        if namespace not in self._shown:
            if len(self._shown) >= MAX_MISSIONS:
                self.warn("missions", f"{MAX_MISSIONS} missions are shown: not {namespace or '/'}")
                return None
            self._shown[namespace] = Shown()
            self.get_logger().info(f"showing the mission in {namespace or '/'}")
            for topic in TOPICS:
                self._subscribe(namespace, topic)
        return self._shown[namespace]

    def _join(self, namespace: str) -> None:
        """Find the publishers of a simulation's reports."""
        publishers = self.get_publishers_info_by_topic(f"{namespace}/step_report")
        # A topic without publishers exists because somebody else subscribes to it.
        shown = self._show(namespace) if publishers else self._shown.get(namespace)
        if shown is None:
            return
        if publishers:
            shown.node = full_name(publishers[0])
        silent = time.monotonic() - shown.heard_s > _SILENCE_S
        count = 0 if silent else len(publishers)
        if shown.publishers != count:
            shown.publishers = count
            self._put(namespace, "publishers", count)

    def _join_bridge(self, namespace: str, bridge: FoundBridge | None) -> None:
        """Find the bridge, even without a simulation: its vehicles may be in the air."""
        shown = self._shown.get(namespace) if bridge is None else self._show(namespace)
        if shown is None:
            return
        if shown.publishers < 0:
            # The bridge itself subscribes to the topics of a simulation.
            self._join(namespace)
        if bridge is not None and shown.bridge is None:
            shown.bridge_heard_s = time.monotonic()
        shown.bridge = bridge
        silent = time.monotonic() - shown.bridge_heard_s > _SILENCE_S
        drones = () if bridge is None or silent else bridge.drones
        if shown.drones != drones:
            shown.drones = drones
            self._put(namespace, "bridge", drones)

    def _subscribe(self, namespace: str, topic: str) -> None:
        kind, qos = requested(topic, self.program)
        self._shown[namespace].topics[topic] = self._listener.create_subscription(
            kind, f"{namespace}/{topic}", spun_by_nobody, qos, raw=True
        )

    def _take(self) -> None:
        """Pass on the new messages, in the order of their arrival."""
        before, came = MachineClocks.read(), []
        for namespace, shown in self._shown.items():
            for topic, subscription in shown.topics.items():
                taken = list(take_all(subscription))
                came += taken
                self._topics[subscription.topic_name] = namespace, topic, subscription.msg_type
                if topic == ANSWERS:
                    for message in taken:
                        take_answer(self._awaited, namespace, message.data)
                if taken and topic in LAYERS:
                    shown.exact = len(taken[-1].data) <= _MAX_EXACT_BYTES
                if taken and (topic in TOPICS or topic in EXACT_LAYERS):
                    shown.heard_s = time.monotonic()
                elif taken:
                    shown.bridge_heard_s = time.monotonic()
        for message in self._arrivals.order(came, before, time.time_ns()):
            namespace, topic, kind = self._topics[message.topic]
            read = partial(deserialize_message, message.data, kind)
            self.inbox.put(Received(namespace, topic, read, message.published_ns))

    def _put(self, namespace: str, topic: str, value: Any) -> None:
        self.inbox.put(Received(namespace, topic, lambda: value))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            node = node_of_status(status.name)
            for namespace, shown in self._shown.items():
                if node and shown.node == node:
                    shown.heard_s = time.monotonic()
                    self._put(namespace, "diagnostics", status)
                planner = next((item.value for item in status.values if item.key == "planner"), "")
                if planner and node in shown.planners:
                    shown.planners[node] = planner

    # Commands

    def _serve_commands(self) -> None:
        # A reset with a seed sets the parameter first.
        self._calls.put(
            command if command.seed is None else command._replace(name="seed")
            for command in self.inbox.take_commands()
        )
        self._calls.turn(time.monotonic())

    def _request(self, command: Command) -> Any:
        """Return the request of the service for a command, or the text of an input."""
        if command.input:
            return command.input
        if command.name in _OPERATIONS:
            what, values = _OPERATIONS[command.name]
            return OPERATOR_SERVICES[what].Request(**values)
        _, kind, values = _SERVICES[command.name]
        request = kind.Request(**values)
        if command.name == "seed":
            seed = Parameter("seed", Parameter.Type.INTEGER, command.seed)
            request.parameters = [seed.to_parameter_msg()]
        return request

    def _client(self, command: Command) -> Any:
        """Return the client of the service for a command, None if nobody can serve it."""
        namespace = command.namespace
        shown = self._shown.get(namespace)
        if shown is None:
            return None
        if command.input:
            return shown.doors.get(command.name)
        if command.name in _OPERATIONS:
            what = _OPERATIONS[command.name][0]
            if shown.bridge is None or not shown.drones:
                return None
            name = service_name(namespace, shown.bridge, command.vehicle, what)
            kind = OPERATOR_SERVICES[what]
        else:
            service, kind, _ = _SERVICES[command.name]
            if not shown.node:
                return None
            name = f"{shown.node}/{service}"
        if name not in shown.callers:
            shown.callers[name] = self.create_client(kind, name)
        return shown.callers[name]

    def _on_answer(self, command: Command, response: Any) -> None:
        if command.input:
            self._answer(command, change_of(response))
            return
        if command.name == "seed":
            refusals = [result.reason for result in response.results if not result.successful]
            if refusals:
                self._answer(command, f"refused: {'; '.join(refusals)}")
            else:
                # It is as old as the click that it is a part of.
                self._calls.put([command._replace(name="reset", seed=None)])
            return
        text = response.message if response.success else f"refused: {response.message}"
        self._answer(command, text)
        if command.name in ("pause", "resume") and response.success:
            self._put(command.namespace, "paused", command.name == "pause")

    def _answer(self, command: Command, text: str) -> None:
        name = command.name
        if name in _OPERATIONS:
            name += f" {command.vehicle or 'all'}"
        self.get_logger().info(f"{name} in {command.namespace or '/'}: {text}")
        topic = "vehicle_answer" if command.name in _OPERATIONS else "answer"
        topic = "live_answer" if command.input else topic
        self._put(command.namespace, topic, f"{name}: {text}")


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""

    def make() -> DashboardNode:
        # The page must not slow down a mission.
        os.nice(_NICENESS)
        node = DashboardNode()
        node.serve()
        return node

    return run_node("dashboard", make, argv)


if __name__ == "__main__":
    sys.exit(main())
