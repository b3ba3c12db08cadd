# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A batch of searches as a `VecEnv` of Stable-Baselines3."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.base.extras import pip_install
from dsse_ros.search.environments.drone_slots import DroneSlots

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError(f"{error}; {pip_install('sb3')}", name=error.name) from error


class DroneVecEnv(VecEnv):
    """A `VecEnv` of one environment for each drone of each world, with action masks.

    When a drone's search ends, its info has `episode` as from `Monitor`, `is_success` (whether
    every person was found) and `TimeLimit.truncated` (whether time ran out). After a timeout the
    learner bootstraps from the value of `terminal_observation`.

    A drone that no longer acts, because it has left a mission that others continue or its time has
    run out, keeps its place in the arrays, because they cannot shrink. Its mask is all False, so
    MaskablePPO takes no gradient of the policy from it.

    Args:
        slots: The drones.
    """

    render_mode = None

    def __init__(self, slots: DroneSlots) -> None:
        self.slots = slots
        actions = spaces.Discrete(slots.num_actions)
        super().__init__(slots.num_slots, slots.single_observation_space, actions)
        self._began_s = time.monotonic()
        self._returns = np.zeros(slots.num_slots)
        self._lengths = np.zeros(slots.num_slots, np.int64)
        self._out = np.zeros(slots.num_slots, np.bool_)
        self._masks = np.zeros((slots.num_slots, slots.num_actions), np.bool_)
        self._actions = np.zeros(slots.num_slots, np.int64)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return (S, A) bool, the allowed actions; a drone that does not act has none."""
        return self._masks

    def reset(self) -> NDArray[np.float32]:
        """Start a new mission in every world; after `seed(s)` world b is that of seed s + b."""
        observations, masks = self.slots.reset(self._seeds[0])
        self._reset_seeds()
        self._note_masks(masks)
        self._returns[:], self._lengths[:], self._out[:] = 0.0, 0, False
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions (S,) of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]:
        """Advance every world by one step."""
        step = self.slots.step(self._actions)
        self._note_masks(step.action_masks)
        self._returns += step.rewards
        self._lengths += ~self._out
        dones = step.terminated | step.truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        drones = self.num_envs // len(step.over)
        for slot in np.flatnonzero(dones & ~self._out).tolist():
            infos[slot] = {
                "terminal_observation": step.final_observations[slot],
                "episode": {
                    "r": float(self._returns[slot]),
                    "l": int(self._lengths[slot]),
                    "t": time.monotonic() - self._began_s,
                },
                "is_success": bool(step.found[slot // drones]),
                "TimeLimit.truncated": bool(step.out_of_time[slot]),
            }
            self._returns[slot], self._lengths[slot] = 0.0, 0
        self._out = dones & ~np.repeat(step.over, drones)
        return step.observations, step.rewards.astype(np.float32), dones, infos

    def _note_masks(self, masks: NDArray[np.int8]) -> None:
        self._masks = masks.astype(np.bool_) & self.slots.acting[:, None]

    def close(self) -> None:
        """End the batch's threads."""
        self.slots.close()

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Call a method of this object; return its result for each slot."""
        return list(getattr(self, method_name)(*args, **kwargs)[self._indices(indices)])

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of this object for each slot."""
        return [getattr(self, attr_name)] * len(self._indices(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: slots have no attributes of their own.

        Raises:
            AttributeError: Always.
        """
        raise AttributeError(f"{attr_name}: a slot has no attributes of its own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each slot."""
        return [False] * len(self._indices(indices))

    def _indices(self, indices: Any) -> list[int]:
        return list(self._get_indices(indices))
