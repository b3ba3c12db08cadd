# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensors by name."""

from __future__ import annotations

from dsse_ros.base.registry import Registry
from dsse_ros.world.sensors.camera import CAMERA
from dsse_ros.world.sensors.flown_over import FLOWN_OVER
from dsse_ros.world.sensors.own_cell import OWN_CELL
from dsse_ros.world.sensors.sensor import Sensor
from dsse_ros.world.sensors.swept_strip import SWEPT_STRIP

SENSORS = Registry[Sensor](
    "sensor",
    Sensor,
    {
        "own_cell": OWN_CELL,
        "flown_over": FLOWN_OVER,
        "sweep_width": SWEPT_STRIP,
        "camera": CAMERA,
    },
)
