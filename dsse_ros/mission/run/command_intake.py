# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Intake of commands from messages into a mission, on cells or in metres, without ROS."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dsse_ros.base.fields import FieldError
from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.mission.run.command_parsers import (
    parse_action_name,
    parse_goal,
    parse_joint_action,
    refuse_behavior_tree,
)
from dsse_ros.mission.run.metres_parsers import (
    Velocity,
    action_of,
    parse_joint_command,
    parse_track,
    parse_velocity,
    parse_wind,
)
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.mission_space import MetresMissionSpace
from dsse_ros.world.scenario.frames import GridFrame
from msg_adapters.poses import base_link, pose_from_message, poses_from_message
from msg_adapters.velocities import twist_from_message
from msg_adapters.winds import wind_from_message

COMMAND_POSE = "command_pose"
"""Topic of each drone."""
NAVIGATE_TO_POSE = "navigate_to_pose"
"""Name of the action of each drone."""
WIND = "vehicle_wind"
"""Topic of the wind in which vehicles in metres fly."""


class DroneCommand(NamedTuple):
    """A command of one drone.

    Attributes:
        parse: Returns the value of a message, from (drone, message).
        give: Gives the value to the mission, from (drone, value); returns why it cannot.
    """

    parse: Callable[[int, Any], Result[Any]]
    give: Callable[[int, Any], Rejected | None]


class Commands(NamedTuple):
    """The commands of a mission, on cells or in metres.

    Attributes:
        joint: The topic that commands all drones.
        parse_joint: Returns the actions in its data, for the mission, the step and the drones in
            flight.
        of_drones: By topic of each drone.
    """

    joint: str
    parse_joint: Callable[[Any, int, int, Sequence[bool]], Result[Any]]
    of_drones: Mapping[str, DroneCommand]


def _on_cells(mission: Mission, frame: GridFrame) -> Commands:
    """Return the commands of drones that move from cell to cell."""
    actions = mission.env.rules.actions
    return Commands(
        joint="joint_action",
        parse_joint=lambda data, number, step, live: parse_joint_action(
            data, number, step, actions, live
        ),
        of_drones={
            "cmd_action_name": DroneCommand(
                lambda _, message: parse_action_name(message.data, actions),
                mission.commands.set_action,
            ),
            COMMAND_POSE: DroneCommand(
                lambda _, message: parse_goal(pose_from_message(message), frame), mission.send
            ),
        },
    )


def _in_metres(mission: Mission, frame: GridFrame, airframes: np.recarray[Any, Any]) -> Commands:
    """Return the commands of drones that fly in metres."""
    bodies = [base_link(name, frame.frame_prefix) for name in mission.env.possible_agents]
    step_s = mission.env.scenario.step_duration_s

    def fly(drone: int, velocity: Velocity) -> None:
        mission.commands.set_action(drone, action_of(velocity, airframes[drone], step_s))

    return Commands(
        joint="joint_command",
        parse_joint=parse_joint_command,
        of_drones={
            "cmd_vel": DroneCommand(
                lambda drone, message: parse_velocity(twist_from_message(message), bodies[drone]),
                fly,
            ),
            COMMAND_POSE: DroneCommand(
                lambda _, message: parse_track([pose_from_message(message)], frame), mission.send
            ),
            "command_path": DroneCommand(
                lambda _, message: parse_track(poses_from_message(message), frame), mission.send
            ),
        },
    )


