# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Stable-Baselines3 learns in the searches of `DroneVecEnv`."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from dsse_ros.search.environments.drone_slots import DroneSlots
from dsse_ros.search.environments.factories import vector_env

torch = pytest.importorskip("torch")
MaskablePPO = pytest.importorskip("sb3_contrib").MaskablePPO
BaseCallback = pytest.importorskip("stable_baselines3.common.callbacks").BaseCallback

from dsse_ros.training.vec_env import DroneVecEnv  # noqa: E402

SEARCH: dict[str, Any] = {
    "rules": "v2", "grid_size": 12, "person_initial_position": (5, 6), "timestep_limit": 20,
    "drones_positions": [(5, 6), (4, 6), (5, 5)], "probability_of_detection": 0.5,
}  # fmt: skip


def test_a_learner_takes_the_value_of_what_was_to_come_where_the_time_is_out() -> None:
    seen: dict[str, Any] = {"rewards": [], "infos": []}
    collected = []

    class Noted(DroneVecEnv):
        def step_wait(self) -> Any:
            observations, rewards, dones, infos = super().step_wait()
            seen["rewards"].append(rewards.copy())
            seen["infos"].append(infos)
            return observations, rewards, dones, infos

    class Collected(BaseCallback):
        def _on_step(self) -> bool:
            return True

        def _on_rollout_end(self) -> None:
            collected.append(copy.deepcopy(self.model.rollout_buffer))

    slots = DroneSlots(vector_env(4, **SEARCH))
    model = MaskablePPO(
        "MlpPolicy", Noted(slots), n_steps=64, batch_size=96, seed=3, device="cpu", gamma=0.9,
        learning_rate=0.0,
    )  # fmt: skip
    model.learn(1, callback=Collected())
    late = ended = 0
    expected = np.array(seen["rewards"])
    for (step, slot), info in np.ndenumerate(np.array(seen["infos"])):
        if info.get("TimeLimit.truncated"):
            last, _ = model.policy.obs_to_tensor(info["terminal_observation"])
            with torch.no_grad():
                expected[step, slot] += 0.9 * model.policy.predict_values(last).item()
            assert info["episode"]["l"] == 21 and not info["is_success"]
            late += 1
        elif info:
            assert info["is_success"]
            ended += 1
    np.testing.assert_allclose(collected[0].rewards, expected, atol=1e-5)
    assert late > 0 and ended > 0
    assert model.ep_info_buffer and all(1 <= episode["l"] <= 21 for episode in model.ep_info_buffer)
