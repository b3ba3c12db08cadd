# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""All topics of a mission as bytes: discovered as they appear, taken in batches."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription

from dsse_ros.base.fields import FieldError
from dsse_ros.base.message_types import message_class
from dsse_ros.mission.recording.offered_qos import common
from dsse_ros.mission.recording.schemas import definition
from dsse_ros.ros.runtime.arrivals import Arrivals, MachineClocks
from dsse_ros.ros.runtime.polling import RawMessage, polling_node, spun_by_nobody, take_all
from msg_adapters.topics import TOPICS

OF_ALL = tuple(name for name in TOPICS if name.startswith("/"))
"""Topics that all missions of a domain share."""
NOT_OF_A_MISSION = ("/parameter_events", "/rosout")
_DEPTH = 1000
"""Messages of a topic that may wait to be taken."""


class RawTopics:
    """Subscriptions to topics of a namespace, and to those that all missions share.

    Args:
        node: Node whose namespace counts, and which logs; the root namespace has all topics.
        warn: Logs a line of a kind.
        exclude: Patterns of topics to leave out.

    Attributes:
        types: Names of the types of the topics found so far, by topic.
    """

    def __init__(
        self, node: Node, warn: Callable[[str, str], None], exclude: Sequence[str] = ()
    ) -> None:
        self._node = polling_node(node)
        self._prefix = node.get_namespace().rstrip("/") + "/"
        self._warn = warn
        self._exclude = exclude
        self.types: dict[str, str] = {}
        self._subscriptions: dict[str, Subscription] = {}
        # Subscribed with the QoS of other subscribers, because the topic had no publisher yet.
        self._without_publisher: set[str] = set()
        self._refused: set[str] = set()
        self._taken: list[RawMessage] = []
        self._arrivals = Arrivals()

    def discover(self) -> list[str]:
        """Subscribe to new topics, and return their names."""
        self.find()
        new = [topic for topic in self.types if topic not in self._subscriptions]
        return [topic for topic in new if self.subscribe(topic)]

    def find(self) -> list[str]:
        """Return the names of new topics, without subscribing to them."""
        new = []
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self.types:
                if topic in self._without_publisher and self._node.count_publishers(topic):
                    self._subscribe_anew(topic)
            elif self._is_wanted(topic) and self._is_known(topic, types[0]):
                self.types[topic] = types[0]
                new.append(topic)
        return new

    def subscribe(self, topic: str) -> bool:
        """Subscribe to a discovered topic; return whether it has any endpoint."""
        profiles = self._profiles(topic)
        if not profiles:
            # All have gone again.
            self._without_publisher.discard(topic)
            return False
        kind = message_class(self.types[topic])
        self._subscriptions[topic] = self._node.create_subscription(
            kind, topic, spun_by_nobody, common(profiles, _DEPTH), raw=True
        )
        return True

    def unsubscribe(self, topic: str) -> None:
        """End the subscription of a topic."""
        self._node.destroy_subscription(self._subscriptions.pop(topic))
        self._without_publisher.discard(topic)

    def is_subscribed(self, topic: str) -> bool:
        """Return whether a topic is subscribed."""
        return topic in self._subscriptions

    def is_latched(self, topic: str) -> bool:
        """Return whether late joiners get the last messages of a topic that is subscribed."""
        profile = self._subscriptions[topic].qos_profile
        return bool(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)

    def num_publishers(self, topic: str) -> int:
        """Return the number of publishers that a topic has now."""
        return int(self._node.count_publishers(topic))

    def offers(self, topic: str) -> list[Any]:
        """Return rclpy's TopicEndpointInfo of each publisher of a topic."""
        return list(self._node.get_publishers_info_by_topic(topic))

    def take(self) -> list[RawMessage]:
        """Return the new messages in the order of their arrival, see `Arrivals`."""
        before, taken = MachineClocks.read(), self._taken
        for subscription in self._subscriptions.values():
            taken += take_all(subscription)
        self._taken = []
        arrived = self._arrivals.order(taken, before, time.time_ns())
        if self._arrivals.stepped_ns:
            self._warn(
                "clock",
                f"the clock has stepped back by {self._arrivals.stepped_ns / 1e9:.3f} s; the times "
                "of messages go on as if it had not",
            )
        return arrived

    def destroy(self) -> None:
        """End all subscriptions."""
        self._subscriptions.clear()
        self._node.destroy_node()

    def _is_wanted(self, topic: str) -> bool:
        if topic in NOT_OF_A_MISSION or topic in self._refused or "/_" in topic:
            return False
        if any(fnmatchcase(topic, pattern) for pattern in self._exclude):
            return False
        return topic.startswith(self._prefix) or topic in OF_ALL

    def _is_known(self, topic: str, type_name: str) -> bool:
        try:
            message_class(type_name)
            # The receiver of the bytes needs the definition of the type.
            definition(type_name)
        except FieldError as error:
            self._refused.add(topic)
            self._warn(topic, f"{topic} is left out: {error}")
            return False
        return True

    def _subscribe_anew(self, topic: str) -> None:
        """Subscribe again with the QoS of the publishers, if it differs."""
        profiles = self._profiles(topic)
        self._without_publisher.discard(topic)
        subscription = self._subscriptions[topic]
        if profiles and common(profiles, _DEPTH) != subscription.qos_profile:
            self._taken += take_all(subscription)
            self.unsubscribe(topic)
            self.subscribe(topic)

    def _profiles(self, topic: str) -> list[QoSProfile]:
        """Return the QoS of the publishers, or that of other subscribers if there are none."""
        offered = [info.qos_profile for info in self.offers(topic)]
        if not offered:
            self._without_publisher.add(topic)
        listeners = self._node.get_subscriptions_info_by_topic(topic)
        own = self._node.get_name()
        return offered or [
            listener.qos_profile for listener in listeners if listener.node_name != own
        ]
