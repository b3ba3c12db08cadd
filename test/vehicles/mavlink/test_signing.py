# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""On a signed link only messages signed with the key are accepted, and no forgery has effects."""

from __future__ import annotations

import os
import random
import time
from pathlib import Path

import pytest
from autopilot.wire import Codec as VehicleCodec
from autopilot.wire import mavlink
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.vehicles.mavlink.codec import Codec
from dsse_ros.vehicles.mavlink.messages import Address, Heartbeat
from dsse_ros.vehicles.mavlink.signing import SigningClock, read_key

VEHICLE, OURSELVES = Address(7, 1), Address(245, 191)
KEY, WRONG_KEY = bytes(range(32)), bytes(32)
MESSAGE = (2, 3, 81, 4, 4, 3)


def codec(clock: SigningClock | None = None) -> Codec:
    return Codec(OURSELVES, VEHICLE, key=KEY, clock=clock)


def frame(sender: VehicleCodec, old: bool = False) -> bytes:
    message = mavlink.MAVLink_heartbeat_message(*MESSAGE)
    if old:
        return bytes(message.pack(sender, force_mavlink1=True))
    return bytes(sender.encode(message))


def accepted(ours: Codec, data: bytes) -> int:
    return len(ours.decode(data, 0.0, datagram=True))


def test_a_message_signed_with_the_key_is_accepted() -> None:
    (message,) = codec().decode(frame(VehicleCodec(7, KEY)), 0.0, datagram=True)
    assert str(message) == str(Heartbeat(2, 3, 81, 4, 4, 3))


def test_outgoing_messages_are_signed() -> None:
    data = codec().encode(Heartbeat(18, 8, 0, 0, 4, 3))
    assert data[2] & 1
    assert len(VehicleCodec(7, KEY).decode_all(data, datagram=True)) == 1
    assert VehicleCodec(7, WRONG_KEY).decode_all(data, datagram=True) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["forged", "replayed", "unsigned", "old version", "altered"])
def test_ten_thousand_that_are_not_genuine_are_dropped_and_the_next_genuine_one_is_accepted(
    kind: str,
) -> None:
    ours, genuine, forger = codec(), VehicleCodec(7, KEY), VehicleCodec(7, WRONG_KEY)
    # As if from the future, to make whatever follows look old.
    forger.signing.timestamp += 10**12
    draw, plain = random.Random(5), VehicleCodec(7)
    recorded = [frame(genuine) for _ in range(50)]
    assert all(accepted(ours, one) == 1 for one in recorded)

    def bad() -> bytes:
        if kind == "forged":
            return frame(forger)
        if kind == "replayed":
            return draw.choice(recorded)
        if kind == "altered":
            data = bytearray(frame(genuine))
            # The signature, its time or its link.
            data[-draw.randrange(1, 14)] ^= draw.randrange(1, 256)
            return bytes(data)
        return frame(plain, old=kind == "old version")

    for _ in range(10_000):
        assert accepted(ours, bad()) == 0
    assert accepted(ours, frame(genuine)) == 1
    assert sum(ours.counts[why] for why in ("forged", "unsigned")) == 10_000


@given(st.binary(min_size=13, max_size=13))
def test_no_made_up_signature_is_accepted(signature: bytes) -> None:
    ours, genuine = codec(), VehicleCodec(7, KEY)
    data = frame(genuine)
    if signature[-6:] != data[-6:]:
        assert accepted(ours, data[:-13] + signature) == 0
        assert accepted(ours, frame(genuine)) == 1


def test_a_new_stream_more_than_a_minute_behind_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, late = codec(), VehicleCodec(7, KEY)
    monkeypatch.setattr(late, "_keep_time", lambda: None)
    late.signing.timestamp -= 61 * 100_000
    assert accepted(ours, frame(late)) == 0
    late.signing.timestamp += 10 * 100_000
    assert accepted(ours, frame(late)) == 1


def test_without_a_key_signed_messages_are_accepted() -> None:
    assert (
        len(Codec(OURSELVES, VEHICLE).decode(frame(VehicleCodec(7, KEY)), 0.0, datagram=True)) == 1
    )


# The key file


def key_file(path: Path, data: bytes, mode: int = 0o600) -> Path:
    path.write_bytes(data)
    path.chmod(mode)
    return path


@pytest.mark.parametrize("data", [KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\n"])
def test_a_key_is_32_bytes_or_64_digits(tmp_path: Path, data: bytes) -> None:
    assert read_key(key_file(tmp_path / "key", data)) == KEY


@pytest.mark.parametrize("data", [b"", KEY[:31], KEY + b"\n", b"g" * 64, KEY.hex().encode()[:-1]])
def test_anything_else_is_no_key(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(ValueError, match="must have 32 bytes or 64 hexadecimal digits, got"):
        read_key(key_file(tmp_path / "key", data))


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o666, 0o644])
def test_a_key_that_others_can_use_is_refused(tmp_path: Path, mode: int) -> None:
    with pytest.raises(ValueError, match="mode must be 600"):
        read_key(key_file(tmp_path / "key", KEY, mode))


def test_a_key_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no_such_file"):
        read_key(tmp_path / "no_such_file")


# The clock


def test_a_clock_gives_the_time_and_never_the_same_twice() -> None:
    clock = SigningClock()
    shown = [clock.now() for _ in range(10_000)]
    assert all(later > earlier for earlier, later in zip(shown, shown[1:], strict=False))
    assert abs(shown[0] / 100_000 + 1420070400 - time.time()) < 60.0


def test_a_clock_does_not_go_back_over_a_crash_even_if_the_machines_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, now_s = tmp_path / "time", time.time()
    monkeypatch.setattr(time, "time", lambda: now_s)
    last = 0
    for back_s in (0.0, 3600.0, 1e8, 0.5):
        monkeypatch.setattr(time, "time", lambda back_s=back_s: now_s - back_s)
        # Never closed: it crashes.
        clock = SigningClock(file)
        for _ in range(2000):
            assert clock.now() > last
            last = clock._last


def test_a_clock_that_was_closed_continues_from_its_time(tmp_path: Path) -> None:
    clock = SigningClock(tmp_path / "time")
    shown = clock.now()
    clock.close()
    assert 0 < SigningClock(tmp_path / "time").now() - shown < 60 * 100_000


def test_a_clock_with_an_unreadable_file_reports_it_and_continues(tmp_path: Path) -> None:
    (tmp_path / "time").write_text("noon")
    clock = SigningClock(tmp_path / "time")
    assert clock.now() > 0
    assert "time" in clock.trouble


def test_a_clock_that_cannot_be_stored_reports_it_and_continues(tmp_path: Path) -> None:
    clock = SigningClock(tmp_path / "no_folder" / "time")
    assert clock.now() > 0
    assert "no_folder" in clock.trouble


def test_after_a_restart_our_signatures_are_newer_than_all_before(tmp_path: Path) -> None:
    vehicle = VehicleCodec(7, KEY)
    for _ in range(3):
        ours = codec(SigningClock(tmp_path / "time"))
        for _ in range(5):
            data = ours.encode(Heartbeat(18, 8, 0, 0, 4, 3))
            assert len(vehicle.decode_all(data, datagram=True)) == 1
        ours.close()
    assert os.listdir(tmp_path) == ["time"]
