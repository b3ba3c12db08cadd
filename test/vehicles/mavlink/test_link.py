# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Links over real sockets and a real pseudo-terminal never block, and raise when they are down."""

from __future__ import annotations

import os
import select
import socket
import time
import tty
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.vehicles.mavlink.link import Link, parse_connection

TIMEOUT_S = 60.0


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def receive(link: Link, number: int, now: float = 0.0) -> bytes:
    """Return that many bytes, or what has come in time."""
    data, end_s = b"", time.monotonic() + TIMEOUT_S
    while len(data) < number and time.monotonic() < end_s:
        select.select([link], [], [], 0.1)
        for piece, peer in link.receive(now):
            data += piece
            link.confirm_peer(peer, now)
    return data


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(TIMEOUT_S)
        yield made


def test_udpin_sends_to_the_confirmed_peer(peer: socket.socket) -> None:
    port = free_port()
    link = parse_connection(f"udpin:127.0.0.1:{port}")
    link.open()
    link.send(b"too early")
    assert link.counts["unsent"] == 1
    peer.sendto(b"hello", ("127.0.0.1", port))
    assert receive(link, 5) == b"hello"
    link.send(b"answer")
    assert peer.recv(100) == b"answer"
    link.close()


def test_udpin_drops_other_senders_while_the_peer_is_heard(peer: socket.socket) -> None:
    port = free_port()
    link = parse_connection(f"udpin::{port}")
    link.open()
    peer.sendto(b"hello", ("127.0.0.1", port))
    assert receive(link, 5, now=0.0) == b"hello"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.settimeout(TIMEOUT_S)
        for _ in range(20):
            other.sendto(b"me too", ("127.0.0.1", port))
        peer.sendto(b"still here", ("127.0.0.1", port))
        assert receive(link, 10, now=1.0) == b"still here"
        assert link.counts["wrong_address"] == 20
        link.send(b"answer")
        assert peer.recv(100) == b"answer"
        # Once it has been silent for long, it may come from elsewhere.
        other.sendto(b"moved", ("127.0.0.1", port))
        assert receive(link, 5, now=9.0) == b"moved"
        link.send(b"answer")
        assert other.recv(100) == b"answer"
    link.close()


def test_udpin_listens_on_this_machine_alone_by_default() -> None:
    port = free_port()
    link = parse_connection(f"udpin::{port}")
    link.open()
    with socket.socket(fileno=os.dup(link.fileno())) as bound:
        assert bound.getsockname() == ("127.0.0.1", port)
    link.close()


def test_udpout_receives_from_its_address_alone(peer: socket.socket) -> None:
    link = parse_connection(f"udpout:127.0.0.1:{peer.getsockname()[1]}")
    link.open()
    link.send(b"hello")
    data, ours = peer.recvfrom(100)
    assert data == b"hello"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(b"me too", ours)
    peer.sendto(b"answer", ours)
    assert receive(link, 6) == b"answer"
    link.close()


def test_udpout_without_a_peer_raises_nothing() -> None:
    link = parse_connection(f"udpout:127.0.0.1:{free_port()}")
    link.open()
    for _ in range(20):
        link.send(b"hello")
        assert link.receive(0.0) == []
    link.close()


