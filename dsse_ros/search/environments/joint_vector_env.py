# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many searches at once with Gymnasium's interface."""

from __future__ import annotations

from typing import Any

import gymnasium
from gymnasium.vector import AutoresetMode

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.vector_env import VectorEnv


class JointVectorEnv(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """A `VectorEnv` with Gymnasium's interface: one agent per world commands all its drones.

    The action is (N,) numbers and the reward is the sum over the drones. A world is truncated at
    the time limit, and terminated if its search ends otherwise.

    Args:
        env: A `VectorEnv` with dense maps, on the CPU.

    Raises:
        FieldError: If the environment is lazy, or on another device.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, env: VectorEnv) -> None:
        # Set before any check: Gymnasium also closes environments whose `__init__` failed.
        self.env = env
        if env.device != "cpu":
            raise FieldError(f"device must be cpu with Gymnasium's interface, got {env.device!r}")
        if env.lazy:
            raise FieldError("lazy must be false, so that observations are arrays, got true")
        self.num_envs = env.num_envs
        self.single_observation_space, self.single_action_space = env.single_spaces()
        batch = gymnasium.vector.utils.batch_space
        self.observation_space = batch(self.single_observation_space, self.num_envs)
        self.action_space = batch(self.single_action_space, self.num_envs)

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        """Start a new mission in every world; arguments as in `VectorEnv.reset`."""
        return self.env.reset(seed, options)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Advance every world by one step."""
        observations, rewards, _, _, infos = self.env.step(actions)
        done = infos["over"]
        out_of_time = self.env.out_of_time(infos)
        return observations, rewards.sum(axis=1), done & ~out_of_time, out_of_time, infos

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self.env.close()
