# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle is started with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .faults import Fault
from .local_frame import Place

AutopilotName = Literal["ardupilot", "arduplane", "px4", "px4plane"]


@dataclass(frozen=True)
class Settings:
    """What a vehicle is started with; times are vehicle times.

    Attributes:
        system: System id.
        autopilot: Whose behaviour it has.
        home: Where it stands.
        seed: Random seed.
        key: 32 bytes to sign with, None not to sign.
        ready_s: Time from the start until it can be armed.
        requests_lost_s: Time from the start in which requests for messages are acknowledged and
            lost.
        gps: Whether it ever has a position.
        endurance_s: Time in the air that its battery lasts.
        wind_mps: Wind to the north and to the east.
        estimates_wind: Whether it reports that wind; ArduCopter by default reports 0.
        faults: Failures.
        parameters: Values of its parameters, by name, instead of the usual ones.
    """

    system: int = 1
    autopilot: AutopilotName = "ardupilot"
    home: Place = Place(-24.0, -46.3, 0.0)
    seed: int = 0
    key: bytes | None = None
    ready_s: float = 42.0
    requests_lost_s: float = 1.0
    gps: bool = True
    endurance_s: float = 1500.0
    wind_mps: tuple[float, float] = (0.0, 0.0)
    estimates_wind: bool = True
    faults: tuple[Fault, ...] = ()
    parameters: tuple[tuple[str, float], ...] = ()
