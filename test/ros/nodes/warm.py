# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Imports the nodes and plays a step, so that what is forked from here has its functions loaded."""

import gc
import inspect
from importlib.util import find_spec

from rosidl_generator_py import import_type_support

import dsse_ros.ros.nodes.mavlink_bridge
import dsse_ros.ros.nodes.planner_node
import dsse_ros.ros.nodes.sim_node  # noqa: F401
from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.factories import parallel_env
from msg_adapters.topics import TOPICS

_mission = Mission(parallel_env(), 0, belief=True)
_mission.prepare_belief()
_mission.advance("stay")

# A publisher, a subscription or a service loads the code of its messages.
_packages = {topic.type_name.partition("/")[0] for topic in TOPICS.values()}
for _package in ("rcl_interfaces", "rosgraph_msgs", "std_srvs", *_packages):
    if find_spec(_package):
        import_type_support(_package)
# A node's first log line looks through the files of all modules for its caller's.
inspect.stack()
# A collection in a forked node would copy every page that holds an object of these.
gc.freeze()
