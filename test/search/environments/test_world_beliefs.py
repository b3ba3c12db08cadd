# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Environments that observe the belief: it follows what is searched, in each world for itself."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from looking import find_in, search_in_vain
from numpy.typing import NDArray
from pettingzoo.test import api_test, parallel_api_test
from pettingzoo.test.state_test import state_test

from dsse_ros.base.fields import FieldError
from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.aec import aec_env
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.joint_vector_env import JointVectorEnv
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.snapshot import SnapshotError
from dsse_ros.search.environments.world_beliefs import DRIFT_SAMPLES, WorldBeliefs

CONFIG = Path(__file__).resolve().parents[3] / "config"
CASES: dict[str, dict[str, Any]] = {
    "paper": {
        "grid_size": 10, "num_drones": 3, "vector": (0.2, 0.1), "probability_of_detection": 0.6,
        "timestep_limit": 25, "collisions": False,
    },
    "several persons": {
        "grid_size": 10, "num_drones": 3, "probability_of_detection": 0.5, "timestep_limit": 25,
        "person_amount": 3, "person_pod_multipliers": [1.0, 0.5, 0.5], "collisions": False,
    },
    "v1": {"rules": "v1", "grid_size": 10, "sigma": 2, "timestep_limit": 25},
    "v2": {
        "rules": "v2", "grid_size": 10, "num_drones": 2, "vector": (0.6, 0.3), "timestep_limit": 25,
        "probability_of_detection": 0.5, "person_initial_position": (4, 4),
    },
    # What is observed of the drones, and not where they are, is all that there is to learn from.
    "wrong positions": {
        "rules": "v2", "grid_size": 10, "num_drones": 3, "vector": (0.6, 0.3), "timestep_limit": 25,
        "probability_of_detection": 0.5, "person_initial_position": (4, 4), "person_amount": 2,
        "drones_positions": [(4, 4), (5, 4), (4, 3)], "position_noise": 0.8,
    },
}  # fmt: skip
cases = pytest.mark.parametrize("case", CASES)
copies = pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]
)


def joints(env: Any, seed: int, shape: tuple[int, ...]) -> NDArray[np.int8]:
    """Return random joint actions, half of them searches."""
    rng, actions = np.random.default_rng(seed), env.rules.actions
    joint = rng.integers(0, len(actions), shape)
    return np.where(rng.random(shape) < 0.5, actions.index("search"), joint).astype(np.int8)


def observed(env: SearchEnv, joint: NDArray[np.int8]) -> tuple[NDArray[np.float32], float]:
    """Do a step and return the belief and the POS that the agents get."""
    agents = env.agents
    observations, *_, infos = env.step({agent: int(joint[int(agent[5:])]) for agent in agents})
    for agent in agents:
        assert observations[agent][1] is observations[agents[0]][1]
        assert env.observation_space(agent).contains(observations[agent])
    return observations[agents[0]][1], infos[agents[0]]["pos"]


@cases
def test_the_belief_of_an_environment_is_that_of_its_searches(case: str) -> None:
    env = parallel_env(observe="belief", **CASES[case])
    belief = Belief(Forecast(env.scenario, env.rules, drift_samples=DRIFT_SAMPLES))
    search = env.rules.actions.index("search")
    for seed in range(4):
        _, infos = env.reset(seed=seed)
        belief.reset()
        assert {info["pos"] for info in infos.values()} == {0.0}
        assert env.probability == pytest.approx(belief.poc(), abs=1e-6)
        for joint in joints(env, seed, (30, env.world.num_drones)):
            if not env.agents:
                break
            # The step that finds the time out may do nothing else.
            last = env.steps_done == env.scenario.timestep_limit + env.rules.time_out_grace
            acts = env.rules.time_out_acts or not last
            live = [int(agent[5:]) for agent in env.agents] if acts else []
            cells = [tuple(cell) for cell in env.positions.tolist()]
            seen, pos = observed(env, joint)
            searchers = [drone for drone in live if joint[drone] == search]
            found = env.world.found[0]
            search_in_vain(belief, [cells[i] for i in searchers if not found[i]])
            for drone in searchers:
                if found[drone]:
                    find_in(belief, cells[drone])
            belief.advance()
            assert seen == pytest.approx(belief.poc(), abs=1e-6)
            assert pos == pytest.approx(belief.pos, abs=1e-9)
            assert seen.min() >= 0.0 and seen.max() <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2])
@cases
def test_world_b_of_a_batch_has_the_belief_of_the_single_environment(
    case: str, threads: int
) -> None:
    fields = {"observe": "belief", **CASES[case]}
    batch = vector_env(9, threads=threads, **fields)
    singles = [parallel_env(**fields) for _ in range(9)]
    batch.reset(seed=5)
    for b, env in enumerate(singles):
        env.reset(seed=5 + b)
    for joint in joints(batch, 1, (60, 9, batch.world.num_drones)):
        observations, *_, infos = batch.step(joint)
        for b, env in enumerate(singles):
            if env.agents:
                _, pos = observed(env, joint[b])
            else:
                # The batch resets a world that is done.
                env.reset()
                pos = 0.0
            assert np.array_equal(observations["probability"][b], env.probability)
            assert infos["pos"][b] == pos
    batch.close()


