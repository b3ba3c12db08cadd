# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Diagnostics."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.diagnostics import diagnostic_array
from msg_adapters.stamps import to_stamp


def test_a_status_has_its_level_and_every_value_as_text_in_order():
    message = diagnostic_array(
        to_stamp(5 * 10**9),
        name="sim_node: lockstep",
        hardware_id="simulation",
        level="warning",
        message="waiting for drone1",
        values={"step": np.int64(7), "missing": ["drone1"], "rejected.stale_step": 2, "p": None},
    )
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
