# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages that command drones, parsed into `Accepted` or `Rejected`, and made for planners."""

from __future__ import annotations

import array
import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Int32MultiArray, String

from dsse_ros.result import Accepted, Rejected, Result, shown
from dsse_ros.scenario.frames import GridFrame, map_to_cell

Cell = tuple[int, int]

NO_ACTION = -1
"""In a joint action: the place of a drone that is not live."""


def parse_action_name(message: String, actions: Sequence[str]) -> Result[int]:
    """Return the action number of a `cmd_action_name`, which must be exactly one of the names.

    Args:
        message: The command.
        actions: Names of the rules' actions by number.

    Returns:
        The number, or `unknown_action`.
    """
    names = list(actions)
    if message.data not in names:
        return Rejected(
            "unknown_action", f"data must be one of {', '.join(names)}, got {shown(message.data)}"
        )
    return Accepted(names.index(message.data))


def parse_goal(message: PoseStamped, frame: GridFrame) -> Result[Cell]:
    """Return the cell (col, row) of a `command_pose`.

    Args:
        message: The goal; its altitude and heading are not used, but must be finite.
        frame: The grid.

    Returns:
        The cell, or `foreign_frame`, `not_finite` or `outside_grid`.
    """
    if message.header.frame_id != frame.map_frame:
        found = shown(message.header.frame_id)
        reason = f"header.frame_id must be {frame.map_frame!r}, got {found}"
        return Rejected("foreign_frame", reason)
    for part, axes in (("position", "xyz"), ("orientation", "xyzw")):
        for axis in axes:
            value = getattr(getattr(message.pose, part), axis)
            if not math.isfinite(value):
                reason = f"pose.{part}.{axis} must be a finite number, got {value!r}"
                return Rejected("not_finite", reason)
    x, y = message.pose.position.x, message.pose.position.y
    cell = map_to_cell(frame, x, y)
    if cell is None:
        reason = f"pose.position must be 0 <= x, y < {frame.side_m:.6g} m, got ({x:.6g}, {y:.6g})"
        return Rejected("outside_grid", reason)
    return Accepted(cell)


def parse_navigation(goal: Any, frame: GridFrame) -> Result[Cell]:
    """Return the cell (col, row) of a goal of `navigate_to_pose`.

    Args:
        goal: nav2_msgs/action/NavigateToPose.Goal; its `pose` is as that of `parse_goal`.
        frame: The grid.

    Returns:
        The cell, or `behavior_tree`, `foreign_frame`, `not_finite` or `outside_grid`.
    """
    if goal.behavior_tree:
        reason = f"behavior_tree must be empty, got {shown(goal.behavior_tree)}"
        return Rejected("behavior_tree", reason)
    return parse_goal(goal.pose, frame)


def parse_joint_action(
    message: Int32MultiArray,
    mission: int,
    step: int,
    num_drones: int,
    actions: Sequence[str],
    live: Sequence[bool],
) -> Result[tuple[int, ...]]:
    """Return the actions of a `joint_action`, for all drones or for none.

    Args:
        message: Its data are [mission, step, a0, a1, ...].
        mission: Number of the mission.
        step: Number of the step that the actions must be for: that of the last report.
        num_drones: Number of drones, N.
        actions: Names of the rules' actions by number.
        live: For each drone whether it takes part; the others' entries are ignored.

    Returns:
        N action numbers, `NO_ACTION` where a drone is not live, or `wrong_size`, `stale_mission`,
        `stale_step` or `unknown_action`.
    """
    data = message.data
    if len(data) != 2 + num_drones:
        return Rejected(
            "wrong_size",
            f"data must be mission, step and {num_drones} actions, got {len(data)} numbers",
        )
    if data[0] != mission:
        return Rejected("stale_mission", f"data[0] must be mission {mission}, got {data[0]}")
    if data[1] != step:
        return Rejected("stale_step", f"data[1] must be step {step}, got {data[1]}")
    chosen = []
    for index, (action, takes_part) in enumerate(zip(data[2:], live, strict=True), start=2):
        if not takes_part:
            chosen.append(NO_ACTION)
        elif 0 <= action < len(actions):
            chosen.append(int(action))
        else:
            known = ", ".join(f"{number} {name}" for number, name in enumerate(actions))
            reason = f"data[{index}] must be one of {known}, got {action}"
            return Rejected("unknown_action", reason)
    return Accepted(tuple(chosen))


def joint_action_message(mission: int, step: int, actions: Sequence[int]) -> Int32MultiArray:
    """Return a `joint_action`: [mission, step, a0, a1, ...].

    Args:
        mission: Number of the mission.
        step: Number of the step that the actions are for.
        actions: N action numbers in the order of the agents; any for a drone that is not live.
    """
    numbers = [int(number) for number in (mission, step, *actions)]
    return Int32MultiArray(data=array.array("i", numbers))
