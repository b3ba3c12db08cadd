# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Quality of service of the topics, and its overrides by parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)
from rclpy.subscription import Subscription

from dsse_ros.base.fields import FieldError, Spec, check_known, specs
from dsse_ros.base.message_types import message_class
from dsse_ros.ros.runtime.parameters import QOS_PREFIX, declare
from dsse_ros.ros.runtime.run_node import AlarmNode
from msg_adapters.topics import Qos, of_drones, topic_of

T = TypeVar("T")

LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Late joiners get the last message."""

COMPLETE = QoSProfile(
    depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Step reports and POS: a subscriber that must see each step may fall behind or come late by this
many steps, which most missions do not exceed."""

RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Odometry, clock and diagnostics."""

COMMANDS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Commands to drones, never latched: a restarted simulation numbers its missions and steps like the
one before, and must not take the commands to that one."""

QUEUED = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""Inputs of a live search and their answers: many may come at once, and each counts."""

SENSOR = qos_profile_sensor_data
"""Fixes: fresh rather than complete."""

PROFILES: dict[Qos, QoSProfile] = {
    "latched": LATCHED,
    "complete": COMPLETE,
    "reliable": RELIABLE,
    "command": COMMANDS,
    "queued": QUEUED,
    "sensor": SENSOR,
}
"""The profiles by their names in the table of topics."""

_POLICIES: dict[str, tuple[Spec, Callable[[Any], Any]]] = {
    "history": (
        Spec("str", "Which messages are kept.", choices=("keep_last", "keep_all")),
        lambda value: HistoryPolicy[value.upper()],
    ),
    "depth": (Spec("int", "Messages kept.", "messages", low=1, high=10**6), int),
    "reliability": (
        Spec("str", "Whether lost messages are sent again.", choices=("reliable", "best_effort")),
        lambda value: ReliabilityPolicy[value.upper()],
    ),
    "durability": (
        Spec(
            "str", "Whether late listeners get messages.", choices=("transient_local", "volatile")
        ),
        lambda value: DurabilityPolicy[value.upper()],
    ),
}


def offered(topic: str, program: str) -> tuple[Any, QoSProfile]:
    """Return the message class and the QoS with which a program publishes a topic.

    Raises:
        ValueError: If it is not one of the topic's publishers.
        FieldError: If the type is not installed.
    """
    row = topic_of(topic)
    if program not in row.publishers:
        raise ValueError(f"{program} must be one of the publishers of {topic}: {row.publishers}")
    return message_class(row.type_name), PROFILES[row.qos]


def requested(topic: str, program: str) -> tuple[Any, QoSProfile]:
    """Return the message class and the QoS with which a program subscribes to a topic.

    Raises:
        ValueError: If it is not one of the topic's subscribers.
        FieldError: If the type is not installed.
    """
    row = topic_of(topic)
    if program not in row.subscribers:
        raise ValueError(f"{program} must be one of the subscribers of {topic}: {row.subscribers}")
    return message_class(row.type_name), PROFILES[row.subscriber_qos.get(program, row.qos)]


class Endpoints:
    """Makes the publishers and subscriptions of a node as the table of topics has them.

    Parameters change their QoS. They have the usual names of ROS 2,
    `qos_overrides.<resolved topic>.<publisher or subscription>.<policy>`, with the policies
    history, depth, reliability and durability. Only the given ones are declared: a hundred drones
    would have thousands.

    Args:
        node: Node of the endpoints.
        overrides: Those that the node was started with, by name.
    """

    def __init__(self, node: AlarmNode, overrides: Mapping[str, Any]) -> None:
        self._node = node
        self._overrides = dict(overrides)

    def publisher(self, topic: str) -> Publisher:
        """Return a publisher of a topic, such as `agents` or `drone3/pose`.

        Raises:
            FieldError: If its type is not installed, or an override of its QoS is not allowed.
        """
        kind, qos = offered(topic, self._node.program)
        return self._node.create_publisher(kind, topic, self._profile("publisher", topic, qos))

    def subscription(self, topic: str, callback: Callable[[Any], None]) -> Subscription:
        """Return a subscription; the node logs what its callback raises.

        Raises:
            FieldError: If its type is not installed, or an override of its QoS is not allowed.
        """
        kind, qos = requested(topic, self._node.program)
        return self._node.create_subscription(
            kind,
            topic,
            self._node.isolated(topic, callback),
            self._profile("subscription", topic, qos),
        )

    def check_all_used(self, later: str = "") -> None:
        """Check that every override of the command line has an endpoint.

        Args:
            later: A topic of each drone, whose endpoints are made once the drones are known.

        Raises:
            FieldError: If one does not.
        """
        for name in self._overrides.keys() & self._node.typed_names:
            if not later or f"/{later}." not in of_drones(name):
                raise FieldError(f"{name} matches no topic of {self._node.get_name()}")

    def _profile(self, entity: str, topic: str, qos: QoSProfile) -> QoSProfile:
        prefix = f"{QOS_PREFIX}{self._node.resolve_topic_name(topic)}.{entity}."
        names = [name for name in self._overrides if name.startswith(prefix)]
        if not names:
            return qos
        policies = {name.removeprefix(prefix): self._overrides.pop(name) for name in names}
        check_known(prefix.rstrip("."), policies, _POLICIES)
        specs = {prefix + policy: _POLICIES[policy][0] for policy in policies}
        values = {
            prefix + policy: specs[prefix + policy].check(prefix + policy, value)
            for policy, value in policies.items()
        }
        declare(self._node, specs, values)
        changed = {policy: _POLICIES[policy][1](values[prefix + policy]) for policy in policies}
        if qos is COMMANDS and changed.get("durability") == DurabilityPolicy.TRANSIENT_LOCAL:
            raise FieldError(
                f"{prefix}durability must be volatile, because an old command must not take "
                "effect, got 'transient_local'"
            )
        return QoSProfile(**{policy: getattr(qos, policy) for policy in _POLICIES} | changed)


def read_settings(node: AlarmNode, kind: type[T]) -> tuple[T, Endpoints]:
    """Declare a node's parameters; return its settings of this class, and its endpoints.

    Raises:
        FieldError: If a parameter is not allowed.
    """
    known = specs(kind)
    values, qos = node.take_overrides(known)
    settings = kind(**values)
    declare(node, known, vars(settings))
    return settings, Endpoints(node, qos)
