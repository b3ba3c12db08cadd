# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Passes messages between the thread of the ROS node and that of the page, at little cost.

The node's thread only stores the bytes of messages here. The page deserializes them a few times a
second, and for most topics only the last message.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from typing import Any, NamedTuple

from dsse_ros.screens.dashboard.service_calls import Command


class Received(NamedTuple):
    """A message.

    Attributes:
        namespace: Of the simulation, "" for none.
        topic: Relative to it.
        read: Returns the message.
        published_ns: Wall time of its publication, on the clock of its publisher.
    """

    namespace: str
    topic: str
    read: Callable[[], Any]
    published_ns: int = 0


class Inbox:
    """Messages for the page, and commands for the node.

    Args:
        complete: Topics of which every message is kept; of other topics only the last one is.
    """

    def __init__(self, complete: Collection[str]) -> None:
        self._complete = frozenset(complete)
        self._lock = threading.Lock()
        self._messages: dict[object, Received] = {}
        self._commands: list[Command] = []

    def put(self, received: Received) -> None:
        """Leave a message for the page."""
        of_all = received.topic in self._complete
        key = object() if of_all else (received.namespace, received.topic)
        with self._lock:
            # Insert it at the end, in the order of arrival.
            self._messages.pop(key, None)
            self._messages[key] = received

    def take(self) -> list[Received]:
        """Return the messages since the last call, in the order in which they came."""
        with self._lock:
            messages, self._messages = self._messages, {}
        return list(messages.values())

    def command(self, command: Command) -> None:
        """Leave a command for the node."""
        with self._lock:
            self._commands.append(command)

    def take_commands(self) -> list[Command]:
        """Return the commands since the last call."""
        with self._lock:
            commands, self._commands = self._commands, []
        return commands
