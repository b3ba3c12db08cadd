# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A batch is its single environments, bit for bit, dense or lazy, on one thread or several."""

from __future__ import annotations

import os
import re
import signal
import threading
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import data_equivalence
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.agents import RESET_FIRST
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.joint_vector_env import JointVectorEnv
from dsse_ros.search.environments.vector_env import LazyMaps
from dsse_ros.search.step import kernels
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.targets import sea_map

BATCH, DRONES, GRID = 5, 3, 9
MISSION: dict[str, Any] = {
    "grid_size": GRID,
    "num_drones": DRONES,
    "vector": (0.3, -0.2),
    "person_initial_position": (4, 5),
    "person_amount": 2,
    "timestep_limit": 25,
}
PROFILES = ("paper", "v1", "v2")


def random_actions(env: Any, steps: int, seed: int = 0) -> Any:
    count = len(env.rules.actions)
    generator = np.random.default_rng(seed)
    return generator.integers(0, count, (steps, env.num_envs, DRONES)).astype(np.int8)


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("rules", PROFILES)
def test_world_b_is_the_single_environment_of_seed_s_plus_b(rules: str, threads: int) -> None:
    batch = vector_env(BATCH, rules=rules, threads=threads, **MISSION)
    singles = [parallel_env(rules=rules, **MISSION) for _ in range(BATCH)]
    observations, infos = batch.reset(seed=7)
    for b, single in enumerate(singles):
        single.reset(seed=7 + b)
        assert np.array_equal(single.probability, observations["probability"][b])
    over = infos["over"]
    resets = 0
    for actions in random_actions(batch, 150):
        observations, rewards, terminated, truncated, infos = batch.step(actions)
        for b, single in enumerate(singles):
            if over[b]:
                single.reset()
                resets += 1
                assert not rewards[b].any() and not (terminated | truncated)[b].any()
            else:
                *_, ended, cut, _ = single.step(
                    {a: int(actions[b, int(a[5:])]) for a in single.agents}
                )
                assert np.array_equal(rewards[b], single.world.rewards[0])
                assert all(terminated[b, int(a[5:])] == flag for a, flag in ended.items())
                assert all(truncated[b, int(a[5:])] == flag for a, flag in cut.items())
            for mine, theirs in (
                (batch.world.worlds, single.world.worlds),
                (batch.world.drones, single.world.drones),
                (batch.world.persons, single.world.persons),
            ):
                assert mine[b].tobytes() == theirs[0].tobytes()
            assert np.array_equal(observations["probability"][b], single.probability)
            assert np.array_equal(observations["positions"][b], single.positions)
            assert np.array_equal(infos["action_mask"][b], single.action_masks())
        over = infos["over"]
    assert resets > BATCH


@pytest.mark.parametrize("rules", PROFILES)
def test_a_lazy_batch_plays_the_same_missions_and_knows_every_cell(rules: str) -> None:
    dense = vector_env(BATCH, rules=rules, **MISSION)
    lazy = vector_env(BATCH, rules=rules, lazy=True, **MISSION)
    dense.reset(seed=3)
    lazy.reset(seed=3)
    for actions in random_actions(dense, 60):
        observations, rewards, *flags, _ = dense.step(actions)
        lazy_observations, lazy_rewards, *lazy_flags, _ = lazy.step(actions)
        maps, parameters = observations["probability"], lazy_observations["probability"]
        assert np.array_equal(parameters.dense(), maps)
        assert data_equivalence((rewards, flags), (lazy_rewards, lazy_flags))
        centres = observations["positions"]
        padded = np.pad(maps, ((0, 0), (3, 3), (3, 3)))
        windows = parameters.windows(centres, 2)
        for b in range(BATCH):
            for n, (x, y) in enumerate(centres[b] + 3):
                around = padded[b, y - 2 : y + 3, x - 2 : x + 3]
                assert np.array_equal(windows[b, n], around)
        assert np.array_equal(parameters.cells(centres), windows[:, :, 2, 2])


