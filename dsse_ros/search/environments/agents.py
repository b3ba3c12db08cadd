# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""PettingZoo's agents: their observations, infos and spaces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

RESET_FIRST = "reset() must be called first"
"""Message of Gymnasium's `ResetNeeded`."""


class Observation(NamedTuple):
    """The observation of one drone.

    Attributes:
        position: (2,) integers, the drone's cell (x, y).
        probability: (R, C) float32, the probability of cell [y, x].
    """

    position: NDArray[np.integer[Any]]
    probability: NDArray[np.float32]


AgentObservation = tuple[NDArray[np.integer[Any]], NDArray[np.float32]]
"""Plain tuple that an environment returns per agent; `Observation(*value)` names its parts."""

Started = tuple[dict[str, AgentObservation], dict[str, dict[str, Any]]]
"""What `reset` returns: observations and infos, by agent."""

Stepped = tuple[
    dict[str, AgentObservation],
    dict[str, float],
    dict[str, bool],
    dict[str, bool],
    dict[str, dict[str, Any]],
]
"""What `step` returns: observations, rewards, terminations, truncations and infos, by agent."""


def agent_infos(
    agents: Iterable[str],
    found: bool,
    masks: Iterable[NDArray[np.int8]] | None,
    columns: Mapping[str, Iterable[Any]],
) -> dict[str, dict[str, Any]]:
    """Return the infos of agents, by name.

    Args:
        agents: Names of the agents.
        found: Whether every person has been found, or every cell covered.
        masks: Action mask (A,) of each agent; None in metres.
        columns: Further values by key, one per agent, see `World.info_columns`.
    """
    infos: dict[str, dict[str, Any]]
    if masks is None:
        infos = {agent: {"Found": found} for agent in agents}
    else:
        infos = {agent: {"Found": found, "action_mask": mask} for agent, mask in zip(agents, masks)}
    for name, values in columns.items():
        for info, value in zip(infos.values(), values, strict=True):
            info[name] = value
    return infos


class AgentSpaces:
    """An environment that keeps the spaces of its agents in two dictionaries.

    PettingZoo's own methods warn. Users rely on getting the same object each time, because they
    may have seeded it.

    Attributes:
        observation_spaces: Observation space of each agent.
        action_spaces: Action space of each agent.
    """

    observation_spaces: dict[str, spaces.Space[Any]]
    action_spaces: dict[str, spaces.Space[Any]]

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the agent's observation space, always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the agent's action space, always the same object."""
        return self.action_spaces[agent]
