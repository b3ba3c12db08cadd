# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Faults of drones: off by default, repeated by their seed, alike in single worlds and batches."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError, specs
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.snapshot import Snapshot
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.fault_kernels import STATUSES
from dsse_ros.world.scenario.action_times import action_times
from dsse_ros.world.scenario.fault_fields import FAULTS, FaultFields, faults_of

G = 8
SEARCH: dict[str, Any] = {
    "grid_size": G,
    "num_drones": 3,
    "drones_positions": [(0, 0), (4, 3), (7, 7)],
    "timestep_limit": 60,
    "person_amount": 2,
    "probability_of_detection": 0.0,
}
EXAMPLES: dict[str, dict[str, Any]] = {
    "battery": {
        "battery_move": 4.0, "battery_search": 6.0, "battery_hover": 3.0, "battery_return": 5.0,
        "relief_steps": 3,
    },
    "loss": {"loss_rate": 0.05, "loss_steps": [0, 7, 0]},
    "false_alarms": {"false_alarm_rate": 0.3, "false_alarm_steps": 2},
    "dropped_commands": {"command_drop_rate": 0.2},
    "delayed_commands": {"command_delay": 2},
    "stuck": {"stuck_rate": 0.1, "stuck_steps": 3},
    "position_noise": {"position_noise": 0.8},
    "wind": {"wind_speed": 6.0, "wind_toward": 70.0},
}  # fmt: skip
"""Of each fault, fields that bring it about; together they make one search of all faults."""
ALL = {name: value for fields in EXAMPLES.values() for name, value in fields.items()}
fault_sets = st.sets(st.sampled_from(sorted(EXAMPLES)), min_size=1)
RULES = {"v2": {}, "paper": {"collisions": False}}


def fields_of(faults: set[str]) -> dict[str, Any]:
    return SEARCH | {k: v for name in sorted(faults) for k, v in EXAMPLES[name].items()}


def fly(env: SearchEnv, seed: int, steps: int = 40) -> list[Any]:
    """Return all that a mission hands out; actions are drawn among those that masks allow."""
    rng = np.random.default_rng(seed)
    observations, infos = env.reset(seed=seed)
    seen: list[Any] = [(observations, infos)]
    for _ in range(steps):
        if not env.agents:
            break
        actions = {}
        for agent in env.possible_agents:
            draw = rng.random()
            if agent in env.agents:
                allowed = np.flatnonzero(infos[agent]["action_mask"])
                actions[agent] = int(allowed[int(draw * len(allowed))])
        observations, *rest, infos = env.step(actions)
        seen.append((observations, *rest, infos))
    return seen


def assert_equal(one: Any, other: Any) -> None:
    np.testing.assert_equal(one, other)


def test_every_fault_has_fields_and_every_field_is_of_one_fault() -> None:
    of_faults = [name for fault in FAULTS.values() for name in (*fault.switches, *fault.options)]
    assert sorted(of_faults) == sorted(specs(FaultFields))
    assert EXAMPLES.keys() == FAULTS.keys()
    for name, fields in EXAMPLES.items():
        assert faults_of(parallel_env(SEARCH, **fields).scenario) == [name]


def test_without_a_fault_there_is_nothing_of_them() -> None:
    env = parallel_env(SEARCH)
    assert env.world.faults is None
    assert env.scenario.loss_steps == (0,)
    _, infos = env.reset(seed=1)
    assert infos["drone0"].keys() == {"Found", "action_mask", "found_person"}
    assert "conditions" not in env.snapshot().arrays


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(fault_sets, st.integers(0, 2**32), st.sampled_from(sorted(RULES)))
def test_the_same_seed_gives_the_same_mission_with_any_faults(
    faults: set[str], seed: int, rules: str
) -> None:
    env, twin = (parallel_env(fields_of(faults), rules=rules, **RULES[rules]) for _ in range(2))
    first = fly(env, seed)
    assert_equal(fly(env, seed), first)
    assert_equal(fly(twin, seed), first)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(fault_sets, st.integers(0, 2**16), st.integers(1, 2))
