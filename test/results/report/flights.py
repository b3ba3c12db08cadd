# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions flown by random actions, and what is recorded of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.run.mission import Mission, StepResult
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_frame

SCENARIO = {
    "name": "A test & its <name>", "grid_size": 9, "num_drones": 3, "cell_size": 130.0,
    "sigma": 2.0, "timestep_limit": 14, "person_initial_position": (4, 4),
    "probability_of_detection": 0.7, "drones_positions": [(3, 4), (4, 3), (5, 5)],
}  # fmt: skip


@dataclass
class Flown:
    """A mission that was flown.

    Attributes:
        number: Its number.
        results: Of its steps, that of the start first.
        pos: After each step.
        found_persons: (P,) whether each person was found.
    """

    number: int
    results: list[StepResult] = field(default_factory=list)
    pos: list[float] = field(default_factory=list)
    found_persons: list[bool] = field(default_factory=list)


class Recorder(Protocol):
    """Records the steps of missions."""

    def write(self, mission: Mission) -> None:
        """Record a step."""

    def close(self) -> None:
        """End the record."""


class Log:
    """Records to a CSV, as `sim_node` does."""

    def __init__(self, path: Path, env: SearchEnv) -> None:
        self._log = MissionLog(path, scenario_frame(env.scenario), covers=env.rules.covers)

    def write(self, mission: Mission) -> None:
        self._log.write(mission, mission.result)

    def close(self) -> None:
        self._log.close()


def environment(rules: str = "paper", **scenario: Any) -> SearchEnv:
    """Return the environment of a small search with these fields."""
    return SearchEnv(Scenario.read(SCENARIO).override(**scenario), profile(rules))


def fly(
    env: SearchEnv,
    recorder: Recorder,
    *,
    seeds: tuple[int, ...] = (1,),
    steps: int | None = None,
    searching: float = 0.6,
) -> list[Flown]:
    """Fly missions by random actions of their seeds; returns what happened.

    Args:
        env: The environment.
        recorder: Of all of them.
        seeds: One for each mission.
        steps: At most so many in the last mission.
        searching: Part of the actions that are searches.
    """
    mission = Mission(env, seeds[0], belief=env.scenario.grid_size.longer <= 50)
    flown = []
    for seed in seeds:
        draw = np.random.default_rng(seed)
        if flown:
            mission.reset(seed)
        one = Flown(mission.number)
        flown.append(one)
        limit = steps if seed == seeds[-1] else None
        while True:
            recorder.write(mission)
            one.results.append(mission.result)
            one.pos.append(0.0 if mission.pos is None else mission.pos)
            one.found_persons = env.world.persons["found"][0].tolist()
            if mission.done or (limit is not None and mission.result.step >= limit):
                break
            search = env.rules.action_set.search
            joint = draw.integers(0, search, len(env.possible_agents))
            joint[draw.random(len(joint)) < searching] = search
            mission.command_all(joint.tolist())
            mission.advance("hold")
    recorder.close()
    return flown
