# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bytes to and from one vehicle over UDP, TCP or a serial line, without blocking.

Connection strings are pymavlink's. Its own connections are not used: they print, sleep while they
reconnect, and over UDP reply to any sender.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import socket
import termios
import tty
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

Peer = tuple[str, int] | None

_MAX_DATAGRAM = 2048
_MAX_READS = 32
_MAX_STREAM_READ = 1 << 14
_MAX_UNSENT = 1 << 16
_PEER_SILENT_S = 5.0
_SOCKET = re.compile(r"(udpin|udpout|udp|tcpin|tcpout|tcp):(?://)?([^:/@?\s]*):(\d+)", re.ASCII)
_WITHOUT_KIND = re.compile(r"(?:\d{1,3}(?:\.\d{1,3}){3}|localhost):\d+", re.ASCII)
_SHARED = re.compile(r"(?:mcast|udpbcast):", re.ASCII)
_KINDS = {"udp": "udpin", "tcpout": "tcp"}
# What follows a comma is a rate; what follows a colon only if it is a number, as in a path of
# /dev/serial/by-path there are others.
_SERIAL = re.compile(r"(?:serial:(?://)?)?(/[^/,?][^,?]*?)(?:,(.*)|:(\d+))?", re.ASCII)
_DEFAULT_BAUD = "57600"
_B = re.compile(r"B([1-9]\d*)")
_RATES = sorted((found[1] for found in map(_B.fullmatch, dir(termios)) if found), key=int)


class Link(ABC):
    """A connection; when it is down it raises OSError, and can be opened again.

    Args:
        name: The connection string.

    Attributes:
        name: The connection string, as `KIND:HOST:PORT` or `/dev/DEVICE,BAUD`.
        datagram: Whether bytes come in whole frames.
        connecting: Whether a connection is being made; it may still be refused.
        counts: `wrong_address`: datagrams dropped because another address is the vehicle's;
            `unsent`: frames dropped because there was no peer, or no room to send them.
    """

    datagram = False
    connecting = False

    def __init__(self, name: str) -> None:
        self.name = name
        self.counts: Counter[str] = Counter()
        # A socket, or the file of a serial line.
        self._file: Any = None

    @abstractmethod
    def open(self) -> None:
        """Open it.

        Raises:
            OSError: If that is not possible now.
        """

    def close(self) -> None:
        """Close it; it may be closed already."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def fileno(self) -> int:
        """Return the file descriptor to poll.

        Raises:
            OSError: If it is not open.
        """
        if self._file is None:
            raise OSError(errno.ENOTCONN, os.strerror(errno.ENOTCONN))
        return int(self._file.fileno())

    @property
    def waits_to_send(self) -> bool:
        """Whether to poll for writing too."""
        return False

    @abstractmethod
    def receive(self, now: float) -> list[tuple[bytes, Peer]]:
        """Return some of the bytes that have arrived, and where from.

        Raises:
            OSError: If the connection was closed by the peer.
        """

    def confirm_peer(self, peer: Peer, now: float) -> None:  # noqa: B027
        """Take an address for the vehicle's: a valid message came from there."""

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send a frame, after the unsent rest of earlier ones.

        Raises:
            OSError: If the connection was closed by the peer.
        """


def parse_connection(name: str) -> Link:
    """Return the link, not yet open, of a connection string.

    Args:
        name: `udpin:HOST:PORT` (or `udp:`, or `IP:PORT` alone) listens, `udpout:HOST:PORT` sends
            first;
            `tcp:HOST:PORT` (or `tcpout:`) is a client, `tcpin:HOST:PORT` a server of one client;
            `/dev/...` or `serial:/dev/...` is a serial line, followed by `,BAUD` or `:BAUD` if not
            57600. The default host is this machine. The kind may be followed by `//`, as in
            the URLs of MAVSDK and mavros.

    Raises:
        ValueError: If it is not a connection string.
    """
    stated = f"udpin:{name}" if _WITHOUT_KIND.fullmatch(name) else name
    if match := _SOCKET.fullmatch(stated):
        kind, host, port = _KINDS.get(match[1], match[1]), match[2] or "127.0.0.1", int(match[3])
        if not 0 < port < 1 << 16:
            raise ValueError(f"connection must have a port from 1 to 65535, got {name!r}")
        return _SOCKET_LINKS[kind](f"{kind}:{host}:{port}", (host, port))
    if match := _SERIAL.fullmatch(name):
        path, baud = match[1], match[2] or match[3] or _DEFAULT_BAUD
        if baud not in _RATES:
            raise ValueError(f"connection must have a rate of {', '.join(_RATES)}, got {name!r}")
        return _SerialLink(f"{path},{baud}", path, int(baud))
    shared = " that only one vehicle uses" if _SHARED.match(name) else ""
    raise ValueError(
        "connection must be udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or "
        f"/dev/DEVICE,BAUD{shared}, got {name!r}"
    )


class _UdpLink(Link):
    """UDP to one address, or UDP that listens.

    A link that listens sends to the confirmed peer, and drops other senders for as long as that one
    is heard. Otherwise the socket drops them.
    """

    datagram = True

    def __init__(self, name: str, address: tuple[str, int], *, listens: bool) -> None:
        super().__init__(name)
        self._address = address
        self._listens = listens
        self._peer: Peer = None
        self._peer_s = 0.0

    def open(self) -> None:
        self.close()
        self._file = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._file.setblocking(False)
        try:
            if self._listens:
                self._file.bind(self._address)
            else:
                self._file.connect(self._address)
                self._peer = self._file.getpeername()
        except OSError:
            self.close()
            raise

    def receive(self, now: float) -> list[tuple[bytes, Peer]]:
        came: list[tuple[bytes, Peer]] = []
        for _ in range(_MAX_READS):
            try:
                data, peer = self._file.recvfrom(_MAX_DATAGRAM)
            except BlockingIOError:
                break
            except ConnectionError:
                # The peer has not opened its port, or has closed it.
                continue
            if self._may_be_peer(peer, now):
                came.append((data, peer))
            else:
                self.counts["wrong_address"] += 1
        return came

    def confirm_peer(self, peer: Peer, now: float) -> None:
        if self._may_be_peer(peer, now):
            self._peer, self._peer_s = peer, now

    def _may_be_peer(self, peer: Peer, now: float) -> bool:
        return self._peer in (None, peer) or now - self._peer_s > _PEER_SILENT_S

    def send(self, data: bytes) -> None:
        if not data:
            return
        try:
            if self._peer is None:
                raise ConnectionError
            self._file.sendto(data, self._peer)
        except (BlockingIOError, ConnectionError):
            # There is no peer yet, or no buffer space; whatever matters is sent again.
            self.counts["unsent"] += 1


class _StreamLink(Link):
    """A link of a byte stream, which may have to wait before it can send."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._unsent = bytearray()

    def close(self) -> None:
        self._unsent.clear()
        super().close()

    @property
    def waits_to_send(self) -> bool:
        return self.connecting or bool(self._unsent)

    def _is_connected(self) -> bool:
        """Return whether there is a peer."""
        return True

    def receive(self, now: float) -> list[tuple[bytes, Peer]]:
        try:
            if not self._is_connected():
                return []
            data = os.read(self.fileno(), _MAX_STREAM_READ)
        except BlockingIOError:
            return []
        if not data:
            raise ConnectionResetError(errno.ECONNRESET, "closed by the peer")
        return [(data, None)]

    def send(self, data: bytes) -> None:
        if len(self._unsent) + len(data) > _MAX_UNSENT:
            # A frame that could not be sent in time is of no use, but one that has begun must end.
            self.counts["unsent"] += 1
            data = b""
        self._unsent += data
        with contextlib.suppress(BlockingIOError):
            while self._unsent and self._is_connected():
                del self._unsent[: os.write(self.fileno(), self._unsent)]


