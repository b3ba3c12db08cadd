# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Uploads over links that lose, double and delay: complete or failed, and never a mixture.

A mission that was stored correctly comes back changed; any other difference is found.
"""

import dataclasses
import math
import random

import pytest
from lossy_world import OURSELVES, Channel, World
from message_values import changed, contents
from mission_vehicle import HOME, VEHICLE, VEHICLES, ArduPilot, Px4
from sample_missions import mission

from dsse_ros.vehicles.autopilots import ARDUPILOT, AUTOPILOTS, PX4
from dsse_ros.vehicles.control.transfer import Done, Failed, Timeouts
from dsse_ros.vehicles.control.upload import VerifiedUpload, difference
from dsse_ros.vehicles.mavlink.messages import (
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestList,
)

NAMES = list(VEHICLES)
BAD_LINK = Channel(loss=0.3, duplicate=0.2, reorder=0.3)


def verified(items, autopilot, **options):
    return VerifiedUpload(items, VEHICLE, OURSELVES, autopilot=AUTOPILOTS[autopilot], **options)


def complete(autopilot, channel, runs):
    """Return in how many runs 20 items were uploaded and read back; check what the vehicle held."""
    items = mission(1, 20)
    done = 0
    for seed in range(runs):
        world = World(VEHICLES[autopilot](), channel, seed)
        result = world.run(verified(items, autopilot), horizon_s=600)
        assert all(
            not held or not difference(items, held, AUTOPILOTS[autopilot])
            for held in world.vehicle.held
        )
        if isinstance(result, Done):
            done += 1
            assert difference(items, world.vehicle.mission, AUTOPILOTS[autopilot]) is None
            assert contents(result.items) == contents(world.vehicle.mission)
    return done


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", NAMES)
def test_every_upload_is_complete_over_a_link_that_loses_5_percent(autopilot):
    assert complete(autopilot, Channel(loss=0.05), 1000) == 1000


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", NAMES)
def test_uploads_are_complete_over_a_link_that_loses_30_percent_and_doubles_and_reorders(autopilot):
    assert complete(autopilot, BAD_LINK, 1000) >= 0.999 * 1000


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", NAMES)
def test_uploads_are_complete_over_a_link_that_only_doubles_and_reorders(autopilot):
    assert complete(autopilot, Channel(duplicate=0.2, reorder=0.3), 300) == 300


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", NAMES)
def test_no_vehicle_ever_holds_a_mixture_of_a_cancelled_mission_and_the_next(autopilot):
    for seed in range(300):
        draw = random.Random(seed)
        channel = dataclasses.replace(BAD_LINK, loss=draw.choice([0.0, 0.05, 0.3]))
        missions = [mission(number, draw.randint(2, 20)) for number in (1, 2)]
        world = World(VEHICLES[autopilot](), channel, seed)
        first = verified(missions[0], autopilot)
        world.send(first.start(world.now))
        until = draw.uniform(0, draw.choice([1, 30]))
        while first.result is None and world.step(first, until):
            pass
        world.send(first.cancel(world.now))
        while first.result is None:
            assert world.step(first, until + 12), "the cancelled upload goes on"
        assert isinstance(world.run(verified(missions[1], autopilot)), Done)
        for held in world.vehicle.held:
            assert not held or None in [
                difference(items, held, AUTOPILOTS[autopilot]) for items in missions
            ]


class Corrupting(ArduPilot):
    """Stores a wrong altitude now and then."""

    corrupted = 0

    def stored(self, item):
        kept = super().stored(item)
        if item.seq == 2 and self.corrupted:
            self.corrupted -= 1
            return changed(kept, z=20.0)
        return kept


@pytest.mark.parametrize(("corrupted", "done"), [(0, True), (3, True), (4, False)])
def test_a_mission_that_reads_back_wrong_is_uploaded_again_as_often_as_allowed(corrupted, done):
    vehicle = Corrupting()
    vehicle.corrupted = corrupted
    exchange = verified(mission(1, 5), "ardupilot", timeouts=Timeouts(upload_retries=3))
    result = World(vehicle, Channel(), seed=0).run(exchange)
    assert isinstance(result, Done) == done
    assert exchange.counts["mismatch"] == min(corrupted, 3)
    if isinstance(result, Failed):
        assert (result.code, result.changed) == ("mismatch", True)
        assert "item 2: z 120.0 was sent, 20.0 read back" in result.reason


class Mute(Px4):
    """Sends no acknowledgement."""

    def ack(self, to, result):
        return []


def test_a_mission_that_reads_back_right_needs_no_acknowledgement():
    world = World(Mute(), Channel(), seed=0)
    assert isinstance(world.run(verified(mission(1), "px4")), Done)


def test_without_a_reply_after_the_upload_the_mission_counts_as_changed():
    world = World(ArduPilot(), Channel(), seed=0)
    exchange = verified(mission(1), "ardupilot")
    world.send(exchange.start(0.0))
    while not world.vehicle.mission:
        world.step(exchange)
    world.channel = Channel(loss=1.0)
    while exchange.result is None:
        world.step(exchange)
    assert exchange.result.code == "no_reply" and exchange.result.changed


@pytest.mark.parametrize("autopilot", NAMES)
def test_cancel_ends_an_upload_whenever_it_comes(autopilot):
    """Cancels before the first, second, third, ... event of an undisturbed upload."""
    steps = 0
    while True:
        world = World(VEHICLES[autopilot](), Channel(), seed=0)
        exchange = verified(mission(1, 4), autopilot)
        world.send(exchange.start(0.0))
        for _ in range(steps):
            world.step(exchange)
        if exchange.result is not None:
            break
        sent = exchange.cancel(world.now)
        assert sent == [] or isinstance(sent[0], MissionAck)
        now = world.now
        while exchange.result is None:
            now = exchange.deadline
            sent = exchange.tick(now)
            assert not any(isinstance(message, MissionItemInt) for message in sent)
        assert exchange.result.code == "cancelled"
        assert now - world.now <= Timeouts().stall_s
        steps += 1
    assert steps > 20


SENT = mission(1, 5)


def stored(autopilot, items=SENT):
    vehicle = VEHICLES[autopilot]()
    return tuple(vehicle.stored(item) for item in items)


def read_with(index, autopilot="ardupilot", **values):
    read = list(stored(autopilot))
    read[index] = changed(read[index], **values)
    return read


@pytest.mark.parametrize("autopilot", VEHICLES)
def test_a_mission_is_the_same_as_its_vehicle_returns_it(autopilot):
    assert contents(stored(autopilot)) != contents(SENT)
    assert difference(SENT, stored(autopilot), AUTOPILOTS[autopilot]) is None


def test_home_is_the_vehicles_own_with_ardupilot_only():
    assert difference(SENT, (HOME, *SENT[1:]), ARDUPILOT) is None
    assert "item 0" in difference(SENT, (HOME, *SENT[1:]), PX4)


def test_an_open_yaw_comes_back_as_anything():
    for yaw in (0.0, 90.0, math.nan):
        assert difference(SENT, read_with(1, param4=yaw), ARDUPILOT) is None


@pytest.mark.parametrize(
    "values",
    [
        {"seq": 4},
        {"seq": 2},
        {"command": 19},
        {"command": 17},
        {"frame": 0},
        {"frame": 4},
        {"frame": 10},
        {"x": SENT[1].x + 3},
        {"y": SENT[1].y - 3},
        {"z": 119.9},
        {"z": math.nan},
        {"param1": 7.0},
        {"param1": math.nan},
        {"param2": 0.0},
    ],
)
def test_every_field_that_matters_is_compared(values):
    name = next(iter(values))
    assert f"item 1: {name} " in difference(SENT, read_with(1, **values), ARDUPILOT)


@pytest.mark.parametrize("frame", [2, 3, 6])
def test_a_return_has_no_place_to_compare(frame):
    sent = changed(SENT[-1], seq=0, frame=frame)
    read = changed(sent, x=10**7, y=10**7, z=9.0)
    assert sent.command == 20 and difference([sent], [read], PX4) is None


def test_frames_are_the_same_in_either_form():
    floats = [changed(item, frame=3) for item in SENT]
    assert difference(floats, floats, PX4) is None
    assert difference(SENT, floats, ARDUPILOT) is None


def test_what_is_read_back_is_asked_for_with_the_same_timeouts():
    timeouts = Timeouts(reply_s=2.5, settle_s=0.5)
    exchange = verified(mission(1, 2), "px4", timeouts=timeouts)
    assert exchange.start(0.0) == [MissionCount(*VEHICLE, 2)]
    for seq in range(2):
        exchange.receive(MissionRequest(*OURSELVES, seq), VEHICLE, 0.1)
    exchange.receive(MissionAck(*OURSELVES, 0), VEHICLE, 0.2)
    assert exchange.tick(0.7) == [MissionRequestList(*VEHICLE)]
    assert exchange.deadline == 0.7 + 2.5


def test_px4_returns_times_and_radii_as_they_were():
    assert difference(SENT, read_with(1, "px4", param1=5.5), PX4) is not None
    assert difference(SENT, read_with(1, "ardupilot", param1=5.5), ARDUPILOT) is None


def test_a_mission_with_another_number_of_items_differs():
    assert difference(SENT, SENT[:-1], PX4) == "5 items were sent, 4 read back"
    assert difference(SENT, (), ARDUPILOT) is not None
    assert difference((), (), ARDUPILOT) is None


def test_items_of_another_mission_are_found():
    mixture = (*SENT[:3], *mission(2, 5)[3:])
    assert "item 3" in difference(SENT, mixture, ARDUPILOT)
