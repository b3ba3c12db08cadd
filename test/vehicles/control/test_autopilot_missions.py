# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""ArduCopter's side of the mission protocol, and how it flies a mission, in vehicle time."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from autopilot.bench import AUTO, GUIDED, Bench
from autopilot.commands import ACCEPTED, FAILED
from autopilot.local_frame import Place
from autopilot.mission_items import Item
from autopilot.wire import mavlink

OK, ERROR, NO_SPACE, INVALID_4, INVALID_X, INVALID_SEQUENCE, DENIED, CANCELLED = (
    0, 1, 4, 9, 10, 13, 14, 15,
)  # fmt: skip
MISSION_CURRENT, SET_MODE, LOITER_TIME = 42, 176, 19


@pytest.fixture
def bench() -> Bench:
    return Bench(home=Place(-24.0, -46.3, 100.0))


def clear(bench: Bench) -> int:
    bench.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 0))
    result: int = bench.last("MISSION_ACK").type
    return result


def current(bench: Bench) -> tuple[int, int]:
    """Return the number and the total of a new MISSION_CURRENT."""
    assert bench.command(512, MISSION_CURRENT) == ACCEPTED
    message = bench.last("MISSION_CURRENT")
    return message.seq, message.total


def test_it_requests_with_the_deprecated_message_and_accepts_the_new_one(bench: Bench) -> None:
    items = bench.mission((50, 0, 20))
    assert bench.upload(items) == OK
    requests = bench.all("MISSION_REQUEST")
    assert [request.seq for request in requests] == list(range(len(items)))
    assert {request.target_system for request in requests} == {255}
    assert not bench.all("MISSION_REQUEST_INT")


def test_item_0_is_home_and_counts_but_not_in_the_total(bench: Bench) -> None:
    items = bench.mission((50, 0, 20), (50, 50, 20))
    items[0] = replace(items[0], x=0, y=0, z=7.0)
    bench.upload(items)
    back = bench.download()
    assert len(back) == 5
    assert (back[0].x, back[0].y, back[0].z) == (-240000000, -463000000, 100)
    assert current(bench) == (0, 4)


def test_what_is_read_back_is_not_what_was_sent(bench: Bench) -> None:
    items = bench.mission(*((10.0 * i, 5.0 * i, 20.0) for i in range(40)))
    items[2] = replace(items[2], param1=2.7, param4=math.nan)
    items[-1] = replace(items[-1], z=30.0)
    bench.upload(items)
    back = bench.download()
    assert {item.frame for item in back[1:-1]} == {3}
    assert (back[-1].frame, back[-1].z) == (0, 0)
    assert (back[2].param1, back[2].param2, back[2].param4) == (2, 0, 0)
    off = {b.x - a.x for a, b in zip(items[1:-1], back[1:-1], strict=True)}
    assert off == {-1, 0, 1}


def test_a_read_back_mission_reads_the_same_again(bench: Bench) -> None:
    bench.upload(bench.mission((50, 0, 20)))
    assert bench.download() == bench.download()


def test_after_clearing_the_count_is_0(bench: Bench) -> None:
    bench.upload(bench.mission((50, 0, 20)))
    assert clear(bench) == OK
    assert bench.download() == []


def test_a_stalled_upload_is_requested_each_second_and_ends_after_8(bench: Bench) -> None:
    items = bench.mission((50, 0, 20))
    bench.send_count(items)
    bench.send_item(items, 0)
    bench.wait(7.9)
    assert [request.seq for request in bench.all("MISSION_REQUEST")] == [0, *[1] * 8]
    assert not bench.all("MISSION_ACK")
    bench.wait(0.4)
    assert bench.last("MISSION_ACK").type == CANCELLED
    bench.send_item(items, 1)
    assert bench.last("MISSION_ACK").type == ERROR


