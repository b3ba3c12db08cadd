# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which vehicles a step waits for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsse_ros.mission.awaited_vehicles import AwaitedVehicles
from dsse_ros.scenario.frames import GridFrame, cell_to_map
from msg_adapters.vehicles import Progress

FRAME = GridFrame(6, 130.0, -24.04, -46.17, 0.0, 120.0)
CELLS = np.array([[0, 5], [3, 2]])
RADIUS_M = 10.0
RUN = 7


@pytest.fixture
def charges() -> dict[int, float]:
    """What is left in the batteries, by drone."""
    return {}


@pytest.fixture
def vehicles(charges: dict[int, float]) -> AwaitedVehicles:
    """Vehicles of a mission whose report has the stamps from 100 to 300."""
    awaited = AwaitedVehicles(FRAME, charges.__setitem__)
    awaited.set_stamp(100, first=True)
    awaited.set_stamp(300, first=False)
    return awaited


def late(vehicles: AwaitedVehicles) -> list[int]:
    return vehicles.late([0, 1], CELLS, RADIUS_M)


def test_a_vehicle_is_late_until_it_is_in_the_cell_of_its_drone(vehicles: AwaitedVehicles) -> None:
    assert late(vehicles) == [0, 1]
    x_m, y_m = cell_to_map(FRAME, 3, 2)
    vehicles.set_place(1, (x_m, y_m + RADIUS_M + 0.1))
    assert late(vehicles) == [0, 1]
    vehicles.set_place(1, (x_m, y_m + RADIUS_M - 0.1))
    assert late(vehicles) == [0]
    vehicles.set_place(1, None)
    assert late(vehicles) == [0, 1]


def test_one_that_reports_is_late_until_it_has_done_all_of_the_last_report(
    vehicles: AwaitedVehicles,
) -> None:
    vehicles.set_place(0, cell_to_map(FRAME, 0, 5))
    vehicles.set_progress(0, Progress(300, 200), RUN)
    assert late(vehicles) == [0, 1]
    vehicles.set_progress(0, Progress(300, 300), RUN)
    assert late(vehicles) == [1]
    vehicles.set_stamp(400, first=False)
    assert late(vehicles) == [0, 1]


@pytest.mark.parametrize(("stamp", "counts"), [(99, False), (100, True), (300, True), (301, False)])
def test_a_loss_and_a_battery_count_in_their_own_mission_only(
    vehicles: AwaitedVehicles, charges: dict[int, float], stamp: int, counts: bool
) -> None:
    reason = vehicles.set_progress(1, Progress(stamp, lost="link lost", battery=0.5), RUN)
    assert (reason, charges) == (("link lost", {1: 0.5}) if counts else ("", {}))


def test_what_was_reported_of_another_run_counts_for_nothing(
    vehicles: AwaitedVehicles, charges: dict[int, float]
) -> None:
    vehicles.set_place(0, cell_to_map(FRAME, 0, 5))
    reported = Progress(300, 300, "link lost", 0.5, run_id=RUN + 1)
    assert vehicles.set_progress(0, reported, RUN) == ""
    assert late(vehicles) == [0, 1] and charges == {}
    assert vehicles.set_progress(0, replace(reported, run_id=RUN), RUN) == "link lost"


def test_where_vehicles_were_is_of_the_mission_before(vehicles: AwaitedVehicles) -> None:
    vehicles.set_place(0, cell_to_map(FRAME, 0, 5))
    vehicles.lost[1] = "link lost"
    vehicles.begin()
    assert late(vehicles) == [0, 1] and vehicles.lost == {}


def test_stamps_that_come_again_are_not_those_of_before(vehicles: AwaitedVehicles) -> None:
    vehicles.set_place(0, cell_to_map(FRAME, 0, 5))
    vehicles.set_progress(0, Progress(300, 300), RUN)
    assert late(vehicles) == [1]
    vehicles.restart_time()
    assert late(vehicles) == [0, 1]
