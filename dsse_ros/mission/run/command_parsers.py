# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands of drones and places of vehicles, `Accepted` or `Rejected`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from dsse_ros.base.fields import shown
from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.world.scenario.frames import GridFrame, map_to_cell

if TYPE_CHECKING:
    from msg_adapters.poses import FramedPose

Cell = tuple[int, int]

NO_ACTION = -1
"""In a joint action: the place of a drone that is not live."""


def parse_action_name(name: str, actions: Sequence[str]) -> Result[int]:
    """Return the action number of a `cmd_action_name`, which must be exactly one of the names.

    Args:
        name: The command.
        actions: Names of the rules' actions by number.

    Returns:
        The number, or `unknown_action`.
    """
    names = list(actions)
    if name not in names:
        reason = f"data must be one of {', '.join(names)}, got {shown(name)}"
        return Rejected("unknown_action", reason)
    return Accepted(names.index(name))


def parse_goal(pose: FramedPose, frame: GridFrame) -> Result[Cell]:
    """Return the cell (col, row) of a `command_pose`; see `parse_point`."""
    parsed = parse_point(pose, frame)
    if isinstance(parsed, Rejected):
        return parsed
    cell = map_to_cell(frame, *parsed.value)
    assert cell is not None
    return Accepted(cell)


def parse_point(pose: FramedPose, frame: GridFrame) -> Result[tuple[float, float]]:
    """Return x and y in metres of a goal in the map frame, which must be on the grid.

    Its altitude and heading are not used, but must be finite.

    Returns:
        x and y, or `foreign_frame`, `not_finite` or `outside_grid`.
    """
    if foreign := _foreign_frame(pose, frame):
        return foreign
    for part, axes in (("position", "xyz"), ("orientation", "xyzw")):
        for axis, value in zip(axes, getattr(pose, part), strict=True):
            if not math.isfinite(value):
                reason = f"pose.{part}.{axis} must be a finite number, got {value!r}"
                return Rejected("not_finite", reason)
    x, y, _ = pose.position
    if map_to_cell(frame, x, y) is None:
        width, height = (f"{side:.6g}" for side in frame.extent)
        allowed = (
            f"0 <= x, y < {width}" if width == height else f"0 <= x < {width}, 0 <= y < {height}"
        )
        reason = f"pose.position must be {allowed} m, got ({x:.6g}, {y:.6g})"
        return Rejected("outside_grid", reason)
    return Accepted((x, y))


def refuse_behavior_tree(behavior_tree: str) -> Rejected | None:
    """Return why a goal of `navigate_to_pose` with this behavior tree is refused, if it is."""
    if not behavior_tree:
        return None
    return Rejected("behavior_tree", f"behavior_tree must be empty, got {shown(behavior_tree)}")


def parse_place(pose: FramedPose, frame: GridFrame) -> Result[tuple[float, float]]:
    """Return x and y in metres of a vehicle in the map frame, on the grid or not.

    Returns:
        x and y, or `foreign_frame` or `not_finite`.
    """
    if foreign := _foreign_frame(pose, frame):
        return foreign
    x_m, y_m, _ = pose.position
    if not (math.isfinite(x_m) and math.isfinite(y_m)):
        return Rejected("not_finite", f"pose.position must be finite, got ({x_m!r}, {y_m!r})")
    return Accepted((x_m, y_m))


def _foreign_frame(pose: FramedPose, frame: GridFrame) -> Rejected | None:
    if pose.frame_id == frame.map_frame:
        return None
    reason = f"header.frame_id must be {frame.map_frame!r}, got {shown(pose.frame_id)}"
    return Rejected("foreign_frame", reason)


def parse_joint_action(
    data: Sequence[int], mission: int, step: int, actions: Sequence[str], live: Sequence[bool]
) -> Result[tuple[int, ...]]:
    """Return the actions of a `joint_action`, for all drones or for none.

    Args:
        data: The command, [mission, step, a0, a1, ...].
        mission: Number of the mission.
        step: Number of the step that the actions must be for: that of the last report.
        actions: Names of the rules' actions by number.
        live: For each of the N drones whether it takes part; the others' entries are ignored.

    Returns:
        N action numbers, `NO_ACTION` where a drone is not live, or `wrong_size`, `stale_mission`,
        `stale_step` or `unknown_action`.
    """
    if len(data) != 2 + len(live):
        reason = f"data must be mission, step and {len(live)} actions, got {len(data)} numbers"
        return Rejected("wrong_size", reason)
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
            reason = f"drone{index - 2}: data[{index}] must be one of {known}, got {action}"
            return Rejected("unknown_action", reason)
    return Accepted(tuple(chosen))
