# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Another sensor is another file: whatever counts looks counts its looks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ahead import AHEAD
from builtin_interfaces.msg import Time
from effort import LITTLE_EFFORT

from dsse_ros.base.fields import FieldError
from dsse_ros.conformance.registered import registered
from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import step_report_of
from dsse_ros.planners.belief import BeliefPlanner, GreedyOnBelief
from dsse_ros.planners.registry import PLANNER_NAMES, planner_for
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.metrics import effort
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.world import World
from dsse_ros.search.environments.world_beliefs import DRIFT_SAMPLES, WorldBeliefs
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_and_rules
from dsse_ros.world.sensors.registry import SENSORS
from dsse_ros.world.targets.registry import TARGET_MODELS
from msg_adapters.stamps import header
from msg_adapters.step_report import finds_of, step_report_from_message, step_report_message

FIELDS: dict[str, Any] = {
    "grid_size": 12, "num_drones": 3, "person_amount": 3, "timestep_limit": 50,
    "one_find_per_search": False, "person_pod_multipliers": [1.0, 0.5, 0.5],
}  # fmt: skip


@pytest.fixture(autouse=True)
def _ahead() -> Iterator[None]:
    with registered(SENSORS, AHEAD) as name:
        FIELDS["sensor"] = name
        yield


def test_an_unknown_sensor_is_refused_in_a_line() -> None:
    with pytest.raises(FieldError, match="sensor must be one of own_cell, .*under_t.* got 'eyes'"):
        parallel_env(sensor="eyes")


def test_a_move_finds_who_is_ahead_and_says_which_look_did() -> None:
    batch = vector_env(3000, rules="v2", **{**FIELDS, "num_drones": 1, "person_amount": 1,
                       "person_pod_multipliers": None, "person_initial_position": (8, 6),
                       "drones_positions": [(5, 6)], "vector": (0.0, 0.0)})  # fmt: skip
    batch.reset(seed=0)
    world, right = batch.world, batch.rules.actions.index("right")
    there = [
        (world.persons["x"][:, 0] == 7 + k) & (world.persons["y"][:, 0] == 6) for k in range(3)
    ]
    batch.step(np.full((3000, 1), right, np.int8))
    finds = np.where(world.found, world.finds, 0)[:, 0]
    assert any(near.any() for near in there)
    for k, near in enumerate(there):
        assert ((finds[near] == 0) | (finds[near] == 1 << k)).all()
        share = (finds[near] > 0).mean() if near.any() else 0.3
        assert share == pytest.approx(0.3, abs=5 * (0.21 / max(near.sum(), 1)) ** 0.5)
    assert (finds[~np.any(there, axis=0)] == 0).all()


@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_world_b_of_a_batch_is_the_single_environment(rules: str) -> None:
    batch, rng = vector_env(3, rules=rules, **FIELDS), np.random.default_rng(1)
    batch.reset(seed=5)
    singles = [parallel_env(rules=rules, **FIELDS) for _ in range(3)]
    for b, env in enumerate(singles):
        env.reset(seed=5 + b)
    for _ in range(8):
        actions = rng.integers(0, len(batch.rules.action_set), (3, 3)).astype(np.int8)
        if batch.world.worlds["done"].any():
            break
        batch.step(actions)
        for b, env in enumerate(singles):
            env.advance(actions[b])
            assert (env.world.drones[0] == batch.world.drones[b]).all()
            assert (env.world.persons[0] == batch.world.persons[b]).all()


def test_the_planner_knows_from_its_infos_what_the_simulation_knows() -> None:
    env = parallel_env(rules="v2", observe="belief", **FIELDS)
    observations, infos = env.reset(seed=3)
    planner = BeliefPlanner(env, GreedyOnBelief, drift_samples=DRIFT_SAMPLES)
    steps = 0
    while env.agents and steps < 25:
        actions = planner(observations, infos)
        seen = next(iter(observations.values()))[1]
        assert planner.belief is not None
        assert planner.belief.poc() == pytest.approx(seen, abs=1e-6)
        assert planner.belief.pos == pytest.approx(infos[env.agents[0]]["pos"], abs=1e-9)
        observations, _, _, _, infos = env.step(actions)
        steps += 1
    assert steps > 3


