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

_MESSAGE, _TIME, _RESPONSE = 1, 2, 3
_REQUEST = 2
_SUBSCRIBE, _ADVERTISE = "subscribe", "advertise"


class FoxgloveClient:
    """A connected client.

    Attributes:
        port: That of the server.
        info: What the server says of itself.
        channels: What it offers, by topic.
        services: Those that it offers, by name.
        messages: What has come, decoded by the schemas that it sends, by topic.
        status: What it has complained about.
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
        self.services: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[Any]] = defaultdict(list)
        self.status: list[str] = []
        self.time_ns: int | None = None
        self._of_subscription: dict[int, str] = {}
        self._decoders: dict[str, Any] = {}
        self._offered: dict[str, int] = {}
        self._answers: dict[int, Any] = {}
        self._calls = 0
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

    def publish(self, topic: str, schema_name: str, data: Any, encoding: str = "json") -> None:
        """Send a message; an object as JSON."""
        key = f"{topic} {schema_name} {encoding}"
        if key not in self._offered:
            number = self._offered[key] = len(self._offered) + 1
            offer = {
                "id": number, "topic": topic, "encoding": encoding, "schemaName": schema_name,
            }  # fmt: skip
            self.send(_ADVERTISE, channels=[offer])
        payload = data if isinstance(data, bytes) else json.dumps(data).encode()
        self._socket.send(struct.pack("<BI", _MESSAGE, self._offered[key]) + payload)

    def call(self, name: str, request: Any, encoding: str = "json") -> dict[str, Any] | str:
        """Call a service once it is offered; returns its response, or why there is none."""
        service = self.until(lambda: self.services.get(name), f"service {name}")
        self._calls += 1
        number, payload = self._calls, request
        if not isinstance(payload, bytes):
            payload = json.dumps(payload).encode()
        head = struct.pack("<BIII", _REQUEST, service["id"], number, len(encoding))
        self._socket.send(head + encoding.encode() + payload)
        self.until(lambda: number in self._answers, f"an answer of {name}")
        answer: dict[str, Any] | str = self._answers.pop(number)
        return answer

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
            elif data[0] == _RESPONSE:
                _, call, length = struct.unpack_from("<III", data, 1)
                self._answers[call] = json.loads(data[13 + length :])
            elif data[0] == _TIME:
                (self.time_ns,) = struct.unpack_from("<Q", data, 1)

    def _take_order(self, order: dict[str, Any]) -> None:
        match order["op"]:
            case "serverInfo":
                self.info = order
            case "advertise":
                self.channels |= {channel["topic"]: channel for channel in order["channels"]}
            case "advertiseServices":
                self.services |= {service["name"]: service for service in order["services"]}
            case "unadvertiseServices":
                left = self.services.items()
                gone = order["serviceIds"]
                self.services = {name: one for name, one in left if one["id"] not in gone}
            case "serviceCallFailure":
                self._answers[order["callId"]] = order["message"]
            case "status":
                self.status.append(order["message"])
