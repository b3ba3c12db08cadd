# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Uploads, message by message."""

import pytest
from lossy_world import OURSELVES, Channel, World
from message_values import changed
from mission_vehicle import VEHICLE, VEHICLES, ArduPilot
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from sample_missions import mission

from dsse_ros.vehicles.autopilots import AUTOPILOTS, PX4
from dsse_ros.vehicles.control.transfer import Done, Failed, Timeouts
from dsse_ros.vehicles.control.upload import Upload, difference
from dsse_ros.vehicles.mavlink.messages import (
    Address,
    MissionAck,
    MissionCount,
    MissionRequest,
    MissionRequestInt,
)

ITEMS = mission(1, 3)
ACCEPTED, ERROR = mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_ERROR
DENIED = mavlink.MAV_MISSION_DENIED
INVALID_SEQUENCE = mavlink.MAV_MISSION_INVALID_SEQUENCE
CANCELLED = MissionAck(*VEHICLE, mavlink.MAV_MISSION_OPERATION_CANCELLED)
TIMEOUTS = Timeouts()


def upload(items=ITEMS, *, autopilot="ardupilot", **options):
    return Upload(items, VEHICLE, OURSELVES, autopilot=AUTOPILOTS[autopilot], **options)


def request(seq):
    return MissionRequest(*OURSELVES, seq)


def ack(result):
    return MissionAck(*OURSELVES, result)


def serve_all(exchange, now=0.0):
    for item in ITEMS:
        sent = exchange.receive(request(item.seq), VEHICLE, now)
        assert sent == [item]


@pytest.mark.parametrize("autopilot", VEHICLES)
def test_a_vehicle_holds_what_was_uploaded(autopilot):
    world = World(VEHICLES[autopilot](), Channel(), seed=0)
    assert world.run(upload(autopilot=autopilot)) == Done(ITEMS)
    assert difference(ITEMS, world.vehicle.mission, AUTOPILOTS[autopilot]) is None


@pytest.mark.parametrize("autopilot", VEHICLES)
def test_an_empty_mission_clears_the_vehicle(autopilot):
    world = World(VEHICLES[autopilot](), Channel(), seed=0)
    world.run(upload(autopilot=autopilot))
    assert world.run(upload((), autopilot=autopilot)) == Done(())
    assert world.vehicle.mission == ()


@pytest.mark.parametrize("kind", [MissionRequest, MissionRequestInt])
def test_the_deprecated_request_gets_the_same_reply(kind):
    exchange = upload()
    assert exchange.start(0.0) == [MissionCount(*VEHICLE, 3)]
    sent = exchange.receive(kind(*OURSELVES, 0), VEHICLE, 0.1)
    assert sent == [ITEMS[0]]


def test_an_item_requested_again_is_sent_again():
    exchange = upload()
    exchange.start(0.0)
    for seq in (0, 1, 1, 0, 2, 1):
        sent = exchange.receive(request(seq), VEHICLE, 0.1)
        assert sent == [ITEMS[seq]]


def test_an_unanswered_message_is_sent_again_in_its_own_time():
    exchange = upload()
    exchange.start(0.0)
    assert exchange.deadline == TIMEOUTS.reply_s
    assert exchange.tick(1.4) == []
    assert exchange.tick(1.5) == [MissionCount(*VEHICLE, 3)]
    exchange.receive(request(0), VEHICLE, 2.0)
    assert exchange.deadline == 2.0 + TIMEOUTS.item_s
    assert exchange.tick(2.25) == [ITEMS[0]]


@pytest.mark.parametrize("requested", [0, 1, 2])
def test_an_acknowledgement_before_every_item_was_requested_is_an_error(requested):
    exchange = upload(timeouts=Timeouts(upload_retries=0))
    exchange.start(0.0)
    for seq in range(requested):
        exchange.receive(request(seq), VEHICLE, 0.1)
    assert exchange.receive(ack(0), VEHICLE, 0.2) == [CANCELLED]
    assert exchange.tick(exchange.deadline) == []
    reason = f"upload: acknowledged after {requested} of 3 items were requested"
    assert exchange.result == Failed("early_ack", reason, changed=True)


