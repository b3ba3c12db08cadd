# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""ArduCopter's behaviour, in vehicle time."""

from __future__ import annotations

import math

import pytest
from autopilot.bench import AUTO, GUIDED, LOITER, RTL, Bench
from autopilot.commands import ACCEPTED, DENIED, FAILED, UNSUPPORTED
from autopilot.local_frame import Place
from autopilot.wire import mavlink

ARM, TAKE_OFF, SET_MODE, REPOSITION = 400, 22, 176, 192
POSITION, TARGET, SYS_STATUS, EKF = 33, 87, 1, 193
BY_DEFAULT = {"HEARTBEAT", "PARAM_VALUE", "STATUSTEXT", "TIMESYNC"} | {
    "HOME_POSITION",
    "GPS_GLOBAL_ORIGIN",
}
HIGH_HOME = Place(-24.0, -46.3, 500.0)


@pytest.fixture
def bench() -> Bench:
    return Bench(home=HIGH_HOME)


def armed_on_the_ground(bench: Bench) -> None:
    bench.until(lambda: bench.vehicle.ready)
    assert bench.command(SET_MODE, 1, GUIDED) == ACCEPTED
    assert bench.command(ARM, 1) == ACCEPTED


def test_only_a_few_messages_are_streamed_by_default(bench: Bench) -> None:
    bench.wait(100)
    assert {message.get_type() for message in bench.received} == BY_DEFAULT
    assert len(bench.all("HEARTBEAT")) == 101


def test_a_requested_message_comes_at_its_rate_in_vehicle_time(bench: Bench) -> None:
    bench.wait(2)
    bench.stream(POSITION, 10)
    bench.wait(10)
    assert len(bench.all("GLOBAL_POSITION_INT")) == pytest.approx(100, abs=1)
    assert bench.command(511, POSITION, -1) == ACCEPTED
    before = len(bench.all("GLOBAL_POSITION_INT"))
    bench.wait(10)
    assert len(bench.all("GLOBAL_POSITION_INT")) == before


def test_a_request_in_the_first_second_is_acknowledged_and_lost(bench: Bench) -> None:
    bench.wait(0.5)
    bench.stream(POSITION, 10)
    bench.wait(10)
    assert bench.all("GLOBAL_POSITION_INT") == []


def test_an_unknown_message_is_denied_and_an_unknown_command_unsupported(bench: Bench) -> None:
    assert bench.command(511, 12345, 1e6) == DENIED
    assert bench.command(31000) == UNSUPPORTED


def test_it_is_ready_42_s_after_the_start_and_knows_its_position_before(bench: Bench) -> None:
    bench.wait(2)
    bench.stream(EKF, 10)
    bench.stream(SYS_STATUS, 10)

    def position() -> bool:
        flags = bench.last("EKF_STATUS_REPORT").flags
        return bool(flags & 16 and not flags & 128)

    def healthy() -> bool:
        return bool(bench.last("SYS_STATUS").onboard_control_sensors_health & 1 << 28)

    bench.wait(0.2)
    bench.until(position)
    assert not healthy()
    bench.until(healthy)
    assert bench.vehicle.time_s == pytest.approx(42, abs=0.3)
    assert bench.command(ARM, 1) == ACCEPTED


@pytest.mark.parametrize("at_s", [5.0, 30.0])
def test_arming_too_early_fails_with_a_status_text(bench: Bench, at_s: float) -> None:
    bench.wait(at_s)
    assert bench.command(SET_MODE, 1, GUIDED) == ACCEPTED
    assert bench.command(ARM, 1) == FAILED
    assert bench.texts()[-1].startswith("Arm: ")
    assert not bench.vehicle.armed


def test_auto_and_rtl_cannot_be_armed(bench: Bench) -> None:
    bench.until(lambda: bench.vehicle.ready)
    bench.command(SET_MODE, 1, RTL)
    assert bench.command(ARM, 1) == FAILED
    assert "not armable" in bench.texts()[-1]


@pytest.mark.parametrize(
    ("away_m", "up_m", "alt_cm", "climb_cm", "slope", "top_m"),
    [
        (30.0, 10.0, 1500, 0, 3.0, 15.0),
        (30.0, 10.0, 0, 0, 3.0, 10.0),
        (30.0, 10.0, 1500, 300, 3.0, 15.0),
        (30.0, 10.0, 1500, -500, 3.0, 15.0),
        (30.0, 10.0, 1500, 1000, 3.0, 20.0),
        (10.0, 10.0, 6000, 0, 3.0, 30.0),
        (2.0, 10.0, 1500, 0, 3.0, 10.0),
        (2.0, 10.0, 1500, 0, 0.0, 15.0),
        (0.0, 20.0, 1500, 1000, 3.0, 30.0),
    ],
)
def test_it_climbs_to_return_unless_it_is_near_home(
    bench: Bench,
    away_m: float,
    up_m: float,
    alt_cm: float,
    climb_cm: float,
    slope: float,
    top_m: float,
) -> None:
    parameters = bench.vehicle.parameters
    parameters["RTL_ALT"], parameters["RTL_CLIMB_MIN"] = alt_cm, climb_cm
    parameters["RTL_CONE_SLOPE"] = slope
    bench.fly_to_altitude(up_m)
    bench.vehicle.craft.north_m = away_m
    bench.command(SET_MODE, 1, RTL)
    assert bench.top_m_until_landed() == pytest.approx(top_m, abs=0.4)


