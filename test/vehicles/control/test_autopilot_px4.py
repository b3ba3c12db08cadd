# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""PX4's behaviour, in vehicle time."""

from __future__ import annotations

import math
import struct
from dataclasses import replace

import pytest
from autopilot.bench import POSITION_ONLY, Bench
from autopilot.commands import ACCEPTED, TEMPORARILY_REJECTED, UNSUPPORTED
from autopilot.faults import Fault
from autopilot.local_frame import Place
from autopilot.px4 import Mode, Px4
from autopilot.wire import mavlink

OK, ERROR = 0, 1
SET_MODE, REPOSITION = 176, 192
AUTO_MISSION, AUTO_RTL, AUTO_LAND, OFFBOARD = (4, 4), (4, 5), (4, 6), (6, 0)


@pytest.fixture
def bench() -> Bench:
    return Bench(autopilot="px4", home=Place(47.4, 8.5, 488.0), ready_s=5.0)


def events(bench: Bench) -> list[str]:
    assert isinstance(bench.vehicle, Px4)
    return bench.vehicle.events


def stream_setpoints(bench: Bench, seconds: float, rate_hz: float) -> None:
    for _ in range(round(seconds * rate_hz)):
        bench.setpoint(40, 0, 30)
        bench.wait(1 / rate_hz)


def test_its_heartbeat_is_px4s_with_the_mode_in_the_upper_bytes(bench: Bench) -> None:
    bench.fly_to_altitude()
    bench.command(SET_MODE, 1, *AUTO_RTL)
    bench.wait(1.01)
    heartbeat = bench.last("HEARTBEAT")
    assert heartbeat.autopilot == mavlink.MAV_AUTOPILOT_PX4
    assert heartbeat.custom_mode == 4 << 16 | 5 << 24
    assert heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_arming_too_early_is_rejected_with_a_reason(bench: Bench) -> None:
    bench.wait(1)
    assert bench.command(400, 1) == TEMPORARILY_REJECTED
    assert events(bench)[-1].startswith("Arming denied: ")


def test_a_take_off_is_above_the_sea_and_ends_in_hold(bench: Bench) -> None:
    bench.fly_to_altitude(12)
    assert bench.vehicle.craft.up_m == pytest.approx(12, abs=0.1)
    assert bench.vehicle.custom_mode == Mode.HOLD


def test_at_rest_its_estimator_reports_a_constant_position(bench: Bench) -> None:
    bench.until(lambda: bench.vehicle.ready)
    bench.wait(1.01)
    assert bench.last("ESTIMATOR_STATUS").flags == 1023
    bench.fly_to_altitude()
    assert not bench.last("ESTIMATOR_STATUS").flags & mavlink.ESTIMATOR_CONST_POS_MODE


