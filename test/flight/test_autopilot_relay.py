# SPDX-License-Identifier: Apache-2.0
"""The relay is as bad as it is told to be, and equally bad each time."""

from __future__ import annotations

import select
import socket
from collections import Counter
from typing import Any

import pytest
from autopilot.relay import Direction, Weather
from autopilot.running import running_relay
from hypothesis import given
from hypothesis import strategies as st

COUNT = 400
shares = st.floats(0, 1)
weathers = st.builds(Weather, shares, shares, shares, st.floats(0, 1), st.floats(0, 1))


def udp_socket() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    return made


def read_all(receiver: socket.socket, patience_s: float = 1.0) -> list[tuple[int, Any]]:
    """Return numbers and senders until nothing has come for a while."""
    got = []
    while select.select([receiver], [], [], patience_s)[0]:
        data, peer = receiver.recvfrom(100)
        got.append((int.from_bytes(data, "big"), peer))
    return got


def numbered(number: int) -> bytes:
    return number.to_bytes(4, "big")


@given(weather=weathers, seed=st.text(max_size=5))
def test_what_becomes_of_a_datagram_depends_on_the_seed_alone(weather: Weather, seed: str) -> None:
    first, second = Direction(weather, seed), Direction(weather, seed)
    fates = [first.delays_s() for _ in range(50)]
    assert fates == [second.delays_s() for _ in range(50)]
    longest_s = weather.delay_s + weather.jitter_s + weather.hold_s
    assert all(weather.delay_s <= delay_s <= longest_s for fate in fates for delay_s in fate)


@given(weather=weathers, delay_s=st.floats(0, 1))
def test_a_change_of_delays_changes_nothing_else(weather: Weather, delay_s: float) -> None:
    other = Weather(weather.loss, weather.duplicate, weather.reorder, delay_s)
    one, two = Direction(weather, "seed"), Direction(other, "seed")
    for _ in range(50):
        assert len(one.delays_s()) == len(two.delays_s())


def test_shares_are_what_they_should_be() -> None:
    direction = Direction(Weather(loss=0.3, duplicate=0.2, reorder=0.1), "seed")
    fates = [direction.delays_s() for _ in range(20000)]
    copies = [delay_s for fate in fates for delay_s in fate]
    lost = sum(not fate for fate in fates)
    assert lost / 20000 == pytest.approx(0.3, abs=0.02)
    assert sum(len(fate) == 2 for fate in fates) / (20000 - lost) == pytest.approx(0.2, abs=0.02)
    assert sum(delay_s > 0 for delay_s in copies) / len(copies) == pytest.approx(0.1, abs=0.01)
    counts = direction.counts
    assert (counts.came, counts.lost, counts.sent) == (20000, lost, len(copies))


def test_it_does_to_real_datagrams_what_it_is_told_to() -> None:
    weather = {"loss": 0.3, "duplicate": 0.2, "reorder": 0.2}
    expected = Direction(Weather(**weather), "5 outward")
    counts: dict[str, Any] = {}
    with udp_socket() as far, udp_socket() as near:
        to_port = far.getsockname()[1]
        with running_relay(to_port, **weather, seed=5, counts=counts) as relay:
            near.connect((relay.host, relay.port))
            got = []
            for number in range(COUNT):
                near.send(numbered(number))
                if number % 20 == 19:
                    # Buffers are not endless.
                    got += read_all(far, 0.01)
            numbers = [number for number, _ in got + read_all(far)]
    wanted = Counter({number: len(expected.delays_s()) for number in range(COUNT)})
    assert Counter(numbers) == +wanted
    assert numbers != sorted(numbers)
    assert counts["outward"] == {
        "came": COUNT,
        "lost": expected.counts.lost,
        "sent": len(numbers),
    }
    assert counts["homeward"]["came"] == 0


def test_answers_find_their_way_back() -> None:
    with (
        udp_socket() as far,
        udp_socket() as near,
        running_relay(far.getsockname()[1], delay_s=0.02) as relay,
    ):
        near.connect((relay.host, relay.port))
        near.send(numbered(1))
        [(number, peer)] = read_all(far)
        far.sendto(numbered(number + 1), peer)
        assert [number for number, _ in read_all(near)] == [2]
