# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The probability of success after a step, as std_msgs/Float64MultiArray, and back."""

from __future__ import annotations

import array
import math

from std_msgs.msg import Float64MultiArray


def pos_message(run_id: int, mission: int, step: int, pos: float) -> Float64MultiArray:
    """Return the message `[run_id, mission, step, pos]`; float64 holds each of them exactly.

    Args:
        run_id: Identity of the simulation.
        mission: Number of the mission.
        step: Steps done.
        pos: Cumulative probability of success of the searches, 0 to 1.
    """
    return Float64MultiArray(data=array.array("d", (run_id, mission, step, pos)))


def pos_from_message(message: Float64MultiArray) -> tuple[int, int, int, float]:
    """Return run_id, mission, step and probability of success: the inverse of `pos_message`.

    Raises:
        ValueError: If the message has another form.
    """
    values = message.data
    if len(values) != 4 or not all(map(math.isfinite, values)):
        raise ValueError(
            "data must be four finite numbers [run_id, mission, step, pos], "
            f"got {list(values)!r:.60}"
        )
    run_id, mission, step, pos = values
    return int(run_id), int(mission), int(step), float(pos)
