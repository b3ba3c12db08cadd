# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Diagnostics."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.diagnostics import (
    diagnostic_array,
    diagnostic_status,
    node_of_status,
    status_name,
)
from msg_adapters.stamps import to_stamp


def test_a_status_has_its_level_and_every_value_as_text_in_order():
    values = {"step": np.int64(7), "missing": ["drone1"], "rejected.stale_step": 2, "p": None}
    made = diagnostic_status(
        "sim_node: lockstep", "warning", "waiting for drone1", values, "simulation"
    )
    message = diagnostic_array(to_stamp(5 * 10**9), made)
    assert message.header.stamp.sec == 5
    (status,) = message.status
    assert status.level == b"\x01" == DiagnosticStatus.WARN
    assert (status.name, status.hardware_id) == ("sim_node: lockstep", "simulation")
    assert status.message == "waiting for drone1"
    assert [(value.key, value.value) for value in status.values] == [
        ("step", "7"),
        ("missing", "['drone1']"),
        ("rejected.stale_step", "2"),
        ("p", "None"),
    ]


@pytest.mark.parametrize("node", ["/sim_node", "/one/two/sim_node", "sim_node"])
def test_a_status_begins_with_the_package_and_names_the_node(node: str):
    name = status_name(node)
    assert name == f"dsse_ros: {node.lstrip('/')}"
    assert node_of_status(name) == f"/{node.lstrip('/')}"
    # Of a drone, and of somebody else.
    assert status_name(node, "drone3") == f"{name}: drone3"
    assert [node_of_status(node_name) for node_name in (f"{name}: drone3", node, "")] == [
        "",
        "",
        "",
    ]
