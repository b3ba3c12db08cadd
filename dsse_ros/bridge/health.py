# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Health of the bridge in one line: what keeps its vehicles from flying the search."""

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
    """Return the level and the line to show.

    Args:
        vehicles: Number of vehicles.
        named: Names of the vehicles that need attention, by the reason, which is one word;
            `unreachable` for a connection that cannot be used.
        following: Whether the bridge follows a search.
        alive: Whether a simulation is running.
        holding: Whether the vehicles hold because no steps come.
        trouble: Why no vehicle can fly; empty if they can.
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
