# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Waypoints as actions of a search in metres."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo.utils.wrappers import BaseParallelWrapper

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.space import turn_and_speed_of
from dsse_ros.search.step.metres_paths import shares_of
from dsse_ros.search.step.metres_steering import steer
from dsse_ros.world.scenario.swarm import number_of


class Waypoints(BaseParallelWrapper[str, Any, Any]):
    """A `SearchEnv` in metres with positions as actions: a drone flies there until the next one.

    It is (2,), shares of the grid's width from the west and of its height from the north, 0 to 1.
    A drone that can slow down is there at the end of a step at the earliest; one with a turn radius
    flies at cruise.

    Args:
        env: The environment.

    Raises:
        FieldError: If it does not fly in metres.
    """

    def __init__(self, env: SearchEnv) -> None:
        if not (isinstance(env, SearchEnv) and env.rules.in_metres):
            raise FieldError(f"env must be a SearchEnv in metres, got {shown(type(env).__name__)}")
        super().__init__(env)
        self._env = env
        self._spaces = {
            agent: spaces.Box(0.0, 1.0, (2,), np.float32) for agent in env.possible_agents
        }

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the agent's action space, always the same object."""
        return self._spaces[agent]

    def step(self, actions: Mapping[str, Any]) -> Any:
        """Advance the mission by one step, as `SearchEnv.step`.

        Raises:
            FieldError: If a position is missing or not on the grid; the mission stays as it is.
        """
        world = self._env.world
        assert world.metres is not None
        airframes, wind = world.metres.airframes[world.looks.kind], world.metres.wind
        extent = world.grid_size.extent(world.scenario.cell_size)
        goals = np.zeros((world.num_drones, 2))
        if not isinstance(actions, Mapping):
            raise FieldError(f"actions must be two numbers per live agent, got {shown(actions)}")
        for agent in self._env.agents:
            goals[number_of(agent)] = turn_and_speed_of(
                agent, actions, low=0.0, names="east and south"
            )
        chosen = steer(
            airframes, wind, extent, world.metres.states[0], goals * extent, True,
            np.empty((world.metres.paths.shape[2], 2)),
        )  # fmt: skip
        shares = {}
        for agent in self._env.agents:
            n = number_of(agent)
            turn, speed = chosen[n].tolist()
            shares[agent] = shares_of(airframes[n], turn, speed, wind.step_s)
        return self._env.step(shares)
