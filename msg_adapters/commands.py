# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages that command drones, parsed into `Accepted` or `Rejected`, and made for planners."""

from __future__ import annotations

import array
import math
from collections.abc import Sequence

from geometry_msgs.msg import Pose, PoseStamped
from nav_msgs.msg import Path
from std_msgs.msg import Int8, Int32MultiArray, String

from msg_adapters.frames import GridFrame, map_to_cell
from msg_adapters.result import Accepted, Rejected, Result, shown

Cell = tuple[int, int]

MAX_GOALS = 10_000
"""Longest `command_path` that is accepted."""

NO_ACTION = -1
"""In a joint action: the place of a drone that is not live."""


def parse_action(message: Int8, actions: Sequence[str]) -> Result[int]:
    """Return the action number of a `cmd_action`.

    Args:
        message: The command.
        actions: Names of the rules' actions: the action with number i is actions[i].

    Returns:
        The number, or `unknown_action`.
    """
    if not 0 <= message.data < len(actions):
        return _unknown_action("data", message.data, actions)
    return Accepted(int(message.data))


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
            "unknown_action",
            f"data: {shown(message.data)} is not allowed; one of {', '.join(names)}",
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
        return _foreign_frame("header.frame_id", message.header.frame_id, frame)
    return _goal_cell("pose", message.pose, frame)


def parse_path(message: Path, frame: GridFrame) -> Result[tuple[Cell, ...]]:
    """Return the cells (col, row) of a `command_path` in their order.

    Args:
        message: The goals; the frame of a single pose may be left empty.
        frame: The grid.

    Returns:
        1 to `MAX_GOALS` cells, or `foreign_frame`, `empty_path`, `path_too_long`, `not_finite`
        or `outside_grid`.
    """
    if message.header.frame_id != frame.map_frame:
        return _foreign_frame("header.frame_id", message.header.frame_id, frame)
    count = len(message.poses)
    if count == 0:
        return Rejected("empty_path", f"poses: 0 poses are not allowed; 1 to {MAX_GOALS}")
    if count > MAX_GOALS:
        return Rejected("path_too_long", f"poses: {count} poses are not allowed; 1 to {MAX_GOALS}")
    cells = []
    for index, stamped in enumerate(message.poses):
        if stamped.header.frame_id not in ("", frame.map_frame):
            field = f"poses[{index}].header.frame_id"
            return _foreign_frame(field, stamped.header.frame_id, frame)
        goal = _goal_cell(f"poses[{index}].pose", stamped.pose, frame)
        if isinstance(goal, Rejected):
            return goal
        cells.append(goal.value)
    return Accepted(tuple(cells))


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
        message: Its data are [mission, step, a0, a1, ...] or [step, a0, a1, ...]: their
            length decides.
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
    head = len(data) - num_drones
    if head not in (1, 2):
        return Rejected(
            "wrong_size",
            f"data: {len(data)} numbers are not allowed; {1 + num_drones} or {2 + num_drones}: "
            f"the mission, which may be left out, the step and {num_drones} actions",
        )
    if head == 2 and data[0] != mission:
        return Rejected("stale_mission", f"data[0]: mission {data[0]} is not allowed; {mission} is")
    if data[head - 1] != step:
        return Rejected(
            "stale_step", f"data[{head - 1}]: step {data[head - 1]} is not allowed; {step} is"
        )
    chosen = []
    for index, (action, takes_part) in enumerate(zip(data[head:], live, strict=True), start=head):
        if not takes_part:
            chosen.append(NO_ACTION)
        elif 0 <= action < len(actions):
            chosen.append(int(action))
        else:
            return _unknown_action(f"data[{index}]", action, actions)
    return Accepted(tuple(chosen))


def joint_action_message(
    step: int, actions: Sequence[int], mission: int | None = None
) -> Int32MultiArray:
    """Return a `joint_action`: [mission, step, a0, a1, ...], or [step, a0, a1, ...].

    Args:
        step: Number of the step that the actions are for.
        actions: N action numbers in the order of the agents; any for a drone that is not live.
        mission: Number of the mission; without it the actions fit that step of any mission.
    """
    head = [step] if mission is None else [mission, step]
    return Int32MultiArray(data=array.array("i", [int(number) for number in (*head, *actions)]))


def _goal_cell(field: str, pose: Pose, frame: GridFrame) -> Result[Cell]:
    for part in ("position", "orientation"):
        vector = getattr(pose, part)
        for axis in "xyz" if part == "position" else "xyzw":
            value = getattr(vector, axis)
            if not math.isfinite(value):
                return Rejected(
                    "not_finite",
                    f"{field}.{part}.{axis}: {value!r} is not allowed; a finite number",
                )
    cell = map_to_cell(frame, pose.position.x, pose.position.y)
    if cell is None:
        side_m = frame.grid_size * frame.cell_size_m
        return Rejected(
            "outside_grid",
            f"{field}.position: ({pose.position.x:.6g}, {pose.position.y:.6g}) is not allowed; "
            f"0 <= x, y < {side_m:.6g} m",
        )
    return Accepted(cell)


def _foreign_frame(field: str, frame_id: str, frame: GridFrame) -> Rejected:
    return Rejected(
        "foreign_frame", f"{field}: {shown(frame_id)} is not allowed; {frame.map_frame!r} is"
    )


def _unknown_action(field: str, action: int, actions: Sequence[str]) -> Rejected:
    known = ", ".join(f"{number} {name}" for number, name in enumerate(actions))
    return Rejected("unknown_action", f"{field}: action {action} is not allowed; {known}")