def test_the_whole_upload_starts_again_as_often_as_allowed():
    exchange = upload(timeouts=Timeouts(upload_retries=2))
    sent = exchange.start(0.0)
    now = 0.0
    for _ in range(3):
        assert sent == [MissionCount(*VEHICLE, 3)]
        exchange.receive(ack(0), VEHICLE, now)
        now = exchange.deadline
        sent = exchange.tick(now)
    assert sent == [] and exchange.result.code == "early_ack"


@pytest.mark.parametrize("result", range(2, 13))
def test_a_fault_of_the_mission_ends_the_upload_at_once(result):
    exchange = upload()
    exchange.start(0.0)
    exchange.receive(request(0), VEHICLE, 0.1)
    exchange.receive(ack(result), VEHICLE, 0.2)
    exchange.tick(0.2 + TIMEOUTS.settle_s)
    assert exchange.result.code == "refused" and f"({result})" in exchange.result.reason
    assert exchange.result.changed


def test_a_bad_latitude_is_refused_by_the_vehicle_with_its_reason():
    bad = changed(ITEMS[1], x=100 * 10**7)
    world = World(ArduPilot(), Channel(), seed=0)
    result = world.run(upload((ITEMS[0], bad, ITEMS[2])))
    assert f"({mavlink.MAV_MISSION_INVALID_PARAM5_X})" in result.reason
    assert "INVALID_PARAM5_X (10)" in result.reason


def test_a_nack_of_an_item_that_arrives_twice_does_not_stop_an_upload():
    exchange = upload()
    exchange.start(0.0)
    exchange.receive(request(0), VEHICLE, 0.1)
    for result in (
        INVALID_SEQUENCE,
        ERROR,
        DENIED,
    ):
        assert exchange.receive(ack(result), VEHICLE, 0.1) == []
    assert exchange.counts["ignored_nack"] == 3
    serve_all(exchange, 0.2)
    exchange.receive(ack(0), VEHICLE, 0.3)
    exchange.tick(0.3 + TIMEOUTS.settle_s)
    assert exchange.result == Done(ITEMS)


def test_the_count_is_sent_to_a_busy_vehicle_until_its_own_timeout():
    exchange = upload()
    sent, now = exchange.start(0.0), 0.0
    while exchange.result is None:
        if sent == [MissionCount(*VEHICLE, 3)]:
            exchange.receive(ack(DENIED), VEHICLE, now)
        now = exchange.deadline
        sent = exchange.tick(now)
    assert exchange.result.code == "refused" and f"({DENIED})" in exchange.result.reason
    assert now > TIMEOUTS.stall_s


def test_a_dead_link_is_reported_after_all_retries():
    exchange = upload()
    now, count = 0.0, len(exchange.start(0.0))
    while exchange.result is None:
        now = exchange.deadline
        count += exchange.tick(now) == [MissionCount(*VEHICLE, 3)]
    assert exchange.result.code == "no_reply" and exchange.result.changed
    assert count == TIMEOUTS.retries + 1


def test_a_stalled_upload_waits_until_the_vehicles_own_timeout():
    exchange = upload(timeouts=Timeouts(upload_retries=0))
    exchange.start(0.0)
    exchange.receive(request(0), VEHICLE, 0.0)
    now = 0.0
    while exchange.tick(now) != [CANCELLED]:
        now = exchange.deadline
    assert now > TIMEOUTS.stall_s
    while exchange.result is None:
        exchange.tick(exchange.deadline)
    assert exchange.result == Failed("stalled", "upload: stalled after 1 of 3 items", changed=True)


