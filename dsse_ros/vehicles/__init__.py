# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles over MAVLink: frames, autopilots, missions, control of one, and of a fleet."""
