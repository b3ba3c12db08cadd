# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Downloads, message by message."""

import pytest
from lossy_world import OURSELVES, Channel, World
from message_values import contents
from mission_vehicle import VEHICLE, VEHICLES, addressed
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from sample_missions import mission

from dsse_ros.vehicles.control.transfer import Done, Failed, Timeouts
from dsse_ros.vehicles.control.upload import Download
from dsse_ros.vehicles.mavlink.messages import (
    MissionAck,
    MissionCount,
    MissionRequestInt,
    MissionRequestList,
)

ITEMS = mission(1, 3)
TIMEOUTS = Timeouts()


def download(**options):
    return Download(VEHICLE, OURSELVES, **options)


def holding(autopilot, items):
    vehicle = VEHICLES[autopilot]()
    vehicle.held.append(items)
    return vehicle


def item(seq):
    return addressed(ITEMS[seq], OURSELVES)


@pytest.mark.parametrize("autopilot", VEHICLES)
@pytest.mark.parametrize("count", [2, 20, 300])
def test_a_mission_is_read_as_it_is_held(autopilot, count):
    items = mission(1, count)
    result = World(holding(autopilot, items), Channel(), seed=0).run(download())
    assert isinstance(result, Done)
    assert contents(result.items) == contents(items)


@pytest.mark.parametrize("autopilot", VEHICLES)
def test_an_empty_mission_is_read_as_such(autopilot):
    assert World(holding(autopilot, ()), Channel(), seed=0).run(download()) == Done(())


def test_items_are_requested_in_their_order_and_the_end_is_acknowledged():
    exchange = download()
    assert exchange.start(0.0) == [MissionRequestList(*VEHICLE)]
    sent = exchange.receive(MissionCount(*OURSELVES, 3), VEHICLE, 0.1)
    for seq in range(3):
        assert sent == [MissionRequestInt(*VEHICLE, seq)]
        sent = exchange.receive(item(seq), VEHICLE, 0.2)
    assert sent == [MissionAck(*VEHICLE, mavlink.MAV_MISSION_ACCEPTED)]
    assert contents(exchange.result.items) == contents(ITEMS) and exchange.deadline is None


def test_an_item_out_of_sequence_is_ignored_and_the_right_one_requested_again():
    exchange = download()
    exchange.start(0.0)
    exchange.receive(MissionCount(*OURSELVES, 3), VEHICLE, 0.0)
    for seq in (1, 2):
        assert exchange.receive(item(seq), VEHICLE, 0.1) == []
    assert exchange.counts["out_of_sequence"] == 2
    assert exchange.tick(TIMEOUTS.item_s) == [MissionRequestInt(*VEHICLE, 0)]


def test_an_aborted_download_starts_again_and_more_slowly():
    exchange = download()
    exchange.start(0.0)
    now, pauses = 0.0, []
    for _ in range(4):
        sent = exchange.receive(MissionCount(*OURSELVES, 3), VEHICLE, now)
        if not sent:
            pauses.append(exchange.deadline - now)
            sent = exchange.tick(exchange.deadline)
        assert sent == [MissionRequestInt(*VEHICLE, 0)]
        sent = exchange.receive(MissionAck(*OURSELVES, mavlink.MAV_MISSION_ERROR), VEHICLE, now)
        if exchange.result is None:
            assert sent == [MissionRequestList(*VEHICLE)]
    assert pauses == pytest.approx([TIMEOUTS.settle_s / k for k in (4, 2, 1)])
    assert exchange.result == Failed("stalled", "download: aborted by the vehicle")


def test_a_cancelled_download_sends_a_cancellation_and_ends():
    exchange = download()
    exchange.start(0.0)
    exchange.receive(MissionCount(*OURSELVES, 3), VEHICLE, 0.1)
    cancelled = MissionAck(*VEHICLE, mavlink.MAV_MISSION_OPERATION_CANCELLED)
    assert exchange.cancel(0.2) == [cancelled]
    assert exchange.result.code == "cancelled" and not exchange.result.changed


def test_a_vehicle_that_does_not_support_missions_ends_the_download():
    exchange = download()
    exchange.start(0.0)
    unsupported = mavlink.MAV_MISSION_UNSUPPORTED
    exchange.receive(MissionAck(*OURSELVES, unsupported), VEHICLE, 0.1)
    reason = f"the vehicle refused the download: UNSUPPORTED ({int(unsupported)})"
    assert exchange.result == Failed("refused", reason)


def test_a_fault_of_the_mission_ends_a_download_under_way():
    exchange = download()
    exchange.start(0.0)
    exchange.receive(MissionCount(*OURSELVES, 3), VEHICLE, 0.1)
    fault = mavlink.MAV_MISSION_INVALID_PARAM7
    cancelled = MissionAck(*VEHICLE, mavlink.MAV_MISSION_OPERATION_CANCELLED)
    assert exchange.receive(MissionAck(*OURSELVES, fault), VEHICLE, 0.2) == [cancelled]
    reason = f"the vehicle refused the download: INVALID_PARAM7 ({int(fault)})"
    assert exchange.result == Failed("refused", reason)


def test_a_download_that_gets_no_further_says_how_far_it_came():
    exchange = download(timeouts=Timeouts(upload_retries=0))
    exchange.start(0.0)
    exchange.receive(MissionCount(*OURSELVES, 3), VEHICLE, 0.0)
    exchange.receive(item(0), VEHICLE, 0.1)
    requests = 1
    while exchange.result is None:
        requests += exchange.tick(exchange.deadline) == [MissionRequestInt(*VEHICLE, 1)]
    assert exchange.result == Failed("stalled", "download: stalled after 1 of 3 items")
    assert requests == TIMEOUTS.retries + 1


def test_what_no_download_waits_for_is_counted_and_changes_nothing():
    exchange = download()
    exchange.start(0.0)
    accepted = MissionAck(*OURSELVES, mavlink.MAV_MISSION_ACCEPTED)
    for message in (accepted, item(0), MissionRequestInt(*OURSELVES, 0)):
        assert exchange.receive(message, VEHICLE, 0.1) == []
    exchange.receive(MissionCount(*OURSELVES, 3), VEHICLE, 0.1)
    for message in (accepted, MissionCount(*OURSELVES, 2)):
        assert exchange.receive(message, VEHICLE, 0.2) == []
    assert exchange.counts["unexpected"] == 5 and exchange.result is None
