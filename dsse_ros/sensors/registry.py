# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensors by name."""

from __future__ import annotations

from dsse_ros.sensors.own_cell import OWN_CELL
from dsse_ros.sensors.sensor import Sensor

SENSORS: dict[str, Sensor] = {"own_cell": OWN_CELL}
