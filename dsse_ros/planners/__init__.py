# SPDX-License-Identifier: Apache-2.0
"""Planners: policies from observations to actions, the same for ROS and the PettingZoo env."""

from dsse_ros.planners.planner import Observation, Planner, PlannerFactory, Search
from dsse_ros.planners.registry import (
    PLANNER_NAMES,
    PLANNERS,
    load_planner,
    make_planner,
    planner_for,
)

__all__ = [
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