def test_worlds_of_a_batch_are_those_of_single_environments_with_any_faults(
    faults: set[str], seed: int, threads: int
) -> None:
    fields, count = fields_of(faults), 3
    batch = vector_env(count, fields, rules="v2", threads=threads)
    envs = [parallel_env(fields, rules="v2") for _ in range(count)]
    rng = np.random.default_rng(seed)
    observed, infos = batch.reset(seed=seed)
    for b, env in enumerate(envs):
        env.reset(seed=seed + b)
    for _ in range(30):
        for b, env in enumerate(envs):
            assert_equal(observed["positions"][b], env.positions)
            assert_equal(infos["action_mask"][b], env.action_masks())
            if env.world.faults is not None:
                conditions = env.world.faults.conditions[0]
                assert_equal(infos["status"][b], conditions["status"])
                assert_equal(infos["action"][b], conditions["applied"])
            assert env.world.state_bytes() == batch_bytes(batch, b, env)
        joint = rng.integers(0, 9, (count, 3)).astype(np.int8)
        observed, _, _, _, infos = batch.step(joint)
        for b, env in enumerate(envs):
            if infos["step"][b] == 0:
                env.reset()
            else:
                env.advance(joint[b])
    batch.close()


def batch_bytes(batch: Any, b: int, env: SearchEnv) -> bytes:
    """Return the state of one world of a batch as that of a batch of one."""
    twin = copy.copy(env.world)
    twin.faults = copy.copy(env.world.faults)
    for name in ("worlds", "starts", "drones", "persons"):
        setattr(twin, name, getattr(batch.world, name)[[b]])
    if twin.faults is not None:
        twin.faults.conditions = batch.world.faults.conditions[[b]]
    return twin.state_bytes()


def test_a_mission_with_all_faults_goes_on_from_a_snapshot_bit_for_bit() -> None:
    env = parallel_env(SEARCH, rules="v2", **ALL)
    env.reset(seed=5)
    joint = np.array([1, 8, 2], np.int8)
    for _ in range(12):
        env.advance(joint)
    twin = parallel_env(SEARCH, rules="v2", **ALL)
    twin.restore(Snapshot.from_bytes(env.snapshot().to_bytes()))
    for _ in range(20):
        assert twin.world.state_bytes() == env.world.state_bytes()
        assert_equal(twin.action_masks(), env.action_masks())
        env.advance(joint)
        twin.advance(joint)
    assert_equal(copy.deepcopy(env).positions, env.positions)


def test_a_drone_is_lost_in_its_step_and_with_its_rate() -> None:
    env = parallel_env(SEARCH, loss_steps=[0, 7, 0])
    env.reset(seed=1)
    for step in range(1, 9):
        _, rewards, terminated, _, infos = env.step(dict.fromkeys(env.agents, 4))
        assert ("drone1" in terminated) == (step <= 7)
        assert terminated.get("drone1", step > 7) == (step >= 7)
    assert env.agents == ["drone0", "drone2"]
    batch = vector_env(500, SEARCH, loss_rate=0.3)
    batch.reset(seed=1)
    _, _, terminated, _, infos = batch.step(np.full((500, 3), 4, np.int8))
    lost = infos["status"] == STATUSES.index("lost")
    # 1500 drones; five standard deviations.
    assert lost.mean() == pytest.approx(0.3, abs=5 * (0.3 * 0.7 / 1500) ** 0.5)
    assert (lost == terminated).all()


def test_a_mission_whose_drones_are_all_lost_is_over() -> None:
    env = parallel_env(SEARCH, loss_rate=1.0)
    env.reset(seed=1)
    _, rewards, terminated, _, _ = env.step(dict.fromkeys(env.agents, 0))
    assert not env.agents
    assert all(terminated.values())
    assert set(rewards.values()) == {0.0}


@pytest.mark.parametrize("delay", [0, 1, 4])
def test_a_drone_does_what_it_was_commanded_so_many_steps_ago(delay: int) -> None:
    env = parallel_env(SEARCH, rules="v2", command_delay=delay, command_drop_rate=1e-12)
    env.reset(seed=1)
    commands = np.random.default_rng(2).integers(0, 9, (20, 3)).astype(np.int8)
    assert env.world.faults is not None
    for step, joint in enumerate(commands):
        env.advance(joint)
        expected = commands[step - delay] if step >= delay else np.full(3, NO_ACTION)
        assert_equal(env.world.faults.applied[0], expected)


def test_commands_are_dropped_and_searches_raise_false_alarms_at_their_rates() -> None:
    batch = vector_env(400, SEARCH, command_drop_rate=0.25, false_alarm_rate=0.5)
    batch.reset(seed=3)
    *_, infos = batch.step(np.full((400, 3), 4, np.int8))
    dropped, identifying = (
        infos["action"] == NO_ACTION,
        infos["status"] == STATUSES.index("identifying"),
    )
    assert dropped.mean() == pytest.approx(0.25, abs=5 * (0.25 * 0.75 / 1200) ** 0.5)
    assert not (dropped & identifying).any()
    searches = (~dropped).sum()
    assert identifying.sum() / searches == pytest.approx(0.5, abs=5 * (0.25 / searches) ** 0.5)
    # Two steps later it is known.
    for _ in range(2):
        before = infos["status"] == STATUSES.index("identifying")
        *_, infos = batch.step(np.zeros((400, 3), np.int8) + 1)
        assert (infos["action"][before] == NO_ACTION).all()
    assert (infos["status"][identifying] == STATUSES.index("searching")).all()


