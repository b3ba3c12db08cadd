# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Intake of commands from messages into a mission in metres, without ROS."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from dsse_ros.mission.command_intake import COMMAND_POSE, CommandIntake
from dsse_ros.mission.flight_commands import (
    action_of,
    parse_joint_command,
    parse_track,
    parse_velocity,
)
from dsse_ros.mission.flight_mission import FlightMission
from dsse_ros.mission.mission import Mission
from dsse_ros.scenario.frames import GridFrame
from msg_adapters.poses import FramedPose, base_link, pose_from_message, poses_from_message
from msg_adapters.velocities import twist_from_message

JOINT_COMMAND = "joint_command"
"""Topic that commands all drones in metres."""


class FlightIntake(CommandIntake):
    """A `CommandIntake` of commands in metres.

    Args:
        mission: The mission to command.
        frame: Frame of the grid.
        warn: Logs a line of a kind.
        debug: Logs a line, built only if debug logging is on.
    """

    joint = JOINT_COMMAND

    def __init__(
        self,
        mission: FlightMission,
        frame: GridFrame,
        warn: Callable[[str, str], None],
        debug: Callable[[Callable[[], str]], None],
    ) -> None:
        super().__init__(mission, frame, warn, debug)
        self._flights = mission

    def topics(self) -> dict[str, Callable[[Any], bool]]:
        """See `CommandIntake`."""
        found: dict[str, Callable[[Any], bool]] = {JOINT_COMMAND: self.joint_command}
        for i, name in enumerate(self._flights.env.possible_agents):
            found[f"{name}/cmd_vel"] = partial(self.velocity, i)
            found[f"{name}/{COMMAND_POSE}"] = partial(self.goal, i)
            found[f"{name}/command_path"] = partial(self.track, i)
        return found

    def joint_command(self, message: Any) -> bool:
        """Take std_msgs/Float64MultiArray, the turns and speeds of all drones for a step."""
        mission = self._flights
        live = mission.env.world.drones["alive"][0].tolist()
        parsed = parse_joint_command(message.data, mission.number, mission.result.step, live)
        return self._take_joint(JOINT_COMMAND, message.data, parsed)

    def goal(self, drone: int, message: Any, name: str = COMMAND_POSE) -> bool:
        """Take geometry_msgs/PoseStamped, where to fly straight; see `CommandIntake`."""
        return self._set_track(drone, name, [pose_from_message(message)])

    def track(self, drone: int, message: Any) -> bool:
        """Take nav_msgs/Path, a track to fly."""
        return self._set_track(drone, "command_path", poses_from_message(message))

    def _set_track(self, drone: int, topic: str, poses: list[FramedPose]) -> bool:
        parsed = parse_track(poses, self._frame)
        points = self._take(f"drone{drone}/{topic}", drone, parsed)
        if points is None:
            return False
        self._flights.commands.set_track(drone, points)
        return True

    def velocity(self, drone: int, message: Any) -> bool:
        """Take geometry_msgs/TwistStamped, a velocity that is held for the next step."""
        mission = self._flights
        name = base_link(mission.env.possible_agents[drone], self._frame.frame_prefix)
        parsed = parse_velocity(twist_from_message(message), name)
        velocity = self._take(f"drone{drone}/cmd_vel", drone, parsed)
        if velocity is None:
            return False
        flyer = mission.commands.flyers[drone]
        step_s = mission.env.scenario.step_duration_s
        mission.commands.set_action(drone, action_of(velocity, flyer, step_s))
        return True


def intake_of(
    mission: Mission,
    frame: GridFrame,
    warn: Callable[[str, str], None],
    debug: Callable[[Callable[[], str]], None],
) -> CommandIntake:
    """Return the intake of a mission, in metres a `FlightIntake`; see there."""
    if isinstance(mission, FlightMission):
        return FlightIntake(mission, frame, warn, debug)
    return CommandIntake(mission, frame, warn, debug)
