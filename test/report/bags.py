# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `sim_node` publishes of a mission, written to a bag without DDS."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from dsse_ros.mission.mission import Mission
from dsse_ros.mission.step_reports import mission_report_of, step_report_of
from dsse_ros.recording.bag import BagWriter
from dsse_ros.scenario.agents import AgentsInfo, SearchDefinition, agents_json, area_rows
from dsse_ros.scenario.frames import scenario_frame
from dsse_ros.search import SearchEnv
from msg_adapters.images import probability_image
from msg_adapters.mission_report import mission_report_message
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_message

TYPES = {
    "agents": "std_msgs/msg/String",
    "belief": "sensor_msgs/msg/Image",
    "mission_report": "sensor_msgs/msg/PointCloud2",
    "probability": "sensor_msgs/msg/Image",
    "step_report": "sensor_msgs/msg/PointCloud2",
}


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
        topics: Collection[str] = tuple(TYPES),
        namespace: str = "",
        definition: bool = True,
        skip: Collection[int] = (),
        run_id: int = 7,
    ) -> None:
        self._bag = BagWriter(path)
        self._channels = {
            name: self._bag.add_topic(f"{namespace}/{name}", TYPES[name]) for name in topics
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
        result, frame, env = mission.result, self._frame, self._env
        stamp = to_stamp(result.stamp_ns)
        if result.step == 0:
            self._write("agents", String(data=agents_json(self._info(mission))))
        if result.step not in self._skip:
            self._write(
                "probability", probability_image(header(frame.map_frame, stamp), env.probability)
            )
            if "belief" in self._channels:
                self._write(
                    "belief", probability_image(header(frame.map_frame, stamp), mission.belief())
                )
            report = step_report_of(mission, frame, self._run_id)
            self._write("step_report", step_report_message(header(frame.map_frame, stamp), report))
        if mission.done:
            whole = mission_report_of(mission, frame, self._run_id)
            self._write(
                "mission_report", mission_report_message(header(frame.map_frame, stamp), whole)
            )

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