def test_a_stuck_drone_stays_where_it_is_for_its_time() -> None:
    env = parallel_env(SEARCH, rules="v2", stuck_rate=0.3, stuck_steps=4)
    env.reset(seed=4)
    assert env.world.faults is not None
    rng, stuck = np.random.default_rng(1), 0
    for _ in range(50):
        before, cells = env.world.faults.conditions[0].copy(), env.positions
        env.advance(rng.integers(0, 9, 3).astype(np.int8))
        after = env.world.faults.conditions[0]
        for drone in range(3):
            if before["status"][drone] == STATUSES.index("stuck"):
                stuck += 1
                assert after["applied"][drone] == NO_ACTION
                assert_equal(env.positions[drone], cells[drone])
    assert stuck > 30


def test_what_a_drone_observes_is_noisy_and_what_it_does_is_not() -> None:
    noisy, true = (
        parallel_env(SEARCH, rules="v2", position_noise=noise, stuck_rate=1e-12)
        for noise in (1.5, 0.0)
    )
    errors = []
    for env in (noisy, true):
        env.reset(seed=1)
    for joint in np.random.default_rng(2).integers(0, 9, (200, 3)).astype(np.int8):
        for env in (noisy, true):
            env.advance(joint)
        drones = noisy.world.drones[0]
        assert_equal(drones["x"], true.world.drones[0]["x"])
        assert_equal(noisy.action_masks(), true.action_masks())
        assert ((noisy.positions >= 0) & (noisy.positions < G)).all()
        errors.append(noisy.positions[:, 0] - drones["x"])
    assert 0.5 < np.std(errors) < 1.6


def test_a_drone_makes_its_way_against_the_wind_at_its_ground_speed() -> None:
    env = parallel_env(
        grid_size=40, drones_positions=[(0, 20)], wind_speed=5.0, wind_toward=270.0, rules="v2",
        drone_speed=10.0,
    )  # fmt: skip
    shares = dict(zip(env.rules.actions, action_times(env.scenario, env.rules).shares, strict=True))
    assert shares["right"] == pytest.approx(0.5)
    assert shares["left"] == 1.0
    assert shares["up"] == pytest.approx(0.75**0.5)
    assert shares["down"] == pytest.approx(0.75**0.5)
    assert shares["search"] == 1.0
    env.reset(seed=1)
    for _ in range(30):
        env.advance(np.array([1], np.int8))
    assert env.positions[0].tolist() == [15, 20]
    for _ in range(15):
        env.advance(np.array([0], np.int8))
    assert env.positions[0].tolist() == [0, 20]
    for _ in range(20):
        env.advance(np.array([2], np.int8))
    assert env.positions[0].tolist() == [0, 20 - int(20 * 0.75**0.5)]
    # In the time that it took: 15 cells against a wind of 5 m/s at an airspeed of 10 m/s.
    scenario = env.scenario
    assert scenario.step_duration_s == scenario.cell_size / 10.0
    assert 30 * scenario.step_duration_s == pytest.approx(15 * scenario.cell_size / (10.0 - 5.0))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"loss_steps": [1, 2]}, ["loss_steps", "2", "one per drone (3)"]),
        ({"wind_speed": 10.0}, ["wind_speed", "10", "below"]),
        ({"battery_search": 1.0}, ["battery_search", "battery_move"]),
        ({"relief_steps": 1}, ["relief_steps", "battery_move"]),
        ({"battery_move": 50.0, "battery_reserve": 60.0}, ["battery_reserve", "60", "50"]),
        ({"command_delay": 33}, ["command_delay", "33", "<= 32"]),
        ({"loss_rate": 1.1}, ["loss_rate", "1.1", "<= 1"]),
        ({"battery_move": 1.0, "actions": ["left", "search"]}, ["battery_move", "right"]),
    ],
)
def test_faults_that_cannot_be_are_refused_on_one_line(
    fields: dict[str, Any], words: list[str]
) -> None:
    with pytest.raises(FieldError) as caught:
        parallel_env(SEARCH, **fields).reset()
    assert "\n" not in str(caught.value)
    assert [word for word in words if word not in str(caught.value)] == []