def test_a_nack_after_the_last_item_shortens_the_wait():
    exchange = upload(timeouts=Timeouts(upload_retries=0))
    exchange.start(0.0)
    serve_all(exchange)
    exchange.receive(ack(ERROR), VEHICLE, 0.1)
    now = 0.0
    while exchange.result is None:
        now = exchange.deadline
        exchange.tick(now)
    assert exchange.result == Done(ITEMS)
    assert now <= 2 * TIMEOUTS.reply_s + TIMEOUTS.settle_s


def test_a_vehicle_that_still_waits_for_another_mission_gets_nothing_of_this_one():
    exchange = upload()
    exchange.start(0.0)
    assert exchange.receive(request(1), VEHICLE, 0.1) == [CANCELLED]
    assert exchange.receive(request(2), VEHICLE, 0.1) == [CANCELLED]
    assert exchange.counts["unexpected"] == 2
    serve_all(exchange, 0.2)


def test_a_vehicle_that_cancels_gets_the_mission_again_as_often_as_allowed():
    exchange = upload(timeouts=Timeouts(upload_retries=0))
    exchange.start(0.0)
    exchange.receive(request(0), VEHICLE, 0.1)
    exchange.receive(ack(mavlink.MAV_MISSION_OPERATION_CANCELLED), VEHICLE, 0.2)
    assert exchange.deadline == 0.2 + TIMEOUTS.settle_s
    exchange.tick(exchange.deadline)
    reason = "upload: cancelled by the vehicle"
    assert exchange.result == Failed("cancelled_by_vehicle", reason, changed=True)


def test_a_nack_before_the_last_item_does_not_shorten_the_wait():
    exchange = upload(timeouts=Timeouts(upload_retries=0))
    exchange.start(0.0)
    exchange.receive(request(0), VEHICLE, 0.0)
    exchange.receive(ack(ERROR), VEHICLE, 0.1)
    now = 0.0
    while exchange.tick(now) != [CANCELLED]:
        now = exchange.deadline
    assert now > TIMEOUTS.stall_s


def test_an_upload_asks_and_is_cancelled_as_a_mission():
    exchange = upload(ITEMS, autopilot="px4", timeouts=Timeouts(settle_s=0.5))
    assert exchange.start(0.0) == [MissionCount(*VEHICLE, 3)]
    asked = MissionRequest(*OURSELVES, 0)
    assert exchange.receive(asked, VEHICLE, 0.1) == [ITEMS[0]]
    assert exchange.receive(MissionCount(*OURSELVES, 3), VEHICLE, 0.1) == []
    assert exchange.counts["unexpected"] == 1
    cancelled = MissionAck(*VEHICLE, mavlink.MAV_MISSION_OPERATION_CANCELLED)
    assert exchange.cancel(0.2) == [cancelled]
    assert exchange.deadline == 0.2 + 2 * 0.5


def test_a_request_for_an_item_that_does_not_exist_is_counted():
    exchange = upload()
    exchange.start(0.0)
    exchange.receive(request(0), VEHICLE, 0.1)
    assert exchange.receive(request(3), VEHICLE, 0.1) == []
    assert exchange.counts["unexpected"] == 1


def test_a_vehicle_that_requests_again_after_the_end_gets_the_same_mission():
    exchange = upload()
    exchange.start(0.0)
    serve_all(exchange, 0.1)
    exchange.receive(ack(0), VEHICLE, 0.2)
    assert exchange.result is None
    serve_all(exchange, 0.9)
    assert exchange.counts["late"] == len(ITEMS)
    assert exchange.tick(0.2 + TIMEOUTS.settle_s) == [] and exchange.result is None
    exchange.tick(0.9 + TIMEOUTS.settle_s)
    assert exchange.result == Done(ITEMS)


def test_a_cancelled_upload_answers_requests_with_a_cancellation():
    exchange = upload(autopilot="px4")
    exchange.start(0.0)
    exchange.receive(request(0), VEHICLE, 0.1)
    assert exchange.cancel(0.2) == [CANCELLED]
    assert exchange.receive(request(1), VEHICLE, 0.3) == [CANCELLED]
    exchange.tick(0.3 + 2 * TIMEOUTS.settle_s)
    assert exchange.result.code == "cancelled" and exchange.result.changed