def test_tcp_connects_and_raises_when_the_peer_closes() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(TIMEOUT_S)
        link = parse_connection(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        for _ in range(2):
            link.open()
            link.send(b"hello ")
            client, _ = server.accept()
            client.settimeout(TIMEOUT_S)
            select.select([], [link], [], TIMEOUT_S)
            link.send(b"you")
            data = b""
            while len(data) < 9:
                data += client.recv(100)
            assert data == b"hello you"
            client.sendall(b"answer")
            assert receive(link, 6) == b"answer"
            client.close()
            with pytest.raises(OSError, match="closed by the peer"):
                receive(link, 1)
            link.close()


def test_tcp_without_a_server_fails_without_blocking() -> None:
    link = parse_connection(f"tcp:127.0.0.1:{free_port(socket.SOCK_STREAM)}")
    with pytest.raises(OSError):
        link.open()
        assert select.select([link], [], [], TIMEOUT_S)[0]
        link.receive(0.0)
    link.close()


def test_a_stream_that_nobody_reads_drops_whole_frames() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = parse_connection(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        link.open()
        client, _ = server.accept()
        client.settimeout(TIMEOUT_S)
        select.select([], [link], [], TIMEOUT_S)
        frame = bytes(range(256)) * 4
        while link.counts["unsent"] < 3:
            link.send(frame)
        assert link.waits_to_send
        data = b""
        while link.waits_to_send:
            data += client.recv(1 << 20)
            link.send(b"")
        link.close()
        while piece := client.recv(1 << 20):
            data += piece
        client.close()
        assert data == frame * (len(data) // len(frame))


def test_tcpin_serves_a_client() -> None:
    port = free_port(socket.SOCK_STREAM)
    link = parse_connection(f"tcpin:127.0.0.1:{port}")
    link.open()
    link.send(b"no client yet")
    with socket.create_connection(("127.0.0.1", port), TIMEOUT_S) as client:
        client.sendall(b"hello")
        assert receive(link, 5) == b"hello"
        link.send(b"answer")
        assert client.recv(100) == b"answer"
    with pytest.raises(OSError, match="closed by the peer"):
        receive(link, 1)
    link.close()


@pytest.mark.parametrize(
    "form",
    ["{}", "{},115200", "{}:57600", "serial:{},57600", "serial:{}:57600", "serial://{}:115200"],
)
def test_a_serial_line_carries_bytes_as_they_are(form: str) -> None:
    ours, theirs = os.openpty()
    tty.setraw(ours)
    try:
        link = parse_connection(form.format(os.ttyname(theirs)))
        link.open()
        every = bytes(range(256))
        os.write(ours, every)
        assert receive(link, 256) == every
        link.send(every)
        data = b""
        while len(data) < 256:
            data += os.read(ours, 256)
        assert data == every
        link.close()
    finally:
        os.close(ours)
        os.close(theirs)


def test_what_is_no_serial_line_is_refused() -> None:
    for path in ("/dev/null", "/dev/no_such_line"):
        with pytest.raises(OSError):
            parse_connection(path).open()


@pytest.mark.parametrize(
    "name",
    [
        "",
        "14550",
        "udpin:127.0.0.1",
        "udpin:127.0.0.1:0",
        "udpin:127.0.0.1:70000",
        "udp:127.0.0.1:port",
        "mcast:",
        "udp:///dev/ttyS0:57600",
        "udp://:14540@127.0.0.1:14557",
        "udp://0.0.0.0:14540/?ids=1",
        "udp-b://:14540",
        "udp://127.0.0.1",
        "serial://ttyACM0:57600",
        "serial:///dev/ttyACM0:57600?ids=1,240",
        "/dev/ttyS0,12345",
        "/dev/ttyS0:12345",
        "/dev/ttyS0,0",
        "/dev/ttyS0,RKINT",
        "/dev/ttyS0,057600",
        "/dev/ttyS0,٥٧٦٠٠",
        "ttyS0",
    ],
)
def test_a_connection_that_names_nothing_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="^connection must .*, got "):
        parse_connection(name)


@given(
    kind=st.sampled_from(["udp", "udpin", "udpout", "tcp", "tcpout", "tcpin"]),
    host=st.sampled_from(["", "0.0.0.0", "127.0.0.1", "192.168.1.10", "companion.local"]),
    port=st.integers(1, 65535),
)
def test_a_url_is_the_connection_of_the_same_kind_host_and_port(
    kind: str, host: str, port: int
) -> None:
    link, same = (
        parse_connection(f"{kind}://{host}:{port}"),
        parse_connection(f"{kind}:{host}:{port}"),
    )
    assert type(link) is type(same) and link.name == same.name
    first = {"udp": "udpin", "tcpout": "tcp"}.get(kind, kind)
    assert link.name == f"{first}:{host or '127.0.0.1'}:{port}"
    assert parse_connection(link.name).name == link.name


@given(
    path=st.sampled_from(
        ["/dev/ttyACM0", "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0", "/dev/pts/3"]
    ),
    rate=st.sampled_from(["", "9600", "57600", "921600"]),
    form=st.sampled_from(["{}", "serial:{}", "serial://{}"]),
    mark=st.sampled_from(",:"),
)
def test_a_serial_line_has_one_name_in_all_forms(
    path: str, rate: str, form: str, mark: str
) -> None:
    name = form.format(f"{path}{mark}{rate}" if rate else path)
    assert parse_connection(name).name == f"{path},{rate or 57600}"


def test_a_url_listens_where_a_vehicle_on_this_machine_sends(peer: socket.socket) -> None:
    for host in ("", "0.0.0.0"):
        port = free_port()
        link = parse_connection(f"udp://{host}:{port}")
        link.open()
        peer.sendto(b"hello", ("127.0.0.1", port))
        assert receive(link, 5) == b"hello"
        link.close()


@pytest.mark.parametrize("name", ["127.0.0.1:14550", "localhost:14550"])
def test_an_address_without_a_kind_listens_as_that_of_pymavlink_does(name: str) -> None:
    assert parse_connection(name).name == f"udpin:{name}"


@pytest.mark.parametrize("name", ["mcast:", "mcast:14550", "udpbcast:192.168.1.255:14550"])
def test_an_address_that_many_vehicles_share_is_refused_for_that(name: str) -> None:
    with pytest.raises(ValueError, match="BAUD that only one vehicle uses, got "):
        parse_connection(name)


@pytest.mark.parametrize("name", ["upd:14550", "udp:14550", "tcp:14550", "vehicle:14550"])
def test_a_kind_without_a_host_is_no_address(name: str) -> None:
    with pytest.raises(ValueError, match="must be udpin:HOST:PORT"):
        parse_connection(name)
