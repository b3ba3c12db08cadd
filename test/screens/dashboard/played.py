# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission that was really played, as the messages that `sim_node` would publish of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import String

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_messages import StepMessages
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.agents import AgentsInfo, agents_json
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.scenario import scenario_frame
from msg_adapters.stamps import to_stamp

RUN_ID = 77


@dataclass
class Step:
    """A step, as messages by topic and as arrays."""

    number: int
    messages: dict[str, Any]
    cells: NDArray[np.int64]
    rewards: NDArray[np.float64]
    searched: NDArray[np.bool_]
    found: NDArray[np.bool_]
    flying: NDArray[np.bool_]
    pos: float


class Played:
    """Missions of one simulation.

    Args:
        run_id: Identity of the simulation.
        fields: Of the scenario and the rules.
    """

    def __init__(self, run_id: int = RUN_ID, **fields: Any) -> None:
        self.run_id = run_id
        self.env = parallel_env(**fields)
        self.mission = Mission(self.env, 0)
        self.frame: GridFrame = scenario_frame(self.env.scenario)

    @property
    def agents(self) -> Any:
        """The message of the topic of that name."""
        env = self.env
        return String(
            data=agents_json(
                AgentsInfo(
                    agents=tuple(env.possible_agents),
                    actions=env.rules.actions,
                    rules=env.rules.profile,
                    seed=0,
                    frame=self.frame,
                    timestep_limit=int(env.scenario.timestep_limit or 0),
                    step_duration_s=env.scenario.step_duration_s,
                    mission=self.mission.number,
                    run_id=self.run_id,
                    definition=SearchDefinition(env.rules, env.mission_scenario),
                )
            )
        )

    def step(self) -> Step:
        """Return the step that the mission is in."""
        result, pos = self.mission.result, self.mission.pos
        assert pos is not None
        topics = ["probability_grid", "belief_grid", "probability_of_success", "step_report"]
        if self.env.rules.covers:
            topics.remove("belief_grid")
        return Step(
            number=result.step,
            messages={topic: self._message(topic) for topic in topics},
            cells=result.cells,
            rewards=result.rewards,
            searched=result.actions == self.env.rules.action_set.search,
            found=result.found,
            flying=~(result.terminated | result.truncated),
            pos=pos,
        )

    def _message(self, topic: str) -> Any:
        # One that is kept would fill the message of an earlier step again.
        messages = StepMessages(self.mission, self.frame, self.run_id)
        return messages.make(topic, to_stamp(self.mission.result.stamp_ns))

    def play(self, seed: int, steps: int = 10**6) -> Iterator[Step]:
        """Play a mission, or its first steps, by chance."""
        mission = self.mission
        mission.reset(seed)
        chance = np.random.default_rng(seed)
        yield self.step()
        while not mission.done and mission.result.step < steps:
            masks = self.env.action_masks()
            # The last action is to search, which loses no drone.
            may = [np.flatnonzero([*mask[:-1], True]) for mask in masks]
            mission.command_all([int(chance.choice(actions)) for actions in may])
            mission.advance("search")
            yield self.step()

    def fly(self, seed: int, steps: int) -> Iterator[Step]:
        """Fly the first steps of a mission in metres by chance."""
        mission, chance = self.mission, np.random.default_rng(seed)
        mission.reset(seed)
        yield self.step()
        for _ in range(steps):
            mission.command_all(chance.uniform(-1, 1, (len(mission.tracks), 2)).tolist())
            mission.advance("search")
            yield self.step()

    @property
    def mission_report(self) -> Any:
        """The message of the topic of that name."""
        return self._message("mission_report")
