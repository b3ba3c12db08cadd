# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The loop that plays missions with a planner, step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from dsse_ros.planners.planner import Infos, Observations


class Missions(Protocol):
    """What `play` steps: an environment with one mission, or a `MissionBatch`."""

    @property
    def agents(self) -> Sequence[str]:
        """The agents that are in the search; none once the missions are over."""
        ...

    def reset(self, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start; returns observations and infos, by agent."""
        ...

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Advance by one step; returns what `PlayedStep` has besides the actions."""
        ...


class PlayedStep(NamedTuple):
    """A step, by agent.

    Attributes:
        actions: Of the agents that were in the search before the step.
        observations: After the step, as those that follow.
        rewards: Of the step.
        terminations: Whose search has ended.
        truncations: Whose search the time limit has ended.
        infos: As `Planner` describes them.
    """

    actions: Mapping[str, int]
    observations: Observations
    rewards: Mapping[str, float]
    terminations: Mapping[str, bool]
    truncations: Mapping[str, bool]
    infos: Infos


def play(
    env: Missions,
    planner: Callable[[Any, Any], Mapping[str, Any]],
    *,
    seed: Any = None,
    options: dict[str, Any] | None = None,
) -> Iterator[PlayedStep]:
    """Play a mission, or all missions of a batch, to the end and yield each step.

    The planner is given the agents that are in the search: the last observation of an agent that
    has just left it is for learning only.

    Args:
        env: A `SearchEnv`, any environment with its observations and infos, or a `MissionBatch`.
        planner: A `Planner`; of a batch, its `SharedPlanners`.
        seed: As in `reset`.
        options: As in `reset`.
    """
    observations, infos = env.reset(seed=seed, options=options)
    while env.agents:
        observations = {agent: observations[agent] for agent in env.agents}
        actions = planner(observations, infos)
        step = PlayedStep(actions, *env.step(actions))
        observations, infos = step.observations, step.infos
        yield step
