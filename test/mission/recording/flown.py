# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions as a recorder hears them, without DDS: what is commanded, and what comes of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from dsse_ros.mission.recording.bag import BagWriter, Recorded
from dsse_ros.mission.run.command_intake import CommandIntake
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_messages import Display, StepMessages
from dsse_ros.mission.run.step_reports import mission_report_of, step_report_of
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.agents import AgentsInfo, agents_json
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.frames import map_positions
from dsse_ros.world.scenario.geodesy import cell_fix
from dsse_ros.world.scenario.rules import Rules, profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_frame
from msg_adapters.commands import joint_action_message
from msg_adapters.images import probability_image
from msg_adapters.mission_report import mission_report_message
from msg_adapters.occupancy import occupancy_grid
from msg_adapters.particles import particles_message
from msg_adapters.pos import pos_message
from msg_adapters.poses import base_link, nav_sat_fix, path, pose_array, pose_stamped
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_message

MS = 1_000_000
START_NS = 1_700_000_000 * 10**9


class Flown:
    """A simulation in lockstep whose messages are all kept.

    With `everything`, it publishes what follows from the mission besides `step_report`.

    Attributes:
        messages: All messages in the order in which they were published, a millisecond apart.
    """

    def __init__(
        self, *, run_id: int = 7, namespace: str = "/", seed: int = 1, rules: str | Rules = "v2",
        start_ns: int = START_NS, belief: bool = False, everything: bool = False,
        reveal_person: bool = False, **fields: Any,
    ) -> None:  # fmt: skip
        scenario = {"grid_size": 8, "num_drones": 3, "probability_of_detection": 0.0} | fields
        env = SearchEnv(Scenario(**scenario), profile(rules) if isinstance(rules, str) else rules)
        self.mission = Mission(env, seed, belief=belief)
        self.everything, self.reveal_person = everything, reveal_person
        self.frame = scenario_frame(env.scenario)
        self.run_id, self.namespace = run_id, namespace
        self.messages_of_step = StepMessages(self.mission, self.frame, run_id)
        self.intake = CommandIntake(self.mission, self.frame, lambda *_: None, lambda _: None)
        self.messages: list[Recorded] = []
        self.time_ns = start_ns
        self._begin()

    def publish(self, topic: str, message: Any) -> Any:
        """Keep a message, and return it."""
        self.time_ns += MS
        name = topic if topic.startswith("/") else self.namespace + topic
        kind = f"{type(message).__module__.split('.')[0]}/msg/{type(message).__name__}"
        data = bytes(serialize_message(message))
        self.messages.append(Recorded(name, kind, self.time_ns, self.time_ns, data))
        return message

    def _begin(self) -> None:
        env, mission = self.mission.env, self.mission
        info = AgentsInfo(
            agents=tuple(env.possible_agents), actions=env.rules.actions,
            rules=env.rules.profile, seed=mission.seed, frame=self.frame,
            timestep_limit=int(env.scenario.timestep_limit or 0),
            step_duration_s=env.scenario.step_duration_s, mission=mission.number,
            run_id=self.run_id,
            definition=SearchDefinition(env.rules, env.mission_scenario),
        )  # fmt: skip
        self.publish("agents", String(data=agents_json(info)))
        self.report()

    def report(self) -> None:
        """Publish the last step, the report of it last, as `sim_node` does."""
        mission, frame = self.mission, self.frame
        cells, stamp = mission.result.cells, to_stamp(mission.result.stamp_ns)
        if self.everything:
            self._publish_maps(stamp)
            head, positions = header(frame.map_frame, stamp), map_positions(frame, cells)
            for i, cell in enumerate(cells.tolist()):
                self.publish(f"drone{i}/pose", pose_stamped(head, positions[i]))
                body = header(base_link(f"drone{i}"), stamp)
                fix = cell_fix(frame, i, *cell)
                self.publish(f"drone{i}/fix", nav_sat_fix(body, fix))
                if (
                    battery := self.messages_of_step.make("drone<i>/battery", stamp, i)
                ) is not None:
                    self.publish(f"drone{i}/battery", battery)
            self.publish("drones", pose_array(head, positions))
        report = step_report_of(mission, frame, self.run_id)
        self.publish("step_report", step_report_message(header(frame.map_frame, stamp), report))
        if self.everything:
            self._publish_history(stamp)
        if self.everything and mission.done:
            whole = mission_report_of(mission, frame, self.run_id)
            self.publish(
                "mission_report", mission_report_message(header(frame.map_frame, stamp), whole)
            )

    def _publish_history(self, stamp: Time) -> None:
        mission, frame = self.mission, self.frame
        for i, track in enumerate(mission.tracks):
            positions = map_positions(frame, track, i)
            self.publish(f"drone{i}/path", path(header(frame.map_frame, stamp), positions))
        display = Display(reveal_person=self.reveal_person)
        self.publish("markers", self.messages_of_step.make("markers", stamp, 0, display))

    def _publish_maps(self, stamp: Time) -> None:
        mission, frame = self.mission, self.frame
        if (particles := mission.particles()) is not None:
            self.publish("particles", particles_message(header(frame.map_frame, stamp), *particles))
        maps = {"probability": mission.env.probability}
        if mission.pos is not None and not mission.env.rules.covers:
            maps["belief"] = mission.belief()
        for name, values in maps.items():
            self.publish(name, probability_image(header(frame.map_frame, stamp), values))
            self.publish(
                f"{name}_grid",
                occupancy_grid(header(frame.map_frame, stamp), frame.cell_size_m, values, "log"),
            )
        if mission.pos is not None:
            pos = pos_message(self.run_id, mission.number, mission.result.step, mission.pos)
            self.publish("probability_of_success", pos)

    def reset(self, seed: int) -> None:
        """Start another mission."""
        self.mission.reset(seed)
        self._begin()

    def joint(self, *actions: int, step: int | None = None) -> None:
        """Command all drones at once."""
        mission = self.mission
        number = mission.result.step if step is None else step
        message = joint_action_message(mission.number, number, actions)
        self.intake.take_joint(self.publish("joint_action", message))

    def action(self, drone: int, name: str) -> None:
        """Command one drone by the name of an action."""
        message = self.publish(f"drone{drone}/cmd_action_name", String(data=name))
        self.intake.take(drone, "cmd_action_name", message)

    def step(self, missing: str = "search") -> None:
        """Do a step and publish it."""
        self.mission.advance(missing)
        self.report()

    def fly(
        self,
        steps: int,
        work: Sequence[Sequence[int]] = (),
        looks: Sequence[NDArray[np.void]] = (),
    ) -> None:
        """Do steps with a joint action each, of all actions in turn that stay on the grid.

        `work` is what the vehicles still have to do, step by step, `looks` from where they look.
        """
        for _ in range(steps):
            if self.mission.done:
                return
            step = self.mission.result.step
            allowed = [np.flatnonzero(mask) for mask in self.mission.env.action_masks()]
            self.joint(*[int(able[(step + i) % len(able)]) for i, able in enumerate(allowed)])
            if step < len(work):
                self.mission.set_work(np.array(work[step], np.int8))
                self.mission.set_viewpoints(looks[step])
            self.step()

    def find(self, topic: str, number: int = 0) -> int:
        """Return the index of a topic's message of this number."""
        found = [i for i, message in enumerate(self.messages) if message.topic.endswith(topic)]
        return found[number]


def with_byte(message: Recorded, place: int, value: int) -> Recorded:
    """Return a message with another byte in a place."""
    data = bytearray(message.data)
    assert data[place] != value
    data[place] = value
    return dataclasses.replace(message, data=bytes(data))


def write(path: Path, messages: Sequence[Recorded], *, per_chunk: int = 10**9) -> Path:
    """Write messages to a bag, a chunk for so many each."""
    bag = BagWriter(path)
    topics: dict[str, int] = {}
    for number, message in enumerate(messages, start=1):
        if message.topic not in topics:
            topics[message.topic] = bag.add_topic(
                message.topic, message.type_name, message.offered_qos
            )
        bag.write(
            topics[message.topic], message.data,
            log_time_ns=message.log_time_ns, publish_time_ns=message.publish_time_ns,
        )  # fmt: skip
        if number % per_chunk == 0:
            bag.flush()
    bag.close()
    return path
