# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A client of the WebSocket protocol of Foxglove (github.com/foxglove/ws-protocol)."""

from __future__ import annotations

import contextlib
import json
import re
import struct
from collections import defaultdict
from typing import Any

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rig import Process, Rig
from websockets.sync.client import connect
from websockets.typing import Subprotocol

_MESSAGE, _TIME = 1, 2
_REQUEST = 2
_SUBSCRIBE, _ADVERTISE = "subscribe", "advertise"


class FoxgloveClient:
    """A connected client.

    Attributes:
        port: That of the server.
        info: What the server says of itself.
        channels: What it offers, by topic.
        messages: What has come, decoded by the schemas that it sends, by topic.
        refusals: Why it has refused what the client sent.
        time_ns: Its time, None before it has sent any.
    """

    def __init__(self, rig: Rig, viewer: Process) -> None:
        self._rig = rig
        found = rig.until(lambda: re.search(r"ws://[\d.]+:(\d+)\n", viewer.output), "a server")
        self.port = int(found[1])
        self._stack = contextlib.ExitStack()
        self._socket = self._stack.enter_context(
            connect(
                found[0].strip(),
                subprotocols=[Subprotocol("foxglove.sdk.v1")],
                max_size=None,
                compression=None,
            )
        )
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[Any]] = defaultdict(list)
        self.refusals: list[str] = []
        self.time_ns: int | None = None
        self._of_subscription: dict[int, str] = {}
        self._decoders: dict[str, Any] = {}
        self._offers = 0
        self.until(lambda: self.info, "serverInfo")

    def close(self) -> None:
        """Leave."""
        self._stack.close()

    def until(self, condition: Any, what: str) -> Any:
        """Return the condition's value as soon as it is true, taking what comes meanwhile."""

        def held() -> Any:
            self._take()
            return condition()

        return self._rig.until(held, what)

    def subscribe(self, topic: str) -> None:
        """Subscribe a topic once it is offered, if it is not subscribed."""
        if topic in self._of_subscription.values():
            return
        channel = self.until(lambda: self.channels.get(topic), f"channel {topic}")
        self._decoders[topic] = DecoderFactory().decoder_for(
            channel["encoding"],
            Schema(
                id=1,
                name=channel["schemaName"],
                encoding=channel["schemaEncoding"],
                data=channel["schema"].encode(),
            ),
        )
        number = channel["id"] + 1000
        self._of_subscription[number] = topic
        self.send(_SUBSCRIBE, subscriptions=[{"id": number, "channelId": channel["id"]}])

    def unsubscribe(self, topic: str) -> None:
        """End a subscription."""
        numbers = [n for n, one in self._of_subscription.items() if one == topic]
        self.send("unsubscribe", subscriptionIds=numbers)
        for number in numbers:
            del self._of_subscription[number]

    def first(self, topic: str) -> Any:
        """Subscribe a topic and return its first message."""
        self.subscribe(topic)
        return self.until(lambda: self.messages[topic], f"a message on {topic}")[0]

    def publish(self, topic: str, schema_name: str, data: Any) -> None:
        """Offer a channel, and send a message on it as JSON."""
        self._offers += 1
        number = self._offers
        offer = {"id": number, "topic": topic, "encoding": "json", "schemaName": schema_name}
        self.send(_ADVERTISE, channels=[offer])
        self._socket.send(struct.pack("<BI", _MESSAGE, number) + json.dumps(data).encode())

    def request(self, service: int, data: Any) -> None:
        """Call a service by its number."""
        head = struct.pack("<BIII", _REQUEST, service, 1, len("json"))
        self._socket.send(head + b"json" + json.dumps(data).encode())

    def send(self, op: str, **values: Any) -> None:
        """Send an order of the protocol."""
        self._socket.send(json.dumps({"op": op, **values}))

    def send_raw(self, data: bytes | str) -> None:
        """Send what need not be of the protocol."""
        self._socket.send(data)

    def _take(self) -> None:
        while True:
            try:
                data = self._socket.recv(timeout=0)
            except TimeoutError:
                return
            if isinstance(data, str):
                self._take_order(json.loads(data))
            elif data[0] == _MESSAGE:
                number, _ = struct.unpack_from("<IQ", data, 1)
                topic = self._of_subscription.get(number)
                # It may have ended while the message was on its way.
                if topic is not None:
                    self.messages[topic].append(self._decoders[topic](data[13:]))
            elif data[0] == _TIME:
                (self.time_ns,) = struct.unpack_from("<Q", data, 1)

    def _take_order(self, order: dict[str, Any]) -> None:
        match order["op"]:
            case "serverInfo":
                self.info = order
            case "advertise":
                self.channels |= {channel["topic"]: channel for channel in order["channels"]}
            case "serviceCallFailure" | "status":
                self.refusals.append(order["message"])
