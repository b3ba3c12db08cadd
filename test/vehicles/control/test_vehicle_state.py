# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state is what the vehicle has reported, and nothing else."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from message_values import with_fields
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots import AUTOPILOTS, Failsafe
from dsse_ros.vehicles.control.message_requests import MessageRequests
from dsse_ros.vehicles.control.vehicle_state import VehicleState, observe, without_link
from dsse_ros.vehicles.mavlink.events import EventMessage
from dsse_ros.vehicles.mavlink.messages import (
    INCOMING,
    Address,
    Attitude,
    AutopilotVersion,
    BatteryStatus,
    EkfStatus,
    ExtendedSysState,
    GlobalPosition,
    Heartbeat,
    HomePosition,
    Incoming,
    MissionCurrent,
    MissionItemReached,
    ParamRequestRead,
    ParamValue,
    PositionTarget,
    StatusText,
    SysStatus,
    Wind,
    WindCov,
)

GUIDED = Heartbeat(2, 3, 1, 4, 3, 3)
ARMED = Heartbeat(2, 3, 129, 4, 4, 3)
READY = 1 << 28
HERE = GlobalPosition(5000, -240000000, -463000000, 130_000, 120_000, 300, 400, -50, 9000)
NUMBERS = st.integers(-(2**31), 2**32 - 1)
UNUSED = (0.0,) * 8


def sys_status(health: int, remaining: int, enabled: int = 0) -> SysStatus:
    return with_fields(
        SysStatus,
        onboard_control_sensors_health=health,
        battery_remaining=remaining,
        onboard_control_sensors_enabled=enabled,
    )


def battery(state: str) -> BatteryStatus:
    number = getattr(mavlink, f"MAV_BATTERY_CHARGE_STATE_{state}")
    return with_fields(BatteryStatus, charge_state=number)


def ekf(flags: int) -> EkfStatus:
    return with_fields(EkfStatus, flags=flags)


def after(*messages: Incoming, autopilot: str = "ardupilot") -> VehicleState:
    state = VehicleState()
    for message in messages:
        state = observe(state, message, 7.0, AUTOPILOTS[autopilot])
    return state


def test_at_first_nothing_is_known() -> None:
    state = VehicleState()
    assert not (state.connected or state.ready or state.armed or state.flying or state.has_position)
    assert math.isnan(state.lat_deg) and math.isnan(state.battery)
    assert state.home is None and state.mode == "" and state.item_reached == -1


def test_a_heartbeat_has_mode_and_arming() -> None:
    state = after(GUIDED)
    assert (state.connected, state.mode, state.armed, state.heard_s) == (True, "GUIDED", False, 7.0)
    assert after(ARMED).armed


def test_a_position_comes_in_degrees_and_metres() -> None:
    state = after(HERE)
    assert (state.lat_deg, state.lon_deg) == pytest.approx((-24.0, -46.3))
    assert (state.alt_amsl_m, state.alt_m) == pytest.approx((130.0, 120.0))
    assert (state.speed_mps, state.climb_mps, state.heading_deg) == pytest.approx((5.0, 0.5, 90.0))
    assert state.boot_s == pytest.approx(5.0)


@pytest.mark.parametrize(("lat", "lon"), [(0, 0), (1126, -2934)])
def test_an_unknown_position_is_none(lat: int, lon: int) -> None:
    unknown = GlobalPosition(5000, lat, lon, 0, 0, 0, 0, 0, 65535)
    assert not after(unknown).has_position
    assert after(HERE, unknown).lat_deg == pytest.approx(-24.0)


@pytest.mark.parametrize(
    ("flags", "health", "ready"),
    [(831, READY, True), (831, 0, False), (831 & ~16, READY, False), (831 | 128, READY, False)],
)
def test_ready_takes_a_position_and_the_checks(flags: int, health: int, ready: bool) -> None:
    for messages in (
        (ekf(flags), sys_status(health, 90)),
        (sys_status(health, 90), ekf(flags)),
    ):
        assert after(GUIDED, *messages).ready is ready


@pytest.mark.parametrize(
    ("landed", "flying"), [(1, False), (2, True), (3, True), (4, True), (0, True)]
)
def test_flying_is_its_landed_state(landed: int, flying: bool) -> None:
    assert after(ARMED, ExtendedSysState(0, landed)).flying is flying
    assert not after(GUIDED, ExtendedSysState(0, landed)).flying


@pytest.mark.parametrize(("remaining", "battery"), [(0, 0.0), (55, 0.55), (100, 1.0)])
def test_the_battery_is_a_share(remaining: int, battery: float) -> None:
    assert after(sys_status(0, remaining)).battery == pytest.approx(battery)


def test_a_battery_that_is_not_measured_is_not_known() -> None:
    assert math.isnan(after(sys_status(0, -1)).battery)


