# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command of all drones as std_msgs/Int32MultiArray or, in metres, Float64MultiArray."""

from __future__ import annotations

import array
from collections.abc import Sequence

from std_msgs.msg import Float64MultiArray, Int32MultiArray


def joint_action_message(mission: int, step: int, actions: Sequence[int]) -> Int32MultiArray:
    """Return a `joint_action`: [mission, step, a0, a1, ...].

    Args:
        mission: Number of the mission.
        step: Number of the step that the actions are for.
        actions: N action numbers in the order of the agents; any for a drone that is not live.
    """
    numbers = [int(number) for number in (mission, step, *actions)]
    return Int32MultiArray(data=array.array("i", numbers))


def joint_command_message(
    mission: int, step: int, actions: Sequence[Sequence[float]]
) -> Float64MultiArray:
    """Return a `joint_command`: [mission, step, turn0, speed0, turn1, ...].

    Args:
        mission: Number of the mission.
        step: Number of the step that the actions are for.
        actions: N turns and speeds in the order of the agents; any for a drone that is not live.
    """
    numbers = [
        float(mission),
        float(step),
        *(float(number) for action in actions for number in action),
    ]
    return Float64MultiArray(data=array.array("d", numbers))
