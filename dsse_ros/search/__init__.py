# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search as arrays: rules, scenario, world, and its PettingZoo environments."""

from dsse_ros.scenario.actions import ACTION_VECTORS, ActionSet
from dsse_ros.scenario.definition import SearchDefinition
from dsse_ros.scenario.fields import FieldError
from dsse_ros.scenario.rules import PROFILES, Rules, profile
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.search.aec import aec_env, env, raw_env
from dsse_ros.search.environments import search_env
from dsse_ros.search.joint_vector_env import JointVectorEnv
from dsse_ros.search.observation import Observation
from dsse_ros.search.parallel_env import SearchEnv, parallel_env
from dsse_ros.search.snapshot import Snapshot, SnapshotError
from dsse_ros.search.vector_env import LazyMaps, VectorEnv, vector_env
from dsse_ros.search.world import HOLD, World

__all__ = [
    "ACTION_VECTORS",
    "HOLD",
    "PROFILES",
    "ActionSet",
    "FieldError",
    "JointVectorEnv",
    "LazyMaps",
    "Observation",
    "Rules",
    "Scenario",
    "SearchDefinition",
    "SearchEnv",
    "Snapshot",
    "SnapshotError",
    "VectorEnv",
    "World",
    "aec_env",
    "env",
    "parallel_env",
    "search_env",
    "profile",
    "raw_env",
    "vector_env",
]