def test_its_status_texts_go_to_a_ground_station_alone(bench: Bench) -> None:
    bench.command(400, 1)
    assert not bench.texts() and any(data[7:10] == bytes((0x9A, 1, 0)) for data in bench.sent)
    station = mavlink.MAV_TYPE_GCS
    bench.send(
        mavlink.MAVLink_heartbeat_message(station, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    )
    bench.command(400, 1)
    assert bench.texts() == ["Arming denied: Resolve system health failures firs"]


def test_a_low_battery_makes_it_hold_and_then_land(bench: Bench) -> None:
    bench.fly_to_altitude()
    bench.vehicle._start_fault(Fault("battery", 0.0))
    bench.wait(2.5)
    assert bench.vehicle.custom_mode == Mode.HOLD
    assert bench.last("HEARTBEAT").system_status == mavlink.MAV_STATE_CRITICAL
    emergency = mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY
    assert bench.last("BATTERY_STATUS").charge_state == emergency
    bench.until(lambda: bench.vehicle.custom_mode == Mode.LAND, limit_s=6.0)


@pytest.mark.parametrize("frame", [0, 3, 6])
def test_a_reposition_is_above_the_sea_whatever_its_frame(bench: Bench, frame: int) -> None:
    bench.fly_to_altitude()
    lat_deg, lon_deg = bench.vehicle.frame.geodetic(0, 50)
    result = bench.command_at(REPOSITION, lat_deg, lon_deg, 518, frame=frame, param2=1)
    assert result == ACCEPTED
    bench.wait(60)
    assert bench.vehicle.craft.point == pytest.approx((0, 50, 30), abs=0.1)


def test_a_reposition_without_the_flag_that_changes_the_mode_is_unsupported(bench: Bench) -> None:
    bench.fly_to_altitude()
    result = bench.command_at(REPOSITION, 47.4, 8.5, 518, frame=0, param2=0)
    assert result == UNSUPPORTED


class TestOffboard:
    def test_it_is_refused_without_setpoints(self, bench: Bench) -> None:
        bench.fly_to_altitude()
        assert bench.command(SET_MODE, 1, *OFFBOARD) == TEMPORARILY_REJECTED

    def test_it_is_refused_with_too_few(self, bench: Bench) -> None:
        bench.fly_to_altitude()
        stream_setpoints(bench, 5, 0.9)
        assert bench.command(SET_MODE, 1, *OFFBOARD) == TEMPORARILY_REJECTED

    def test_it_flies_them_while_they_come_and_returns_when_they_stop(self, bench: Bench) -> None:
        bench.fly_to_altitude()
        before = bench.vehicle.craft.point
        stream_setpoints(bench, 2, 4)
        assert bench.vehicle.craft.point == pytest.approx(before, abs=0.1)
        assert bench.command(SET_MODE, 1, *OFFBOARD) == ACCEPTED
        stream_setpoints(bench, 30, 4)
        assert bench.vehicle.craft.point == pytest.approx((40, 0, 30), abs=0.1)
        bench.wait(1.2)
        assert bench.vehicle.custom_mode == Mode.RTL
        bench.wait(1)
        assert bench.last("HEARTBEAT").system_status == mavlink.MAV_STATE_CRITICAL
        assert not bench.texts()
        bench.setpoint(40, 0, 30)
        bench.wait(0.2)
        assert bench.vehicle.custom_mode == Mode.OFFBOARD
        bench.wait(0.9)
        assert bench.last("HEARTBEAT").system_status == mavlink.MAV_STATE_ACTIVE

    def test_another_mode_that_is_chosen_meanwhile_stays(self, bench: Bench) -> None:
        bench.fly_to_altitude()
        stream_setpoints(bench, 2, 4)
        assert bench.command(SET_MODE, 1, *OFFBOARD) == ACCEPTED
        bench.wait(2)
        assert bench.command(SET_MODE, 1, *AUTO_LAND) == ACCEPTED
        stream_setpoints(bench, 2, 4)
        assert bench.vehicle.custom_mode == Mode.LAND
        assert bench.last("HEARTBEAT").system_status == mavlink.MAV_STATE_ACTIVE

    def test_after_a_landing_it_is_in_offboard_again_and_cannot_be_armed(
        self, bench: Bench
    ) -> None:
        bench.fly_to_altitude()
        stream_setpoints(bench, 2, 4)
        assert bench.command(SET_MODE, 1, *OFFBOARD) == ACCEPTED
        assert bench.command(SET_MODE, 1, *AUTO_LAND) == ACCEPTED
        bench.until(lambda: not bench.vehicle.armed)
        bench.wait(2)
        assert bench.vehicle.custom_mode == Mode.OFFBOARD
        prearm = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        assert not bench.last("SYS_STATUS").onboard_control_sensors_health & prearm
        assert bench.command(400, 1) == TEMPORARILY_REJECTED
        assert bench.command(SET_MODE, 1, 4, 3) == ACCEPTED
        assert bench.command(400, 1) == ACCEPTED

    def test_a_change_of_speed_is_accepted_and_ignored(self, bench: Bench) -> None:
        bench.fly_to_altitude()
        assert bench.command(178, 1, 3.0, -1) == ACCEPTED
        for _ in range(4):
            bench.setpoint(400, 0, 20)
            bench.wait(0.25)
        assert bench.command(SET_MODE, 1, *OFFBOARD) == ACCEPTED
        for _ in range(40):
            bench.setpoint(400, 0, 20)
            bench.wait(0.25)
        assert bench.vehicle.craft.ground_speed_mps > 10.0


class TestMissions:
    def test_there_is_no_home_item_and_all_is_read_back(self, bench: Bench) -> None:
        items = [bench.item(16, 10.0 * i, 0.0, 30.0, param2=2.0) for i in range(30)]
        items[3] = replace(items[3], frame=3)
        assert bench.upload(items) == OK
        assert len(bench.all("MISSION_REQUEST_INT")) == len(items)
        assert bench.download() == [replace(item, frame=6) for item in items]

    def test_an_upload_that_stalls_ends_without_a_message_and_changes_nothing(
        self, bench: Bench
    ) -> None:
        first = [bench.item(16, 10, 0, 30), bench.item(16, 20, 0, 30)]
        bench.upload(first)
        acks = len(bench.all("MISSION_ACK"))
        second = [bench.item(16, 10, 0, 50), bench.item(16, 20, 0, 50)]
        bench.send_count(second)
        bench.send_item(second, 0)
        bench.wait(6)
        assert len(bench.all("MISSION_ACK")) == acks
        assert events(bench)[-1] == "Operation timeout"
        assert bench.download() == first

    def test_it_requests_four_times_a_second(self, bench: Bench) -> None:
        bench.send_count([bench.item(16)])
        bench.wait(1.01)
        assert len(bench.all("MISSION_REQUEST_INT")) in (4, 5)

    def test_repeated_items_do_no_harm(self, bench: Bench) -> None:
        items = [bench.item(16, 10, 0, 30), bench.item(16, 20, 0, 30)]
        bench.send_count(items)
        for seq in (0, 0, 1, 1):
            bench.send_item(items, seq)
        assert [ack.type for ack in bench.all("MISSION_ACK")] == [OK, OK]
        bench.send_item(items, 0)
        assert bench.last("MISSION_ACK").type == ERROR

    def test_an_upload_during_a_download_is_refused(self, bench: Bench) -> None:
        items = [bench.item(16, 10, 0, 30)]
        bench.upload(items)
        bench.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
        bench.send_count(items)
        assert bench.last("MISSION_ACK").type == ERROR
        bench.wait(6)
        assert bench.upload(items) == OK

    def test_a_cancelled_upload_can_start_again(self, bench: Bench) -> None:
        items = [bench.item(16, 10, 0, 30), bench.item(16, 20, 0, 30)]
        bench.send_count(items)
        bench.send_item(items, 0)
        bench.send(mavlink.MAVLink_mission_ack_message(1, 1, 15, 0))
        assert bench.upload(items) == OK

    def test_it_takes_off_flies_and_returns(self, bench: Bench) -> None:
        bench.until(lambda: bench.vehicle.ready)
        way = [bench.item(16, 50, 0, 20), bench.item(16, 50, 50, 25)]
        bench.upload([*way, bench.item(20, x=0, y=0, frame=2)])
        assert bench.command(300) == ACCEPTED
        modes = set()

        def down() -> bool:
            modes.add(bench.vehicle.custom_mode)
            return not bench.vehicle.armed

        bench.until(down)
        assert modes == {Mode.MISSION, Mode.RTL, Mode.HOLD}
        reached = [message.seq for message in bench.all("MISSION_ITEM_REACHED")]
        assert list(dict.fromkeys(reached)) == [0, 1, 2]
        assert reached.count(1) > 1, "it is reported more than once"
        # It comes down wherever it is within this radius of home.
        assert math.hypot(*bench.vehicle.craft.point) < bench.vehicle.parameters["NAV_ACC_RAD"]

    def test_the_mode_is_refused_without_a_mission(self, bench: Bench) -> None:
        bench.fly_to_altitude()
        assert bench.command(SET_MODE, 1, *AUTO_MISSION) == TEMPORARILY_REJECTED


def test_it_lands_where_it_is_and_disarms_two_seconds_later(bench: Bench) -> None:
    bench.fly_to_altitude()
    assert bench.command(SET_MODE, 1, *AUTO_LAND) == ACCEPTED
    bench.until(lambda: bench.vehicle.landed)
    assert bench.until(lambda: not bench.vehicle.armed) == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize(
    ("away_m", "up_m", "cone_deg", "top_m"),
    [
        (30.0, 20.0, 45, 30.0),
        (30.0, 40.0, 45, 40.0),
        (8.0, 20.0, 45, 20.0),
        (8.0, 20.0, 18, 24.6),
        (8.0, 20.0, 0, 30.0),
        (0.0, 20.0, 1, 20.0),
    ],
)
def test_it_climbs_to_return_unless_it_is_near_home(
    bench: Bench, away_m: float, up_m: float, cone_deg: int, top_m: float
) -> None:
    bench.vehicle.parameters["RTL_CONE_ANG"] = cone_deg
    bench.fly_to_altitude(up_m)
    bench.vehicle.craft.north_m = away_m
    bench.command(SET_MODE, 1, *AUTO_RTL)
    assert bench.top_m_until_landed() == pytest.approx(top_m, abs=0.4)


def test_whole_parameters_travel_as_their_bits(bench: Bench) -> None:
    bits = struct.unpack("<f", struct.pack("<i", 7))[0]
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"NAV_DLL_ACT", bits, 6))
    assert bench.vehicle.parameters["NAV_DLL_ACT"] == 7
    value = bench.last("PARAM_VALUE").param_value
    assert struct.unpack("<i", struct.pack("<f", value)) == (7,)


def test_setpoints_in_the_local_frame_are_from_home(bench: Bench) -> None:
    bench.fly_to_altitude()

    def stream(seconds: int) -> None:
        for _ in range(4 * seconds):
            bench.send(
                mavlink.MAVLink_set_position_target_local_ned_message(
                    0, 1, 1, 1, POSITION_ONLY, 10.0, 20.0, -30.0, *[0.0] * 8
                )
            )
            bench.wait(0.25)

    stream(1)
    assert bench.command(SET_MODE, 1, *OFFBOARD) == ACCEPTED
    stream(30)
    assert bench.vehicle.craft.point == pytest.approx((10, 20, 30), abs=0.1)