@pytest.mark.parametrize(
    ("autopilot", "name", "value", "alt_m"),
    [
        ("ardupilot", "RTL_ALT", 1500.0, 15.0),
        ("ardupilot", "RTL_ALT_M", 15.0, 15.0),
        ("px4", "RTL_RETURN_ALT", 30.0, 30.0),
    ],
)
def test_the_altitude_of_its_return_is_one_of_its_parameters(
    autopilot: str, name: str, value: float, alt_m: float
) -> None:
    message, other = (
        ParamValue(one.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32, 2, 0)
        for one in (name, "RTL_LOIT_TIME")
    )
    assert after(message, other, autopilot=autopilot).return_alt_m == pytest.approx(alt_m)
    assert math.isnan(after(other, autopilot=autopilot).return_alt_m)


@pytest.mark.parametrize(("name", "value"), [("RTL_CLIMB_MIN", 300.0), ("RTL_CLIMB_MIN_M", 3.0)])
def test_the_least_climb_of_its_return_is_one_of_its_parameters(name: str, value: float) -> None:
    message = ParamValue(name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32, 2, 0)
    assert after(message).return_climb_m == pytest.approx(3.0)
    assert math.isnan(after(message, autopilot="px4").return_climb_m)


@pytest.mark.parametrize(
    ("text", "failsafe"),
    [
        ("Battery 1 is low 9.96V used 2900 mAh", Failsafe.BATTERY),
        ("Battery Failsafe", Failsafe.BATTERY),
        ("Low battery level, return advised", Failsafe.BATTERY),
        ("GCS Failsafe", Failsafe.GCS),
        ("Radio Failsafe - RTL", Failsafe.RADIO),
        ("EKF Failsafe: changed to LAND Mode", Failsafe.EKF),
        ("PreArm: Battery 1 low voltage failsafe", None),
        ("Reached command #3", None),
    ],
)
def test_a_failsafe_is_named_by_what_the_vehicle_reports(
    text: str, failsafe: Failsafe | None
) -> None:
    assert after(ARMED, StatusText(4, text)).failsafe == failsafe
    critical = Heartbeat(2, 3, 129, 6, 5, 3)
    assert after(StatusText(4, text), critical).failsafe == (failsafe or Failsafe.CRITICAL)
    assert after(StatusText(4, text), critical, ARMED).failsafe is None


CRITICAL = Heartbeat(2, 12, 129, 4 << 16 | 5 << 24, mavlink.MAV_STATE_CRITICAL, 3)
ACTIVE = Heartbeat(2, 12, 129, 4 << 16 | 5 << 24, mavlink.MAV_STATE_ACTIVE, 3)


def unwell(sensor: int) -> SysStatus:
    return sys_status(READY, 80, READY | sensor)


@pytest.mark.parametrize(
    ("message", "failsafe"),
    [
        (battery("EMERGENCY"), Failsafe.BATTERY),
        (battery("CRITICAL"), Failsafe.BATTERY),
        (battery("LOW"), Failsafe.CRITICAL),
        (unwell(mavlink.MAV_SYS_STATUS_SENSOR_GPS), Failsafe.GPS),
        (unwell(mavlink.MAV_SYS_STATUS_AHRS), Failsafe.EKF),
        (unwell(mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS), Failsafe.MOTORS),
        # Nobody flies these with a remote control in simulation, and nothing is wrong.
        (unwell(mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER), Failsafe.CRITICAL),
        (StatusText(4, "Low battery level, return advised"), Failsafe.BATTERY),
    ],
)
def test_a_failsafe_of_px4_is_named_by_what_is_not_well(
    message: Incoming, failsafe: Failsafe
) -> None:
    assert after(message, CRITICAL, autopilot="px4").failsafe == failsafe
    assert after(CRITICAL, message, autopilot="px4").failsafe == failsafe
    # What is not well is no failsafe by itself.
    assert after(ACTIVE, message, autopilot="px4").failsafe is None
    assert after(CRITICAL, message, ACTIVE, autopilot="px4").failsafe is None


def test_px4_is_ready_when_its_checks_are_passed_and_its_place_is_known() -> None:
    checks = sys_status(READY, 90)
    assert after(HERE, checks, autopilot="px4").ready
    assert not after(checks, autopilot="px4").ready
    assert not after(HERE, sys_status(0, 90), autopilot="px4").ready


def test_a_failsafe_that_is_cleared_is_none() -> None:
    assert (
        after(StatusText(4, "GCS Failsafe"), StatusText(4, "GCS Failsafe Cleared")).failsafe is None
    )


def test_progress_home_and_target_are_known() -> None:
    state = after(
        HERE,
        MissionCurrent(4, mission_state=5),
        MissionItemReached(3),
        with_fields(HomePosition, latitude=-240000000, longitude=-463000000, altitude=10_000),
        PositionTarget(0, 0, 3576, -240010000, -463000000, 140.0, *UNUSED),
    )
    assert (state.item_current, state.item_reached, state.mission_over) == (4, 3, True)
    assert state.home == pytest.approx((-24.0, -46.3, 10.0))
    assert state.target == pytest.approx((-24.001, -46.3, 140.0))
    relative = after(HERE, PositionTarget(0, 6, 3576, -240010000, -463000000, 130.0, *UNUSED))
    assert relative.target == pytest.approx((-24.001, -46.3, 140.0))
    assert after(HERE, PositionTarget(0, 0, 7, 0, 0, 0.0, *UNUSED)).target is None


