# SPDX-License-Identifier: Apache-2.0
"""Quality of service of the topics; every one of them can be overridden by parameters."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data

LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""The last message waits for whoever joins late."""

RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Commands, odometry, clock and diagnostics."""

SENSOR = qos_profile_sensor_data
"""Fixes: fresh rather than complete."""
