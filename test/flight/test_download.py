# SPDX-License-Identifier: Apache-2.0
"""Downloads and clearing, message by message."""

import pytest
from lossy_world import OURSELVES, Channel, World
from mission_vehicle import VEHICLE, VEHICLES, ArduPilot
from sample_missions import mission

from dsse_ros.flight.clear import Clear
from dsse_ros.flight.download import Download
from dsse_ros.flight.messages import (
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    MissionResult,
)
from dsse_ros.flight.transfer import Done, Timeouts

ITEMS = mission(1, 3)
TIMEOUTS = Timeouts()


def download(**options):
    return Download(VEHICLE, OURSELVES, **options)


def holding(dialect, items):
    vehicle = VEHICLES[dialect]()
    vehicle.held.append(items)
    return vehicle


def item(seq):
    return MissionItemInt(OURSELVES, ITEMS[seq])


@pytest.mark.parametrize("dialect", VEHICLES)
@pytest.mark.parametrize("count", [2, 20, 300])
def test_a_mission_is_read_as_it_is_held(dialect, count):
    items = mission(1, count)
    result = World(holding(dialect, items), Channel(), seed=0).run(download())
    assert isinstance(result, Done)
    assert result.items == items


@pytest.mark.parametrize("dialect", VEHICLES)
def test_an_empty_mission_is_read_as_such(dialect):
    assert World(holding(dialect, ()), Channel(), seed=0).run(download()) == Done(())


def test_items_are_asked_for_in_their_order_and_the_end_is_acknowledged():
    exchange = download()
    assert exchange.start(0.0) == [MissionRequestList(VEHICLE)]
    sent = exchange.receive(MissionCount(OURSELVES, 3), VEHICLE, 0.1)
    for seq in range(3):
        assert sent == [MissionRequestInt(VEHICLE, seq)]
        sent = exchange.receive(item(seq), VEHICLE, 0.2)
    assert sent == [MissionAck(VEHICLE, MissionResult.ACCEPTED)]
    assert exchange.result == Done(ITEMS) and exchange.deadline is None


def test_an_item_out_of_turn_is_left_and_the_right_one_asked_for_again():
    exchange = download()
    exchange.start(0.0)
    exchange.receive(MissionCount(OURSELVES, 3), VEHICLE, 0.0)
    for seq in (1, 2):
        assert exchange.receive(item(seq), VEHICLE, 0.1) == []
    assert exchange.counts["out_of_sequence"] == 2
    assert exchange.tick(TIMEOUTS.item_s) == [MissionRequestInt(VEHICLE, 0)]


def test_a_download_that_is_broken_off_begins_anew_and_more_slowly():
    exchange = download()
    exchange.start(0.0)
    now, pauses = 0.0, []
    for _ in range(4):
        sent = exchange.receive(MissionCount(OURSELVES, 3), VEHICLE, now)
        if not sent:
            pauses.append(exchange.deadline - now)
            sent = exchange.tick(exchange.deadline)
        assert sent == [MissionRequestInt(VEHICLE, 0)]
        sent = exchange.receive(MissionAck(OURSELVES, MissionResult.ERROR), VEHICLE, now)
        if exchange.result is None:
            assert sent == [MissionRequestList(VEHICLE)]
    assert pauses == sorted(pauses) and pauses[-1] == pytest.approx(TIMEOUTS.settle_s)
    assert exchange.result.code == "stalled" and not exchange.result.changed


def test_a_cancelled_download_says_so_and_is_over():
    exchange = download()
    exchange.start(0.0)
    exchange.receive(MissionCount(OURSELVES, 3), VEHICLE, 0.1)
    cancelled = MissionAck(VEHICLE, MissionResult.OPERATION_CANCELLED)
    assert exchange.cancel(0.2) == [cancelled]
    assert exchange.result.code == "cancelled" and not exchange.result.changed


def test_a_vehicle_that_does_not_know_the_kind_of_mission_is_believed():
    exchange = download(mission_type=2)
    exchange.start(0.0)
    exchange.receive(MissionAck(OURSELVES, MissionResult.UNSUPPORTED, 2), VEHICLE, 0.1)
    assert exchange.result.code == "refused"


@pytest.mark.parametrize("dialect", VEHICLES)
def test_a_cleared_vehicle_holds_nothing(dialect):
    world = World(holding(dialect, ITEMS), Channel(), seed=0)
    assert world.run(Clear(VEHICLE, OURSELVES)) == Done(())
    assert world.vehicle.mission == ()


def test_a_vehicle_in_auto_keeps_its_mission_and_says_so():
    vehicle = holding("ardupilot", ITEMS)
    vehicle.stubborn = True
    result = World(vehicle, Channel(), seed=0).run(Clear(VEHICLE, OURSELVES))
    assert result.code == "refused" and result.ack == MissionResult.ERROR
    assert vehicle.mission == ITEMS


def test_no_late_order_to_clear_is_under_way_when_clearing_is_done():
    for seed in range(200):
        world = World(ArduPilot(), Channel(duplicate=0.5, reorder=0.5), seed)
        world.vehicle.held.append(ITEMS)
        assert world.run(Clear(VEHICLE, OURSELVES)) == Done(())
        world.vehicle.held.append(ITEMS)
        world.run(Download(VEHICLE, OURSELVES))
        assert world.vehicle.mission == ITEMS


def test_clearing_that_is_cancelled_may_have_been_done():
    exchange = Clear(VEHICLE, OURSELVES)
    assert exchange.start(0.0) == [MissionClearAll(VEHICLE)]
    assert exchange.cancel(0.1) == []
    exchange.tick(0.1 + TIMEOUTS.settle_s)
    assert exchange.result.code == "cancelled" and exchange.result.changed
