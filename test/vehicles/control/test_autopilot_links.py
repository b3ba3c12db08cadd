# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The process, over real sockets of this machine."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from autopilot import options
from autopilot.running import Running, running_autopilot
from autopilot.wire import Codec, Message, mavlink

TIMEOUT_S = 60.0


class Client:
    """A client of an autopilot."""

    def __init__(self, autopilot: Running, system: int = 255, key: bytes | None = None) -> None:
        self.codec = Codec(system, key)
        self.stream = autopilot.connection.startswith("tcp:")
        there = (autopilot.host, autopilot.port)
        if self.stream:
            self.socket = socket.create_connection(there, TIMEOUT_S)
        else:
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            if autopilot.connection.startswith("udpin:"):
                self.socket.bind(there)
            else:
                self.socket.connect(there)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: Any) -> None:
        self.socket.close()

    def send(self, message: Message) -> None:
        self.socket.send(self.codec.encode(message))

    def receive(self, timeout_s: float) -> list[Message]:
        """Return the next messages, none if nothing arrives in time."""
        if not select.select([self.socket], [], [], timeout_s)[0]:
            return []
        return self.codec.decode_all(self.socket.recv(4096), datagram=not self.stream)

    def messages(self) -> Iterator[Message]:
        deadline_s = time.monotonic() + TIMEOUT_S
        while time.monotonic() < deadline_s:
            yield from self.receive(0.5)

    def until(self, kind: str) -> Message:
        return next(message for message in self.messages() if message.get_type() == kind)

    def request(self, number: int, kind: str, system: int = 1) -> Message:
        """Request a message of a kind until it arrives."""
        # Drop replies to earlier requests.
        while self.receive(0.0):
            pass
        deadline_s = time.monotonic() + TIMEOUT_S
        while time.monotonic() < deadline_s:
            self.send(mavlink.MAVLink_command_long_message(system, 1, 512, 0, number, *[0.0] * 6))
            for message in self.receive(0.5):
                if message.get_type() == kind:
                    return message
        raise AssertionError(f"no {kind}")


def test_udp_sends_first() -> None:
    with running_autopilot(link="udp", system=7) as autopilot, Client(autopilot) as client:
        heartbeat = client.until("HEARTBEAT")
        assert (heartbeat.get_srcSystem(), heartbeat.autopilot) == (7, 3)


@pytest.mark.slow
def test_udpin_sends_to_all_peers_that_have_sent() -> None:
    with (
        running_autopilot("px4", link="udpin") as autopilot,
        Client(autopilot) as first,
        Client(autopilot, 254) as second,
    ):
        assert first.receive(1.2) == []
        for client in (first, second):
            client.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        for client in (first, second):
            assert client.until("HEARTBEAT").autopilot == 12


@pytest.mark.slow
def test_a_reply_comes_from_the_vehicle_that_got_the_request() -> None:
    with (
        running_autopilot(system=3) as one,
        running_autopilot(system=4) as other,
        Client(one) as client,
        Client(other) as other_client,
    ):
        assert client.request(148, "AUTOPILOT_VERSION", 3).get_srcSystem() == 3
        assert other_client.request(148, "AUTOPILOT_VERSION", 4).get_srcSystem() == 4


@pytest.mark.slow
def test_on_tcp_nothing_starts_before_a_client_comes() -> None:
    with running_autopilot(link="tcp", speedup=100) as autopilot:
        time.sleep(1.5)
        start_s = time.monotonic()
        with Client(autopilot) as client:
            client.until("HEARTBEAT")
            boot_s = client.request(2, "SYSTEM_TIME").time_boot_ms / 1000
            assert boot_s < 100 * (time.monotonic() - start_s) + 5


@pytest.mark.slow
def test_tcp_serves_one_client_and_then_the_next() -> None:
    with running_autopilot(link="tcp") as autopilot:
        with Client(autopilot) as first, Client(autopilot) as second:
            first.until("HEARTBEAT")
            assert second.receive(1.2) == []
            first.socket.close()
            second.until("HEARTBEAT")
        with Client(autopilot) as third:
            third.until("HEARTBEAT")


@pytest.mark.slow
def test_vehicle_time_is_wall_time_times_the_speedup() -> None:
    with running_autopilot(speedup=50) as autopilot, Client(autopilot) as client:
        start_s = time.monotonic()
        first_s = later_s = client.request(2, "SYSTEM_TIME").time_boot_ms / 1000
        # It is never ahead, and behind only on a machine that is too busy.
        while later_s - first_s < 50:
            later_s = client.request(2, "SYSTEM_TIME").time_boot_ms / 1000
            gone_s = time.monotonic() - start_s
            assert later_s - first_s < 50 * gone_s + 1 and gone_s < TIMEOUT_S


@pytest.mark.slow
@pytest.mark.parametrize("form", ["bytes", "digits"])
def test_with_a_key_only_signed_messages_are_accepted(tmp_path: Path, form: str) -> None:
    key = bytes(range(1, 33))
    file = tmp_path / "key"
    file.write_bytes(key if form == "bytes" else key.hex().encode() + b"\n")
    with running_autopilot(key_file=file) as autopilot:
        with Client(autopilot) as unsigned:
            unsigned.send(mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, *[0.0] * 6))
            messages = unsigned.messages()
            # A reply would come before the next heartbeat but one.
            kinds = [next(messages).get_type()]
            while kinds.count("HEARTBEAT") < 3:
                kinds.append(next(messages).get_type())
            assert "AUTOPILOT_VERSION" not in kinds
        with Client(autopilot, key=key) as signed:
            assert signed.request(148, "AUTOPILOT_VERSION").get_signed()


@pytest.mark.slow
def test_it_ends_by_a_signal_and_with_its_standard_input() -> None:
    with running_autopilot() as autopilot:
        autopilot.process.terminate()
        assert autopilot.process.wait(TIMEOUT_S) == 0
    with running_autopilot(link="tcp", speedup=20) as autopilot, Client(autopilot) as client:
        client.until("HEARTBEAT")
        assert autopilot.process.stdin is not None
        autopilot.process.stdin.close()
        assert autopilot.process.wait(TIMEOUT_S) == 0


def test_it_ends_while_it_waits_for_its_first_client() -> None:
    with running_autopilot(link="tcp") as autopilot:
        assert autopilot.running
    assert not autopilot.running


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ("", "no link"),
        ("--udpin 70000", "port must be 0 to 65535, got 70000"),
        ("--udpin 0 --sysid 0", "1 to 255"),
        ("--udpin 0 --speedup 0", "must be > 0, got 0"),
        ("--udpin 0 --home 1,2", "latitude,longitude,altitude"),
        ("--udpin 0 --fault fire@3", "KIND@"),
        ("--udpin 0 --fault pilot@3=HOVER", "got HOVER"),
        ("--udpin 0 --signing-key /dev/null", "must have 32 bytes, got 0"),
    ],
)
def test_options_that_are_not_allowed_are_refused_with_a_reason(
    arguments: str, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        options.parse(arguments.split())
    assert reason in capsys.readouterr().err
