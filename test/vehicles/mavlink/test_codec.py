# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Any bytes are decoded without an error, and only the vehicle's messages are accepted."""

from __future__ import annotations

import math
import random
import time
from typing import Any

import pytest
from autopilot.wire import Codec as VehicleCodec
from autopilot.wire import mavlink
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.vehicles.control.item_messages import item_message
from dsse_ros.vehicles.mavlink.codec import Codec
from dsse_ros.vehicles.mavlink.messages import (
    Address,
    GlobalPosition,
    Heartbeat,
    MissionRequest,
    MissionSetCurrent,
    SetPositionTarget,
    StatusText,
    command_long,
)
from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, MissionItem

VEHICLE, OURSELVES = Address(7, 1), Address(245, 191)
HEARTBEAT = Heartbeat(18, 8, 0, 0, 4, 3)
both = pytest.mark.parametrize("datagram", [True, False], ids=["datagrams", "stream"])


def codec() -> Codec:
    return Codec(OURSELVES, VEHICLE)


def heartbeats(number: int, system: int = 7, component: int = 1, old: bool = False) -> list[bytes]:
    sender = VehicleCodec(system)
    sender.srcComponent = component
    message = mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3)
    frames = []
    for _ in range(number):
        frames.append(bytes(message.pack(sender, force_mavlink1=old)))
        sender.seq = (sender.seq + 1) % 256
    return frames


def malformed(draw: random.Random) -> bytes:
    """Return what is nearly a frame, or none at all."""
    frame = bytearray(draw.choice(SAMPLES))
    kind = draw.randrange(6)
    if kind == 0:
        return draw.randbytes(draw.randrange(1, 60))
    if kind == 1:
        return bytes(frame[: draw.randrange(1, len(frame))])
    if kind == 2:
        # A start that promises the longest frame there is.
        return bytes((draw.choice((0xFD, 0xFE)), 255, draw.choice((0, 1, 255)))) + frame[3:]
    if kind == 3:
        return bytes((0xFD,)) * draw.randrange(1, 40)
    for _ in range(draw.randrange(1, 5)):
        frame[draw.randrange(len(frame))] ^= draw.randrange(1, 256)
    return bytes(frame)


SAMPLES = [
    *heartbeats(1),
    *heartbeats(1, old=True),
    bytes(VehicleCodec(7).encode(mavlink.MAVLink_statustext_message(4, b"x" * 50))),
    bytes(VehicleCodec(7).encode(mavlink.MAVLink_mission_count_message(245, 191, 9, 0))),
    bytes(VehicleCodec(7, bytes(32)).encode(mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3))),
]


def chunks(number: int, text: bytes) -> list[bytes]:
    sender = VehicleCodec(7)
    parts = [text[at : at + 50] for at in range(0, len(text) + 1, 50)]
    return [
        bytes(sender.encode(mavlink.MAVLink_statustext_message(4, part, number, seq)))
        for seq, part in enumerate(parts)
    ]


LONG = "RTL: start return at 31 m (30 m above destination), " * 3


@pytest.mark.slow
@both
@given(data=st.data())
def test_a_long_text_is_joined_in_whatever_order_it_comes(datagram: bool, data: Any) -> None:
    one, other = LONG[: data.draw(st.integers(1, 150))].rstrip(), LONG[7:].rstrip()
    frames = data.draw(st.permutations(chunks(3, one.encode()) + chunks(4, other.encode())))
    ours, messages = codec(), []
    for frame in frames:
        messages += ours.decode(frame, 0.0, datagram=datagram)
    assert sorted(messages, key=repr) == sorted(
        [StatusText(4, one), StatusText(4, other)], key=repr
    )


def test_a_text_with_a_missing_chunk_has_a_gap() -> None:
    frames, ours = chunks(9, LONG.encode()), codec()
    for frame in (frames[0], frames[2]):
        assert ours.decode(frame, 0.0, datagram=True) == []
    (text,) = ours.decode(b"", 3.0, datagram=True)
    assert text == StatusText(4, f"{LONG[:50]}...{LONG[100:150]}".rstrip())


def test_texts_that_never_end_do_not_pile_up() -> None:
    ours = codec()
    messages = [
        m for n in range(1, 200) for m in ours.decode(chunks(n, b"x" * 60)[0], 0.0, datagram=True)
    ]
    assert len(messages) > 180


