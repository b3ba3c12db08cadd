# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every message survives the wire unchanged: a value of a wrong type would not."""

import json
import subprocess
import sys

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters import (
    commands,
    diagnostics,
    images,
    markers,
    mission_report,
    occupancy,
    poses,
    stamps,
    step_report,
)

# ROS 2's own imports, on the first message that is converted.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")

STAMP = stamps.to_stamp(np.int64(13_000_000_001))
HEAD = stamps.header("map", STAMP)
# Sizes that are exact in float32, as the fields of some messages are.
PLACES = ((np.float64(65), 65.0, 120.0), (455.0, 455.0, np.float64(120)))
MATRIX = np.arange(16, dtype=np.float32).reshape(4, 4)


def report():
    return step_report.make_step_report(
        {
            "x": [65.0, 455.0],
            "y": [65.0, 455.0],
            "z": np.float64(120),
            "run_id": np.uint32(4_000_000_000),
            "mission": np.int64(2),
            "step": 1,
            "col": np.array([0, 3]),
            "row": np.array([3, 0]),
            "action": np.array([0, 4]),
            "reward": np.array([1.0, -100.0]),
            "terminated": np.array([False, True]),
            "truncated": False,
            "found": np.array([False, False]),
            "held": np.array([True, False]),
            "all_found": False,
            "action_mask": np.ones((2, 5), dtype=np.int8),
        }
    )


def all_messages():
    yield stamps.to_stamp(np.int64(13))
    yield occupancy.occupancy_grid(HEAD, np.float32(130), MATRIX)
    yield images.probability_image(HEAD, MATRIX)
    yield poses.pose_stamped(HEAD, PLACES[0])
    yield poses.odometry(HEAD, "drone0/base_link", PLACES[1], (np.float64(3), np.float64(4)))
    yield poses.path(HEAD, PLACES)
    yield poses.pose_array(HEAD, PLACES)
    yield poses.nav_sat_fix(HEAD, (np.float64(-24), np.float32(-46), 120))
    yield from poses.transforms(HEAD, ("drone0", "drone1"), PLACES, np.array([0.5, 1.0]))
    yield commands.joint_action_message(np.int64(2), np.int64(3), np.array([0, -1]))
    yield step_report.step_report_message(HEAD, report())
    whole = np.zeros((3, 2), mission_report.MISSION_REPORT_DTYPE)
    yield mission_report.mission_report_message(HEAD, whole)
    yield markers.marker_array(
        HEAD,
        markers.Scene(
            np.float64(130),
            520.0,
            520.0,
            drones=[markers.ShownDrone("drone0", PLACES[0], PLACES, live=np.True_)],
            datum=PLACES[1],
            radius_m=np.float64(195),
            persons=[markers.ShownPerson(PLACES[0], found=False)],
        ),
    )
    status = diagnostics.diagnostic_status("sim_node", "ok", "", {"step": np.int64(1)})
    yield diagnostics.diagnostic_array(STAMP, status)


@pytest.mark.parametrize("message", all_messages(), ids=lambda message: type(message).__name__)
def test_a_message_is_the_same_on_the_other_side(message):
    again = deserialize_message(serialize_message(message), type(message))
    assert text_of(again) == text_of(message)


def text_of(message):
    """Return the fields of a message with numbers as the wire has them."""

    def plain(value):
        if hasattr(value, "get_fields_and_field_types"):
            fields = value.get_fields_and_field_types()
            return {
                name: f"{getattr(value, name):.6g}"
                if kind == "float"
                else plain(getattr(value, name))
                for name, kind in fields.items()
            }
        if isinstance(value, str | bytes):
            return str(value)
        if hasattr(value, "__len__"):
            return [plain(entry) for entry in value]
        return value.item() if isinstance(value, np.generic) else value

    return json.dumps(plain(message))


@pytest.mark.slow
def test_the_adapters_import_messages_and_nothing_of_the_search():
    script = (
        "import importlib, pkgutil, sys, msg_adapters\n"
        "for module in pkgutil.iter_modules(msg_adapters.__path__):\n"
        "    importlib.import_module(f'msg_adapters.{module.name}')\n"
        "print(*sorted({name.split('.')[0] for name in sys.modules}))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert {"msg_adapters", "nav_msgs", "numpy"} <= loaded
    assert not loaded & {"dsse_ros", "rclpy", "pymavlink", "tf2_msgs"}
