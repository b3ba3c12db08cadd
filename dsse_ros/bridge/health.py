# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How well the bridge is, in one line: what keeps its vehicles from flying the search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

Level = Literal["ok", "warning", "error"]


def health(
    vehicles: int,
    *,
    named: Mapping[str, Sequence[str]],
    following: bool,
    alive: bool,
    holding: bool,
    trouble: str,
) -> tuple[Level, str]:
    """Return the level, and the line for people.

    Args:
        vehicles: How many there are.
        named: Names of those that do not do what their drones did, by the reason in a word;
            `unreachable` for a connection that cannot be used.
        following: Whether there is a search.
        alive: Whether a simulation is there.
        holding: Whether the vehicles hold, as no steps come.
        trouble: Why none can be flown; empty if they can.
    """
    if trouble:
        return "error", trouble
    if vehicles and len(named.get("unreachable", ())) == vehicles:
        return "error", "no vehicle can be reached"
    if holding:
        return "warning", "no steps: the vehicles hold"
    if not alive:
        return "warning", "the simulation is gone" if following else "waiting for step_report"
    lines = [f"{what}: {', '.join(names)}" for what, names in named.items() if names]
    if lines:
        return "warning", "; ".join(lines)
    return "ok", "following" if following else "waiting for step_report"