def test_whatever_arrays_are_handed_in_the_step_is_compiled_once() -> None:
    env = vector_env(BATCH, lazy=True, **MISSION)
    parameters = env.reset(seed=3)[0]["probability"]
    actions = random_actions(env, 1)[0]
    cells = np.zeros((BATCH, 4, 2), np.int64)
    env.step(actions)
    expected = parameters.cells(cells)
    compiled = [len(kernels.step_worlds.signatures), len(sea_map.read_cells.signatures)]
    for array in (
        cells.astype(np.uint8),
        np.broadcast_to(np.int32(0), cells.shape),
        cells.tolist(),
    ):
        assert np.array_equal(parameters.cells(array), expected)
        assert np.array_equal(parameters.windows(array, 0)[..., 0, 0], expected)
    for array in (np.broadcast_to(np.int8(4), actions.shape), np.asfortranarray(actions)):
        env.step(array)
    env.step(actions.astype(">i4"))
    assert [len(kernels.step_worlds.signatures), len(sea_map.read_cells.signatures)] == compiled


@pytest.mark.parametrize(
    ("ask", "fault"),
    [
        (lambda maps: maps.cells(np.zeros((BATCH, 4, 2))), "cells must be integers .* got float64"),
        (
            lambda maps: maps.cells(np.zeros((BATCH - 1, 4, 2), int)),
            "cells must be integers .* got int64",
        ),
        (lambda maps: maps.cells([[1, 2], [3]]), "cells must be integers .* got "),
        (
            lambda maps: maps.windows(np.zeros((BATCH, 4, 3), int), 1),
            "centres must be integers .* got int64",
        ),
        (lambda maps: maps.windows(np.zeros((BATCH, 4, 2), int), -1), "reach must be .* got -1"),
        (lambda maps: maps.windows(np.zeros((BATCH, 4, 2), int), 0.5), "reach must be .* got 0.5"),
        (
            lambda maps: maps.windows(np.zeros((BATCH, 4, 2), int), 2**62),
            "reach must be an integer",
        ),
    ],
)
def test_cells_that_are_none_are_refused_by_name(
    ask: Callable[[LazyMaps], Any], fault: str
) -> None:
    maps = vector_env(BATCH, lazy=True, **MISSION).reset(seed=0)[0]["probability"]
    with pytest.raises(FieldError, match=fault):
        ask(maps)


def test_what_a_step_returned_stays_unless_overwriting_was_asked_for() -> None:
    for copy in (True, False):
        env = vector_env(BATCH, copy=copy, **MISSION)
        env.reset(seed=0)
        observations, *rest, infos = env.step(random_actions(env, 1)[0])
        first = [*observations.values(), *rest, infos["action_mask"]]
        before = [array.copy() for array in first]
        for actions in random_actions(env, 5, seed=1):
            env.step(actions)
        stayed = [np.array_equal(a, b) for a, b in zip(before, first, strict=True)]
        assert all(stayed) if copy else not any(stayed[:3])


@settings(max_examples=25, deadline=None)
@given(st.lists(st.sampled_from(["map", "row", "memory", "all", None]), min_size=8, max_size=30))
def test_whatever_part_of_an_observation_is_kept_never_changes(kept: list[str | None]) -> None:
    env = vector_env(BATCH, threads=2, **MISSION)
    env.reset(seed=0)
    holds = []
    for keep, actions in zip(kept, random_actions(env, len(kept)), strict=True):
        observations, *rest, infos = env.step(actions)
        maps = observations["probability"]
        parts: list[Any] = {
            "map": [maps],
            "row": [maps[1][2:, ::2].T, observations["positions"][0, 1:]],
            "memory": [memoryview(maps)[0:2], memoryview(rest[0])],
            "all": [observations, *rest, *infos.values()],
            None: [],
        }[keep]
        for part in parts:
            arrays = part.values() if isinstance(part, dict) else [part]
            holds += [(array, np.array(array)) for array in arrays]
        del observations, rest, infos, maps, parts
    for array, as_it_was in holds:
        assert np.array_equal(array, as_it_was)


