# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Other libraries take the published environments (docs/coming_from_dsse.md, Other libraries)."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test
from pettingzoo.utils import parallel_to_aec

from dsse_ros.compat import DroneSwarmSearch, wrappers
from dsse_ros.search.environments.aec import FlattenedObservationWrapper
from dsse_ros.search.environments.factories import parallel_env

ARRAYS = [wrappers.AllFlattenWrapper, wrappers.MatrixEncodeWrapper, wrappers.TopNProbsWrapper]
TUPLES = [lambda env: env, wrappers.AllPositionsWrapper, wrappers.CommunicationWrapper]


def search() -> DroneSwarmSearch:
    return DroneSwarmSearch(grid_size=6, drone_amount=2, timestep_limit=20)


FLAT = [
    lambda: FlattenedObservationWrapper(search()),
    lambda: FlattenedObservationWrapper(wrappers.TopNProbsWrapper(search())),
    lambda: FlattenedObservationWrapper(parallel_env(rules="v2", grid_size=6, num_drones=2)),
]
"""What docs/coming_from_dsse.md has for users of learning libraries."""


@pytest.mark.parametrize("wrap", [*ARRAYS, *TUPLES])
def test_the_parallel_api_is_pettingzoos(wrap: Callable[[Any], Any]) -> None:
    parallel_api_test(wrap(search()), num_cycles=50)


# PettingZoo recommends names like drone_0, and no negative numbers in matrices.
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("wrap", ARRAYS)
def test_arrays_pass_the_aec_api_test(wrap: Callable[[Any], Any]) -> None:
    api_test(parallel_to_aec(wrap(search())), num_cycles=50)


@pytest.mark.parametrize("wrap", TUPLES)
def test_flattened_tuples_pass_the_aec_api_test(wrap: Callable[[Any], Any]) -> None:
    api_test(parallel_to_aec(FlattenedObservationWrapper(wrap(search()))), num_cycles=50)


@pytest.mark.parametrize("wrap", [*ARRAYS, *TUPLES])
def test_every_observation_flattens_to_a_float32_vector_of_its_space(
    wrap: Callable[[Any], Any],
) -> None:
    env = FlattenedObservationWrapper(wrap(search()))
    observations, _ = env.reset(seed=1)
    while env.agents:
        for agent, observed in observations.items():
            assert observed.dtype == np.float32 and observed.ndim == 1
            assert env.observation_space(agent).contains(observed)
        observations, *_ = env.step(dict.fromkeys(env.agents, 1))


@pytest.mark.parametrize("wrap", [wrappers.TopNProbsWrapper, FlattenedObservationWrapper])
def test_supersuit_makes_floats_of_them(wrap: Callable[[Any], Any]) -> None:
    supersuit = pytest.importorskip("supersuit")
    env = supersuit.dtype_v0(wrap(search()), np.float32)
    assert {observed.dtype for observed in env.reset()[0].values()} == {np.dtype(np.float32)}
    parallel_api_test(env, num_cycles=50)


# TorchRL names the version of PettingZoo that it is tested with; our action masks are read-only.
@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL:UserWarning")
@pytest.mark.filterwarnings("ignore:The given NumPy array is not writable:UserWarning")
@pytest.mark.parametrize("make", FLAT)
def test_torchrl_rolls_out_a_network(make: Callable[[], Any]) -> None:
    pytest.importorskip("torchrl")
    from tensordict.nn import TensorDictModule, TensorDictSequential
    from torchrl.envs import PettingZooWrapper, check_env_specs
    from torchrl.modules import MultiAgentMLP

    env = PettingZooWrapper(make(), use_mask=True, categorical_actions=True)
    check_env_specs(env)
    observed = env.observation_spec["drone", "observation"]
    count = env.full_action_spec["drone", "action"].space.n
    network = MultiAgentMLP(observed.shape[-1], count, 2, centralized=False, share_params=True)
    keys = ("drone", "observation"), ("drone", "logits")
    policy = TensorDictSequential(
        TensorDictModule(network, in_keys=keys[:1], out_keys=keys[1:]),
        TensorDictModule(
            lambda logits: logits.argmax(-1), in_keys=keys[1:], out_keys=[("drone", "action")]
        ),
    )
    rollout = env.rollout(30, policy, break_when_any_done=True)
    assert rollout["drone", "logits"].shape == (len(rollout), 2, count)


