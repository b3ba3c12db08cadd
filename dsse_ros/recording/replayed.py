# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The outcome of the replay of a mission."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Difference:
    """The first difference.

    Attributes:
        step: Step of the mission.
        drone: Name of the drone, "" where it is not of one.
        field: What differs: a field of the step report, or a topic of commands.
        recorded, replayed: What it is in the bag and in the replay.
    """

    step: int
    drone: str
    field: str
    recorded: str
    replayed: str

    def __str__(self) -> str:
        of = f", {self.drone}" if self.drone else ""
        return (
            f"step {self.step}{of}: {self.field} is {self.recorded} in the bag, "
            f"{self.replayed} in the replay"
        )


@dataclass
class ReplayedMission:
    """The outcome of the replay of a mission.

    Attributes:
        namespace: Of its topics, with a slash at the end.
        run_id, number: Which mission it is.
        seed: Its seed.
        steps: Steps that were replayed.
        uncommanded: Actions of drones that had no command in the bag for a step.
        refused: Commands that were refused, by code.
        lost: Names of the drones that were lost with their vehicles.
        difference: The first difference; nothing is replayed after it.
        incomplete: Why it cannot be replayed, or not on; "" if it can.
    """

    namespace: str
    run_id: int
    number: int
    seed: int | None = None
    steps: int = 0
    uncommanded: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    lost: list[str] = field(default_factory=list)
    difference: Difference | None = None
    incomplete: str = ""
