# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""With a key, only messages signed with it are accepted, and no forgery has effects."""

from __future__ import annotations

import pytest
from autopilot.bench import Bench
from autopilot.wire import Codec, mavlink

KEY, WRONG_KEY = bytes(range(32)), bytes(32)
VERSION = 148


@pytest.fixture
def bench() -> Bench:
    return Bench(key=KEY)


def request() -> mavlink.MAVLink_message:
    return mavlink.MAVLink_command_long_message(1, 1, 512, 0, VERSION, *[0.0] * 6)


def answers(bench: Bench, frame: bytes) -> int:
    """Return how many answers a frame gets."""
    before = len(bench.all("AUTOPILOT_VERSION"))
    bench.vehicle.receive(bench.channel, frame)
    return len(bench.all("AUTOPILOT_VERSION")) - before


def test_a_signed_request_gets_a_signed_reply(bench: Bench) -> None:
    assert answers(bench, Codec(255, KEY).encode(request())) == 1
    assert all(message.get_signed() for message in bench.received)


def test_an_unsigned_or_wrongly_signed_or_old_frame_gets_none(bench: Bench) -> None:
    assert answers(bench, Codec(255).encode(request())) == 0
    assert answers(bench, Codec(255, WRONG_KEY).encode(request())) == 0
    old = request().pack(Codec(255), force_mavlink1=True)
    assert old[0] == 0xFE
    assert answers(bench, old) == 0


def test_a_replayed_frame_gets_none(bench: Bench) -> None:
    frame = Codec(255, KEY).encode(request())
    assert [answers(bench, frame) for _ in range(3)] == [1, 0, 0]


def test_a_forgery_from_the_future_does_not_silence_the_genuine_sender(bench: Bench) -> None:
    genuine, forger = Codec(255, KEY), Codec(255, WRONG_KEY)
    assert answers(bench, genuine.encode(request())) == 1
    forger.signing.timestamp = genuine.signing.timestamp + 10**9
    for _ in range(100):
        assert answers(bench, forger.encode(request())) == 0
        assert answers(bench, genuine.encode(request())) == 1


def test_a_new_stream_more_than_a_minute_behind_is_refused(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert answers(bench, Codec(255, KEY).encode(request())) == 1
    late = Codec(254, KEY)
    late.signing.timestamp -= 61 * 100_000
    monkeypatch.setattr(late, "_keep_time", lambda: None)
    assert answers(bench, late.encode(request())) == 0
    late.signing.timestamp += 10 * 100_000
    assert answers(bench, late.encode(request())) == 1


def test_a_key_has_32_bytes() -> None:
    with pytest.raises(ValueError, match="32 bytes"):
        Bench(key=b"short")
