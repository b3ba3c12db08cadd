# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Kinds of drones: slower ones are under way for whole steps, and each does only what it can."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.aec import aec_env
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.fault_kernels import STATUSES
from dsse_ros.world.scenario.action_times import any_binding
from dsse_ros.world.searchers.registry import SEARCHERS
from dsse_ros.world.searchers.searcher import Searcher

G = 8
KINDS = {
    "slow": Searcher(doc="takes three steps for a cell", speed=4.0),
    "slower": Searcher(doc="takes four steps for a cell", speed=2.5),
    "short": Searcher(doc="flies for five steps", endurance_min=5.1 * 13.0 / 60),
    "straight": Searcher(doc="flies straight", moves=("left", "right", "up", "down")),
    "high": Searcher(doc="flies high", altitude=300.0),
    "as_fast": Searcher(doc="is as fast as others", speed=10.0),
    "racer": Searcher(doc="is faster than others", speed=20.0),
    "still": Searcher(doc="has no speed", speed=0.0),
    "odd": Searcher(doc="has a move that is none", moves=("hop",)),
    "one_way": Searcher(doc="cannot go back", speed=5.0, moves=("left", "up")),
    "blind": Searcher(doc="has an unknown sensor", sensor="sonar"),
}
SEARCH: dict[str, Any] = {
    "grid_size": G, "num_drones": 3, "drones_positions": [(0, 0), (4, 3), (7, 7)],
    "timestep_limit": 60, "person_amount": 2, "probability_of_detection": 0.0, "rules": "v2",
}  # fmt: skip
SWARM = ("slow", "straight", "drone")
MIXES = st.lists(st.sampled_from(["drone", "slow", "slower", "short", "straight"]), min_size=3,
                 max_size=3)  # fmt: skip
FAULTS: dict[str, Any] = {
    "stuck_rate": 0.1, "stuck_steps": 2, "command_drop_rate": 0.1, "wind_speed": 1.5,
    "wind_toward": 70.0, "false_alarm_rate": 0.2, "command_delay": 1,
}  # fmt: skip
BATTERY: dict[str, Any] = {"battery_move": 2.0, "battery_search": 3.0, "relief_steps": 3}


@pytest.fixture(autouse=True, scope="module")
def kinds() -> Any:
    with pytest.MonkeyPatch.context() as patch:
        for name, kind in KINDS.items():
            patch.setitem(SEARCHERS, name, kind)
        yield


def env_with(searchers: Any, **fields: Any) -> SearchEnv:
    return parallel_env(**{**SEARCH, "searchers": tuple(searchers), **fields})


def layer(env: SearchEnv) -> Any:
    assert env.world.faults is not None
    return env.world.faults


def status(env: SearchEnv) -> list[str]:
    return [STATUSES[number] for number in layer(env).conditions["status"][0]]


@pytest.mark.parametrize("searchers", [("drone",), ("as_fast",), ("racer",), ("high", "drone")])
def test_drones_that_are_as_fast_as_each_other_have_nothing_between_command_and_action(
    searchers: tuple[str, ...],
) -> None:
    positions = [(0, 0), (4, 3)][: len(searchers)]
    env = env_with(searchers, num_drones=len(searchers), drones_positions=positions)
    assert env.world.faults is None
    assert not any_binding(env.scenario, env.rules)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.sampled_from(["drone", "slow", "slower", "racer"]), min_size=3, max_size=3))
def test_a_step_lasts_as_long_as_the_fastest_kind_needs_for_a_cell(searchers: list[str]) -> None:
    speeds = [SEARCHERS[name].speed or 10.0 for name in searchers]
    env = env_with(searchers, current_speed=0.5, current_toward=90.0)
    scenario = env.scenario
    assert scenario.step_duration_s == scenario.cell_size / max(speeds)
    assert any_binding(scenario, env.rules) == (len(set(speeds)) > 1)
    # The current stays what it is.
    assert scenario.other_ways["current_speed"] == pytest.approx(0.5)
    assert scenario.drift[0] == pytest.approx(0.5 * scenario.step_duration_s / scenario.cell_size)


@settings(max_examples=20, deadline=None)
@given(MIXES, st.integers(0, 2**16))
def test_a_cell_takes_a_slower_drone_a_whole_number_of_steps(
    searchers: list[str], seed: int
) -> None:
    env = env_with(searchers, collisions=False)
    fastest = max(SEARCHERS[name].speed or 10.0 for name in searchers)
    needed = [math.ceil(fastest / (SEARCHERS[name].speed or 10.0)) for name in searchers]
    _, infos = env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    begun = [(0, 0)] * 3
    for _ in range(env.scenario.timestep_limit - 1):
        before = env.positions
        joint, masks = {}, {}
        for agent in env.agents:
            masks[agent] = infos[agent]["action_mask"]
            joint[agent] = int(rng.choice(np.flatnonzero(masks[agent])))
        _, _, _, _, infos = env.step(joint)
        for agent, action in joint.items():
            n = int(agent[5:])
            now = infos[agent].get("status", "searching")
            if now == "home":
                continue
            moved = env.positions[n] - before[n]
            steps, heading = begun[n]
            if steps:
                assert action == heading and masks[agent].sum() == 1
            move = env.rules.action_set.moves[action]
            steps = steps + 1 if move != (0, 0) else needed[n]
            arrives = steps == needed[n]
            assert moved.tolist() == list(move if arrives else (0, 0))
            assert infos[agent].get("action", action) == (action if arrives else NO_ACTION)
            assert now == ("searching" if arrives else "under_way")
            begun[n] = (0, 0) if arrives else (steps, action)


