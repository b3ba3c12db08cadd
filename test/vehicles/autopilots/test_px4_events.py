# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Events as a real PX4 1.17.0 has sent them."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots import PX4
from dsse_ros.vehicles.control.vehicle_state import VehicleState, observe
from dsse_ros.vehicles.mavlink.codec import Codec
from dsse_ros.vehicles.mavlink.events import EventMessage, event_number
from dsse_ros.vehicles.mavlink.messages import Address, SysStatus

# Payloads, the zeros at their ends left out.
SUMMARY = "e093a801c06a00001b00000088000000100080000000b03a7f80b03a7f80"
NO_MISSION = "d9c20501c06a00001c000000660800000014"
MISSION_REQUIRED = "d9c205014c3c00001600000066ffffffff14"
NO_SETPOINTS = "c71d2f014c3c000017000000330040000014"
NO_REMOTE_CONTROL = "29ed06014c3c00001800000044ffffffff07"
GPS_FIX = "91bebc01488e000027000000447c007e0003"
OUTSIDE = "2f093e0130f801002700000033ffffffff14"
NO_LOCAL_PLACE = "b91bd30114ab020012000000330000380011"
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
        (SUMMARY, None),
        (NO_MISSION, None),
        (MISSION_REQUIRED, "no valid mission"),
        (NO_SETPOINTS, None),
        (NO_REMOTE_CONTROL, None),
        (GPS_FIX, "GPS fix is too low"),
        (NO_PLACE, "no global position estimate"),
        (OUTSIDE, "it is outside its geofence"),
    ],
)
def test_a_check_is_named_that_keeps_it_from_being_armed_in_hold(
    payload: str, text: str | None
) -> None:
    assert PX4.failed_check(received(payload)) == text


def test_each_report_is_in_place_of_the_one_before() -> None:
    state = VehicleState()
    for payload in (SUMMARY, GPS_FIX, NO_PLACE):
        state = observe(state, received(payload), 0.0, PX4)
    assert state.unready == "GPS fix is too low; no global position estimate"
    for payload in (SUMMARY, NO_REMOTE_CONTROL, MISSION_REQUIRED):
        state = observe(state, received(payload), 100.0, PX4)
    assert state.unready == "no valid mission"


def test_a_check_that_fails_outlasts_a_readiness_that_was_reported_before() -> None:
    ready = SysStatus(0, 0, mavlink.MAV_SYS_STATUS_PREARM_CHECK, 0, 0, 0, 90, 0, 0, 0, 0, 0, 0)
    state = VehicleState(lat_deg=-24.0, lon_deg=-46.3, alt_amsl_m=120.0, alt_m=120.0)
    for message in (received(SUMMARY), received(OUTSIDE), ready):
        state = observe(state, message, 0.0, PX4)
    assert state.ready and state.unready is None
    assert state.failed_checks == {"it is outside its geofence"}
    # An error counts that does not keep it from being armed in HOLD; no mission is none.
    state = observe(state, received(NO_MISSION), 0.0, PX4)
    state = observe(state, received(NO_LOCAL_PLACE), 0.0, PX4)
    assert state.failed_checks == {"it is outside its geofence", "no position estimate"}
    assert state.unready is None
    assert not observe(state, received(SUMMARY), 0.0, PX4).failed_checks