def test_a_flight_takes_as_long_as_a_real_one(bench: Bench) -> None:
    armed_on_the_ground(bench)
    assert bench.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 120) == ACCEPTED
    assert bench.until(lambda: bench.vehicle.craft.up_m > 119.7) == pytest.approx(52, abs=2)
    bench.wait(5)
    bench.setpoint(0, 130, 120)
    leg_s = bench.until(lambda: abs(bench.vehicle.craft.east_m - 130) < 0.2)
    assert leg_s == pytest.approx(18, abs=1)
    bench.command(20)
    assert bench.until(lambda: not bench.vehicle.armed) == pytest.approx(121, abs=5)
    assert bench.vehicle.landed
    assert math.hypot(*bench.vehicle.craft.point) < 0.5


def test_it_disarms_itself_after_10_s_on_the_ground(bench: Bench) -> None:
    armed_on_the_ground(bench)
    assert bench.until(lambda: not bench.vehicle.armed) == pytest.approx(10, abs=0.2)


def test_a_take_off_in_the_air_fails(bench: Bench) -> None:
    bench.fly_to_altitude()
    assert bench.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 50) == FAILED


def test_a_take_off_outside_guided_or_without_motors_fails(bench: Bench) -> None:
    bench.until(lambda: bench.vehicle.ready)
    assert bench.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 50) == FAILED
    bench.command(SET_MODE, 1, LOITER)
    assert bench.command(ARM, 1) == ACCEPTED
    assert bench.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 50) == FAILED


def test_a_position_target_in_mid_take_off_overrides_the_climb(bench: Bench) -> None:
    armed_on_the_ground(bench)
    bench.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 120)
    bench.until(lambda: bench.vehicle.craft.up_m > 30)
    bench.setpoint(0, 50, 40)
    bench.wait(40)
    assert bench.vehicle.craft.point == pytest.approx((0, 50, 40), abs=0.1)


@pytest.mark.parametrize("frame", [0, 5])
def test_altitudes_of_the_frames_0_and_5_are_above_the_sea(bench: Bench, frame: int) -> None:
    bench.fly_to_altitude()
    bench.setpoint(30, 0, 540, frame)
    bench.wait(40)
    assert bench.vehicle.craft.point == pytest.approx((30, 0, 40), abs=0.1)


@pytest.mark.parametrize("frame", [3, 6])
def test_altitudes_of_the_frames_3_and_6_are_above_home(bench: Bench, frame: int) -> None:
    bench.fly_to_altitude()
    bench.setpoint(30, 0, 40, frame)
    bench.wait(40)
    assert bench.vehicle.craft.point == pytest.approx((30, 0, 40), abs=0.1)


@pytest.mark.parametrize("frame", [1, 7])
def test_local_frames_stop_it(bench: Bench, frame: int) -> None:
    bench.fly_to_altitude()
    bench.setpoint(500, 0, 20)
    bench.wait(10)
    bench.setpoint(30, 0, 40, frame)
    bench.wait(10)
    here = bench.vehicle.craft.point
    assert here.north_m < 150 and bench.vehicle.craft.ground_speed_mps == pytest.approx(0)
    bench.wait(10)
    assert bench.vehicle.craft.point == here


@pytest.mark.parametrize("frame", [10, 11])
def test_terrain_frames_change_nothing(bench: Bench, frame: int) -> None:
    bench.fly_to_altitude()
    bench.setpoint(100, 0, 20)
    bench.wait(2)
    bench.setpoint(0, 100, 40, frame)
    bench.wait(40)
    assert bench.vehicle.craft.point == pytest.approx((100, 0, 20), abs=0.1)


def test_a_setpoint_outside_guided_is_ignored_without_a_message(bench: Bench) -> None:
    bench.fly_to_altitude()
    bench.command(SET_MODE, 1, LOITER)
    bench.wait(1.01)
    before, texts = bench.vehicle.craft.point, bench.texts()
    bench.setpoint(100, 0, 20)
    bench.wait(20)
    assert bench.vehicle.craft.point == pytest.approx(before, abs=0.01)
    assert bench.texts() == texts


def test_a_setpoint_on_the_ground_lifts_nothing(bench: Bench) -> None:
    armed_on_the_ground(bench)
    bench.setpoint(100, 0, 20)
    bench.wait(9)
    assert bench.vehicle.craft.point == (0, 0, 0)


