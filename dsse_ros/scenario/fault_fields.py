# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The faults of a scenario as data: their fields, and one table of what each of them is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from dsse_ros.scenario.battery_fields import BatteryFields
from dsse_ros.scenario.fields import FieldError, field

MAX_DELAY = 32
"""Steps of the longest delay of commands."""


@dataclass(frozen=True, kw_only=True)
class FaultFields(BatteryFields):
    """What can go wrong; by default nothing does."""

    loss_rate: float = field(
        "float", "Probability that a step loses a drone in the air.", 0.0, low=0, high=1
    )
    loss_steps: tuple[int, ...] = field(
        "ints", "Step that loses each drone, or one for all drones; 0 for never.", (0,),
        low=0, high=10**9, unit="steps",
    )  # fmt: skip
    stuck_rate: float = field(
        "float", "Probability that a step finds a drone stuck: it hovers and does nothing.", 0.0,
        low=0, high=1,
    )  # fmt: skip
    stuck_steps: int = field(
        "int", "How long a drone is stuck.", 5, low=1, high=10**6, unit="steps"
    )
    command_drop_rate: float = field(
        "float", "Probability that a command does not arrive: the drone hovers.", 0.0,
        low=0, high=1,
    )  # fmt: skip
    command_delay: int = field(
        "int", "How long a command is under way: a drone does what it was commanded so long ago.",
        0, low=0, high=MAX_DELAY, unit="steps",
    )  # fmt: skip
    false_alarm_rate: float = field(
        "float", "Probability that a search that finds nobody reports somebody.", 0.0,
        low=0, high=1,
    )  # fmt: skip
    false_alarm_steps: int = field(
        "int", "How long a drone hovers to see that its alarm was false.", 2,
        low=1, high=10**6, unit="steps",
    )  # fmt: skip
    position_noise: float = field(
        "float",
        "Standard deviation, along each axis, of the positions that drones observe; where they "
        "are and what they search stays true.",
        0.0,
        low=0,
        high=1e4,
        unit="cells",
    )
    wind_speed: float = field(
        "float", "Speed of the wind, below that of the drones: their airspeed is drone_speed.", 0.0,
        low=0, high=1000, unit="m/s",
    )  # fmt: skip
    wind_toward: float = field(
        "float", "Direction the wind blows to, clockwise from north.", 0.0,
        low=-360, high=360, unit="deg",
    )  # fmt: skip

    def resolved_faults(self, num_drones: int, drone_speed: float) -> dict[str, Any]:
        """Return the fields with nothing left to derive.

        Args:
            num_drones: N.
            drone_speed: Of the slowest drone, in m/s.

        Raises:
            FieldError: If they contradict each other or the drones.
        """
        if len(self.loss_steps) not in (1, num_drones):
            raise FieldError(
                f"loss_steps: {len(self.loss_steps)} steps are not allowed; "
                f"one for all drones or one per drone ({num_drones})"
            )
        if self.wind_speed >= drone_speed:
            raise FieldError(
                f"wind_speed: {self.wind_speed:g} is not allowed; below the drones' "
                f"{drone_speed:g} m/s, or they would not hold their cells"
            )
        return self.resolved_battery()


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes:
        doc: What it does, one sentence.
        switches: Fields of which each brings the fault about, where it is not 0.
        options: Fields that say how.
        holds_up: Whether a drone may stay in a cell that it was commanded to leave.
    """

    doc: str
    switches: tuple[str, ...]
    options: tuple[str, ...] = ()
    holds_up: bool = False


FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "battery": Fault(
            "Each step takes energy; a drone that could not come home later goes home now.",
            ("battery_move",),
            (
                "battery_search", "battery_hover", "battery_return", "battery_reserve",
                "relief_steps",
            ),
        ),
        "loss": Fault("A drone drops out for good.", ("loss_rate", "loss_steps")),
        "false_alarms": Fault(
            "A search seems to find somebody; the drone hovers until it knows better.",
            ("false_alarm_rate",),
            ("false_alarm_steps",),
            holds_up=True,
        ),
        "dropped_commands": Fault(
            "A command does not arrive; the drone hovers.", ("command_drop_rate",), holds_up=True
        ),
        "delayed_commands": Fault("Commands arrive late.", ("command_delay",), holds_up=True),
        "stuck": Fault(
            "A drone hovers where it is, whatever its command.", ("stuck_rate",), ("stuck_steps",),
            holds_up=True,
        ),
        "position_noise": Fault("Drones observe wrong positions.", ("position_noise",)),
        "wind": Fault(
            "Moves against or across the wind take more steps.", ("wind_speed",), ("wind_toward",),
            holds_up=True,
        ),
    }
)  # fmt: skip
"""Every fault by name. Missed detections are `probability_of_detection`, as planners know it."""


def faults_of(scenario: FaultFields) -> list[str]:
    """Return the names of the faults that a scenario has."""
    return [
        name
        for name, fault in FAULTS.items()
        if any(np.any(getattr(scenario, switch)) for switch in fault.switches)
    ]


def hold_up(scenario: FaultFields) -> bool:
    """Return whether faults may keep a drone in a cell that it was commanded to leave."""
    return any(FAULTS[name].holds_up for name in faults_of(scenario))
