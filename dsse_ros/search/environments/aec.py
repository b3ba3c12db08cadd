# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search as a PettingZoo AEC environment: agents act in turns, observations are flat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils import BaseParallelWrapper, wrappers
from pettingzoo.utils.conversions import parallel_to_aec_wrapper

from dsse_ros.search.environments.factories import parallel_env


class FlattenedObservationWrapper(BaseParallelWrapper[str, Any, int]):
    """Makes each observation one float32 vector and names agents `drone_0`.

    PettingZoo's AEC tests and the networks of learning libraries expect both. Observations are
    flattened by `gymnasium.spaces.flatten`, cells as one-hot vectors; `unflatten` with the inner
    space gives them back, rounded to float32.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env)
        self._inner = {f"drone_{i}": agent for i, agent in enumerate(env.possible_agents)}
        self._outer = {agent: name for name, agent in self._inner.items()}
        self._spaces = {
            name: _float32(spaces.flatten_space(env.observation_space(agent)))
            for name, agent in self._inner.items()
        }

    @property
    def possible_agents(self) -> list[str]:
        """All agents: drone_0, drone_1, ..."""
        return list(self._inner)

    @property
    def agents(self) -> list[str]:  # type: ignore[override]
        """The live agents."""
        return [self._outer[agent] for agent in self.env.agents]

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the agent's flat observation space, always the same object."""
        return self._spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the agent's action space, always the same object."""
        return self.env.action_space(self._inner[agent])

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Start a new mission, as `SearchEnv.reset`."""
        observations, infos = self.env.reset(seed=seed, options=options)
        return self._flatten(observations), self._rename(infos)

    def step(self, actions: Mapping[str, int]) -> Any:
        """Advance the mission by one step, as `SearchEnv.step`."""
        observations, *rest = self.env.step(
            {self._inner[name]: a for name, a in actions.items() if name in self._inner}
        )
        return self._flatten(observations), *map(self._rename, rest)

    def _rename(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {self._outer[agent]: value for agent, value in values.items()}

    def _flatten(self, observations: Mapping[str, Any]) -> dict[str, Any]:
        return {
            self._outer[agent]: np.asarray(
                spaces.flatten(self.env.observation_space(agent), observation), np.float32
            )
            for agent, observation in observations.items()
        }


def _float32(space: Any) -> spaces.Box:
    low, high = (bound.astype(np.float32) for bound in (space.low, space.high))
    return spaces.Box(low, high, dtype=np.float32)


def raw_env(*args: Any, **kwargs: Any) -> AECEnv[str, Any, int | None]:
    """Return the search as an AEC environment without wrappers; arguments as in `parallel_env`.

    Agents are named drone_0 and observe float32 vectors, see `FlattenedObservationWrapper`.
    """
    return parallel_to_aec_wrapper(FlattenedObservationWrapper(parallel_env(*args, **kwargs)))


def aec_env(*args: Any, **kwargs: Any) -> AECEnv[str, Any, int | None]:
    """Return the search as an AEC environment that checks its use; arguments of `parallel_env`."""
    wrapped = raw_env(*args, **kwargs)
    # PettingZoo's wrapper is for numbered actions; an environment in metres checks its own.
    if all(
        isinstance(wrapped.action_space(agent), spaces.Discrete)
        for agent in wrapped.possible_agents
    ):
        wrapped = wrappers.AssertOutOfBoundsWrapper(wrapped)
    return wrappers.OrderEnforcingWrapper(wrapped)


env = aec_env
"""The name that PettingZoo users expect."""