def test_the_target_is_reported_above_the_sea_whatever_frame_it_came_in(bench: Bench) -> None:
    bench.fly_to_altitude()
    bench.stream(TARGET, 5)
    bench.setpoint(100, 0, 40, 6)
    bench.wait(1)
    target = bench.last("POSITION_TARGET_GLOBAL_INT")
    lat_deg, _ = bench.vehicle.frame.geodetic(100, 0)
    assert (target.coordinate_frame, target.alt) == (0, 540)
    assert abs(target.lat_int - lat_deg * 1e7) <= 1


def test_messages_to_system_0_are_accepted_and_to_another_are_not(bench: Bench) -> None:
    bench.fly_to_altitude()
    bench.setpoint(60, 0, 20, target=0)
    bench.wait(30)
    assert bench.vehicle.craft.north_m == pytest.approx(60, abs=0.1)
    bench.setpoint(0, 0, 20, target=2)
    bench.wait(30)
    assert bench.vehicle.craft.north_m == pytest.approx(60, abs=0.1)
    assert bench.command(SET_MODE, 1, LOITER, target=2) is None
    assert bench.command(SET_MODE, 1, LOITER, target=0) == ACCEPTED


def test_a_reposition_needs_the_flag_that_changes_the_mode(bench: Bench) -> None:
    bench.fly_to_altitude()
    lat_deg, lon_deg = bench.vehicle.frame.geodetic(80, 0)

    def reposition(param2: float) -> int | None:
        return bench.command_at(REPOSITION, lat_deg, lon_deg, 25, frame=6, param2=param2)

    assert reposition(0) == ACCEPTED
    bench.command(SET_MODE, 1, RTL)
    assert reposition(0) == DENIED
    assert bench.last("COMMAND_ACK").target_system == 255
    assert reposition(1) == ACCEPTED
    bench.wait(30)
    assert bench.vehicle.custom_mode == GUIDED
    assert bench.vehicle.craft.point == pytest.approx((80, 0, 25), abs=0.1)


def test_a_set_velocity_lasts_three_seconds(bench: Bench) -> None:
    bench.fly_to_altitude()
    bench.send(
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, 0x0DC7, 0, 0, 0, 4.0, 0, 0, *[0.0] * 5
        )
    )
    bench.wait(2.9)
    assert bench.vehicle.craft.north_mps == pytest.approx(4)
    bench.wait(5)
    assert bench.vehicle.craft.north_mps == pytest.approx(0)


class TestGcsFailsafe:
    @staticmethod
    def hear_from(bench: Bench, system: int, seconds: int) -> None:
        for _ in range(seconds):
            bench.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), system)
            bench.wait(1)

    @staticmethod
    def switch_on(bench: Bench) -> None:
        bench.send(mavlink.MAVLink_param_set_message(1, 1, b"FS_GCS_ENABLE", 1, 6))
        assert bench.last("PARAM_VALUE").param_value == 1

    def test_it_is_off_by_default(self, bench: Bench) -> None:
        bench.fly_to_altitude()
        self.hear_from(bench, 255, 3)
        bench.wait(60)
        assert bench.vehicle.custom_mode == GUIDED

    def test_it_returns_after_5_s_and_keeps_returning(self, bench: Bench) -> None:
        self.switch_on(bench)
        bench.fly_to_altitude()
        self.hear_from(bench, 255, 20)
        assert bench.vehicle.custom_mode == GUIDED
        assert bench.until(lambda: bench.vehicle.custom_mode == RTL) == pytest.approx(4, abs=0.3)
        self.hear_from(bench, 255, 5)
        assert bench.vehicle.custom_mode == RTL
        assert bench.texts()[-2:] == ["GCS Failsafe", "GCS Failsafe Cleared"]

    def test_heartbeats_of_another_system_do_not_count(self, bench: Bench) -> None:
        self.switch_on(bench)
        bench.fly_to_altitude()
        self.hear_from(bench, 255, 2)
        self.hear_from(bench, 250, 6)
        assert bench.vehicle.custom_mode == RTL


def test_a_mission_must_begin_with_a_take_off_when_on_the_ground(bench: Bench) -> None:
    armed_on_the_ground(bench)
    assert bench.command(SET_MODE, 1, AUTO) == FAILED
    items = bench.mission((50, 0, 20))
    del items[1]
    bench.upload(items)
    assert bench.command(SET_MODE, 1, AUTO) == FAILED
    assert "Auto: Missing Takeoff Cmd" in bench.texts()


def test_all_parameters_are_sent_when_the_list_is_requested(bench: Bench) -> None:
    bench.send(mavlink.MAVLink_param_request_list_message(1, 1))
    bench.wait(2)
    values = bench.all("PARAM_VALUE")
    assert [value.param_index for value in values] == list(range(values[0].param_count))
    assert {value.param_id for value in values} >= {"SYSID_THISMAV", "WPNAV_SPEED"}


def test_a_changed_speed_is_flown(bench: Bench) -> None:
    bench.fly_to_altitude()
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"WPNAV_SPEED", 300.0, 9))
    bench.setpoint(300, 0, 20)
    bench.wait(10)
    assert bench.vehicle.craft.ground_speed_mps == pytest.approx(3)
