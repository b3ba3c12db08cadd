# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners: policies from observations to actions, the same for ROS and the PettingZoo env."""

from dsse_ros.planners.planner import Observation, Planner, PlannerFactory, Search
from dsse_ros.planners.registry import (
    BELIEF_PLANNERS,
    PLANNER_NAMES,
    PLANNERS,
    load_planner,
    make_planner,
    planner_for,
)

__all__ = [
    "BELIEF_PLANNERS",
    "PLANNERS",
    "PLANNER_NAMES",
    "Observation",
    "Planner",
    "PlannerFactory",
    "Search",
    "load_planner",
    "make_planner",
    "planner_for",
]
