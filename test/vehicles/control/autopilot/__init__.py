# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A simulated autopilot that behaves as ArduCopter or PX4, in a process of its own.

Start it with `python test/vehicles/control/autopilot --help`, or in a test by `autopilot.running`.
"""
