# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The supported autopilots: one file for each firmware, and the registry of their names."""

from __future__ import annotations

from collections.abc import Mapping

from dsse_ros.vehicles.autopilots.ardupilot import ARDUPILOT, ARDUPLANE
from dsse_ros.vehicles.autopilots.autopilot import Autopilot
from dsse_ros.vehicles.autopilots.failsafe import Failsafe
from dsse_ros.vehicles.autopilots.px4 import PX4, PX4_PLANE

__all__ = ["ARDUPILOT", "ARDUPLANE", "AUTOPILOTS", "PX4", "PX4_PLANE", "Autopilot", "Failsafe"]

AUTOPILOTS: Mapping[str, Autopilot] = {
    autopilot.name: autopilot for autopilot in (ARDUPILOT, ARDUPLANE, PX4, PX4_PLANE)
}
"""The autopilots by their names, the values of the parameter `autopilot`."""
