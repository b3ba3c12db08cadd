# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The other side of a lockstep: listens to everything and answers each report."""

from __future__ import annotations

import struct
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Int32MultiArray

from dsse_ros.ros.runtime.qos import RELIABLE
from dsse_ros.ros.runtime.run_node import new_executor
from msg_adapters.commands import joint_action_message
from msg_adapters.step_report import step_report_dtype

REPORT = "/step_report"
STEP_AT: int = step_report_dtype(1).fields["step"][1]  # type: ignore[index]
"""Offset of the first drone's step in the bytes of a report."""
MISSION_AT: int = step_report_dtype(1).fields["mission"][1]  # type: ignore[index]

NOT_OF_THE_NODE = ("/rosout", "/parameter_events")
DISCOVERY_S = 60.0
QUIET_S = 1.0
SILENCE_S = 20.0
LOOK_S = 0.1
ANSWER_AGAIN_S = 0.5
"""Idle time after which an answer is repeated: nobody may have received the first one."""

OnMessage = Callable[[str, Any], None]


def message_type(name: str) -> Any:
    """Return the class of a message by its name in ROS, as `std_msgs/msg/String`."""
    package, _, kind = name.split("/")
    return getattr(import_module(f"{package}.msg"), kind)


def profile_of(reliability: str, durability: str) -> QoSProfile:
    """Return the quality of service by the names of its policies."""
    chosen = DurabilityPolicy[durability]
    return QoSProfile(
        depth=1 if chosen == DurabilityPolicy.TRANSIENT_LOCAL else 10,
        reliability=ReliabilityPolicy[reliability],
        durability=chosen,
    )


def publications(node: Node, node_name: str) -> dict[str, tuple[str, str, str]]:
    """Return (type, reliability, durability) of each topic of a node, once all exist.

    Raises:
        RuntimeError: If they are not within `DISCOVERY_S`.
    """
    start = quiet_since = time.monotonic()
    seen: list[tuple[str, list[str]]] = []
    while time.monotonic() - start < DISCOVERY_S:
        time.sleep(0.1)
        now = []
        if node_name in node.get_node_names():
            now = sorted(node.get_publisher_names_and_types_by_node(node_name, "/"))
        # A node that is still compiling has no topics.
        complete = REPORT in [topic for topic, _ in now]
        if now != seen or not complete:
            seen, quiet_since = now, time.monotonic()
        elif time.monotonic() - quiet_since > QUIET_S:
            return {
                topic: (types[0], *_policies(node, topic, node_name))
                for topic, types in seen
                if topic not in NOT_OF_THE_NODE
            }
    raise RuntimeError(f"{node_name} is not there after {DISCOVERY_S:g} s")


def _policies(node: Node, topic: str, node_name: str) -> tuple[str, str]:
    for info in node.get_publishers_info_by_topic(topic):
        if info.node_name == node_name:
            return info.qos_profile.reliability.name, info.qos_profile.durability.name
    raise RuntimeError(f"{topic} has no publisher of {node_name}")


class Peer(Node):
    """Subscribes all topics of a node and answers its reports with the actions of a walk.

    Args:
        node_name: Name of the node.
        walk: (K, N) action numbers by step; a report of step K has no answer, because the mission
            is then over.
        raw: Whether to pass on messages as bytes.
        on_message: Called with topic and message.

    Attributes:
        topics: (type, reliability, durability) of each.
        messages: Messages by topic.
        received: Messages.
        steps: Steps that the reports contained.
    """

    def __init__(
        self,
        node_name: str,
        walk: list[list[int]],
        *,
        raw: bool = False,
        on_message: OnMessage | None = None,
    ) -> None:
        super().__init__("peer", start_parameter_services=False)
        self.topics = publications(self, node_name)
        self.messages: Counter[str] = Counter()
        self.received = 0
        self.steps = 0
        self._walk = walk
        self._raw = raw
        self._on_message = on_message
        self._step = 0
        self._mission = 1
        self._publisher = self.create_publisher(Int32MultiArray, "joint_action", RELIABLE)
        for topic, (kind, *policies) in self.topics.items():
            callback = partial(self._on_report if topic == REPORT else self._on, topic)
            self.create_subscription(
                message_type(kind), topic, callback, profile_of(*policies), raw=raw
            )

    def _on(self, topic: str, message: Any) -> None:
        self.received += 1
        self.messages[topic] += 1
        if self._on_message is not None:
            self._on_message(topic, message)

    def _on_report(self, topic: str, message: Any) -> None:
        self._on(topic, message)
        report = deserialize_message(message, PointCloud2) if self._raw else message
        (step,) = struct.unpack_from("<I", report.data, STEP_AT)
        (self._mission,) = struct.unpack_from("<I", report.data, MISSION_AT)
        # The last report of a mission is soon replaced by the first of the next one.
        last = len(self._walk)
        self.steps += step - self._step if step >= self._step else last - self._step + step
        self._step = step
        self.answer()

    def answer(self) -> None:
        """Answer the last report, if it has an answer."""
        if self._step < len(self._walk):
            action = joint_action_message(self._mission, self._step, self._walk[self._step])
            self._publisher.publish(action)


def turn(executor: Executor, peer: Peer) -> Iterator[int]:
    """Yield the number of steps in each event that the peer handles.

    Raises:
        RuntimeError: If nothing comes for `SILENCE_S`.
    """
    idle_s = 0.0
    answered_at_s = 0.0
    while True:
        steps, received, start_s = peer.steps, peer.received, time.monotonic()
        executor.spin_once(timeout_sec=LOOK_S)
        if peer.steps > steps:
            idle_s = answered_at_s = 0.0
        elif peer.received == received:
            idle_s += time.monotonic() - start_s
            if idle_s > SILENCE_S:
                raise RuntimeError(f"no report within {SILENCE_S:g} s")
            if idle_s - answered_at_s > ANSWER_AGAIN_S:
                answered_at_s = idle_s
                peer.answer()
        yield peer.steps - steps


def start(node_name: str, workload: str, **options: Any) -> tuple[Executor, Peer]:
    """Return a peer of a node with the walk in a file, on an executor."""
    with np.load(workload) as file:
        walk = file["actions"][:, 0].tolist()
    rclpy.init()
    peer = Peer(node_name, walk, **options)
    executor = new_executor()
    executor.add_node(peer)
    return executor, peer
