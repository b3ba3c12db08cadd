# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The operator services of a bridge, for clients of a viewer."""

from __future__ import annotations

import time
from collections import deque
from concurrent.futures import Future, TimeoutError
from dataclasses import dataclass
from functools import partial
from typing import Any

import foxglove
from foxglove.websocket import (
    MessageSchema,
    Service,
    ServiceRequest,
    ServiceSchema,
    WebSocketServer,
)
from rclpy.node import Node

from dsse_ros.nodes.client_commands import SERVICE_SCHEMAS, read_request, response_bytes
from dsse_ros.nodes.operator_services import OPERATOR_SERVICES, find_bridges, service_name
from dsse_ros.search import FieldError

ANSWER_S = 5.0
"""Wall time in which a bridge must answer."""


@dataclass(frozen=True)
class _Call:
    """A service call that a client waits for.

    Attributes:
        name: Full name of the service.
        request: The request.
        answer: Receives the response.
        deadline_s: When the client stops waiting, on a steady clock.
    """

    name: str
    request: Any
    answer: Future[bytes]
    deadline_s: float


class ClientServices:
    """Offers the services of a bridge while it is running.

    The server calls from its own threads: requests wait until the node has time for them.

    Args:
        node: Node that calls the bridge.
        namespace: Namespace of the mission, "" for the root.
        server: Server that offers the services to clients.
    """

    def __init__(self, node: Node, namespace: str, server: WebSocketServer) -> None:
        self._node, self._namespace, self._server = node, namespace, server
        self._callers: dict[str, Any] = {}
        self._offered: frozenset[tuple[str, str]] = frozenset()
        self._new: deque[_Call] = deque()
        self._waiting: list[_Call] = []

    def discover(self) -> None:
        """Offer the services that exist."""
        bridge = find_bridges(self._node).get(self._namespace)
        found: frozenset[tuple[str, str]] = frozenset()
        if bridge is not None:
            found = frozenset(
                (service_name(self._namespace, bridge, drone, what), what)
                for drone in ("", *bridge.drones)
                for what in OPERATOR_SERVICES
            )
        gone = [name for name, _ in self._offered - found]
        if gone:
            self._server.remove_services(gone)
        for name in gone:
            self._node.destroy_client(self._callers.pop(name))
        new = sorted(found - self._offered)
        for name, what in new:
            # Create the client now, so that it has discovered the bridge before the first call.
            self._callers[name] = self._node.create_client(OPERATOR_SERVICES[what], name)
        if new:
            self._server.add_services([self._service(name, what) for name, what in new])
        self._offered = found

    def _service(self, name: str, what: str) -> Service:
        request, response = (
            MessageSchema(
                encoding="json",
                schema=foxglove.Schema(name=title, encoding="jsonschema", data=schema.encode()),
            )
            for title, schema in SERVICE_SCHEMAS[what]
        )
        schema = ServiceSchema(name=SERVICE_SCHEMAS[what][0][0].removesuffix("_Request"),
                               request=request, response=response)  # fmt: skip
        return Service(name=name, schema=schema, handler=partial(self._call, name, what))

    def _call(self, name: str, what: str, request: ServiceRequest) -> bytes:
        """Return the bridge's response; runs in a thread of the server.

        Raises:
            FieldError: If the request is not valid, or nobody answers it.
        """
        read = read_request(what, request.payload)
        call = _Call(name, read, Future(), time.monotonic() + ANSWER_S)
        self._new.append(call)
        try:
            return call.answer.result(2.0 * ANSWER_S)
        except TimeoutError:
            raise FieldError(f"{name}: no answer within {ANSWER_S:g} s") from None

    def turn(self) -> None:
        """Send the requests of clients to the bridge."""
        while self._new:
            self._waiting.append(self._new.popleft())
        waiting, self._waiting = self._waiting, []
        for call in waiting:
            caller = self._callers.get(call.name)
            if caller is not None and caller.service_is_ready():
                caller.call_async(call.request).add_done_callback(partial(self._answer, call))
            elif time.monotonic() > call.deadline_s:
                call.answer.set_exception(FieldError(f"{call.name}: nobody serves it"))
            else:
                self._waiting.append(call)

    def _answer(self, call: _Call, response: Any) -> None:
        result = response.result()
        self._node.get_logger().info(f"{call.name}, called by a client: {result.message}")
        call.answer.set_result(response_bytes(result))