class CommandIntake:
    """Passes commands from messages to a mission; counts and logs the refused ones.

    Each method that takes a message returns whether there is a new command.

    Args:
        mission: The mission to command.
        frame: Frame of the grid.
        warn: Logs a line of a kind.
        debug: Logs a line, built only if debug logging is on.

    Attributes:
        rejected: Number of refused messages, by code.
        duplicates: Number of repeated joint commands.
        joint: The topic that commands all drones.
    """

    def __init__(
        self,
        mission: Mission,
        frame: GridFrame,
        warn: Callable[[str, str], None],
        debug: Callable[[Callable[[], str]], None],
    ) -> None:
        self._mission = mission
        self._frame = frame
        self._warn = warn
        self._debug = debug
        self.rejected: Counter[str] = Counter()
        self.duplicates = 0
        self._last_joint: Any = None
        self._refused_after: int | None = None
        space = mission.space
        self._commands = (
            _in_metres(mission, frame, space.airframes)
            if isinstance(space, MetresMissionSpace)
            else _on_cells(mission, frame)
        )
        self.joint = self._commands.joint

    def topics(self) -> dict[str, Callable[[Any], bool]]:
        """Return the method that takes the messages of each topic."""
        found: dict[str, Callable[[Any], bool]] = {self.joint: self.take_joint}
        for i, name in enumerate(self._mission.env.possible_agents):
            for topic in self._commands.of_drones:
                found[f"{name}/{topic}"] = partial(self.take, i, topic)
        return found

    def take(self, drone: int, topic: str, message: Any, name: str = "") -> bool:
        """Take the message of a topic of a drone; name is the action that it comes from."""
        command, topic = self._commands.of_drones[topic], f"drone{drone}/{name or topic}"
        value = self._accept(topic, drone, command.parse(drone, message))
        if value is None:
            return False
        if refused := command.give(drone, value):
            self.reject(topic, refused)
        return refused is None

    def navigation(self, drone: int, goal: Any) -> bool:
        """Take the goal of nav2_msgs/action/NavigateToPose."""
        if refused := refuse_behavior_tree(goal.behavior_tree):
            self.reject(f"drone{drone}/{NAVIGATE_TO_POSE}", refused)
            return False
        return self.take(drone, COMMAND_POSE, goal.pose, NAVIGATE_TO_POSE)

    def take_joint(self, message: Any) -> bool:
        """Take the actions of all drones for a step, of the topic `joint`."""
        mission, data = self._mission, message.data
        live = mission.env.world.drones["alive"][0].tolist()
        parsed = self._commands.parse_joint(data, mission.number, mission.result.step, live)
        again = data == self._last_joint
        if mission.begun and not isinstance(parsed, Rejected):
            parsed = Rejected("step_begun", f"step {mission.result.step + 1} has begun already")
        if again and (isinstance(parsed, Rejected) or mission.refuse()):
            # The sender repeated this message before it saw that its step was done.
            self.duplicates += 1
            return False
        actions = self._accept(self.joint, None, parsed)
        if actions is None:
            return False
        self.duplicates += again
        self._last_joint = data
        mission.command_all(actions)
        return True

    def wind(self, message: Any) -> bool:
        """Take geometry_msgs/Vector3Stamped, the wind that vehicles in metres report."""
        wind_mps = self._accept(WIND, None, parse_wind(wind_from_message(message), self._frame))
        if wind_mps is None:
            return False
        try:
            self._mission.report_wind(wind_mps)
        except FieldError as error:
            self.reject(WIND, Rejected("too_strong", str(error)))
            return False
        return True

    def reject(self, topic: str, rejected: Rejected) -> None:
        """Count and log a refused message."""
        self.rejected[rejected.code] += 1
        if rejected.code != "mission_over" or self._refused_after != self._mission.number:
            self._warn(rejected.code, f"{topic}: {rejected.reason}")
        if rejected.code == "mission_over":
            # A mission stays over, so one warning per mission is enough.
            self._refused_after = self._mission.number

    def _accept(self, topic: str, drone: int | None, parsed: Result[Any]) -> Any:
        """Return the value of a message, None if it or its drone's command is refused."""
        refused = parsed if isinstance(parsed, Rejected) else self._mission.refuse(drone)
        if refused is not None:
            self.reject(topic, refused)
            return None
        assert isinstance(parsed, Accepted)
        self._debug(lambda: f"{topic}: {parsed.value}")
        return parsed.value