# RLlib warns of its own deprecations, and leaves Ray's processes to the exit of this one.
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("make", FLAT)
def test_rllib_trains(make: Callable[[], Any]) -> None:
    pytest.importorskip("torch")
    pytest.importorskip("ray.rllib")
    import ray
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.env import ParallelPettingZooEnv
    from ray.tune import register_env

    register_env("search", lambda _: ParallelPettingZooEnv(make()))
    config = (
        PPOConfig()
        .environment("search")
        .env_runners(num_env_runners=0)
        .multi_agent(policies={"shared"}, policy_mapping_fn=lambda *_, **__: "shared")
        .training(train_batch_size_per_learner=64, minibatch_size=64, num_epochs=1)
    )
    ray.init(num_cpus=1, include_dashboard=False)
    try:
        trained = config.build_algo().train()
    finally:
        ray.shutdown()
    assert trained["env_runners"]["num_env_steps_sampled"] == 64


@pytest.mark.parametrize("make", FLAT)
def test_stable_baselines_trains(make: Callable[[], Any]) -> None:
    supersuit = pytest.importorskip("supersuit")
    learning = pytest.importorskip("stable_baselines3")
    worlds = supersuit.pettingzoo_env_to_vec_env_v1(make())
    worlds = supersuit.concat_vec_envs_v1(worlds, 2, base_class="stable_baselines3")
    model = learning.PPO("MlpPolicy", worlds, n_steps=16, batch_size=64, n_epochs=1, device="cpu")
    assert model.learn(64).num_timesteps == 64


def in_metres() -> FlattenedObservationWrapper:
    """A search whose actions are continuous."""
    env = parallel_env(
        rules="flight", person_motion="constant_drift", grid_size=8, particles=200, num_drones=2,
        timestep_limit=20,
    )  # fmt: skip
    return FlattenedObservationWrapper(env)


@pytest.mark.parametrize("algorithm", ["PPO", "SAC"])
def test_stable_baselines_trains_in_metres(algorithm: str) -> None:
    supersuit = pytest.importorskip("supersuit")
    learning = pytest.importorskip("stable_baselines3")
    worlds = supersuit.pettingzoo_env_to_vec_env_v1(in_metres())
    worlds = supersuit.concat_vec_envs_v1(worlds, 2, base_class="stable_baselines3")
    options = {"PPO": {"n_steps": 16, "n_epochs": 1}, "SAC": {"learning_starts": 16}}[algorithm]
    model = getattr(learning, algorithm)(
        "MlpPolicy", worlds, batch_size=16, device="cpu", **options
    )
    assert model.learn(64).num_timesteps == 64


def test_the_code_on_the_page_about_training_in_metres_runs() -> None:
    pytest.importorskip("supersuit")
    pytest.importorskip("stable_baselines3")
    page = Path(__file__).resolve().parents[2] / "docs" / "tutorials" / "training.md"
    blocks = re.findall(
        r"^```python\n(.*?)^```$", page.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    (code,) = (block for block in blocks if "stable_baselines3" in block)
    exec(compile(code, str(page), "exec"), {})


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL:UserWarning")
def test_torchrl_rolls_out_a_continuous_policy() -> None:
    pytest.importorskip("torchrl")
    from tensordict.nn import TensorDictModule
    from torchrl.envs import PettingZooWrapper, check_env_specs
    from torchrl.modules import MultiAgentMLP

    env = PettingZooWrapper(in_metres(), use_mask=True)
    check_env_specs(env)
    observed = env.observation_spec["drone", "observation"]
    network = MultiAgentMLP(observed.shape[-1], 2, 2, centralized=False, share_params=True)
    policy = TensorDictModule(
        lambda seen: network(seen).tanh(), in_keys=[("drone", "observation")],
        out_keys=[("drone", "action")],
    )  # fmt: skip
    rollout = env.rollout(30, policy, break_when_any_done=True)
    assert rollout["drone", "action"].shape == (len(rollout), 2, 2)