@pytest.mark.slow
@pytest.mark.parametrize("motion", TARGET_MODELS)
@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_nobody_is_found_off_the_grid_or_in_an_excluded_cell_and_pos_counts_nobody_there(
    rules: str, motion: str
) -> None:
    west = [[-24.05, -46.18], [-24.05, -46.16], [-24.02, -46.16], [-24.02, -46.18]]
    scenario, chosen = scenario_and_rules(
        None, rules, area=west, grid_size=12, vector=(0.4, -0.3), person_initial_position=(5, 2),
        drones_positions=[(5, 0)], sensor=FIELDS["sensor"], person_motion=motion, sigma=1.5,
    )  # fmt: skip
    world, generator = World(scenario, chosen, 500), np.random.default_rng(1)
    beliefs, found = WorldBeliefs(world), np.zeros(500, bool)
    world.seed(3)
    world.reset()
    beliefs.reset()
    assert world.area is not None
    beyond = 0
    for _ in range(25):
        actions = generator.integers(0, len(chosen.actions), (500, 1)).astype(np.int8)
        before, alive = world.persons[:, 0].copy(), ~world.worlds["done"]
        beliefs.before_step(actions)
        world.step(actions)
        beliefs.after_step()
        x, y = before["x"], before["y"]
        inside = (x >= 0) & (x < 12) & (y >= 0) & (y < 12)
        inside[inside] = world.area[y[inside], x[inside]]
        finds = alive & world.found[:, 0]
        assert not (finds & ~inside).any()
        found |= finds
        beyond += int((~inside).sum())
    assert (beyond > 0) == (motion in ("constant_drift", "leeway", "drifting_map"))
    assert found.mean() > 0.05
    off = found - beliefs.pos
    assert abs(off.mean()) < 4 * off.std() / 500**0.5


SEA = profile("sea")
SEVERAL = [
    {"class": "PIW-1", "weight": 2},
    {"class": "SKIFF-1", "search_object": "power_boat_20ft"},
    {"class": "LIFE-RAFT-DB-12", "search_object": "raft_4_person", "weight": 0.5},
]


@pytest.mark.slow
@pytest.mark.parametrize("truth", [None, {"object": SEVERAL[::-1]}])
def test_pos_counts_each_object_by_its_own_sweep_width(truth: dict[str, Any] | None) -> None:
    seen = {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 300}
    incident = {
        "object": SEVERAL, "seen": seen, "search_start": "2026-01-17T13:20Z",
        "wind": {"from": 270, "speed": 8.0}, "truth": truth,
    }  # fmt: skip
    scenario = Scenario(
        incident=incident, sensor="sweep_width", particles=20_000, num_drones=2, timestep_limit=60,
        cell_size=300, visibility=9260, weather="poor",
    )  # fmt: skip
    count, generator = 4000, np.random.default_rng(1)
    world = World(scenario, SEA, count)
    beliefs, found = WorldBeliefs(world), np.zeros(count, bool)
    world.seed(3)
    world.reset()
    beliefs.reset()
    assert world.looks.pods.shape[1] == 3 and (np.diff(world.looks.pods, axis=1) != 0).any()
    for _ in range(12):
        actions = generator.integers(0, len(SEA.actions), (count, 2)).astype(np.int8)
        beliefs.before_step(actions)
        world.step(actions)
        beliefs.after_step()
        found |= world.found.any(axis=1)
    assert 0.05 < found.mean() < 0.95
    off = found - beliefs.pos
    assert abs(off.mean()) < 4 * off.std() / count**0.5


@pytest.mark.parametrize("planner", sorted(set(PLANNER_NAMES) - {"astar", "onnx"}))
def test_every_planner_flies_it(planner: str) -> None:
    env = parallel_env(rules="v2", **FIELDS)
    observations, infos = env.reset(seed=1)
    policy = planner_for(env, planner, seed=0, **LITTLE_EFFORT.get(planner, {}))
    for _ in range(30):
        if not env.agents:
            break
        observations, _, _, _, infos = env.step(policy(observations, infos))
        assert ((env.positions >= 0) & (env.positions < 12)).all()


def test_pictures_reports_and_logs_count_its_looks(tmp_path: Path) -> None:
    mission = Mission(parallel_env(rules="v2", render_mode="rgb_array", **FIELDS), seed=2)
    world = mission.env.world
    frame = GridFrame(12, 130.0, -24.0, -46.0, 0.0, 120.0)
    right = mission.env.rules.actions.index("right")
    log = MissionLog(tmp_path / "log.csv", frame, faults=True)
    log.write(mission, mission.result)
    for drone in range(3):
        mission.commands.set_action(drone, right)
    mission.advance("hold")
    log.write(mission, mission.result)
    log.close()
    seen = np.zeros((12, 12), int)
    for col, row in mission.result.cells.tolist():
        seen[row, col + 1 : col + 4] += 1
    assert (mission.env.view().searches == seen).all()
    report = step_report_from_message(
        step_report_message(header(frame.map_frame, Time()), step_report_of(mission, frame, 1))
    )
    assert (finds_of(report) == np.where(world.found, world.finds, 0)[0]).all()
    (record,) = read_csv(tmp_path / "log.csv")
    assert (effort(record) == seen).all()


def test_what_holds_nothing_looks_at_nothing() -> None:
    env = parallel_env(rules="v2", **FIELDS)
    env.reset(seed=0)
    drones, looks, cells = env.world.looks.at(np.array([NO_ACTION, 0, 127]), env.positions)
    assert drones.tolist() == [1] * len(looks) and len(cells) == len(looks)
