# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bytes to and from one vehicle over UDP, TCP or a serial line, without blocking.

Connection strings are pymavlink's. Its own connections are not used: they print, sleep while they
reconnect, and over UDP reply to any sender.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import socket
import termios
import tty
from abc import ABC, abstractmethod
from collections import Counter

Peer = tuple[str, int] | None

_MAX_DATAGRAM = 2048
_MAX_READS = 32
_MAX_STREAM_READ = 1 << 14
_MAX_UNSENT = 1 << 16
_PEER_SILENT_S = 5.0
_FORM = re.compile(r"(udpin|udpout|udp|tcp|tcpin):([^:]*):(\d+)")
_DEFAULT_BAUD = 57600
_B = re.compile(r"B([1-9]\d*)")
_RATES = sorted((found[1] for found in map(_B.fullmatch, dir(termios)) if found), key=int)


class Link(ABC):
    """A connection; when it is down it raises OSError, and can be opened again.

    Attributes:
        name: The connection string.
        datagram: Whether bytes come in whole frames.
        counts: `wrong_address`: datagrams dropped because another address is the vehicle's;
            `unsent`: frames dropped because there was no peer, or no room to send them.
    """

    datagram = False

    def __init__(self, name: str) -> None:
        self.name = name
        self.counts: Counter[str] = Counter()

    @abstractmethod
    def open(self) -> None:
        """Open it.

        Raises:
            OSError: If that is not possible now.
        """

    @abstractmethod
    def close(self) -> None:
        """Close it; it may be closed already."""

    @abstractmethod
    def fileno(self) -> int:
        """Return the file descriptor to poll."""

    @property
    def waits_to_send(self) -> bool:
        """Whether to poll for writing too."""
        return False

    @property
    def connecting(self) -> bool:
        """Whether a connection is being made; it may still be refused."""
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
        name: `udpin:HOST:PORT` (or `udp:`) listens, `udpout:HOST:PORT` sends first;
            `tcp:HOST:PORT` is a client, `tcpin:HOST:PORT` a server of one client; `/dev/...` or
            `serial:/dev/...` is a serial line, followed by `,BAUD` if not 57600. The default
            host is this machine.

    Raises:
        ValueError: If it is not a connection string.
    """
    match = _FORM.fullmatch(name)
    if match:
        kind, address = match[1], (match[2] or "127.0.0.1", int(match[3]))
        if not 0 < address[1] < 1 << 16:
            raise ValueError(f"connection: {name!r} is not allowed; a port from 1 to 65535")
        if kind in ("udpin", "udp"):
            return _UdpInLink(name, address)
        if kind == "udpout":
            return _UdpOutLink(name, address)
        return _TcpLink(name, address) if kind == "tcp" else _TcpInLink(name, address)
    path, _, baud = name.removeprefix("serial:").partition(",")
    if path.startswith("/"):
        if baud and baud not in _RATES:
            raise ValueError(f"connection: {name!r} is not allowed; a rate of {', '.join(_RATES)}")
        return _SerialLink(name, path, int(baud or _DEFAULT_BAUD))
    raise ValueError(
        f"connection: {name!r} is not allowed; udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, "
        "tcpin:HOST:PORT or /dev/DEVICE,BAUD"
    )


class _SocketLink(Link):
    """A link over one socket."""

    def __init__(self, name: str, address: tuple[str, int]) -> None:
        super().__init__(name)
        self._address = address
        self._socket: socket.socket | None = None

    @property
    def _open(self) -> socket.socket:
        if self._socket is None:
            raise OSError(errno.ENOTCONN, os.strerror(errno.ENOTCONN))
        return self._socket

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def fileno(self) -> int:
        return self._open.fileno()


class _UdpLink(_SocketLink):
    """A link of datagrams."""

    datagram = True

    def open(self) -> None:
        self.close()
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            made.setblocking(False)
            self._attach(made)
        except OSError:
            made.close()
            raise
        self._socket = made

    @abstractmethod
    def _attach(self, made: socket.socket) -> None:
        """Bind or connect a socket."""


class _UdpInLink(_UdpLink):
    """UDP that listens.

    It sends to the confirmed peer, and drops other senders for as long as that one is heard.
    """

    def __init__(self, name: str, address: tuple[str, int]) -> None:
        super().__init__(name, address)
        self._peer: Peer = None
        self._peer_s = 0.0

    def _attach(self, made: socket.socket) -> None:
        made.bind(self._address)

    def receive(self, now: float) -> list[tuple[bytes, Peer]]:
        came: list[tuple[bytes, Peer]] = []
        for _ in range(_MAX_READS):
            try:
                data, peer = self._open.recvfrom(_MAX_DATAGRAM)
            except BlockingIOError:
                break
            except ConnectionError:
                # The peer has closed its port.
                continue
            if peer == self._peer or self._peer is None or now - self._peer_s > _PEER_SILENT_S:
                came.append((data, peer))
            else:
                self.counts["wrong_address"] += 1
        return came

    def confirm_peer(self, peer: Peer, now: float) -> None:
        if peer == self._peer or now - self._peer_s > _PEER_SILENT_S or self._peer is None:
            self._peer, self._peer_s = peer, now

    def send(self, data: bytes) -> None:
        if not data:
            return
        if self._peer is None:
            self.counts["unsent"] += 1
            return
        _send_datagram(self._open, data, self._peer, self.counts)


class _UdpOutLink(_UdpLink):
    """UDP to one address; the socket drops other senders."""

    def _attach(self, made: socket.socket) -> None:
        made.connect(self._address)

    def receive(self, now: float) -> list[tuple[bytes, Peer]]:
        came: list[tuple[bytes, Peer]] = []
        for _ in range(_MAX_READS):
            try:
                came.append((self._open.recv(_MAX_DATAGRAM), self._address))
            except BlockingIOError:
                break
            except ConnectionError:
                # The peer has not opened its port, or has closed it.
                continue
        return came

    def send(self, data: bytes) -> None:
        if not data:
            return
        _send_datagram(self._open, data, None, self.counts)


class _StreamLink(Link):
    """A link of a byte stream, which may have to wait before it can send."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._unsent = bytearray()

    @property
    def waits_to_send(self) -> bool:
        return bool(self._unsent)

    @abstractmethod
    def _read(self) -> bytes:
        """Return some bytes, none if the peer has closed the connection."""

    @abstractmethod
    def _write(self, data: bytearray) -> int:
        """Send some of the bytes and return how many."""

    def receive(self, now: float) -> list[tuple[bytes, Peer]]:
        try:
            data = self._read()
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
            while self._unsent:
                del self._unsent[: self._write(self._unsent)]


