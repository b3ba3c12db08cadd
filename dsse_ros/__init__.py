# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drone swarm search and rescue at sea: a PettingZoo world, planners and ROS 2 nodes.

The names of users; each is imported from its module when it is first asked for.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dsse_ros.base.fields import FieldError as FieldError
    from dsse_ros.conformance.belief import belief_test as belief_test
    from dsse_ros.conformance.searcher import searcher_test as searcher_test
    from dsse_ros.conformance.sensor import sensor_test as sensor_test
    from dsse_ros.conformance.target_model import target_model_test as target_model_test
    from dsse_ros.mission.recording.bag import read_bag as read_bag
    from dsse_ros.picture.movie import save_movie as save_movie
    from dsse_ros.planners.batch import play_missions as play_missions
    from dsse_ros.planners.planner import Planner as Planner
    from dsse_ros.planners.play import play as play
    from dsse_ros.planners.registry import make_planner as make_planner
    from dsse_ros.planners.registry import planner_for as planner_for
    from dsse_ros.ros.ros_env import DsseRosEnv as DsseRosEnv
    from dsse_ros.search.belief.belief import Belief as Belief
    from dsse_ros.search.belief.forecasts import forecast_for as forecast_for
    from dsse_ros.search.belief.protocol import TargetBelief as TargetBelief
    from dsse_ros.search.environments.aec import (
        FlattenedObservationWrapper as FlattenedObservationWrapper,
    )
    from dsse_ros.search.environments.aec import aec_env as aec_env
    from dsse_ros.search.environments.drone_slots import DroneSlots as DroneSlots
    from dsse_ros.search.environments.factories import parallel_env as parallel_env
    from dsse_ros.search.environments.factories import vector_env as vector_env
    from dsse_ros.search.environments.joint_vector_env import JointVectorEnv as JointVectorEnv
    from dsse_ros.search.environments.snapshot import Snapshot as Snapshot
    from dsse_ros.search.step.looks import searches_of as searches_of
    from dsse_ros.world.scenario.rules import PROFILES as PROFILES
    from dsse_ros.world.scenario.rules import Rules as Rules
    from dsse_ros.world.scenario.rules import profile as profile
    from dsse_ros.world.scenario.scenario import Scenario as Scenario
    from dsse_ros.world.searchers.searcher import Searcher as Searcher
    from dsse_ros.world.sensors.sensor import Look as Look
    from dsse_ros.world.sensors.sensor import Sensor as Sensor
    from dsse_ros.world.targets.ensemble import Ensemble as Ensemble
    from dsse_ros.world.targets.ensemble import WeightedTracks as WeightedTracks
    from dsse_ros.world.targets.motion import PersonMotion as PersonMotion

_MODULES = {
    "aec_env": "dsse_ros.search.environments.aec",
    "Belief": "dsse_ros.search.belief.belief",
    "belief_test": "dsse_ros.conformance.belief",
    "DroneSlots": "dsse_ros.search.environments.drone_slots",
    "DsseRosEnv": "dsse_ros.ros.ros_env",
    "Ensemble": "dsse_ros.world.targets.ensemble",
    "FieldError": "dsse_ros.base.fields",
    "FlattenedObservationWrapper": "dsse_ros.search.environments.aec",
    "forecast_for": "dsse_ros.search.belief.forecasts",
    "JointVectorEnv": "dsse_ros.search.environments.joint_vector_env",
    "Look": "dsse_ros.world.sensors.sensor",
    "make_planner": "dsse_ros.planners.registry",
    "parallel_env": "dsse_ros.search.environments.factories",
    "PersonMotion": "dsse_ros.world.targets.motion",
    "Planner": "dsse_ros.planners.planner",
    "planner_for": "dsse_ros.planners.registry",
    "play": "dsse_ros.planners.play",
    "play_missions": "dsse_ros.planners.batch",
    "profile": "dsse_ros.world.scenario.rules",
    "PROFILES": "dsse_ros.world.scenario.rules",
    "read_bag": "dsse_ros.mission.recording.bag",
    "Rules": "dsse_ros.world.scenario.rules",
    "save_movie": "dsse_ros.picture.movie",
    "Scenario": "dsse_ros.world.scenario.scenario",
    "Searcher": "dsse_ros.world.searchers.searcher",
    "searcher_test": "dsse_ros.conformance.searcher",
    "searches_of": "dsse_ros.search.step.looks",
    "Sensor": "dsse_ros.world.sensors.sensor",
    "sensor_test": "dsse_ros.conformance.sensor",
    "Snapshot": "dsse_ros.search.environments.snapshot",
    "target_model_test": "dsse_ros.conformance.target_model",
    "TargetBelief": "dsse_ros.search.belief.protocol",
    "vector_env": "dsse_ros.search.environments.factories",
    "WeightedTracks": "dsse_ros.world.targets.ensemble",
}
"""The public names, each with its module."""

__all__ = list(_MODULES)  # noqa: PLE0605


def __getattr__(name: str) -> object:
    """Import a public name.

    Raises:
        AttributeError: If there is none of that name.
    """
    if name not in _MODULES:
        raise AttributeError(f"module 'dsse_ros' has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_MODULES)
