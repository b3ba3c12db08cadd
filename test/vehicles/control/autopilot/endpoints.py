# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sockets of a vehicle: UDP to several peers, TCP to one client at a time."""

from __future__ import annotations

import contextlib
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable
from selectors import EVENT_READ, BaseSelector

Address = tuple[str, int]

_MAX_PEERS = 8
_MAX_DATAGRAM = 2048
_MAX_DATAGRAMS_AT_ONCE = 64
_MAX_UNSENT = 1 << 18


class Endpoint(ABC):
    """A socket.

    Attributes:
        datagram: Whether bytes come in whole frames.
        connection: Connection string with which pymavlink connects to it.
    """

    datagram: bool
    connection: str

    @abstractmethod
    def register(self, selector: BaseSelector, receive: Callable[[bytes], None]) -> None:
        """Have the selector call back, without arguments, when there is something to do.

        Args:
            selector: Its keys' data are what to call.
            receive: Takes the bytes that come in.
        """

    @abstractmethod
    def transmit(self, data: bytes) -> None:
        """Send one frame to all peers, without blocking."""


class UdpEndpoint(Endpoint):
    """UDP to one address first, if one is given, and to every peer that has sent something.

    Args:
        local: What to bind to; port 0 takes a free one.
        peer: Address to send to before anything was received.
    """

    datagram = True

    def __init__(self, local: Address, peer: Address | None = None) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind(local)
        # The most recent sender comes last.
        self._peers: dict[Address, None] = {} if peer is None else {peer: None}
        host, port = self._socket.getsockname()
        self.connection = f"udpout:{host}:{port}" if peer is None else f"udpin:{peer[0]}:{peer[1]}"

    def register(self, selector: BaseSelector, receive: Callable[[bytes], None]) -> None:
        def read() -> None:
            for _ in range(_MAX_DATAGRAMS_AT_ONCE):
                try:
                    data, peer = self._socket.recvfrom(_MAX_DATAGRAM)
                except BlockingIOError:
                    return
                except OSError:
                    # A peer has not opened its port, or has closed it.
                    continue
                self._peers.pop(peer, None)
                self._peers[peer] = None
                if len(self._peers) > _MAX_PEERS:
                    del self._peers[next(iter(self._peers))]
                receive(data)

        selector.register(self._socket, EVENT_READ, read)

    def transmit(self, data: bytes) -> None:
        for peer in self._peers:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, peer)


class TcpEndpoint(Endpoint):
    """TCP to one client; the next one waits until that one disconnects.

    Args:
        local: What to bind to; port 0 takes a free one.
    """

    datagram = False

    def __init__(self, local: Address) -> None:
        self._listener = socket.create_server(local, backlog=4)
        self._listener.setblocking(False)
        self._client: socket.socket | None = None
        self._unsent = bytearray()
        host, port = self._listener.getsockname()
        self.connection = f"tcp:{host}:{port}"

    @property
    def has_client(self) -> bool:
        """Whether a client is being served."""
        return self._client is not None

    def register(self, selector: BaseSelector, receive: Callable[[bytes], None]) -> None:
        def accept() -> None:
            try:
                self._client = self._listener.accept()[0]
            except OSError:
                # It has disconnected already.
                return
            selector.unregister(self._listener)
            self._client.setblocking(False)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._unsent.clear()
            selector.register(self._client, EVENT_READ, read)

        def read() -> None:
            assert self._client is not None
            try:
                data = self._client.recv(1 << 16)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if data:
                receive(data)
                return
            selector.unregister(self._client)
            self._client.close()
            self._client = None
            selector.register(self._listener, EVENT_READ, accept)

        selector.register(self._listener, EVENT_READ, accept)

    def transmit(self, data: bytes) -> None:
        if self._client is None:
            return
        if len(self._unsent) < _MAX_UNSENT:
            self._unsent += data
        # A closed connection is noticed when it is read.
        with contextlib.suppress(OSError):
            del self._unsent[: self._client.send(self._unsent)]
