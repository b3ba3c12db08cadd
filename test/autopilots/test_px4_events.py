# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Events as a real PX4 1.17.0 has sent them."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.autopilots import PX4
from dsse_ros.flight.vehicle_state import VehicleState, observe
from dsse_ros.mavlink.codec import Codec
from dsse_ros.mavlink.events import EventMessage, event_number
from dsse_ros.mavlink.messages import Address

# Payloads, the zeros at their ends left out.
SUMMARY = "e093a801c06a00001b00000088000000100080000000b03a7f80b03a7f80"
NO_MISSION = "d9c20501c06a00001c000000660800000014"
MISSION_REQUIRED = "d9c205014c3c00001600000066ffffffff14"
NO_SETPOINTS = "c71d2f014c3c000017000000330040000014"
NO_REMOTE_CONTROL = "29ed06014c3c00001800000044ffffffff07"
GPS_FIX = "91bebc01488e000027000000447c007e0003"
NO_PLACE = "73c29801488e000029000000333800000018"


def received(payload: str) -> EventMessage:
    """Return the event, over the link."""
    data = bytes.fromhex(payload).ljust(EventMessage.unpacker.size, b"\0")
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    message = mavlink.MAVLink_message(EventMessage.id, "EVENT")
    frame = message._pack(sender, EventMessage.crc_extra, data)
    (event,) = Codec(Address(245, 191), Address(1, 1)).decode(bytes(frame), 0.0, datagram=True)
    assert isinstance(event, EventMessage)
    return event


def test_the_number_of_an_event_is_a_hash_of_its_name() -> None:
    assert event_number("check_modes_mission") == 0x0105C2D9


@pytest.mark.parametrize(
    ("payload", "text"),
    [
        (SUMMARY, ""),
        (NO_MISSION, ""),
        (MISSION_REQUIRED, "no valid mission"),
        (NO_SETPOINTS, ""),
        (NO_REMOTE_CONTROL, ""),
        (GPS_FIX, "GPS fix is too low"),
        (NO_PLACE, "no global position estimate"),
    ],
)
def test_a_check_is_named_that_keeps_it_from_being_armed_in_hold(payload: str, text: str) -> None:
    assert PX4.failed_check(received(payload)) == text


def test_each_report_is_in_place_of_the_one_before() -> None:
    state = VehicleState()
    for payload in (SUMMARY, GPS_FIX, NO_PLACE):
        state = observe(state, received(payload), 0.0, PX4)
    assert state.unready == "GPS fix is too low; no global position estimate"
    for payload in (SUMMARY, NO_REMOTE_CONTROL, MISSION_REQUIRED):
        state = observe(state, received(payload), 100.0, PX4)
    assert state.unready == "no valid mission"
