# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions whose messages wait until they are taken.

For consumers that read messages in batches, or need only the last one: waking up for each message
costs several times as much.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

from rclpy.node import Node
from rclpy.subscription import Subscription


class RawMessage(NamedTuple):
    """A received message, not deserialized.

    Attributes:
        topic: Its topic.
        data: The message in CDR.
        received_ns: Wall time at which it was received.
        published_ns: Wall time at which it was published.
        sequence: Sequence number of its publisher.
    """

    topic: str
    data: bytes
    received_ns: int
    published_ns: int
    sequence: int


def polling_node(node: Node) -> Node:
    """Return a node beside another one, for subscriptions that no executor spins."""
    return Node(
        f"_{node.get_name()}_topics",
        namespace=node.get_namespace(),
        context=node.context,
        # Arguments of the command line and parameters belong to the other node.
        use_global_arguments=False,
        enable_rosout=False,
        start_parameter_services=False,
    )


def take_all(subscription: Subscription) -> Iterator[RawMessage]:
    """Yield the new messages of a subscription, at most as many as its depth."""
    handle, kind = subscription.handle, subscription.msg_type
    topic = subscription.topic_name
    with handle:
        while (taken := handle.take_message(kind, True)) is not None:
            data, info = taken
            yield RawMessage(
                topic,
                data,
                info["received_timestamp"] or time.time_ns(),
                info["source_timestamp"],
                info["publication_sequence_number"] or 0,
            )


def spun_by_nobody(message: bytes) -> None:
    """Stand in for the callback of a subscription whose messages are taken."""
    raise AssertionError("a subscription whose messages are taken")
