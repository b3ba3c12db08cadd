# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros foxglove_viewer`: serves the topics of a mission to Foxglove."""

from __future__ import annotations

import sys
from collections import Counter, deque
from ipaddress import ip_address

import foxglove
from foxglove.websocket import (
    Capability,
    ChannelView,
    Client,
    ServerListener,
    WebSocketServer,
)

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.recording.schemas import definition
from dsse_ros.ros.nodes.raw_topics import RawTopics
from dsse_ros.ros.nodes.settings import ViewerSettings
from dsse_ros.ros.runtime.qos import read_settings
from dsse_ros.ros.runtime.run_node import AlarmNode, run_node

DISCOVERY_PERIOD_S = 0.2
TAKE_PERIOD_S = 0.05


class _Requests(ServerListener):
    """Queues the requests of clients for the node, because the server has its own threads.

    Attributes:
        changes: Subscriptions that have begun (True) or ended: client, topic.
    """

    def __init__(self) -> None:
        self.changes: deque[tuple[bool, int, str]] = deque()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Queue the start of a subscription."""
        self.changes.append((True, client.id, channel.topic))

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Queue the end of a subscription."""
        self.changes.append((False, client.id, channel.topic))


class ViewerNode(AlarmNode):
    """Serves the topics of its namespace to clients of a WebSocket.

    It subscribes to a topic only while a client wants it. Clients can only read: the server does
    not know which page of a browser a client is.

    Raises:
        FieldError: If a parameter is not allowed, or nothing can be served there.
    """

    def __init__(self) -> None:
        super().__init__("foxglove_viewer")
        self.settings, endpoints = read_settings(self, ViewerSettings)
        endpoints.check_all_used()
        self._requests = _Requests()
        # The clients that want each topic, and the last message of each latched topic.
        self._wanted: dict[str, Counter[int]] = {}
        self._last: dict[str, bytes] = {}
        self._channels: dict[str, foxglove.Channel] = {}
        self._broadcast_ns = 0
        self._sdk_context = foxglove.Context()
        self._server = self._serve()
        self._topics = RawTopics(self, self.warn, self.settings.exclude)
        self.at_end(self._topics.destroy)
        self.at_end(self._server.stop)
        self.alarms.make(self._discover).repeat(DISCOVERY_PERIOD_S)
        self.alarms.make(self._turn).repeat(TAKE_PERIOD_S)
        self._discover()

    @property
    def _sim_time(self) -> bool:
        return bool(self.get_parameter("use_sim_time").value)

    def _serve(self) -> WebSocketServer:
        settings = self.settings
        try:
            server = foxglove.start_server(
                name=f"dsse_ros {self.get_namespace()}",
                host=settings.host,
                port=settings.port,
                capabilities=[Capability.Time] if self._sim_time else [],
                server_listener=self._requests,
                context=self._sdk_context,
            )
        except RuntimeError as error:
            place = f"{settings.host!r}, port: {settings.port}"
            raise FieldError(f"host: {place}: {' '.join(str(error).split())}") from None
        url = f"ws://{settings.host}:{server.port}"
        self.get_logger().info(f"serving {self.get_namespace()} to Foxglove at {url}")
        if not _is_loopback(settings.host):
            self.get_logger().warning(f"anybody who can reach {url} may read, without a password")
        return server

    def _discover(self) -> None:
        """Offer the topics that are new."""
        for topic in self._topics.find():
            name = self._topics.types[topic]
            schema = foxglove.Schema(
                name=name, encoding="ros2msg", data=definition(name).encode("utf-8")
            )
            self._channels[topic] = foxglove.Channel(
                topic, schema=schema, message_encoding="cdr", context=self._sdk_context
            )
        for topic in self._wanted:
            if not self._topics.is_subscribed(topic):
                # It had no publisher to subscribe to before.
                self._topics.subscribe(topic)

    def _turn(self) -> None:
        """Handle the requests of clients, and send them the new messages."""
        while self._requests.changes:
            begun, client, topic = self._requests.changes.popleft()
            (self._begin if begun else self._end)(client, topic)
        now_ns = self.get_clock().now().nanoseconds
        if self._sim_time and now_ns != self._broadcast_ns:
            self._broadcast_ns = now_ns
            self._server.broadcast_time(now_ns)
        for message in self._topics.take():
            if message.topic in self._wanted:
                self._channels[message.topic].log(message.data, log_time=now_ns)
                if self._topics.is_latched(message.topic):
                    self._last[message.topic] = message.data

    def _begin(self, client: int, topic: str) -> None:
        """Subscribe to a topic, or send its last message to a later client."""
        if topic not in self._wanted:
            self._wanted[topic] = Counter()
            self._topics.subscribe(topic)
        elif topic in self._last:
            now_ns = self.get_clock().now().nanoseconds
            self._channels[topic].log(self._last[topic], log_time=now_ns, sink_id=client)
        self._wanted[topic][client] += 1

    def _end(self, client: int, topic: str) -> None:
        clients = self._wanted.get(topic, Counter())
        clients -= Counter([client])
        if topic in self._wanted and not clients:
            del self._wanted[topic]
            self._last.pop(topic, None)
            if self._topics.is_subscribed(topic):
                self._topics.unsubscribe(topic)


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""
    return run_node("foxglove_viewer", ViewerNode, argv)


if __name__ == "__main__":
    sys.exit(main())
