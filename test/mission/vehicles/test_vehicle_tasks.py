# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the vehicles have to do, once their drones have begun."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.vehicles.vehicle_tasks import VehicleTasks
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.fault_kernels import ACTING, DONE
from dsse_ros.world.scenario.frames import cell_to_map
from dsse_ros.world.scenario.scenario import scenario_frame
from msg_adapters.stamps import header, to_stamp
from msg_adapters.vehicle_tasks import vehicle_tasks_from_message, vehicle_tasks_message

works = st.lists(st.sampled_from([DONE, ACTING]), min_size=3, max_size=3)
plans = st.lists(st.tuples(st.lists(st.integers(0, 8), min_size=3, max_size=3), works), max_size=25)


def make(**fields: Any) -> tuple[Mission, VehicleTasks]:
    defaults: dict[str, Any] = {
        "grid_size": 8, "num_drones": 3, "person_initial_position": (7, 7), "rules": "sea",
        "probability_of_detection": 0.0, "vehicle_timed_actions": True,
    }  # fmt: skip
    mission = Mission(parallel_env(**{**defaults, **fields}), 3)
    return mission, VehicleTasks(mission)


def begun(mission: Mission, tasks: VehicleTasks, actions: list[int]) -> None:
    count = len(mission.env.rules.actions)
    mission.command_all([action % count for action in actions])
    tasks.begin(mission.begin("hold"))


@given(plans, st.booleans())
def test_a_drone_ends_where_its_task_did_and_one_under_way_keeps_its_task(
    plan: list[tuple[list[int], list[int]]], battery: bool
) -> None:
    mission, tasks = make(**({"battery_move": 4.0, "relief_steps": 2} if battery else {}))
    tasks.restart()
    under_way = np.zeros(3, bool)
    for actions, work in plan:
        if mission.done:
            break
        before, live = tasks.numbers.copy(), mission.live
        begun(mission, tasks, actions)
        assert ((tasks.numbers == before) | ~under_way)[live].all()
        assert (tasks.numbers > before)[[i for i in live if not under_way[i]]].all()
        assert len({*tasks.numbers.tolist()}) == 3
        mission.set_work(np.array(work, np.int8))
        conditions = mission.advance("hold").conditions
        assert conditions is not None
        under_way = conditions["heading"] >= 0
        for i in mission.live:
            if not under_way[i] and conditions["status"][i] == 0:
                assert tasks.ends[i].tolist() == mission.result.cells[i].tolist()


@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_without_faults_the_tasks_are_the_commands(rules: str) -> None:
    mission, tasks = make(rules=rules, vehicle_timed_actions=False)
    tasks.restart()
    assert tasks.numbers.tolist() == [1, 2, 3] and tasks.actions.tolist() == [-1, -1, -1]
    begun(mission, tasks, [1, 3, mission.env.rules.action_set.search])
    assert tasks.ends.tolist() == [[1, 0], [1, 1], [2, 0]]
    # A vehicle is not sent off the grid.
    begun(mission, tasks, [0, 2, 2])
    assert tasks.ends.tolist() == [[0, 0], [1, 0], [2, 0]]


def test_a_step_that_has_begun_is_done_with_its_commands() -> None:
    mission, tasks = make()
    tasks.restart()
    assert mission.missing == [0, 1, 2] and not mission.begun
    begun(mission, tasks, [1, 1, 1])
    assert mission.begun and mission.missing == []
    mission.command_all([3, 3, 3])
    assert mission.advance("hold").actions.tolist() == [1, 1, 1]
    assert not mission.begun


def test_tasks_of_another_mission_have_other_numbers_and_those_of_dead_drones_stay() -> None:
    mission, tasks = make()
    tasks.restart()
    mission.lose(1)
    begun(mission, tasks, [1, 1, 1])
    assert tasks.numbers.tolist() == [4, 2, 5] and tasks.first == 1
    mission.reset(4)
    tasks.restart()
    assert tasks.numbers.tolist() == [6, 7, 8] and tasks.first == 6


def test_the_message_has_what_each_vehicle_does_and_where() -> None:
    mission, tasks = make()
    tasks.restart()
    begun(mission, tasks, [1, 8, 3])
    frame = scenario_frame(mission.env.scenario)
    points = tasks.points(frame, 7)
    message = vehicle_tasks_message(header("map", to_stamp(0)), points)
    assert vehicle_tasks_from_message(message).tobytes() == points.tobytes()
    assert points[["run_id", "mission", "task", "col", "row", "action"]][0].tolist() == [
        (7, 1, 4, 1, 0, 1), (7, 1, 5, 1, 0, 8), (7, 1, 6, 2, 1, 3)
    ]  # fmt: skip
    x, y = cell_to_map(frame, 2, 1)
    assert (points["x"][0, 2], points["y"][0, 2]) == pytest.approx((x, y))
    message.height = 0
    with pytest.raises(ValueError, match="height must be 1 to 64, got 0"):
        vehicle_tasks_from_message(message)
