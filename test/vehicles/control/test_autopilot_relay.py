# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The relay impairs datagrams as configured, and the same way each time."""

from __future__ import annotations

import select
import socket
from collections import Counter
from typing import Any

import pytest
from autopilot.relay import Direction, Impairments
from autopilot.running import running_relay
from hypothesis import given
from hypothesis import strategies as st

COUNT = 400
TIMEOUT_S = 60.0
shares = st.floats(0, 1)
any_impairments = st.builds(Impairments, shares, shares, shares, st.floats(0, 1), st.floats(0, 1))


def udp_socket() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    return made


def read_all(
    receiver: socket.socket, at_least: int, patience_s: float = 1.0
) -> list[tuple[int, Any]]:
    """Return so many numbers and senders, and what else comes until nothing has for a while."""
    got: list[tuple[int, Any]] = []
    while select.select([receiver], [], [], TIMEOUT_S if len(got) < at_least else patience_s)[0]:
        data, peer = receiver.recvfrom(100)
        got.append((int.from_bytes(data, "big"), peer))
    return got


def numbered(number: int) -> bytes:
    return number.to_bytes(4, "big")


@given(impairments=any_impairments, seed=st.text(max_size=5))
def test_what_happens_to_a_datagram_depends_on_the_seed_alone(
    impairments: Impairments, seed: str
) -> None:
    first, second = Direction(impairments, seed), Direction(impairments, seed)
    delays = [first.delays_s() for _ in range(50)]
    assert delays == [second.delays_s() for _ in range(50)]
    longest_s = impairments.delay_s + impairments.jitter_s + impairments.hold_s
    assert all(impairments.delay_s <= delay_s <= longest_s for fate in delays for delay_s in fate)


@given(impairments=any_impairments, delay_s=st.floats(0, 1))
def test_a_change_of_delays_changes_nothing_else(impairments: Impairments, delay_s: float) -> None:
    other = Impairments(impairments.loss, impairments.duplicate, impairments.reorder, delay_s)
    one, two = Direction(impairments, "seed"), Direction(other, "seed")
    for _ in range(50):
        assert len(one.delays_s()) == len(two.delays_s())


@pytest.mark.slow
def test_shares_are_as_configured() -> None:
    direction = Direction(Impairments(loss=0.3, duplicate=0.2, reorder=0.1), "seed")
    delays = [direction.delays_s() for _ in range(20000)]
    copies = [delay_s for fate in delays for delay_s in fate]
    lost = sum(not fate for fate in delays)
    assert lost / 20000 == pytest.approx(0.3, abs=0.02)
    assert sum(len(fate) == 2 for fate in delays) / (20000 - lost) == pytest.approx(0.2, abs=0.02)
    assert sum(delay_s > 0 for delay_s in copies) / len(copies) == pytest.approx(0.1, abs=0.01)
    counts = direction.counts
    assert (counts.received, counts.lost, counts.sent) == (20000, lost, len(copies))


@pytest.mark.slow
def test_real_datagrams_are_impaired_as_configured() -> None:
    impairments = {"loss": 0.3, "duplicate": 0.2, "reorder": 0.2}
    expected = Direction(Impairments(**impairments), "5 outward")
    wanted: Counter[int] = Counter()
    counts: dict[str, Any] = {}
    with udp_socket() as far, udp_socket() as near:
        to_port = far.getsockname()[1]
        with running_relay(to_port, **impairments, seed=5, counts=counts) as relay:
            near.connect((relay.host, relay.port))
            got = []
            for number in range(COUNT):
                near.send(numbered(number))
                wanted[number] = len(expected.delays_s())
                if number % 20 == 19:
                    # Buffers are not endless.
                    got += read_all(far, wanted.total() - len(got), 0.0)
            numbers = [number for number, _ in got + read_all(far, 0)]
    assert Counter(numbers) == +wanted
    assert numbers != sorted(numbers)
    assert counts["outward"] == {
        "received": COUNT,
        "lost": expected.counts.lost,
        "sent": len(numbers),
    }
    assert counts["homeward"]["received"] == 0


@pytest.mark.slow
def test_replies_find_their_way_back() -> None:
    with (
        udp_socket() as far,
        udp_socket() as near,
        running_relay(far.getsockname()[1], delay_s=0.02) as relay,
    ):
        near.connect((relay.host, relay.port))
        near.send(numbered(1))
        [(number, peer)] = read_all(far, 1)
        far.sendto(numbered(number + 1), peer)
        assert [number for number, _ in read_all(near, 1)] == [2]