@pytest.mark.parametrize(
    ("fields", "result"),
    [
        ({"x": 1000000000}, INVALID_X),
        ({"x": -900000001}, INVALID_X),
        ({"y": 1800000001}, 11),
        ({"z": math.nan}, 12),
        ({"command": LOITER_TIME, "param4": math.nan}, INVALID_4),
        ({"param1": math.inf}, 6),
        ({"command": 30000}, 3),
        ({"frame": 1}, 2),
    ],
)
def test_an_impossible_item_ends_the_upload_with_its_reason(
    bench: Bench, fields: dict[str, float], result: int
) -> None:
    items = bench.mission((50, 0, 20), (50, 50, 20))
    items[2] = replace(items[2], **fields)
    bench.send_count(items)
    for seq in range(3):
        bench.send_item(items, seq)
    assert bench.last("MISSION_ACK").type == result
    bench.send_item(items, 3)
    assert bench.last("MISSION_ACK").type == ERROR


def test_an_open_yaw_is_accepted_for_a_waypoint(bench: Bench) -> None:
    items = bench.mission((50, 0, 20))
    items[2] = replace(items[2], param4=math.nan)
    assert bench.upload(items) == OK


def test_a_wrong_number_is_refused_and_the_upload_continues(bench: Bench) -> None:
    items = bench.mission((50, 0, 20))
    bench.send_count(items)
    bench.send_item(items, 0)
    bench.send_item(items, 0)
    assert bench.last("MISSION_ACK").type == INVALID_SEQUENCE
    for seq in range(1, len(items)):
        bench.send_item(items, seq)
    assert bench.last("MISSION_ACK").type == OK


def test_another_sender_is_kept_out_of_an_upload(bench: Bench) -> None:
    items = bench.mission((50, 0, 20))
    bench.send_count(items)
    bench.send_item(items, 0, system=99)
    assert bench.last("MISSION_ACK").type == DENIED
    bench.send_count(items, system=99)
    assert bench.last("MISSION_ACK").type == DENIED
    bench.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0), system=99)
    assert bench.last("MISSION_ACK").type == DENIED
    bench.send_item(items, 0)
    assert bench.last("MISSION_REQUEST").seq == 1


def test_an_aborted_transfer_leaves_two_missions_mixed(bench: Bench) -> None:
    first = bench.mission((50, 0, 20), (50, 50, 20))
    bench.upload(first)
    second = bench.mission((10, 0, 30), (10, 10, 30))
    bench.send_count(second)
    for seq in range(3):
        bench.send_item(second, seq)
    bench.wait(9)
    assert [item.z for item in bench.download()[2:4]] == [30, 20]


def test_more_items_than_it_can_hold_are_refused(bench: Bench) -> None:
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 10000, 0))
    assert bench.last("MISSION_ACK").type == NO_SPACE


def test_a_request_beyond_the_end_is_answered_with_the_count(bench: Bench) -> None:
    bench.upload(bench.mission((50, 0, 20)))
    bench.send(mavlink.MAVLink_mission_request_int_message(1, 1, 9, 0))
    assert bench.last("MISSION_COUNT").count == 4
    assert bench.last("MISSION_ACK").type == ERROR


def test_the_deprecated_request_gets_the_deprecated_item(bench: Bench) -> None:
    bench.upload(bench.mission((50, 0, 20)))
    bench.send(mavlink.MAVLink_mission_request_message(1, 1, 2, 0))
    old = Item.received(bench.last("MISSION_ITEM"))
    assert abs(old.x - bench.download()[2].x) < 20


def test_there_are_no_fences_and_no_rally_points(bench: Bench) -> None:
    bench.send(mavlink.MAVLink_mission_request_list_message(1, 1, 1))
    count = bench.last("MISSION_COUNT")
    assert (count.count, count.mission_type) == (0, 1)


