# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The same input at the same vehicle time gives the same bytes, and no input makes it fail."""

from __future__ import annotations

import math
from typing import Any

import pytest
from autopilot.bench import AUTO, Bench
from autopilot.faults import Fault
from autopilot.wire import Codec, mavlink
from hypothesis import given, settings
from hypothesis import strategies as st

AUTOPILOTS = st.sampled_from(["ardupilot", "px4"])
HANDLED = (
    "command_int", "command_long", "file_transfer_protocol", "heartbeat", "mission_ack",
    "mission_clear_all", "mission_count", "mission_item", "mission_item_int", "mission_request",
    "mission_request_int", "mission_request_list", "mission_set_current", "param_request_list",
    "param_request_read", "param_set", "request_data_stream", "set_mode",
    "set_position_target_global_int", "set_position_target_local_ned", "timesync",
)  # fmt: skip
COMMANDS = [16, 20, 21, 22, 115, 176, 178, 192, 224, 300, 400, 410, 511, 510, 512, 520]
_BITS = {"int8_t": 7, "uint8_t": 8, "int16_t": 15, "uint16_t": 16, "int32_t": 31, "uint32_t": 32,
         "int64_t": 63, "uint64_t": 64}  # fmt: skip


def field(name: str, kind: str, length: int) -> st.SearchStrategy[Any]:
    """Any value of a field, and often a valid one."""
    if name.startswith("target_"):
        return st.sampled_from([0, 1])
    if kind == "char":
        return st.binary(max_size=length)
    if kind in ("float", "double"):
        return st.one_of(
            st.sampled_from([0.0, 1.0, 4.0, 6.0, 20.0, 33.0, math.nan, math.inf, -1.0]),
            st.floats(width=32),
        )
    one = st.integers(-(2 ** _BITS[kind]) if kind[0] == "i" else 0, 2 ** _BITS[kind] - 1)
    if name == "command":
        return st.sampled_from(COMMANDS)
    if name in ("seq", "count", "mission_type", "coordinate_frame", "frame"):
        one = st.one_of(st.integers(0, 6), one)
    return st.lists(one, min_size=length, max_size=length) if length > 1 else one


@st.composite
def messages(draw: st.DrawFn) -> Any:
    """Any message that has a handler."""
    kind = getattr(mavlink, f"MAVLink_{draw(st.sampled_from(HANDLED))}_message")
    values = []
    for name in kind.fieldnames:
        place = kind.ordered_fieldnames.index(name)
        length = kind.array_lengths[place] or 1
        values.append(draw(field(name, kind.fieldtypes[kind.fieldnames.index(name)], length)))
    return kind(*values)


inputs = st.lists(st.tuples(st.floats(0, 4), messages()), max_size=20)


def play(script: list[tuple[float, Any]], *, flying: bool, **settings: Any) -> list[bytes]:
    bench = Bench(ready_s=8.0, **settings)
    if flying:
        bench.fly_to_altitude(5.0)
        bench.upload(bench.mission((9, 0, 5), (0, 9, 8)))
    for wait_s, message in script:
        bench.wait(wait_s)
        bench.send(message)
    bench.wait(10)
    return bench.sent


@pytest.mark.slow
@settings(max_examples=40)
@given(autopilot=AUTOPILOTS, script=inputs, flying=st.booleans(), seed=st.integers(0, 3))
def test_no_input_makes_it_fail_and_the_same_input_gives_the_same_bytes(
    autopilot: str, script: list[tuple[float, Any]], flying: bool, seed: int
) -> None:
    sent = play(script, autopilot=autopilot, flying=flying, seed=seed)
    assert sent == play(script, autopilot=autopilot, flying=flying, seed=seed)


@pytest.mark.slow
@given(autopilot=AUTOPILOTS, garbage=st.lists(st.binary(max_size=300), max_size=10))
def test_after_garbage_the_next_message_is_decoded(autopilot: str, garbage: list[bytes]) -> None:
    bench = Bench(autopilot=autopilot)
    for data in garbage:
        bench.vehicle.receive(bench.channel, data)
    assert bench.command(512, 148) == 0
    assert bench.last("AUTOPILOT_VERSION")


def flight(seed: int, step_s: float) -> list[bytes]:
    bench = Bench(seed=seed, faults=(Fault.parse("acks@200+30=0.5"),))
    bench.fly_to_altitude()
    bench.upload(bench.mission((60, 0, 20), (60, 60, 30)))
    bench.stream(33, 5)
    bench.command(176, 1, AUTO)
    while bench.vehicle.time_s < 250:
        bench.vehicle.advance(bench.vehicle.time_s + step_s)
    for _ in range(20):
        bench.command(410)
    return bench.sent


def test_random_numbers_depend_on_the_seed() -> None:
    assert flight(1, 0.1) == flight(1, 0.1) != flight(2, 0.1)


@pytest.mark.parametrize("step_s", [0.02, 1.0])
def test_the_size_of_time_steps_does_not_matter(step_s: float) -> None:
    def sent(stride_s: float) -> list[bytes]:
        bench = Bench()
        for _ in range(round(60 / stride_s)):
            bench.wait(stride_s)
        return bench.sent

    assert sent(step_s) == sent(0.5)


@given(data=st.binary(min_size=1, max_size=400), cuts=st.lists(st.integers(0, 400), max_size=5))
def test_a_stream_is_decoded_wherever_it_is_cut(data: bytes, cuts: list[int]) -> None:
    sender, receiver = Codec(9), Codec(1)
    frames = b"".join(sender.encode(mavlink.MAVLink_timesync_message(0, n)) for n in data[:20])
    places = [0, *sorted(cut for cut in cuts if cut < len(frames)), len(frames)]
    got = []
    for start, end in zip(places, places[1:], strict=False):
        got += receiver.decode_all(frames[start:end], datagram=False)
    assert [message.ts1 for message in got] == list(data[:20])
