# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros foxglove_viewer`: serves the topics of a mission to Foxglove."""

from __future__ import annotations

import sys
import time
from collections import Counter, deque
from ipaddress import ip_address
from typing import NamedTuple

import foxglove
from foxglove.websocket import (
    Capability,
    ChannelView,
    Client,
    ClientChannel,
    ServerListener,
    WebSocketServer,
)
from rclpy.publisher import Publisher

from dsse_ros.nodes.client_commands import ENCODINGS, check_offer, command_type, read_command
from dsse_ros.nodes.client_services import ClientServices
from dsse_ros.nodes.raw_topics import RawTopics
from dsse_ros.nodes.settings import ViewerSettings
from dsse_ros.recording.schemas import definition, message_class
from dsse_ros.runtime.qos import COMMANDS, read_settings
from dsse_ros.runtime.run_node import AlarmNode, run_node
from dsse_ros.search import FieldError

DISCOVERY_PERIOD_S = 0.2
TAKE_PERIOD_S = 0.05
MATCHED_S = 5.0
"""Wall time in which a new publisher must have found a subscriber."""
_WAITING = 1000
"""Limit of waiting messages from clients; above it, the oldest are dropped."""


class _Offer(NamedTuple):
    """A client's advertisement of a channel."""

    topic: str
    schema_name: str
    encoding: str


class _Requests(ServerListener):
    """Queues the requests of clients for the node, because the server has its own threads.

    Attributes:
        changes: Subscriptions that have begun (True) or ended: client, topic.
        messages: Messages from clients: the offer, the bytes, and when they came.
    """

    def __init__(self) -> None:
        self.changes: deque[tuple[bool, int, str]] = deque()
        self.messages: deque[tuple[_Offer, bytes, float]] = deque(maxlen=_WAITING)
        self._offers: dict[tuple[int, int], _Offer] = {}

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Queue the begin of a subscription."""
        self.changes.append((True, client.id, channel.topic))

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Queue the end of a subscription."""
        self.changes.append((False, client.id, channel.topic))

    def on_client_advertise(self, client: Client, channel: ClientChannel) -> None:
        """Record what the client will send."""
        offer = _Offer(channel.topic, channel.schema_name, channel.encoding)
        self._offers[client.id, channel.id] = offer

    def on_client_unadvertise(self, client: Client, client_channel_id: int) -> None:
        """Forget what the client offered to send."""
        self._offers.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Client, client_channel_id: int, data: bytes) -> None:
        """Queue a message, if the client has offered its channel."""
        offer = self._offers.get((client.id, client_channel_id))
        if offer is not None:
            self.messages.append((offer, data, time.monotonic()))


class ViewerNode(AlarmNode):
    """Serves the topics of its namespace to clients of a WebSocket.

    It subscribes to a topic only while a client wants it.

    Raises:
        FieldError: If a parameter is not allowed, or nothing can be served there.
    """

    def __init__(self) -> None:
        super().__init__("foxglove_viewer")
        self.settings, endpoints = read_settings(self, ViewerSettings)
        endpoints.check_all_used()
        self._namespace = self.get_namespace().rstrip("/") + "/"
        self._requests = _Requests()
        # The clients that want each topic, and the last message of each latched topic.
        self._wanted: dict[str, Counter[int]] = {}
        self._last: dict[str, bytes] = {}
        self._channels: dict[str, foxglove.Channel] = {}
        self._commands: dict[str, Publisher] = {}
        self._broadcast_ns = 0
        self._sdk_context = foxglove.Context()
        self._server = self._serve()
        self._client_services: ClientServices | None = None
        if self.settings.accept_commands:
            self._client_services = ClientServices(self, self._namespace.rstrip("/"), self._server)
        self._topics = RawTopics(self, self.warn, self.settings.exclude)
        self.alarms.make(self._discover).repeat(DISCOVERY_PERIOD_S)
        self.alarms.make(self._turn).repeat(TAKE_PERIOD_S)
        self._discover()

    @property
    def _sim_time(self) -> bool:
        return bool(self.get_parameter("use_sim_time").value)

    def _serve(self) -> WebSocketServer:
        settings = self.settings
        capabilities = [Capability.Time] if self._sim_time else []
        if settings.accept_commands:
            capabilities += [Capability.ClientPublish, Capability.Services]
        try:
            server = foxglove.start_server(
                name=f"dsse_ros {self.get_namespace()}",
                host=settings.host,
                port=settings.port,
                capabilities=capabilities,
                server_listener=self._requests,
                supported_encodings=list(ENCODINGS),
                context=self._sdk_context,
            )
        except RuntimeError as error:
            place = f"{settings.host!r}, port: {settings.port}"
            raise FieldError(f"host: {place}: {' '.join(str(error).split())}") from None
        url = f"ws://{settings.host}:{server.port}"
        self.get_logger().info(f"serving {self.get_namespace()} to Foxglove at {url}")
        if not _is_loopback(settings.host):
            may = "read and command" if settings.accept_commands else "read"
            self.get_logger().warning(f"anybody who can reach {url} may {may}, without a password")
        return server

    def _discover(self) -> None:
        """Offer the topics and services that are new."""
        if self._client_services is not None:
            self._client_services.discover()
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
        self._take_commands()
        if self._client_services is not None:
            self._client_services.turn()
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

    def _take_commands(self) -> None:
        """Publish the commands that clients have sent."""
        messages = self._requests.messages
        later = []
        while messages:
            offer, data, since_s = messages.popleft()
            try:
                if not self._command(offer, data):
                    if time.monotonic() - since_s > MATCHED_S:
                        raise FieldError("no node subscribes to it")
                    later.append((offer, data, since_s))
            except FieldError as error:
                self._refuse(f"refused from a client: {offer.topic}: {error}")
        messages.extendleft(reversed(later))

    def _command(self, offer: _Offer, data: bytes) -> bool:
        """Publish a command; return whether it has a subscriber.

        Raises:
            FieldError: If it is not a command.
        """
        type_name = command_type(self._namespace, offer.topic)
        check_offer(type_name, offer.schema_name, offer.encoding)
        message = read_command(type_name, offer.encoding, data)
        if offer.topic not in self._commands:
            if not self.count_subscribers(offer.topic):
                raise FieldError("no node subscribes to it")
            self._commands[offer.topic] = self.create_publisher(
                message_class(type_name), offer.topic, COMMANDS
            )
        publisher = self._commands[offer.topic]
        if not publisher.get_subscription_count():
            return False
        publisher.publish(message)
        return True

    def _refuse(self, text: str) -> None:
        self.warn("refused", text)
        self._server.publish_status(text, foxglove.StatusLevel.Warning, "refused")

    def destroy_node(self) -> None:
        """Disconnect the clients, and end the node."""
        self._server.stop()
        self._topics.destroy()
        super().destroy_node()


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
