# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The faults of a scenario as data: their fields, and one table of all faults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from dsse_ros.base.fields import FieldError, field
from dsse_ros.world.scenario.battery_fields import BatteryFields
from dsse_ros.world.scenario.truth_fields import TruthFields

MAX_DELAY = 32
"""Longest delay of commands, in steps."""


@dataclass(frozen=True, kw_only=True)
class FaultFields(BatteryFields):
    """Faults that can occur; by default there are none."""

    loss_rate: float = field(
        "float", "Probability per step that a drone in the air is lost.", 0.0, low=0, high=1
    )
    loss_steps: tuple[int, ...] = field(
        "ints", "Step in which each drone is lost, or one for all drones; 0: never.", (0,),
        low=0, high=10**9, unit="steps",
    )  # fmt: skip
    stuck_rate: float = field(
        "float", "Probability per step that a drone gets stuck: it hovers and does nothing.", 0.0,
        low=0, high=1,
    )  # fmt: skip
    stuck_steps: int = field(
        "int", "Time that a drone is stuck.", 5, low=1, high=10**6, unit="steps"
    )
    command_drop_rate: float = field(
        "float", "Probability that a command does not arrive: the drone hovers.", 0.0,
        low=0, high=1,
    )  # fmt: skip
    command_delay: int = field(
        "int", "Delay of commands: a drone executes the command sent this long ago.",
        0, low=0, high=MAX_DELAY, unit="steps",
    )  # fmt: skip
    false_alarm_rate: float = field(
        "float", "Probability that a search that finds nobody reports somebody; with truth none, "
        "by which the belief weighs detections.", 0.0,
        low=0, high=1,
    )  # fmt: skip
    false_alarm_steps: int = field(
        "int", "Time that a drone hovers to check a false alarm.", 2,
        low=1, high=10**6, unit="steps",
    )  # fmt: skip
    position_noise: float = field(
        "float",
        "Standard deviation, along each axis, of the positions that drones observe; their true "
        "positions and searched cells do not change.",
        0.0,
        low=0,
        high=1e4,
        unit="cells",
    )
    wind_speed: float = field(
        "float", "Wind speed, below the drones' airspeed; the airspeed is drone_speed.", 0.0,
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
            drone_speed: Airspeed of the slowest drone, in m/s.

        Raises:
            FieldError: If fields contradict each other or the drones.
        """
        if len(self.loss_steps) not in (1, num_drones):
            raise FieldError(
                f"loss_steps must be one for all drones or one per drone ({num_drones}), got "
                f"{len(self.loss_steps)}"
            )
        check_wind("wind_speed", self.wind_speed, drone_speed)
        return self.resolved_battery()


def check_wind(name: str, speed_mps: float, drone_speed: float) -> None:
    """Raise unless drones can fly against a wind.

    Args:
        name: Of the wind, for the message.
        speed_mps: Its speed.
        drone_speed: Airspeed of the slowest drone, in m/s.

    Raises:
        FieldError: If they cannot.
    """
    if not speed_mps < drone_speed:
        raise FieldError(
            f"{name} must be below drone_speed, {drone_speed:g} m/s, or drones would not hold "
            f"their cells, got {speed_mps:g}"
        )


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes:
        doc: Its effect, in one sentence.
        switches: Fields that each enable the fault if not 0.
        options: Fields that configure the fault.
        holds_up: Whether a drone may stay in a cell that it was commanded to leave.
    """

    doc: str
    switches: tuple[str, ...]
    options: tuple[str, ...] = ()
    holds_up: bool = False


FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "battery": Fault(
            "Each step uses energy; a drone returns before it has too little to get home.",
            ("battery_move",),
            (
                "battery_search", "battery_hover", "battery_return", "battery_reserve",
                "relief_steps",
            ),
        ),
        "loss": Fault("A drone drops out of the search.", ("loss_rate", "loss_steps")),
        "false_alarms": Fault(
            "A search wrongly reports somebody; the drone hovers to check.",
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
"""Every fault by name. Missed detections are not faults: planners know
`probability_of_detection`."""


def faults_of(scenario: TruthFields) -> list[str]:
    """Return the names of a scenario's faults.

    A live search has no false alarms of its own: they are among the detections that it is given.
    """
    return [
        name
        for name, fault in FAULTS.items()
        if any(np.any(getattr(scenario, switch)) for switch in fault.switches)
        and (scenario.has_persons or name != "false_alarms")
    ]


def hold_up(scenario: TruthFields) -> bool:
    """Return whether faults may keep a drone in a cell that it was commanded to leave."""
    return any(FAULTS[name].holds_up for name in faults_of(scenario))