def test_what_was_returned_can_be_changed_and_changes_nothing() -> None:
    env, twin = (vector_env(BATCH, **MISSION) for _ in range(2))
    env.reset(seed=0)
    twin.reset(seed=0)
    for actions in random_actions(env, 30):
        observations, *rest, infos = env.step(actions)
        assert data_equivalence((observations, *rest, infos), twin.step(actions), exact=True)
        for array in (*observations.values(), *rest, *infos.values()):
            array[...] = 1
        observations["probability"].shape = (-1,)


def test_a_loop_that_holds_the_last_two_observations_makes_no_new_maps() -> None:
    env = vector_env(64, grid_size=64, num_drones=DRONES)
    before, _ = env.reset(seed=0)
    map_bytes = before["probability"].nbytes
    made = []
    for actions in random_actions(env, 20):
        tracemalloc.start()
        after, *_ = env.step(actions)
        made.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        before = after  # noqa: F841
    assert max(made[:3]) > map_bytes > 4 * max(made[3:])


@pytest.mark.slow
@pytest.mark.parametrize("grid_size", [511, 512])
def test_maps_too_large_for_a_cache_are_the_same(grid_size: int) -> None:
    worlds = kernels.STREAMED_BYTES // (4 * grid_size**2) + 1
    fields: dict[str, Any] = {"grid_size": grid_size, "sigma": 40, "vector": (3, 1), "rules": "v1"}
    dense, lazy = (vector_env(worlds, lazy=lazy, threads=2, **fields) for lazy in (False, True))
    small = parallel_env(**fields)
    for env in (dense, lazy):
        env.reset(seed=0)
    small.reset(seed=0)
    for _ in range(30):
        actions = np.full((worlds, 1), NO_ACTION, np.int8)
        maps = dense.step(actions)[0]["probability"]
        parameters = lazy.step(actions)[0]["probability"]
        small.advance(actions[0])
        assert maps.nbytes > kernels.STREAMED_BYTES > small.probability.nbytes
        assert np.array_equal(maps[0], small.probability)
    y, x = np.indices((grid_size, grid_size)).reshape(2, 1, -1)
    cells = np.broadcast_to(np.stack([x, y], axis=-1), (worlds, grid_size**2, 2))
    assert np.array_equal(parameters.cells(cells).reshape(maps.shape), maps)


@settings(max_examples=30)
@given(
    st.lists(st.integers(-(2**40), 2**40) | st.integers(-2, 9), min_size=DRONES, max_size=DRONES),
    st.sampled_from(PROFILES),
)
def test_a_number_that_is_no_action_is_refused_unless_the_rules_count_it_as_nothing(
    numbers: list[int], rules: str
) -> None:
    env, twin = (vector_env(1, rules=rules, **MISSION) for _ in range(2))
    for each in (env, twin):
        each.reset(seed=0)
    before, count = env.world.state_bytes(), len(env.rules.actions)
    wrong = [n for n in numbers if not NO_ACTION <= n < count]
    if wrong and not env.rules.noop_actions:
        allowed = f"actions must be from 0 to {count - 1}, or -1 for nothing, got {wrong[0]}"
        with pytest.raises(FieldError, match=f"^{allowed}$"):
            env.step(np.array([numbers]))
        assert env.world.state_bytes() == before
        return
    env.step(np.array([numbers]))
    twin.step(np.array([[n if 0 <= n < count else NO_ACTION for n in numbers]], np.int8))
    assert env.world.state_bytes() == twin.world.state_bytes()