def test_a_drone_under_way_arrives_whatever_it_is_commanded_and_is_in_its_old_cell_until_then() -> (
    None
):
    env = env_with(
        ("slow", "drone", "drone"), drones_positions=[(0, 0), (2, 0), (7, 7)], rules="paper"
    )
    env.reset(seed=1)
    right, search = 1, env.rules.action_set.search
    env.advance(np.array([right, search, search], np.int8))
    for command in (search, NO_ACTION):
        assert status(env) == ["under_way", "searching", "searching"]
        assert env.positions[0].tolist() == [0, 0]
        env.advance(np.array([command, search, search], np.int8))
    assert env.positions[0].tolist() == [1, 0] and status(env)[0] == "searching"
    # Another drone that comes where it still is meets it.
    env.advance(np.array([right, right - 1, search], np.int8))
    assert env.positions[:2].tolist() == [[1, 0], [1, 0]]
    assert env.flags[0].tolist() == [True, True, False]


def test_a_drone_whose_endurance_is_over_is_home_and_then_out_of_the_search() -> None:
    env = env_with(("drone", "short", "drone"))
    env.reset(seed=1)
    for step in range(1, 7):
        _, rewards, terminated, _, infos = env.step(dict.fromkeys(env.agents, 8))
        assert infos["drone1"]["status"] == ("searching" if step < 5 else "home")
        assert terminated["drone1"] == (step == 6)
        if step == 5:
            assert np.flatnonzero(infos["drone1"]["action_mask"]).tolist() == [8]
    assert rewards["drone1"] == 0.0 and infos["drone1"]["action"] == NO_ACTION
    assert env.agents == ["drone0", "drone2"]


def test_an_endurance_that_is_shorter_than_a_step_is_one_step() -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SEARCHERS, "mayfly", Searcher(doc="", endurance_min=0.01))
        env = env_with(("mayfly",))
        env.reset(seed=1)
        env.step(dict.fromkeys(env.agents, 8))
        assert status(env) == ["home"] * 3
        env.step(dict.fromkeys(env.agents, 8))
        assert not env.agents


def test_with_batteries_these_say_how_long_a_drone_flies() -> None:
    env = env_with(("drone", "short", "drone"), **BATTERY)
    env.reset(seed=1)
    for _ in range(12):
        env.advance(np.full(3, env.rules.action_set.search, np.int8))
    assert status(env)[1] == "searching"


def test_what_a_kind_cannot_do_is_masked_and_nothing_where_it_is_commanded() -> None:
    env = env_with(("straight", "drone", "drone"))
    _, infos = env.reset(seed=1)
    names = env.rules.actions
    assert names[7] == "down_right"
    allowed = {names[a] for a in np.flatnonzero(infos["drone0"]["action_mask"])}
    assert allowed == {"right", "down", "search"}
    env.advance(np.array([7, 7, 0], np.int8))
    assert env.positions[:2].tolist() == [[0, 0], [5, 4]]
    assert layer(env).applied[0].tolist() == [NO_ACTION, 7, 0]


