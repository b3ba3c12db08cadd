# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Inputs of a live search from the page: sent once, and answered like a call of a service."""

from __future__ import annotations

import contextlib
from typing import Any

from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_msgs.msg import String

from dsse_ros.base.json_reader import read_json
from dsse_ros.ros.runtime.qos import offered
from dsse_ros.world.scenario.live_texts import answer_from_json
from msg_adapters.topics import published_by

ANSWERS = "live/answers"
"""Topic of the answers to inputs, relative to the namespace of the simulation."""
INPUTS = tuple(
    name.removeprefix("live/") for name in published_by("dashboard") if name.startswith("live/")
)
"""Kinds of inputs that the page sends."""
Awaited = dict[tuple[str, str], list[Future]]
"""Futures of answers, by namespace and identity of the input, in the order of sending."""


class InputDoor:
    """Publishes inputs of one kind; a client as the `Caller` of the page's service calls has it.

    Args:
        node: Node of the publisher.
        namespace: Of the simulation.
        kind: Kind of the inputs.
        awaited: Receives the futures of the answers.
    """

    def __init__(self, node: Node, namespace: str, kind: str, awaited: Awaited) -> None:
        topic = f"live/{kind}"
        message_type, qos = offered(topic, "dashboard")
        self.publisher = node.create_publisher(message_type, f"{namespace}/{topic}", qos)
        self._namespace, self._awaited = namespace, awaited

    def service_is_ready(self) -> bool:
        """Return whether somebody takes inputs."""
        return self.publisher.get_subscription_count() > 0

    def call_async(self, request: Any) -> Future:
        """Send the text of an input; return the future of its answer."""
        future: Future = Future()
        key = self._namespace, str(read_json(request, "request")["id"])
        self._awaited.setdefault(key, []).append(future)
        self.publisher.publish(String(data=request))
        return future

    def remove_pending_request(self, future: Future) -> None:
        """Stop waiting for an answer."""
        for key, futures in list(self._awaited.items()):
            if future in futures:
                futures.remove(future)
            if not futures:
                del self._awaited[key]


def take_answer(awaited: Awaited, namespace: str, data: bytes) -> None:
    """Pass an answer, a serialized message, to the request that has waited longest."""
    if not awaited:
        return
    # The page shows what is wrong with a malformed answer.
    with contextlib.suppress(Exception):
        answer = answer_from_json(deserialize_message(data, String).data)
        futures = awaited.get((namespace, answer.id), [])
        if futures:
            futures.pop(0).set_result(answer)
        if not futures:
            awaited.pop((namespace, answer.id), None)
