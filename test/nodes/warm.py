# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Imports the nodes and plays a step, so that what is forked from here has its functions loaded."""

import dsse_ros.nodes.mavlink_bridge
import dsse_ros.nodes.planner_node
import dsse_ros.nodes.sim_node  # noqa: F401
from dsse_ros.search import parallel_env

_env = parallel_env()
_env.reset(seed=0)
_env.step(dict.fromkeys(_env.agents, 0))