class TestAuto:
    @pytest.fixture
    def flying(self, bench: Bench) -> Bench:
        bench.fly_to_altitude()
        bench.upload(bench.mission((60, 0, 20), (60, 60, 30), hold_s=5))
        assert bench.command(SET_MODE, 1, AUTO) == ACCEPTED
        return bench

    def test_it_reaches_the_items_in_order_lands_at_home_and_disarms(self, flying: Bench) -> None:
        flying.stream(MISSION_CURRENT, 2)
        flying.until(lambda: not flying.vehicle.armed)
        reached = [message.seq for message in flying.all("MISSION_ITEM_REACHED")]
        assert reached == [1, 2, 3, 4]
        assert math.hypot(*flying.vehicle.craft.point) < 0.5
        numbers = [message.seq for message in flying.all("MISSION_CURRENT")]
        assert numbers == sorted(numbers) and set(numbers) >= {2, 3, 4}
        assert flying.last("MISSION_CURRENT").mission_state == 5

    def test_a_waypoint_is_reached_when_its_hold_is_over(self, flying: Bench) -> None:
        flying.until(lambda: flying.vehicle.craft.north_m > 58.1)
        held_s = flying.until(lambda: flying.vehicle.mission.reached == 2)
        assert held_s == pytest.approx(5, abs=0.3)
        assert flying.vehicle.craft.north_m == pytest.approx(60, abs=0.3)

    def test_it_cannot_be_cleared(self, flying: Bench) -> None:
        assert clear(flying) == ERROR
        flying.command(SET_MODE, 1, GUIDED)
        assert clear(flying) == OK

    def test_a_shorter_mission_leaves_the_current_item_beyond_the_total(
        self, flying: Bench
    ) -> None:
        flying.until(lambda: flying.vehicle.mission.current == 3)
        assert flying.upload(flying.mission()[:2]) == OK
        number, total = current(flying)
        assert number == 3 > total == 1

    def test_it_resumes_where_it_was(self, flying: Bench) -> None:
        flying.until(lambda: flying.vehicle.mission.current == 3)
        flying.command(SET_MODE, 1, GUIDED)
        flying.wait(10)
        flying.command(SET_MODE, 1, AUTO)
        flying.until(lambda: flying.vehicle.mission.reached == 3)
        assert current(flying)[0] in (3, 4)

    def test_it_goes_to_an_item_that_is_set(self, flying: Bench) -> None:
        flying.until(lambda: flying.vehicle.mission.current == 2)
        flying.send(mavlink.MAVLink_mission_set_current_message(1, 1, 3))
        assert flying.last("MISSION_CURRENT").seq == 3
        flying.until(lambda: flying.vehicle.mission.reached == 3)
        assert flying.vehicle.craft.point == pytest.approx((60, 60, 30), abs=0.5)


def test_without_a_mission_auto_is_refused_only_when_armed(bench: Bench) -> None:
    assert bench.command(300) == ACCEPTED
    assert bench.command(176, 1, GUIDED) == ACCEPTED
    bench.until(lambda: bench.vehicle.ready)
    assert bench.command(400, 1) == ACCEPTED
    assert bench.command(300) == FAILED


def test_a_mission_starts_on_the_ground_with_its_take_off(bench: Bench) -> None:
    bench.until(lambda: bench.vehicle.ready)
    bench.upload(bench.mission((60, 0, 25)))
    bench.command(SET_MODE, 1, GUIDED)
    bench.command(400, 1)
    assert bench.command(300) == ACCEPTED
    bench.until(lambda: bench.vehicle.mission.reached == 2)
    assert bench.vehicle.craft.up_m == pytest.approx(25, abs=2.1)


def test_a_jump_is_made_as_often_as_it_says(bench: Bench) -> None:
    items = bench.mission((30, 0, 20), (0, 30, 20))
    jump = bench.item(177, param1=2.0, param2=1.0, x=0, y=0, frame=2)
    items.insert(4, jump)
    bench.fly_to_altitude()
    assert bench.upload(items) == OK
    bench.command(SET_MODE, 1, AUTO)
    bench.until(lambda: not bench.vehicle.armed)
    reached = [message.seq for message in bench.all("MISSION_ITEM_REACHED")]
    assert reached == [1, 2, 3, 4, 2, 3, 4, 5]