@cases
@copies
def test_a_copy_goes_on_with_the_belief_alike_and_alone(
    copied: Callable[[Any], Any], case: str
) -> None:
    env = parallel_env(observe="belief", **CASES[case])
    env.reset(seed=2)
    script = joints(env, 3, (10, env.world.num_drones))
    for joint in script[:4]:
        if env.agents:
            observed(env, joint)
    twin = copied(env)
    assert np.array_equal(twin.probability, env.probability)
    ways = []
    for one in (env, twin):
        ways.append([observed(one, joint) for joint in script[4:] if one.agents])
    assert len(ways[0]) == len(ways[1])
    for (seen, pos), (of_twin, pos_of_twin) in zip(*ways, strict=True):
        assert np.array_equal(seen, of_twin) and pos == pos_of_twin


@pytest.mark.parametrize("case", [*CASES, "ensemble"])
@copies
def test_the_beliefs_of_a_copy_are_prepared_like_any(
    copied: Callable[[Any], Any], case: str
) -> None:
    fields = {"rules": "sea", "particles": 100, "person_motion": "constant_drift", "grid_size": 8}
    env = parallel_env(**CASES.get(case, fields))
    env.reset(seed=2)
    beliefs = WorldBeliefs(env.world)
    twin = copied(beliefs)
    for each in (beliefs, twin, copied(twin)):
        each.prepare()
    search = np.full((1, env.world.num_drones), env.rules.action_set.search, np.int8)
    for each in (beliefs, twin):
        each.step(search)
    assert np.array_equal(beliefs.write(), twin.write()) and beliefs.pos == twin.pos


def test_a_snapshot_has_the_belief_and_where_the_search_was_placed() -> None:
    env = parallel_env(observe="belief", **CASES["v2"])
    env.reset(seed=2, options={"vector": (-0.5, 0.4), "person_initial_position": (6, 6)})
    script = joints(env, 3, (12, 2))
    for joint in script[:5]:
        observed(env, joint)
    snapshot = env.snapshot()
    other = parallel_env(observe="belief", **CASES["v2"])
    other.reset(seed=9)
    other.restore(snapshot)
    for joint in script[5:]:
        if not env.agents:
            break
        (seen, pos), (of_other, pos_of_other) = observed(env, joint), observed(other, joint)
        assert np.array_equal(seen, of_other) and pos == pos_of_other


def test_a_snapshot_without_a_belief_is_refused_where_it_is_observed() -> None:
    env = parallel_env(observe="belief", **CASES["v2"])
    env.reset(seed=2)
    before = env.world.state_bytes()
    with pytest.raises(SnapshotError, match="without a belief"):
        env.restore(parallel_env(**CASES["v2"]).snapshot())
    assert env.world.state_bytes() == before


def test_the_environments_that_observe_the_belief_conform() -> None:
    fields = {"observe": "belief", "grid_size": 10, "num_drones": 3, "timestep_limit": 30}
    parallel_api_test(parallel_env(**fields))
    api_test(aec_env(**fields))
    state_test(aec_env(**fields), parallel_env(**fields))
    batch = JointVectorEnv(vector_env(2, **fields))
    assert isinstance(batch, gymnasium.vector.VectorEnv)
    observations, infos = batch.reset(seed=1)
    for _ in range(40):
        assert batch.observation_space.contains(observations)
        assert infos["_pos"].all() and infos["pos"].shape == (2,)
        observations, *_, infos = batch.step(batch.action_space.sample())
    plain = parallel_env(grid_size=10, num_drones=3)
    space = parallel_env(**fields).observation_space("drone0")
    assert space == plain.observation_space("drone0")


def test_what_cannot_be_observed_is_named() -> None:
    for make in (parallel_env, lambda **fields: vector_env(2, **fields)):
        with pytest.raises(FieldError, match="observe must be one of .* got 'person'"):
            make(observe="person")
    with pytest.raises(FieldError, match="lazy must be false with observe belief"):
        vector_env(2, observe="belief", lazy=True)
    with pytest.raises(
        FieldError, match="grid_size must be smaller.* with beliefs .* got 900 x 900"
    ):
        vector_env(2, grid_size=900, observe="belief")


@pytest.mark.slow
def test_nothing_outside_an_area_is_probable() -> None:
    env = parallel_env(CONFIG / "santos_shore.yaml", observe="belief")
    env.reset(seed=1)
    assert env.scenario.area_mask is not None
    for joint in joints(env, 2, (15, env.world.num_drones)):
        if env.agents:
            seen, _ = observed(env, joint)
            assert not seen[~env.scenario.area_mask].any()
            assert seen.sum() == pytest.approx(1, abs=1e-5)