class _TcpLink(_StreamLink):
    """A TCP client."""

    def __init__(self, name: str, address: tuple[str, int]) -> None:
        super().__init__(name)
        self._address = address

    def open(self) -> None:
        self.close()
        self._file = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._file.setblocking(False)
        self._file.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.connecting = True
        result = self._file.connect_ex(self._address)
        if result not in (0, errno.EINPROGRESS):
            self.close()
            raise OSError(result, os.strerror(result))

    def _is_connected(self) -> bool:
        if self.connecting:
            result = self._file.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if result:
                raise OSError(result, os.strerror(result))
            with contextlib.suppress(OSError):
                self._file.getpeername()
                self.connecting = False
        return not self.connecting


class _TcpInLink(_StreamLink):
    """A TCP server of one client; the next one waits until that one disconnects."""

    def __init__(self, name: str, address: tuple[str, int]) -> None:
        super().__init__(name)
        self._address = address
        self._server: socket.socket | None = None

    def open(self) -> None:
        self.close()
        self._file = self._server = socket.create_server(self._address, backlog=1)
        self._file.setblocking(False)

    def close(self) -> None:
        super().close()
        if self._server is not None:
            self._server.close()

    def receive(self, now: float) -> list[tuple[bytes, Peer]]:
        if self._is_connected():
            return super().receive(now)
        with contextlib.suppress(BlockingIOError):
            self._file, _ = self._file.accept()
            self._file.setblocking(False)
            self._file.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return []

    def _is_connected(self) -> bool:
        return self._file is not self._server

    def send(self, data: bytes) -> None:
        if self._is_connected():
            super().send(data)


class _SerialLink(_StreamLink):
    """A serial line, raw, without flow control."""

    def __init__(self, name: str, path: str, baud: int) -> None:
        super().__init__(name)
        self._path = path
        self._speed = getattr(termios, f"B{baud}")

    def open(self) -> None:
        self.close()
        descriptor = os.open(self._path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self._file = io.FileIO(descriptor, "r+")
        try:
            tty.setraw(descriptor)
            attributes = termios.tcgetattr(descriptor)
            attributes[2] = attributes[2] & ~termios.CRTSCTS | termios.CLOCAL | termios.CREAD
            attributes[4] = attributes[5] = self._speed
            termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
        except termios.error as error:
            self.close()
            raise OSError(error.args[0], f"no serial line: {self._path}") from error


_SOCKET_LINKS: dict[str, Callable[[str, tuple[str, int]], Link]] = {
    "udpin": partial(_UdpLink, listens=True),
    "udpout": partial(_UdpLink, listens=False),
    "tcp": _TcpLink,
    "tcpin": _TcpInLink,
}