class _TcpLink(_StreamLink, _SocketLink):
    """A TCP client."""

    def __init__(self, name: str, address: tuple[str, int]) -> None:
        _SocketLink.__init__(self, name, address)
        self._unsent = bytearray()
        self._connecting = False

    def open(self) -> None:
        self.close()
        made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        made.setblocking(False)
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket, self._connecting = made, True
        result = made.connect_ex(self._address)
        if result not in (0, errno.EINPROGRESS):
            self.close()
            raise OSError(result, os.strerror(result))

    def close(self) -> None:
        self._unsent.clear()
        super().close()

    @property
    def waits_to_send(self) -> bool:
        return self._connecting or bool(self._unsent)

    @property
    def connecting(self) -> bool:
        return self._connecting

    def _connected(self) -> bool:
        if self._connecting:
            result = self._open.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if result:
                raise OSError(result, os.strerror(result))
            try:
                self._open.getpeername()
            except OSError:
                return False
            self._connecting = False
        return True

    def _read(self) -> bytes:
        if not self._connected():
            raise BlockingIOError
        return self._open.recv(_MAX_STREAM_READ)

    def _write(self, data: bytearray) -> int:
        if not self._connected():
            raise BlockingIOError
        return self._open.send(data)


class _TcpInLink(_StreamLink, _SocketLink):
    """A TCP server of one client; the next one waits until that one disconnects."""

    def __init__(self, name: str, address: tuple[str, int]) -> None:
        _SocketLink.__init__(self, name, address)
        self._unsent = bytearray()
        self._client: socket.socket | None = None

    def open(self) -> None:
        self.close()
        self._socket = socket.create_server(self._address, backlog=1)
        self._socket.setblocking(False)

    def close(self) -> None:
        self._unsent.clear()
        if self._client is not None:
            self._client.close()
            self._client = None
        super().close()

    def fileno(self) -> int:
        return self._client.fileno() if self._client is not None else self._open.fileno()

    @property
    def waits_to_send(self) -> bool:
        return self._client is not None and bool(self._unsent)

    def _read(self) -> bytes:
        if self._client is None:
            self._client = self._open.accept()[0]
            self._client.setblocking(False)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            raise BlockingIOError
        return self._client.recv(_MAX_STREAM_READ)

    def _write(self, data: bytearray) -> int:
        if self._client is None:
            data.clear()
            return 0
        return self._client.send(data)


class _SerialLink(_StreamLink):
    """A serial line, raw, without flow control."""

    def __init__(self, name: str, path: str, baud: int) -> None:
        super().__init__(name)
        self._path = path
        self._speed = getattr(termios, f"B{baud}")
        self._file: int | None = None

    def open(self) -> None:
        self.close()
        file = os.open(self._path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(file)
            attributes = termios.tcgetattr(file)
            attributes[2] = attributes[2] & ~termios.CRTSCTS | termios.CLOCAL | termios.CREAD
            attributes[4] = attributes[5] = self._speed
            termios.tcsetattr(file, termios.TCSANOW, attributes)
        except termios.error as error:
            os.close(file)
            raise OSError(error.args[0], f"no serial line: {self._path}") from error
        self._file = file

    def close(self) -> None:
        self._unsent.clear()
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def fileno(self) -> int:
        if self._file is None:
            raise OSError(errno.ENOTCONN, os.strerror(errno.ENOTCONN))
        return self._file

    def _read(self) -> bytes:
        return os.read(self.fileno(), _MAX_STREAM_READ)

    def _write(self, data: bytearray) -> int:
        return os.write(self.fileno(), data)


def _send_datagram(through: socket.socket, data: bytes, peer: Peer, counts: Counter[str]) -> None:
    try:
        if peer is None:
            through.send(data)
        else:
            through.sendto(data, peer)
    except (BlockingIOError, ConnectionError):
        # There is no peer yet, or no buffer space; whatever matters is sent again.
        counts["unsent"] += 1
