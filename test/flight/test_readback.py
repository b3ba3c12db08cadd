# SPDX-License-Identifier: Apache-2.0
"""A healthy mission comes back changed; a spoilt one is seen."""

import dataclasses
import math

import pytest
from mission_vehicle import HOME, VEHICLES
from sample_missions import mission

from dsse_ros.flight.readback import difference

SENT = mission(1, 5)


def stored(dialect, items=SENT):
    vehicle = VEHICLES[dialect]()
    return tuple(vehicle.stored(item) for item in items)


def changed(index, dialect="ardupilot", **values):
    read = list(stored(dialect))
    read[index] = dataclasses.replace(read[index], **values)
    return read


@pytest.mark.parametrize("dialect", VEHICLES)
def test_a_mission_is_the_same_as_its_vehicle_returns_it(dialect):
    assert stored(dialect) != SENT
    assert difference(SENT, stored(dialect), dialect) is None


def test_home_is_the_vehicles_own_with_ardupilot_only():
    assert difference(SENT, (HOME, *SENT[1:]), "ardupilot") is None
    assert "item 0" in difference(SENT, (HOME, *SENT[1:]), "px4")


def test_an_open_yaw_comes_back_as_anything():
    for yaw in (0.0, 90.0, math.nan):
        assert difference(SENT, changed(1, param4=yaw), "ardupilot") is None


@pytest.mark.parametrize(
    "values",
    [
        {"seq": 4},
        {"command": 19},
        {"frame": 0},
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
    assert f"item 1: {name} " in difference(SENT, changed(1, **values), "ardupilot")


def test_px4_returns_times_and_radii_as_they_were():
    assert difference(SENT, changed(1, "px4", param1=5.5), "px4") is not None
    assert difference(SENT, changed(1, "ardupilot", param1=5.5), "ardupilot") is None


def test_a_mission_with_another_number_of_items_is_another():
    assert difference(SENT, SENT[:-1], "px4") == "5 items were sent, 4 read back"
    assert difference(SENT, (), "ardupilot") is not None
    assert difference((), (), "ardupilot") is None


def test_items_of_another_mission_are_seen():
    mixture = (*SENT[:3], *mission(2, 5)[3:])
    assert "item 3" in difference(SENT, mixture, "ardupilot")
