# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners: policies from observations to actions, the same for ROS and the PettingZoo env."""

from dsse_ros.planners.planner import Observation, Planner, PlannerFactory, Search
from dsse_ros.planners.play import play
from dsse_ros.planners.registry import (
    COVERAGE_PLANNERS,
    PERSON_PLANNERS,
    PLANNER_NAMES,
    PLANNERS,
    check_options,
    check_task,
    load_planner,
    make_planner,
    planner_for,
    planner_with,
    read_options,
)

__all__ = [
    "COVERAGE_PLANNERS",
    "PERSON_PLANNERS",
    "PLANNERS",
    "PLANNER_NAMES",
    "Observation",
    "Planner",
    "PlannerFactory",
    "Search",
    "check_options",
    "check_task",
    "load_planner",
    "make_planner",
    "planner_for",
    "planner_with",
    "play",
    "read_options",
]
