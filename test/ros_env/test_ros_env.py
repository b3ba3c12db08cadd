# SPDX-License-Identifier: Apache-2.0
"""`DsseRosEnv`, against live nodes and beside the environment that they run."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from pettingzoo.test import parallel_api_test
from rig import TIMEOUT_S, Rig, Sim
from std_srvs.srv import SetBool

from dsse_ros.mission.scenario_files import find_scenario
from dsse_ros.ros_env import DsseRosEnv, SearchLostError
from dsse_ros.search import FieldError, parallel_env
from msg_adapters.vehicles import Progress, progress_message

SMALL: dict[str, Any] = {"grid_size": 6, "timestep_limit": 12}
SEARCHES: dict[str, dict[str, Any]] = {
    "paper": {"num_drones": 3, "person_amount": 2, "person_initial_position": (3, 3), **SMALL},
    "v1": {"num_drones": 2, "sigma": 2.0, **SMALL},
    "v2": {"num_drones": 4, "dispersion_inc": 0.05, **SMALL},
    "santos": {"num_drones": 3, "timestep_limit": 25},
}


def direct(name: str) -> Any:
    """The search in this process."""
    if name == "santos":
        return parallel_env(find_scenario("santos"), **SEARCHES[name])
    return parallel_env(rules=name, **SEARCHES[name])


def parameters(name: str) -> dict[str, Any]:
    """The search as parameters of a node."""
    fields = {k: list(v) if isinstance(v, tuple) else v for k, v in SEARCHES[name].items()}
    return fields | ({"scenario": "santos"} if name == "santos" else {"rules": name})


@pytest.fixture(scope="module")
def sims(rig: Rig) -> dict[str, Sim]:
    """A node for each search, in a namespace of that name."""
    for name in SEARCHES:
        vehicles = {"wait_for_vehicles": True} if name == "santos" else {}
        rig.start("sim_node", parameters(name), "-r", f"__ns:=/{name}")
    return {name: Sim(rig, rig.processes[i], f"/{name}") for i, name in enumerate(SEARCHES)}
