# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every message survives the wire unchanged: a value of a wrong type would not."""

import json
import subprocess
import sys

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from dsse_ros.scenario import geodesy
from dsse_ros.scenario.frames import GridFrame
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
from msg_adapters.stamps import header

# ROS 2's own imports, on the first message that is converted.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")

# Sizes that are exact in float32, as the fields of some messages are.
FRAME = GridFrame(np.int64(4), np.float32(130), np.float64(-24.04), -46.17, 0, np.float64(120))
STAMP = stamps.to_stamp(np.int64(13_000_000_001))
CELLS = np.array([(0, 3), (3, 0)], dtype=np.int64)
NAMES = ("drone0", "drone1")
MATRIX = np.arange(16, dtype=np.float32).reshape(4, 4)


def report():
    return step_report.make_step_report(
        FRAME,
        run_id=np.uint32(4_000_000_000),
        mission=np.int64(2),
        step=1,
        cells=CELLS,
        actions=np.array([0, 4]),
        rewards=np.array([1.0, -100.0]),
        terminated=np.array([False, True]),
        truncated=np.array([False, False]),
        found=np.array([False, False]),
        held=np.array([True, False]),
        action_mask=np.ones((2, 5), dtype=np.int8),
    )


def all_messages():
    fix = geodesy.cell_fix(FRAME, 1, 2)
    yield stamps.to_stamp(np.int64(13))
    yield occupancy.occupancy_grid(header(FRAME.map_frame, STAMP), FRAME.cell_size_m, MATRIX)
    yield images.probability_image(header(FRAME.map_frame, STAMP), MATRIX)
    yield poses.pose_stamped(FRAME, CELLS[0], STAMP)
    yield poses.odometry(
        FRAME, "drone0", np.float64(1.5), CELLS[0, 1], (np.float64(3), np.float32(4)), STAMP
    )
    yield poses.path(FRAME, CELLS, STAMP)
    yield poses.pose_array(FRAME, CELLS, STAMP)
    yield poses.nav_sat_fix(FRAME, *map(np.float64, fix), STAMP, "drone0")
    yield from poses.transforms(FRAME, CELLS, NAMES, STAMP, np.array([0.5, 1.0]))
    yield commands.joint_action_message(np.int64(2), np.int64(3), np.array([0, -1]))
    yield step_report.step_report_message(header(FRAME.map_frame, STAMP), report())
    whole = np.zeros((3, 2), mission_report.MISSION_REPORT_DTYPE)
    yield mission_report.mission_report_message(header(FRAME.map_frame, STAMP), whole)
    yield markers.marker_array(
        FRAME,
        STAMP,
        drone_cells=CELLS,
        names=NAMES,
        tracks=[CELLS, CELLS],
        live=np.array([True, False]),
        datum=np.array([1.5, 2.0]),
        radius_cells=np.float64(1.5),
        person_cells=CELLS,
        found=np.array([True, False]),
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
def test_the_adapters_import_no_node_and_no_mavlink():
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
    assert {"msg_adapters", "nav_msgs", "pymap3d"} <= loaded
    assert not loaded & {"rclpy", "pymavlink", "tf2_msgs"}
