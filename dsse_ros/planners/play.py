# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""One mission with a planner, step by step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pettingzoo import ParallelEnv

from dsse_ros.planners.planner import Infos, Observations, Planner


class PlayedStep(NamedTuple):
    """A step of a mission, by agent.

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
    env: ParallelEnv[str, Any, int],
    planner: Planner,
    *,
    seed: int | None = None,
    options: dict[str, Any] | None = None,
) -> Iterator[PlayedStep]:
    """Play a mission to its end and yield each step.

    The planner is given the agents that are in the search: the last observation of an agent that
    has just left it is for learning only.

    Args:
        env: A `SearchEnv`, or any environment with its observations and infos.
        planner: The planner.
        seed: As in `SearchEnv.reset`.
        options: As in `SearchEnv.reset`.
    """
    observations, infos = env.reset(seed=seed, options=options)
    while env.agents:
        observations = {agent: observations[agent] for agent in env.agents}
        actions = planner(observations, infos)
        step = PlayedStep(actions, *env.step(actions))
        observations, infos = step.observations, step.infos
        yield step