def test_a_late_fault_of_the_vehicle_shortens_the_wait_after_a_cancellation_once():
    exchange = upload()
    exchange.start(0.0)
    exchange.receive(request(0), VEHICLE, 0.1)
    exchange.cancel(0.2)
    for result in (ACCEPTED, INVALID_SEQUENCE):
        assert exchange.receive(ack(result), VEHICLE, 0.3) == []
        assert exchange.deadline == 0.2 + TIMEOUTS.stall_s
    for now in (0.4, 0.9):
        assert exchange.receive(ack(mavlink.MAV_MISSION_OPERATION_CANCELLED), VEHICLE, now) == []
        assert exchange.deadline == 0.4 + TIMEOUTS.settle_s
    assert exchange.counts["late"] == 4
    exchange.tick(0.4 + TIMEOUTS.settle_s)
    assert exchange.result.code == "cancelled"


@pytest.mark.parametrize("autopilot", VEHICLES)
def test_a_vehicle_that_never_stops_requesting_does_not_keep_an_upload_open(autopilot):
    exchange = upload(autopilot=autopilot)
    exchange.start(0.0)
    exchange.cancel(0.0)
    for tenths in range(1, 200):
        now = tenths / 10
        exchange.tick(now)
        exchange.receive(request(0), VEHICLE, now)
        if exchange.result is not None:
            break
    assert now == pytest.approx(TIMEOUTS.stall_s)


@pytest.mark.parametrize("autopilot", VEHICLES)
def test_after_a_cancelled_upload_the_vehicle_waits_for_nothing(autopilot):
    world = World(VEHICLES[autopilot](), Channel(), seed=0)
    exchange = upload(mission(1, 20), autopilot=autopilot)
    world.send(exchange.start(0.0))
    while not world.vehicle.incoming:
        world.step(exchange)
    world.send(exchange.cancel(world.now))
    while exchange.result is None:
        world.step(exchange)
    assert not world.vehicle.receiving
    assert world.vehicle.held == [()]


def test_an_upload_that_was_not_started_is_cancelled_without_a_message():
    exchange = upload()
    assert exchange.cancel(0.0) == []
    assert exchange.result.code == "cancelled" and not exchange.result.changed


def test_an_upload_starts_once():
    exchange = upload()
    exchange.start(0.0)
    with pytest.raises(RuntimeError):
        exchange.start(1.0)


@pytest.mark.parametrize(
    ("items", "field"),
    [
        (ITEMS[1:], r"items\[0\].seq"),
        ((*ITEMS, ITEMS[0]), r"items\[3\].seq"),
        ((changed(ITEMS[0], target_system=2),), r"items\[0\].target_system"),
        ((changed(ITEMS[0], target_component=0),), r"items\[0\].target_component"),
        ((changed(ITEMS[0], mission_type=1),), r"items\[0\].mission_type"),
        ((changed(ITEMS[0], current=2),), r"items\[0\].current"),
    ],
)
def test_items_that_would_not_be_stored_as_meant_are_refused(items, field):
    with pytest.raises(ValueError, match=f"^{field} must be .*, got "):
        upload(items)


@pytest.mark.parametrize("system", [0, -1, 256])
def test_an_upload_is_never_a_broadcast(system):
    with pytest.raises(ValueError, match="^target.system must be "):
        Upload(ITEMS, Address(system, 1), OURSELVES, autopilot=PX4)


@pytest.mark.parametrize(
    "options",
    [{"item_s": 0.0}, {"reply_s": float("nan")}, {"retries": -1}, {"upload_retries": 1001}],
)
def test_timeouts_that_would_never_end_are_refused(options):
    with pytest.raises(ValueError, match=f"^{next(iter(options))} must be .*, got "):
        Timeouts(**options)
