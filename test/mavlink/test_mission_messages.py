# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages survive pymavlink and the wire, items fit their fields, anything else is rejected."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.mavlink.mission_messages import (
    Address,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
    MissionResult,
    WireItem,
    message_fields,
    message_name,
    read_message,
)

BYTES = st.integers(0, 255)
SHORTS = st.integers(0, 65535)
ADDRESSES = st.builds(Address, BYTES, BYTES)
INTS = st.integers(-(2**31), 2**31 - 1)
FLOATS = st.floats(width=32, allow_nan=False)
ITEMS = st.builds(
    WireItem,
    seq=SHORTS,
    frame=BYTES,
    command=SHORTS,
    current=BYTES,
    autocontinue=BYTES,
    param1=FLOATS,
    param2=FLOATS,
    param3=FLOATS,
    param4=FLOATS,
    x=INTS,
    y=INTS,
    z=FLOATS,
    mission_type=BYTES,
)
MESSAGES = st.one_of(
    st.builds(MissionRequestList, ADDRESSES, BYTES),
    st.builds(MissionCount, ADDRESSES, SHORTS, BYTES),
    st.builds(MissionRequestInt, ADDRESSES, SHORTS, BYTES),
    st.builds(MissionRequest, ADDRESSES, SHORTS, BYTES),
    st.builds(MissionItemInt, ADDRESSES, ITEMS),
    st.builds(MissionAck, ADDRESSES, BYTES, BYTES),
)


def over_the_wire(message):
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    encode = getattr(sender, f"{message_name(message).lower()}_encode")
    frame = encode(**message_fields(message)).pack(sender)
    (received,) = mavlink.MAVLink(None).parse_buffer(frame)
    return received


@given(MESSAGES)
def test_a_message_comes_back_from_the_wire(message):
    received = over_the_wire(message)
    assert read_message(received.get_type(), received.to_dict()) == message


def test_an_open_yaw_comes_back_open():
    item = WireItem(seq=3, frame=6, command=16, param4=math.nan)
    received = over_the_wire(MissionItemInt(Address(1, 1), item))
    read = read_message(received.get_type(), received.to_dict())
    assert isinstance(read, MissionItemInt) and math.isnan(read.item.param4)


def test_the_results_are_those_of_the_protocol():
    for result in MissionResult:
        assert getattr(mavlink, f"MAV_MISSION_{result.name}") == result


VALUES = st.one_of(
    st.none(), st.integers(), st.floats(), st.text(max_size=3), st.binary(max_size=3)
)
NAMES = st.sampled_from(
    ["MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK", "HEARTBEAT", "MISSION_CURRENT", "BAD_DATA"]
)
KEYS = st.sampled_from(
    ["target_system", "target_component", "count", "type", "mission_type", *vars(WireItem(0, 0, 0))]
)


@given(NAMES, st.dictionaries(KEYS, VALUES))
def test_fields_that_are_no_message_give_none(name, fields):
    message = read_message(name, fields)
    assert message is None or message_name(message) == name


@pytest.mark.parametrize("name", ["HEARTBEAT", "MISSION_CURRENT", "BAD_DATA", ""])
def test_messages_of_other_protocols_give_none(name):
    fields = {"target_system": 1, "target_component": 1, "seq": 0, "mission_type": 0}
    assert read_message(name, fields) is None


ITEM = WireItem(seq=1, frame=6, command=16)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("seq", -1),
        ("seq", 65536),
        ("frame", 256),
        ("command", 65536),
        ("current", -1),
        ("autocontinue", 256),
        ("x", 2**31),
        ("y", -(2**31) - 1),
        ("x", 1.0),
        ("x", math.nan),
        ("param1", "5"),
        ("z", None),
        ("z", 3.5e38),
        ("mission_type", 256),
    ],
)
def test_a_value_that_does_not_fit_its_field_is_refused(field, value):
    with pytest.raises(ValueError, match=f"^{field}: .* is not allowed"):
        dataclasses.replace(ITEM, **{field: value})


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3.4e38, 0])
def test_whatever_float32_holds_is_kept(value):
    item = dataclasses.replace(ITEM, param4=value)
    assert item.param4 == value or math.isnan(value)
