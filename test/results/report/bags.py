# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `sim_node` publishes of a mission, written to a bag without DDS."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from dsse_ros.mission.recording.bag import BagWriter
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_messages import StepMessages
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.agents import AgentsInfo, agents_json, area_rows
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.scenario import scenario_frame
from msg_adapters.stamps import to_stamp
from msg_adapters.topics import TOPICS

RECORDED = ("agents", "probability", "belief", "step_report", "mission_report")


class Bag:
    """Records to a bag.

    Args:
        path: A new file.
        env: The environment of the missions.
        topics: Those that are recorded.
        namespace: Of the topics.
        definition: Whether `agents` says what is searched.
        skip: Steps whose report is lost.
        run_id: Of the simulation; a later one is recorded later.
    """

    def __init__(
        self,
        path: Path,
        env: SearchEnv,
        *,
        topics: Collection[str] = RECORDED,
        namespace: str = "",
        definition: bool = True,
        skip: Collection[int] = (),
        run_id: int = 7,
    ) -> None:
        self._bag = BagWriter(path)
        self._channels = {
            name: self._bag.add_topic(f"{namespace}/{name}", TOPICS[name].type_name)
            for name in topics
        }
        self._env, self._frame = env, scenario_frame(env.scenario)
        self._definition = SearchDefinition(env.rules, env.scenario) if definition else None
        self._skip = skip
        self._run_id = run_id
        self._now_ns = run_id * 10**12

    def _write(self, name: str, message: Any) -> None:
        if name in self._channels:
            self._now_ns += 1000
            self._bag.write(
                self._channels[name],
                serialize_message(message),
                log_time_ns=self._now_ns,
                publish_time_ns=self._now_ns,
            )

    def write(self, mission: Mission) -> None:
        """Record a step."""
        result, stamp = mission.result, to_stamp(mission.result.stamp_ns)
        messages = StepMessages(mission, self._frame, self._run_id)
        if result.step == 0:
            self._write("agents", String(data=agents_json(self._info(mission))))
        for name in ("probability", "belief", "step_report"):
            if name in self._channels and result.step not in self._skip:
                self._write(name, messages.make(name, stamp))
        if mission.done:
            self._write("mission_report", messages.make("mission_report", stamp))

    def _info(self, mission: Mission) -> AgentsInfo:
        scenario, rules = self._env.scenario, self._env.rules
        return AgentsInfo(
            agents=tuple(self._env.possible_agents),
            actions=rules.actions,
            rules=rules.profile,
            seed=mission.seed,
            frame=self._frame,
            timestep_limit=scenario.timestep_limit,
            step_duration_s=scenario.step_duration_s,
            mission=mission.number,
            run_id=self._run_id,
            definition=self._definition,
            area=area_rows(scenario.area_mask),
        )

    def close(self) -> None:
        """End the bag."""
        self._bag.close()
