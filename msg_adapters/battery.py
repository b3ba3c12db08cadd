# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The charge of a drone's battery as sensor_msgs/BatteryState."""

from __future__ import annotations

import math

from sensor_msgs.msg import BatteryState
from std_msgs.msg import Header

_UNMEASURED = ("voltage", "temperature", "current", "charge", "capacity", "design_capacity")


def battery_state(header: Header, percent: float, *, flying: bool) -> BatteryState:
    """Return the state of a battery of which only the share that is left is known.

    What is not measured is NaN, as the message has it.

    Args:
        header: Time of the state, and the body frame of the drone.
        percent: What is left; NaN if it is not known.
        flying: Whether it is being discharged.
    """
    state = BatteryState(
        header=header,
        percentage=percent / 100.0,
        power_supply_status=(
            BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
            if flying
            else BatteryState.POWER_SUPPLY_STATUS_NOT_CHARGING
        ),
        present=True,
    )
    for name in _UNMEASURED:
        setattr(state, name, math.nan)
    return state