def test_the_actions_of_drones_that_are_out_are_not_looked_at() -> None:
    env = vector_env(1, **MISSION)
    env.reset(seed=0)
    left = env.rules.actions.index("left")
    *_, terminated, _, _ = env.step(np.full((1, DRONES), left))
    assert terminated.any()
    env.step(np.where(terminated, 77, env.rules.action_set.search))
    # The next step after the end of a mission resets the world, whatever its actions.
    while not env.world.worlds["done"].all():
        env.step(np.full((1, DRONES), env.rules.action_set.search))
    *_, infos = env.step(np.full((1, DRONES), 77))
    assert infos["step"][0] == 0


@pytest.mark.parametrize(
    "actions",
    [
        np.zeros((BATCH, DRONES + 1), int),
        np.zeros(DRONES, int),
        np.zeros((BATCH, DRONES)),
        np.zeros((BATCH, DRONES, 1), int),
        [["a"]],
        [[1], [1, 2]],
        4,
    ],
)
def test_actions_of_another_shape_or_kind_are_refused_and_nothing_moves(actions: Any) -> None:
    env = vector_env(BATCH, **MISSION)
    env.reset(seed=0)
    before = env.world.state_bytes()
    with pytest.raises(FieldError, match="actions"):
        env.step(actions)
    assert env.world.state_bytes() == before


def test_bad_numbers_of_worlds_threads_and_fields_are_named() -> None:
    for name, fields in (
        ("num_envs", {"num_envs": 0}),
        ("threads", {"num_envs": 1, "threads": 0}),
        ("lazy", {"num_envs": 1, "lazy": "no"}),
        ("copy", {"num_envs": 1, "copy": 0}),
        ("sigmaa", {"num_envs": 1, "sigmaa": 1}),
        ("grid_size", {"num_envs": 1, "grid_size": 0}),
    ):
        with pytest.raises(FieldError, match=name):
            vector_env(**fields)


def test_every_world_can_start_from_the_options() -> None:
    env = vector_env(3, **MISSION)
    starts = [(1, 1), (2, 2), (3, 3)]
    observations, _ = env.reset(seed=0, options={"drones_positions": starts})
    assert (observations["positions"] == starts).all()
    for options in ({"drones_positions": starts[:2]}, [], 0, np.array([1, 2])):
        with pytest.raises(FieldError, match="drones_positions|options"):
            env.reset(options=options)


def test_gymnasium_sees_one_agent_per_world_who_commands_the_swarm() -> None:
    env = JointVectorEnv(vector_env(4, rules="v2", **MISSION))
    observations, _ = env.reset(seed=1)
    assert observations in env.observation_space
    ended = np.zeros(4, bool)
    for _ in range(120):
        observations, rewards, terminated, truncated, infos = env.step(env.action_space.sample())
        assert observations in env.observation_space
        assert rewards.shape == terminated.shape == truncated.shape == (4,)
        assert ((terminated | truncated) == infos["over"]).all()
        assert not (terminated & truncated).any()
        assert (infos["step"][truncated] == MISSION["timestep_limit"] + 1).all()
        assert infos["Found"][terminated].all()
        ended |= infos["over"]
    assert ended.all()
    with pytest.raises(FieldError, match="lazy"):
        JointVectorEnv(vector_env(1, lazy=True))


@pytest.mark.parametrize("rules", PROFILES)
def test_gymnasium_gets_a_truncation_for_the_time_alone(rules: str) -> None:
    if rules != "v2":
        crashing = JointVectorEnv(vector_env(1, rules=rules, grid_size=5))
        crashing.reset(seed=0)
        *_, terminated, truncated, infos = crashing.step(np.array([[0]]))
        assert (terminated, truncated, infos["over"]) == ([True], [False], [True])
    waiting = JointVectorEnv(
        vector_env(1, rules=rules, grid_size=5, timestep_limit=4, probability_of_detection=0.0)
    )
    waiting.reset(seed=0)
    search = waiting.env.rules.actions.index("search")
    over = False
    while not over:
        *_, terminated, truncated, infos = waiting.step(np.array([[search]]))
        over = infos["over"][0]
    assert (terminated, truncated) == ([False], [True])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_batch_with_threads_goes_on_in_a_forked_process() -> None:
    env = vector_env(4, threads=2, **MISSION)
    env.reset(seed=0)
    actions = np.zeros((4, DRONES), np.int8)
    env.step(actions)
    child = os.fork()
    if child == 0:
        signal.alarm(20)
        env.step(actions)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0


