# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far vehicles are with their tasks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.vehicles.awaited_vehicles import AwaitedVehicles
from dsse_ros.mission.vehicles.vehicle_tasks import VehicleTasks
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.fault_kernels import ACTING, COMING_BACK, DONE
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from msg_adapters.vehicles import Progress

PLACE = {"grid_size": 6, "drones_positions": [(0, 5), (3, 2)], "person_initial_position": (5, 0)}

FRAME = GridFrame(6, 130.0, -24.04, -46.17, 0.0, 120.0)
RADIUS_M = 10.0
RUN = 7


@pytest.fixture
def charges() -> dict[int, float]:
    """What is left in the batteries, by drone."""
    return {}


@pytest.fixture
def tasks() -> VehicleTasks:
    """The tasks 3 and 4 of a mission whose first is 3."""
    made = VehicleTasks(Mission(parallel_env(**PLACE), 1))
    for _ in range(2):
        made.restart()
    return made


@pytest.fixture
def vehicles(charges: dict[int, float], tasks: VehicleTasks) -> AwaitedVehicles:
    return AwaitedVehicles(FRAME, tasks, charges.__setitem__)


def late(vehicles: AwaitedVehicles) -> list[int]:
    found = vehicles.late([0, 1], RADIUS_M)
    assert found == np.flatnonzero(vehicles.work(RADIUS_M) != DONE).tolist()
    return found


def test_a_vehicle_is_late_until_it_is_in_the_cell_of_its_task(vehicles: AwaitedVehicles) -> None:
    assert late(vehicles) == [0, 1]
    x_m, y_m = cell_to_map(FRAME, 3, 2)
    vehicles.set_place(1, (x_m, y_m + RADIUS_M + 0.1))
    assert late(vehicles) == [0, 1]
    vehicles.set_place(1, (x_m, y_m + RADIUS_M - 0.1))
    assert late(vehicles) == [0]
    vehicles.set_place(1, None)
    assert late(vehicles) == [0, 1]


def test_one_that_reports_looks_comes_back_and_is_done_with_this_task_and_no_other(
    vehicles: AwaitedVehicles, tasks: VehicleTasks
) -> None:
    vehicles.set_place(0, cell_to_map(FRAME, 0, 5))
    for looked, arrived, work in (
        (-1, -1, ACTING), (2, 2, ACTING), (3, -1, COMING_BACK), (3, 3, DONE), (4, 4, ACTING)
    ):  # fmt: skip
        vehicles.set_progress(0, Progress(3, looked, arrived), RUN)
        assert vehicles.work(RADIUS_M)[0] == work
    vehicles.set_progress(0, Progress(3, 3, 3), RUN)
    assert late(vehicles) == [1]
    tasks.numbers[0] = 5
    assert late(vehicles) == [0, 1]


@pytest.mark.parametrize(("task", "counts"), [(2, False), (3, True), (4, True), (5, False)])
def test_a_loss_and_a_battery_count_in_their_own_mission_only(
    vehicles: AwaitedVehicles, charges: dict[int, float], task: int, counts: bool
) -> None:
    reason = vehicles.set_progress(1, Progress(task, lost="link lost", battery=0.5), RUN)
    assert (reason, charges) == (("link lost", {1: 0.5}) if counts else (None, {}))


def test_what_was_reported_of_another_run_counts_for_nothing(
    vehicles: AwaitedVehicles, charges: dict[int, float]
) -> None:
    vehicles.set_place(0, cell_to_map(FRAME, 0, 5))
    reported = Progress(3, 3, 3, "link lost", 0.5, run_id=RUN + 1)
    assert vehicles.set_progress(0, reported, RUN) is None
    assert late(vehicles) == [0, 1] and charges == {}
    assert vehicles.set_progress(0, replace(reported, run_id=RUN), RUN) == "link lost"


def test_where_vehicles_were_is_of_the_mission_before(vehicles: AwaitedVehicles) -> None:
    vehicles.set_place(0, cell_to_map(FRAME, 0, 5))
    vehicles.lost[1] = "link lost"
    vehicles.begin()
    assert late(vehicles) == [0, 1] and vehicles.lost == {}
