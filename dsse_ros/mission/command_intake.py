# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Intake of commands from messages into a mission, without ROS."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

from dsse_ros.mission.command_parsers import (
    parse_action_name,
    parse_goal,
    parse_joint_action,
    refuse_behavior_tree,
)
from dsse_ros.mission.mission import Mission
from dsse_ros.result import Rejected
from dsse_ros.scenario.frames import GridFrame
from msg_adapters.poses import pose_from_message

JOINT_ACTION = "joint_action"
"""Topic that commands all drones."""
COMMAND_POSE = "command_pose"
"""Topic of each drone."""
NAVIGATE_TO_POSE = "navigate_to_pose"
"""Name of the action of each drone."""


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
        duplicates: Number of repeated joint actions.
        joint: The topic that commands all drones.
    """

    joint = JOINT_ACTION

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
        self._last_joint_action: Any = None
        self._refused_after: int | None = None

    def topics(self) -> dict[str, Callable[[Any], bool]]:
        """Return what takes the messages of each topic."""
        found: dict[str, Callable[[Any], bool]] = {JOINT_ACTION: self.joint_action}
        for i, name in enumerate(self._mission.env.possible_agents):
            found[f"{name}/cmd_action_name"] = partial(self.action_name, i)
            found[f"{name}/{COMMAND_POSE}"] = partial(self.goal, i)
        return found

    def action_name(self, drone: int, message: Any) -> bool:
        """Take std_msgs/String, the name of an action."""
        parsed = parse_action_name(message.data, self._mission.env.rules.actions)
        action = self._take(f"drone{drone}/cmd_action_name", drone, parsed)
        if action is not None:
            self._mission.commands.set_action(drone, action)
        return action is not None

    def goal(self, drone: int, message: Any, name: str = COMMAND_POSE) -> bool:
        """Take geometry_msgs/PoseStamped, a goal, from a topic or an action of this name."""
        topic = f"drone{drone}/{name}"
        cell = self._take(topic, drone, parse_goal(pose_from_message(message), self._frame))
        if cell is None:
            return False
        if refused := self._mission.refuse_goal(drone, cell):
            self.reject(topic, refused)
            return False
        self._mission.commands.set_goal(drone, cell)
        return True

    def navigation(self, drone: int, goal: Any) -> bool:
        """Take the goal of nav2_msgs/action/NavigateToPose."""
        if refused := refuse_behavior_tree(goal.behavior_tree):
            self.reject(f"drone{drone}/{NAVIGATE_TO_POSE}", refused)
            return False
        return self.goal(drone, goal.pose, NAVIGATE_TO_POSE)

    def joint_action(self, message: Any) -> bool:
        """Take std_msgs/Int32MultiArray, the actions of all drones for a step."""
        mission = self._mission
        live = mission.env.world.drones["alive"][0].tolist()
        parsed = parse_joint_action(
            message.data, mission.number, mission.result.step, mission.env.rules.actions, live
        )
        return self._take_joint(JOINT_ACTION, message.data, parsed)

    def _take_joint(self, topic: str, data: Any, parsed: Any) -> bool:
        """Take the actions of all drones for a step."""
        mission, again = self._mission, data == self._last_joint_action
        if mission.begun and not isinstance(parsed, Rejected):
            parsed = Rejected("step_begun", f"step {mission.result.step + 1} has begun already")
        if again and (isinstance(parsed, Rejected) or mission.refuse()):
            # The sender repeated this message before it saw that its step was done.
            self.duplicates += 1
            return False
        actions = self._take(topic, None, parsed)
        if actions is None:
            return False
        self.duplicates += again
        self._last_joint_action = data
        mission.command_all(actions)
        return True

    def reject(self, topic: str, rejected: Rejected) -> None:
        """Count and log a refused message."""
        self.rejected[rejected.code] += 1
        if rejected.code != "mission_over" or self._refused_after != self._mission.number:
            self._warn(rejected.code, f"{topic}: {rejected.reason}")
        if rejected.code == "mission_over":
            # A mission stays over, so one warning per mission is enough.
            self._refused_after = self._mission.number

    def _take(self, topic: str, drone: int | None, parsed: Any) -> Any:
        """Return the value of an accepted command, None for any other."""
        refused = parsed if isinstance(parsed, Rejected) else self._mission.refuse(drone)
        if refused is not None:
            self.reject(topic, refused)
            return None
        self._debug(lambda: f"{topic}: {parsed.value}")
        return parsed.value
