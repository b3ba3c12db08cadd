# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""PettingZoo's per-agent spaces."""

from __future__ import annotations

from typing import Any

from gymnasium import spaces


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
