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

from dsse_ros.mission.mission import Mission
from dsse_ros.mission.step_reports import mission_report_of, step_report_of
from dsse_ros.scenario.agents import AgentsInfo, agents_json
from dsse_ros.scenario.definition import SearchDefinition
from dsse_ros.scenario.frames import GridFrame, scenario_frame
from dsse_ros.search import parallel_env
from msg_adapters.mission_report import mission_report_message
from msg_adapters.occupancy import occupancy_grid
from msg_adapters.pos import pos_message
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_message

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
        mission, frame, result = self.mission, self.frame, self.mission.result
        stamp = to_stamp(result.stamp_ns)
        report = step_report_of(mission, frame, self.run_id)
        pos = mission.pos
        assert pos is not None
        return Step(
            number=result.step,
            messages={
                "probability_grid": occupancy_grid(
                    header(frame.map_frame, stamp), frame.cell_size_m, self.env.probability
                ),
                **self._belief_grid(stamp),
                "probability_of_success": pos_message(
                    self.run_id, mission.number, result.step, pos
                ),
                "step_report": step_report_message(header(frame.map_frame, stamp), report),
            },
            cells=result.cells,
            rewards=result.rewards,
            searched=result.actions == self.env.rules.actions.index("search"),
            found=result.found,
            flying=~(result.terminated | result.truncated),
            pos=pos,
        )

    def _belief_grid(self, stamp: Any) -> dict[str, Any]:
        if self.env.rules.covers:
            return {}
        return {
            "belief_grid": occupancy_grid(
                header(self.frame.map_frame, stamp), self.frame.cell_size_m, self.mission.belief()
            )
        }

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

    @property
    def mission_report(self) -> Any:
        """The message of the topic of that name."""
        mission = self.mission
        report = mission_report_of(mission, self.frame, self.run_id)
        return mission_report_message(
            header(self.frame.map_frame, to_stamp(mission.result.stamp_ns)), report
        )