@both
def test_the_messages_of_the_vehicle_are_decoded(datagram: bool) -> None:
    data = b"".join(heartbeats(3) + heartbeats(2, old=True))
    data += VehicleCodec(7).encode(mavlink.MAVLink_statustext_message(4, b"hello"))
    messages = codec().decode(data, 0.0, datagram=datagram)
    *beats, text = messages
    assert [str(one) for one in beats] == [str(Heartbeat(2, 3, 81, 4, 4, 3))] * 5
    assert text == StatusText(4, "hello")


@given(cuts=st.lists(st.integers(1, 60), max_size=30))
def test_a_stream_may_come_in_any_pieces(cuts: list[int]) -> None:
    data, ours, messages = b"".join(heartbeats(20)), codec(), []
    for cut in [*cuts, len(data)]:
        messages += ours.decode(data[:cut], 0.0, datagram=False)
        data = data[cut:]
    assert len(messages) == 20
    assert ours.counts == {"accepted": 20}


@given(st.lists(st.binary(max_size=300), max_size=20), st.booleans())
def test_no_bytes_make_it_raise(pieces: list[bytes], datagram: bool) -> None:
    ours = codec()
    for now, piece in enumerate(pieces):
        ours.decode(piece, float(now), datagram=datagram)


@pytest.mark.slow
@both
def test_a_hundred_thousand_malformed_frames_do_no_harm(datagram: bool) -> None:
    draw, ours, longest_s = random.Random(1), codec(), 0.0
    samples = [malformed(draw) for _ in range(2000)]
    good = heartbeats(1)[0]
    for turn in range(100_000 // 100):
        start = time.process_time()
        for _ in range(100):
            ours.decode(draw.choice(samples), turn, datagram=datagram)
        longest_s = max(longest_s, time.process_time() - start)
        if turn % 10 == 0:
            before = ours.counts["accepted"]
            frames = 0
            while ours.counts["accepted"] == before:
                ours.decode(good, turn, datagram=datagram)
                frames += 1
                assert frames <= 30
    assert longest_s < 1.0
    assert ours.counts["bad_data"] > 20_000


@given(st.binary(max_size=400), st.booleans())
def test_after_garbage_frames_are_found_within_thirty(garbage: bytes, datagram: bool) -> None:
    ours = codec()
    ours.decode(garbage, 0.0, datagram=datagram)
    before = ours.counts["accepted"]
    for number, frame in enumerate(heartbeats(30)):
        ours.decode(frame, 0.1 * number, datagram=datagram)
    # In a stream some may still be held back, in what looks like a longer one.
    assert ours.counts["accepted"] - before >= (30 if datagram else 15)
    before = ours.counts["accepted"]
    for number, frame in enumerate(heartbeats(30)):
        ours.decode(frame, 3.0 + 0.1 * number, datagram=datagram)
    assert ours.counts["accepted"] - before >= 30


def test_a_false_start_does_not_swallow_the_frames_behind_it() -> None:
    ours, frames = codec(), heartbeats(40)
    false_start = bytes((0xFD, 255, 0))
    messages = ours.decode(false_start + b"".join(frames), 0.0, datagram=False)
    assert len(messages) == 40


def test_a_false_start_that_does_not_continue_is_dropped() -> None:
    ours = codec()
    ours.decode(bytes((0xFD, 255, 0)), 0.0, datagram=False)
    messages = [
        ours.decode(frame, 1.0 + k, datagram=False) for k, frame in enumerate(heartbeats(3))
    ]
    assert [len(one) for one in messages] == [1, 1, 1]


def test_a_broken_datagram_does_not_affect_the_next() -> None:
    ours, frames = codec(), heartbeats(2)
    assert ours.decode(frames[0][:-1], 0.0, datagram=True) == []
    assert len(ours.decode(frames[1], 0.0, datagram=True)) == 1


@both
def test_wrong_senders_have_no_effect_and_are_counted(datagram: bool) -> None:
    ours, draw = codec(), random.Random(3)
    for _ in range(10_000):
        system, component = draw.randrange(1, 256), draw.randrange(1, 256)
        if (system, component) != VEHICLE:
            frame = heartbeats(1, system, component)[0]
            assert ours.decode(frame, 0.0, datagram=datagram) == []
    assert ours.counts["wrong_sender"] >= 9_990
    assert len(ours.decode(heartbeats(1)[0], 0.0, datagram=datagram)) == 1


def test_a_message_that_is_not_needed_is_counted_and_not_decoded() -> None:
    ours = codec()
    frame = VehicleCodec(7).encode(mavlink.MAVLink_attitude_quaternion_message(0, *[0.0] * 7))
    assert ours.decode(frame, 0.0, datagram=True) == []
    assert ours.counts == {"not_needed": 1}


def test_a_message_of_another_message_set_is_skipped() -> None:
    ours, frame = codec(), bytearray(heartbeats(1)[0])
    frame[7:10] = (60_000).to_bytes(3, "little")
    messages = ours.decode(bytes(frame) + heartbeats(1)[0], 0.0, datagram=False)
    assert len(messages) == 1


@pytest.mark.parametrize(
    ("message", "kind", "fields"),
    [
        (HEARTBEAT, "HEARTBEAT", {"type": 18, "autopilot": 8, "system_status": 4}),
        (
            command_long(VEHICLE, 176, 1.0, 4.0),
            "COMMAND_LONG",
            {"target_system": 7, "command": 176, "param1": 1.0, "param2": 4.0, "param7": 0.0},
        ),
        (
            SetPositionTarget(VEHICLE, -24.0, -46.3, 120.0),
            "SET_POSITION_TARGET_GLOBAL_INT",
            {
                "target_system": 7,
                "target_component": 1,
                "coordinate_frame": 5,
                "type_mask": 3576,
                "lat_int": -240000000,
                "lon_int": -463000000,
                "alt": 120.0,
            },
        ),
        (
            SetPositionTarget(VEHICLE, -24.0, -46.3, 120.0, (3.0, -4.0)),
            "SET_POSITION_TARGET_GLOBAL_INT",
            {"coordinate_frame": 5, "type_mask": 3520, "vx": 3.0, "vy": -4.0, "vz": 0.0},
        ),
        (
            SetPositionTarget(VEHICLE, -24.0, -46.3, 120.0, repositions=True),
            "COMMAND_INT",
            {
                "target_system": 7,
                "frame": 0,
                "command": 192,
                "param1": -1.0,
                "x": -240000000,
                "y": -463000000,
                "z": 120.0,
            },
        ),
        (MissionSetCurrent(*VEHICLE, 3), "MISSION_SET_CURRENT", {"seq": 3, "target_system": 7}),
        (
            item_message(
                MissionItem(178, FRAME_MISSION, lat_deg=5, lon_deg=-6, alt_m=7.0), 2, VEHICLE
            ),
            "MISSION_ITEM_INT",
            {"seq": 2, "frame": 2, "command": 178, "x": 5, "y": -6, "z": 7.0},
        ),
    ],
)
def test_a_message_is_encoded_with_its_fields(
    message: Any, kind: str, fields: dict[str, Any]
) -> None:
    frames = [codec().encode(message)]
    assert all(frame[0] == 0xFD for frame in frames)
    read = VehicleCodec(1).decode_all(frames[0], datagram=True)[0]
    assert read.get_type() == kind
    assert {name: getattr(read, name) for name in fields} == fields
    assert (read.get_srcSystem(), read.get_srcComponent()) == OURSELVES


@pytest.mark.parametrize(("lat_deg", "lon_deg", "name"), [(math.nan, 0, "lat"), (0, 181, "lon")])
def test_a_setpoint_that_is_not_allowed_is_refused_by_name(
    lat_deg: float, lon_deg: float, name: str
) -> None:
    with pytest.raises(ValueError, match=f"^{name}_deg must be -180 to 180, got "):
        codec().encode(SetPositionTarget(VEHICLE, lat_deg, lon_deg, 10.0))


def test_a_message_stays_as_it_is_when_it_is_encoded() -> None:
    before = vars(HEARTBEAT).copy()
    codec().encode(HEARTBEAT)
    assert vars(HEARTBEAT) == before


def test_frames_are_numbered() -> None:
    ours = codec()
    numbers = [ours.encode(HEARTBEAT)[4] for _ in range(300)]
    assert numbers == [number % 256 for number in range(300)]


@given(st.integers(0, 2**16 - 1), st.sampled_from([MissionRequest]))
def test_mission_requests_are_decoded(seq: int, kind: Any) -> None:
    frame = VehicleCodec(7).encode(mavlink.MAVLink_mission_request_message(245, 191, seq, 0))
    (message,) = codec().decode(frame, 0.0, datagram=True)
    assert str(message) == str(kind(*OURSELVES, seq))


@given(st.integers(-(10**8), 10**8), st.integers(-(2**15), 2**15 - 1), st.integers(0, 2**16 - 1))
def test_positions_are_decoded(number: int, speed: int, heading: int) -> None:
    fields = (5, number, -1, number, number, speed, speed, speed, heading)
    frame = VehicleCodec(7).encode(mavlink.MAVLink_global_position_int_message(*fields))
    (message,) = codec().decode(frame, 0.0, datagram=True)
    assert str(message) == str(GlobalPosition(*fields))
