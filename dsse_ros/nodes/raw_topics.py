# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""All topics of a mission as bytes: found as they appear, taken in batches."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription

from dsse_ros.recording.offered_qos import common
from dsse_ros.recording.schemas import definition, message_class
from dsse_ros.runtime.polling import RawMessage, polling_node, spun_by_nobody, take_all
from dsse_ros.search import FieldError

OF_ALL = ("/clock", "/diagnostics", "/tf", "/tf_static")
"""Topics that all missions of a domain share."""
NOT_OF_A_MISSION = ("/parameter_events", "/rosout")
_DEPTH = 1000
"""Messages of a topic that may wait to be taken."""


class RawTopics:
    """The topics of a namespace, and those that all missions share, all subscribed or some of them.

    Args:
        node: Whose namespace it is, and who logs; in the root namespace all topics count.
        warn: Logs a line of a kind.
        exclude: Patterns of topics that are left out.

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
        # Subscribed with the QoS of other listeners, as nobody had published yet.
        self._without_publisher: set[str] = set()
        self._refused: set[str] = set()
        self._waiting: list[RawMessage] = []

    def discover(self) -> list[str]:
        """Subscribe topics that are new, and return their names."""
        self.find()
        new = [topic for topic in self.types if topic not in self._subscriptions]
        return [topic for topic in new if self.subscribe(topic)]

    def find(self) -> list[str]:
        """Return the names of topics that are new, without subscribing them."""
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
        """Subscribe a topic that was found; return whether there is anybody on it."""
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

    def offers(self, topic: str) -> list[Any]:
        """Return what is known of the publishers of a topic, rclpy's TopicEndpointInfo each."""
        return list(self._node.get_publishers_info_by_topic(topic))

    def take(self) -> list[RawMessage]:
        """Return what has come since, in the order in which it was received."""
        # What comes meanwhile, on a topic that had its turn or on one that has not, is for later.
        until_ns = time.time_ns()
        for subscription in self._subscriptions.values():
            self._waiting += take_all(subscription)
        self._waiting.sort(key=lambda message: message.received_ns)
        ready = len(self._waiting)
        while ready and self._waiting[ready - 1].received_ns > until_ns:
            ready -= 1
        taken, self._waiting = self._waiting[:ready], self._waiting[ready:]
        return taken

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
            # Who gets the bytes needs to know what they are.
            definition(type_name)
        except FieldError as error:
            self._refused.add(topic)
            self._warn(topic, f"{topic} is left out: {error}")
            return False
        return True

    def _subscribe_anew(self, topic: str) -> None:
        """Subscribe with what the publishers offer, if that is something else."""
        profiles = self._profiles(topic)
        self._without_publisher.discard(topic)
        subscription = self._subscriptions[topic]
        if profiles and common(profiles, _DEPTH) != subscription.qos_profile:
            self._waiting += take_all(subscription)
            self.unsubscribe(topic)
            self.subscribe(topic)

    def _profiles(self, topic: str) -> list[QoSProfile]:
        """Return what publishers offer, or what others ask for where nobody publishes."""
        offered = [info.qos_profile for info in self.offers(topic)]
        if not offered:
            self._without_publisher.add(topic)
        listeners = self._node.get_subscriptions_info_by_topic(topic)
        own = self._node.get_name()
        return offered or [one.qos_profile for one in listeners if one.node_name != own]
