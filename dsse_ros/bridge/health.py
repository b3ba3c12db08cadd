# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How well the bridge is, in one line: what keeps its vehicles from flying the search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

Level = Literal["ok", "warning", "error"]


@dataclass(frozen=True)
class Situation:
    """What its health depends on.

    Attributes:
        vehicles: How many there are.
        following: Whether there is a search.
        alive: Whether a simulation is there.
        holding: Whether the vehicles hold, as no steps come.
        trouble: Why none can be flown; empty if they can.
        unreachable: Names of those whose connection cannot be used.
        waiting: Names of those that do not do what their drones did, by the reason in a word.
    """

    vehicles: int
    following: bool = True
    alive: bool = True
    holding: bool = False
    trouble: str = ""
    unreachable: Sequence[str] = ()
    waiting: Mapping[str, Sequence[str]] = field(default_factory=dict)


def health(now: Situation) -> tuple[Level, str]:
    """Return the level, and the line for people."""
    if now.trouble:
        return "error", now.trouble
    if now.vehicles and len(now.unreachable) == now.vehicles:
        return "error", "no vehicle can be reached"
    if now.holding:
        return "warning", "no steps: the vehicles hold"
    if not now.alive:
        gone = "the simulation is gone" if now.following else "waiting for step_report"
        return "warning", gone
    named = {**now.waiting, "unreachable": now.unreachable}
    lines = [f"{what}: {', '.join(names)}" for what, names in named.items() if names]
    if lines:
        return "warning", "; ".join(lines)
    return "ok", "following" if now.following else "waiting for step_report"
