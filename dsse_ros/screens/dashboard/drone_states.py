# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state of a drone after a step, as text for the page."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dsse_ros.screens.dashboard.search_history import DroneState, SearchHistory, has_field
from dsse_ros.search.step.fault_kernels import STATUSES
from dsse_ros.world.scenario.agents import AgentsInfo

STATES = {
    DroneState.FLYING: "in flight",
    DroneState.FINDER: "found a person",
    DroneState.OVER: "search over",
    DroneState.LOST: "lost",
    DroneState.OUT_OF_TIME: "out of time",
}
_MAX_NAMED = 3
"""Drones that a state names at most."""


def state_of(state: int, entry: Any) -> str:
    """Return the state of a drone after a step, with faults the true one."""
    text = STATES[DroneState(state)]
    if state == DroneState.FLYING and has_field(entry, "status") and entry["status"]:
        text = STATUSES[entry["status"]].replace("_", " ")
    return text + (", held" if entry["held"] else "")


def flight_of(entry: Any) -> str:
    """Return heading and airspeed of a drone in metres, "none" for any other."""
    if not has_field(entry, "heading"):
        return "none"
    return f"{math.degrees(entry['heading']) % 360:03.0f}°, {entry['airspeed']:.1f} m/s"


def battery_of(entry: Any) -> str:
    """Return the charge of a drone, "" if it does not run down."""
    known = has_field(entry, "battery") and not np.isnan(entry["battery"])
    return f"{entry['battery']:.0f} %" if known else ""


def collided_with(info: AgentsInfo, history: SearchHistory, i: int, drone: int) -> str:
    """Return with which drones one that is lost in known step `i` has collided."""
    collides = info.definition is None or info.definition.rules.collisions
    if not collides or history.states[i][drone] != DroneState.LOST:
        return ""
    names = [info.agents[other] for other in history.collided_with(i, drone)]
    more = f" and {len(names) - _MAX_NAMED} others" if len(names) > _MAX_NAMED else ""
    return f", collided with {', '.join(names[:_MAX_NAMED])}{more}" if names else ""
