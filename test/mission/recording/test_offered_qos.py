# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Quality of service in bags, as rosbag2 and other readers have it."""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)
from rosbags.rosbag2.metadata import parse_qos

from dsse_ros.mission.recording.offered_qos import common, to_yaml
from dsse_ros.ros.runtime.qos import COMPLETE, LATCHED, RELIABLE, SENSOR

PROFILES = [COMPLETE, LATCHED, RELIABLE, SENSOR, qos_profile_sensor_data]

# As rosbag2 0.26 (Jazzy) writes it for a publisher found by Fast DDS.
OF_ROSBAG2 = """\
- history: unknown
  depth: 0
  reliability: reliable
  durability: transient_local
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: automatic
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false"""


def test_rosbags_reads_each_policy_of_a_profile() -> None:
    read = parse_qos(to_yaml(PROFILES))
    for name in ("history", "reliability", "durability", "liveliness"):
        assert [getattr(one, name).name for one in read] == [
            getattr(profile, name).name for profile in PROFILES
        ]
    assert [one.depth for one in read] == [profile.depth for profile in PROFILES]
    assert parse_qos(to_yaml([])) == []


def test_a_profile_is_written_as_by_rosbag2() -> None:
    found = QoSProfile(
        history=HistoryPolicy.UNKNOWN,
        depth=0,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        liveliness=LivelinessPolicy.AUTOMATIC,
        deadline=Duration(nanoseconds=2**63 - 1),
        lifespan=Duration(nanoseconds=2**63 - 1),
        liveliness_lease_duration=Duration(nanoseconds=2**63 - 1),
    )
    assert to_yaml([found]) == OF_ROSBAG2


def test_a_subscription_gets_all_that_every_publisher_offers() -> None:
    def policies(*profiles: QoSProfile) -> tuple[str, str]:
        profile = common(profiles, 5)
        assert profile.depth == 5
        return profile.reliability.name, profile.durability.name

    assert policies(LATCHED, COMPLETE) == ("RELIABLE", "TRANSIENT_LOCAL")
    assert policies(LATCHED, RELIABLE) == ("RELIABLE", "VOLATILE")
    assert policies(LATCHED, SENSOR) == ("BEST_EFFORT", "VOLATILE")
    assert policies() == ("BEST_EFFORT", "VOLATILE")
