# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Health of the bridge and of each vehicle in one line: what keeps it from flying the search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dsse_ros.vehicles.control.vehicle import Vehicle
from msg_adapters.diagnostics import Level


def fleet_health(
    vehicles: int,
    *,
    named: Mapping[str, Sequence[str]],
    following: bool,
    alive: bool,
    holding: bool,
    trouble: str | None,
) -> tuple[Level, str]:
    """Return the level and the line of the bridge.

    Args:
        vehicles: Number of vehicles.
        named: Names of the vehicles that need attention, by the reason, which is one word;
            `unreachable` for a connection that cannot be used.
        following: Whether the bridge follows a search.
        alive: Whether a simulation is running.
        holding: Whether the vehicles hold because no steps come.
        trouble: Why no vehicle can fly.
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


def vehicle_health(
    vehicle: Vehicle,
    lost: str | None,
    refused: str | None,
    blocked: str | None,
    leaves_layer: str | None,
    off_plan: str | None,
) -> tuple[Level, str]:
    """Return the level and the line of a vehicle.

    Args:
        vehicle: The vehicle.
        lost: Why it no longer follows its drone.
        refused: Why the bridge sends it nothing.
        blocked: What keeps it from taking off.
        leaves_layer: Why its own return would leave its layer.
        off_plan: How slow it is, or how far off its leg.
    """
    state, outcome = vehicle.state, vehicle.outcome
    if lost:
        return "error", f"lost: {lost}"
    if refused:
        return "error", f"refused: {refused}"
    if not state.connected:
        return "stale", vehicle.trouble or blocked or f"no heartbeat on {vehicle.connection}"
    if state.unfit:
        return "error", state.unfit
    if blocked:
        return "warning", f"waits: {blocked}"
    failsafe = state.failsafe.value if state.failsafe else ""
    if failsafe or outcome.status in ("failed", "taken_over", "failsafe"):
        return "warning", f"{outcome.status}: {outcome.reason or ''} {failsafe}".strip()
    deviates = off_plan or leaves_layer
    if deviates:
        return "warning", deviates
    return "ok", f"{state.mode}: {outcome.reason or outcome.status}"
