# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Imports the nodes and plays a step, so that what is forked from here has its functions loaded."""

import gc
import inspect

import dsse_ros.nodes.mavlink_bridge
import dsse_ros.nodes.planner_node
import dsse_ros.nodes.sim_node  # noqa: F401
from dsse_ros.mission.mission import Mission
from dsse_ros.search import parallel_env

_mission = Mission(parallel_env(), 0, belief=True)
_mission.prepare_belief()
_mission.advance("stay")

# A node's first log line looks through the files of all modules for its caller's.
inspect.stack()
# A collection in a forked node would copy every page that holds an object of these.
gc.freeze()