def test_a_batch_that_was_not_reset_refuses_its_first_step() -> None:
    actions = np.zeros((3, DRONES), np.int8)
    for env in (vector_env(3, **MISSION), JointVectorEnv(vector_env(3, **MISSION))):
        with pytest.raises(ResetNeeded, match=re.escape(RESET_FIRST)):
            env.step(actions)
        env.reset(seed=5)
        env.step(actions)


def test_batches_of_neighbouring_seeds_share_all_worlds_but_one() -> None:
    env, next_env = (vector_env(BATCH, rules="v2", **MISSION) for _ in range(2))
    env.reset(seed=4)
    next_env.reset(seed=5)
    assert env.world.worlds[1:].tobytes() == next_env.world.worlds[:-1].tobytes()
    assert env.world.persons[1:].tobytes() == next_env.world.persons[:-1].tobytes()


def test_a_seed_sequence_gives_every_world_a_stream_of_its_own() -> None:
    def states(sequence: np.random.SeedSequence, count: int) -> list[int]:
        env = vector_env(count, **MISSION)
        env.world.seed(sequence)
        return env.world.worlds["rng"].tolist()

    children = np.random.SeedSequence(4).spawn(2)
    drawn = [state for child in children for state in states(child, 50)]
    assert len(set(drawn)) == 100
    # Not by the number of worlds beside it, and for one world as of the number.
    assert states(children[0], 50)[:7] == states(children[0], 7)
    single = parallel_env(**MISSION)
    single.world.seed(4)
    assert states(np.random.SeedSequence(4), 1) == single.world.worlds["rng"].tolist()


def test_of_a_list_of_seeds_every_world_has_its_own_and_none_goes_on() -> None:
    env = vector_env(4, rules="v2", **MISSION)
    env.reset(seed=0)
    before = env.world.worlds["rng"].copy()
    env.reset(seed=[7, None, 2**70, np.int64(3)])
    twin = vector_env(4, rules="v2", **MISSION)
    twin.reset(seed=0)
    twin.reset()
    assert before[1] != env.world.worlds["rng"][1] == twin.world.worlds["rng"][1]
    for b, seed in ((0, 7), (2, 2**70), (3, 3)):
        single = parallel_env(rules="v2", **MISSION)
        single.reset(seed=seed)
        assert single.world.persons[0].tobytes() == env.world.persons[b].tobytes()


@pytest.mark.parametrize("seed", [-1, 1.5, True, "12", [1, 2], [1, 2, 3, -4], [[1], 2, 3, 4], {}])
def test_seeds_that_are_none_are_refused_and_nothing_is_seeded(seed: Any) -> None:
    env = vector_env(4, **MISSION)
    env.reset(seed=0)
    before = env.world.state_bytes()
    with pytest.raises(FieldError, match="^seed must be "):
        env.reset(seed=seed)
    assert env.world.state_bytes() == before


def test_every_info_has_a_mask_of_the_worlds_it_holds_for() -> None:
    for env in (vector_env(4, **MISSION), JointVectorEnv(vector_env(4, **MISSION))):
        for infos in (env.reset(seed=0)[1], env.step(np.zeros((4, DRONES), np.int8))[-1]):
            names = {name for name in infos if not name.startswith("_")}
            assert names == {"Found", "step", "over", "action_mask"}
            assert infos.keys() == names | {f"_{name}" for name in names}
            for name in names:
                assert infos[f"_{name}"].dtype == np.bool_
                assert infos[f"_{name}"].tolist() == [True] * 4 == [True] * len(infos[name])