def test_in_the_wind_a_slower_drone_takes_whole_steps_and_others_change_their_minds() -> None:
    env = env_with(
        ("slow", "drone", "drone"), drones_positions=[(4, 0), (4, 3), (7, 7)], wind_speed=2.0,
        wind_toward=270.0,
    )  # fmt: skip
    env.reset(seed=1)
    left, right = 0, 1
    # Against the wind its ground speed is 2 m/s, a fifth of that of the fastest; with it 6 m/s.
    for _ in range(4):
        env.advance(np.array([right, right, 8], np.int8))
        assert env.positions[0].tolist() == [4, 0] and status(env)[0] == "under_way"
    env.advance(np.array([left, left, 8], np.int8))
    assert env.positions[0].tolist() == [5, 0]
    # At 8 m/s the other one was there after two steps, and has turned back.
    assert env.positions[1].tolist() == [6, 3] and status(env)[1] == "searching"
    for _ in range(2):
        env.advance(np.array([left, 8, 8], np.int8))
    assert env.positions[0].tolist() == [4, 0]


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(MIXES, st.integers(0, 2**16), st.booleans(), st.booleans(), st.integers(1, 2))
def test_worlds_of_a_batch_are_those_of_single_environments_with_any_kinds(
    searchers: list[str], seed: int, faults: bool, battery: bool, threads: int
) -> None:
    fields = {
        **SEARCH, "searchers": tuple(searchers), **(FAULTS if faults else {}),
        **(BATTERY if battery else {}),
    }  # fmt: skip
    batch, envs = vector_env(2, **fields, threads=threads), [parallel_env(**fields) for _ in "12"]
    observed, infos = batch.reset(seed=seed)
    for b, env in enumerate(envs):
        env.reset(seed=seed + b)
    rng = np.random.default_rng(seed)
    for _ in range(40):
        for b, env in enumerate(envs):
            np.testing.assert_equal(observed["positions"][b], env.positions)
            np.testing.assert_equal(infos["action_mask"][b], env.action_masks())
            if env.world.faults is not None:
                np.testing.assert_equal(infos["status"][b], layer(env).conditions["status"][0])
        joint = rng.integers(0, 9, (2, 3)).astype(np.int8)
        observed, *_, infos = batch.step(joint)
        for b, env in enumerate(envs):
            if infos["step"][b] == 0:
                env.reset()
            else:
                env.advance(joint[b])
    batch.close()


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(MIXES, st.integers(0, 2**16), st.booleans(), st.booleans(), st.integers(1, 15))
def test_a_mission_with_kinds_goes_on_from_a_snapshot_bit_for_bit(
    searchers: list[str], seed: int, faults: bool, battery: bool, steps: int
) -> None:
    fields = {**(FAULTS if faults else {}), **(BATTERY if battery else {})}
    env, twin = (env_with(searchers, **fields) for _ in range(2))
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        env.advance(rng.integers(0, 9, 3).astype(np.int8))
    twin.restore(Snapshot.from_bytes(env.snapshot().to_bytes()))
    for _ in range(20):
        assert twin.world.state_bytes() == env.world.state_bytes()
        np.testing.assert_equal(twin.action_masks(), env.action_masks())
        joint = rng.integers(0, 9, 3).astype(np.int8)
        env.advance(joint)
        twin.advance(joint)
    np.testing.assert_equal(copy.deepcopy(env).positions, env.positions)


def test_a_snapshot_of_a_kind_that_has_changed_since_is_refused() -> None:
    env = env_with(SWARM)
    env.reset(seed=1)
    snapshot = env.snapshot()
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SEARCHERS, "slow", Searcher(doc="takes two steps for a cell", speed=5.0))
        with pytest.raises(SnapshotError):
            env_with(SWARM).restore(snapshot)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.sampled_from(["drone", "slow", "slower", "straight"]), min_size=3, max_size=3),
    st.integers(0, 2**16),
    st.booleans(),
)
def test_a_drone_of_any_kind_comes_home_with_its_reserve_whatever_it_is_commanded(
    searchers: list[str], seed: int, windy: bool
) -> None:
    wind = {"wind_speed": 1.5, "wind_toward": 30.0} if windy else {}
    env = env_with(searchers, collisions=False, timestep_limit=200, **{**BATTERY, **wind})
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    homes = 0
    for _ in range(150):
        env.advance(rng.integers(0, 9, 3).astype(np.int8))
        conditions, drones = layer(env).conditions[0], env.world.drones[0]
        # A command may lead it off the grid, where nothing calls it home.
        inside = ~drones["terminated"]
        assert (conditions["battery"][inside] >= 20.0 - 1e-6).all()
        homes += (conditions["status"] == STATUSES.index("home")).sum()
    assert homes or env.world.drones[0]["terminated"].all()


def test_turns_of_an_aec_environment_end_with_the_drones_of_any_kind() -> None:
    env = aec_env(**{**SEARCH, "searchers": ("slow", "short", "straight")})
    env.reset(seed=1)
    turns = 0
    for _ in env.agent_iter(1000):
        _, _, terminated, truncated, info = env.last()
        done = terminated or truncated
        env.step(None if done else int(np.flatnonzero(info["action_mask"])[0]))
        turns += 1
    assert not env.agents and turns > 100


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"searchers": ("plane",)}, ["searchers", "plane", "drone"]),
        ({"searchers": ("drone", "slow")}, ["searchers", "2", "one per drone (3)"]),
        ({"searchers": ("still",)}, ["searchers", "still", "speed", "> 0"]),
        ({"searchers": ("odd",)}, ["searchers", "odd", "hop", "left"]),
        ({"searchers": ("blind",)}, ["searchers", "blind", "sonar", "own_cell"]),
        ({"searchers": ("one_way",), **BATTERY}, ["searchers", "one_way", "right", "battery_move"]),
        ({"searchers": ("drone", "slow", "drone"), "wind_speed": 4.0}, ["wind_speed", "4 m/s"]),
    ],
)
def test_kinds_that_cannot_be_are_refused_on_one_line(
    fields: dict[str, Any], words: list[str]
) -> None:
    with pytest.raises(FieldError) as caught:
        parallel_env(**{**SEARCH, **fields})
    assert "\n" not in str(caught.value)
    assert [word for word in words if word not in str(caught.value)] == []