def test_a_wind_of_zero_is_none_that_it_estimates() -> None:
    assert after(Wind(-180.0, 0.0, 0.0)).wind is None
    assert after(Wind(180.0, 5.0, 0.0), Wind(-180.0, 0.0, 0.0)).wind == pytest.approx((0.0, 5.0))


@pytest.mark.parametrize("number", [math.inf, -math.inf, math.nan])
def test_a_wind_or_attitude_that_is_not_finite_is_no_news(number: float) -> None:
    known = after(Wind(180.0, 5.0, 0.0), Attitude(0, 0.1, 0.2, 0.0, 0.0, 0.0, 0.0))
    assert known.wind == pytest.approx((0.0, 5.0))
    for message in (
        Wind(number, 5.0, 0.0),
        Wind(180.0, number, 0.0),
        with_fields(WindCov, wind_x=number),
        Attitude(0, number, 0.0, 0.0, 0.0, 0.0, 0.0),
        Attitude(0, 0.0, number, 0.0, 0.0, 0.0, 0.0),
    ):
        assert observe(known, message, 1.0, AUTOPILOTS["ardupilot"]) == known


@pytest.mark.parametrize("number", [math.inf, -math.inf, math.nan])
def test_a_parameter_that_is_not_finite_is_no_news_and_is_asked_for_again(number: float) -> None:
    def of(name: bytes, value: float) -> ParamValue:
        return ParamValue(name, value, mavlink.MAV_PARAM_TYPE_REAL32, 2, 0)

    autopilot = AUTOPILOTS["ardupilot"]
    known = after(of(b"WPNAV_SPEED", 500.0))
    assert known.speed_limit_mps == 5.0
    assert observe(known, of(b"WPNAV_SPEED", number), 1.0, autopilot) == known
    requests = MessageRequests(Address(1, 1), autopilot, 4.0)
    for now, value, asked in ((0.0, number, True), (1e3, 500.0, False)):
        requests.receive(of(b"WPNAV_SPEED", value), now)
        due = requests.due(now, has_setpoint=False)
        names = {str(one.param_id) for one in due if isinstance(one, ParamRequestRead)}
        assert names and any("WPNAV_SPEED" in name for name in names) == asked


def test_without_a_link_it_is_neither_connected_nor_ready_but_last_seen_somewhere() -> None:
    state = without_link(after(GUIDED, HERE, ekf(831), sys_status(READY, 50)))
    assert not state.connected and not state.ready
    assert state.has_position and state.mode == "GUIDED"


@pytest.mark.slow
@given(st.data(), st.sampled_from(["ardupilot", "px4"]))
def test_no_message_makes_it_raise(data: st.DataObject, autopilot: str) -> None:
    state = VehicleState()
    kinds = [StatusText, *(kind for kind in INCOMING if kind.msgname != "STATUSTEXT")]
    for kind in data.draw(st.lists(st.sampled_from(kinds), max_size=20)):
        if kind is StatusText:
            message = StatusText(data.draw(NUMBERS), data.draw(st.text(max_size=50)))
        else:
            values = {name: data.draw(NUMBERS) for name in kind.fieldnames}
            if kind is EventMessage:
                values["arguments"] = data.draw(st.binary(max_size=40))
            if kind is AutopilotVersion:
                values["uid2"] = data.draw(st.lists(st.integers(0, 255), min_size=18, max_size=18))
            if kind is ParamValue:
                values["param_id"] = data.draw(st.binary(max_size=16))
            message = kind(**values)
        state = observe(state, message, 1.0, AUTOPILOTS[autopilot])
    assert isinstance(state.mode, str)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["ardupilot", "px4"]))
def test_every_mode_has_a_name(custom_mode: int, autopilot: str) -> None:
    assert AUTOPILOTS[autopilot].mode_name(custom_mode)


@pytest.mark.parametrize(
    ("name", "autopilot", "custom_mode"),
    [
        ("GUIDED", "ardupilot", 4),
        ("RTL", "ardupilot", 6),
        ("OFFBOARD", "px4", 6 << 16),
        ("HOLD", "px4", 4 << 16 | 3 << 24),
    ],
)
def test_a_mode_is_asked_for_by_its_name(name: str, autopilot: str, custom_mode: int) -> None:
    one = AUTOPILOTS[autopilot]
    enabled, *fields = map(int, one.mode_parameters(name))
    assert enabled == 1
    assert one.mode_name(custom_mode) == name
    shifted = zip(fields, one.mode_shifts, strict=True)
    assert sum(field << shift for field, shift in shifted) == custom_mode