def test_closing_ends_the_threads_and_a_later_step_starts_them_again() -> None:
    def others() -> set[threading.Thread]:
        return set(threading.enumerate()) - before

    before = set(threading.enumerate())
    env = JointVectorEnv(vector_env(8, threads=3, **MISSION))
    env.reset(seed=0)
    actions = np.zeros((8, DRONES), np.int8)
    env.step(actions)
    assert others()
    env.close()
    assert not others()
    env.step(actions)
    env.env.close()
    env.env.close()
    assert not others()


@pytest.mark.slow
def test_worlds_that_share_scratch_memory_do_not_see_each_others_drones() -> None:
    fields: dict[str, Any] = {"grid_size": 6, "num_drones": DRONES, "lazy": True, "rules": "paper"}
    envs = [vector_env(64, threads=threads, **fields) for threads in (1, 64)]
    for env in envs:
        env.reset(seed=0)
    crashes = 0
    # More steps of worlds than the marks of occupied cells have numbers.
    for actions in random_actions(envs[0], 800):
        rewards, others = (env.step(actions)[1] for env in envs)
        assert np.array_equal(rewards, others)
        crashes += int((rewards == envs[0].rules.collision).sum())
    assert crashes > 100
    assert envs[0].world.state_bytes() == envs[1].world.state_bytes()


@pytest.mark.parametrize("observe", ["map", "belief"])
@pytest.mark.parametrize("rules", PROFILES)
def test_worlds_that_are_reset_by_a_mask_start_as_by_themselves_and_the_others_go_on(
    rules: str, observe: str
) -> None:
    one, other = (vector_env(BATCH, rules=rules, observe=observe, **MISSION) for _ in range(2))
    one.reset(seed=3)
    other.reset(seed=3)
    for actions in random_actions(one, 12):
        one.step(actions)
        other.step(actions)
    mask = np.array([True, False, False, True, False])
    observations, infos = one.reset(seed=40, options={"reset_mask": mask})
    fresh = vector_env(BATCH, rules=rules, observe=observe, **MISSION)
    first, first_infos = fresh.reset(seed=40)
    for name, values in observations.items():
        assert np.array_equal(values[mask], first[name][mask])
    for name, values in infos.items():
        assert np.array_equal(values[mask], first_infos[name][mask])
    for actions in random_actions(one, 20, seed=1):
        observations, *_, infos = one.step(actions)
        in_fresh, *_, infos_in_fresh = fresh.step(actions)
        in_other, *_, infos_in_other = other.step(actions)
        for name, values in observations.items():
            assert np.array_equal(values[mask], in_fresh[name][mask])
            assert np.array_equal(values[~mask], in_other[name][~mask])
        for name, values in infos.items():
            assert np.array_equal(values[mask], infos_in_fresh[name][mask])
            assert np.array_equal(values[~mask], infos_in_other[name][~mask])


def test_no_mask_is_a_reset_of_every_world() -> None:
    env = vector_env(2, **MISSION)
    env.reset(seed=0)
    _, infos = env.reset(options={"reset_mask": None})
    assert infos["step"].tolist() == [0, 0]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"reset_mask": [True]}, r"reset_mask must be bool \(5,\), got \[True\]"),
        ({"reset_mask": np.zeros(5)}, "reset_mask must be bool .*, got "),
        (
            {"reset_mask": np.ones(5, bool), "vector": (0, 0)},
            "reset_mask must be the only option, got 'vector' too",
        ),
    ],
)
def test_a_mask_that_is_none_is_refused_and_the_missions_go_on(options: Any, line: str) -> None:
    env = vector_env(BATCH, **MISSION)
    env.reset(seed=3)
    before = env.world.state_bytes()
    with pytest.raises(FieldError, match=line):
        env.reset(options=options)
    assert env.world.state_bytes() == before
