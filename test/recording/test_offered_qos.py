# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Quality of service in bags, as rosbag2 and other readers have it."""

from __future__ import annotations

import pytest
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)

from dsse_ros.recording.offered_qos import common, from_yaml, to_yaml
from dsse_ros.runtime.qos import COMPLETE, LATCHED, RELIABLE, SENSOR

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


def test_a_profile_survives() -> None:
    assert from_yaml(to_yaml(PROFILES)) == PROFILES
    assert from_yaml(to_yaml([])) == from_yaml("") == []


def test_what_rosbag2_writes_is_read_and_written_again() -> None:
    (profile,) = from_yaml(OF_ROSBAG2)
    assert profile.reliability == ReliabilityPolicy.RELIABLE
    assert profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert to_yaml([profile]) == OF_ROSBAG2


def test_the_numbers_of_rosbag2_before_jazzy_are_read() -> None:
    text = OF_ROSBAG2
    for name, number in (
        ("unknown", 3), ("transient_local", 1), ("automatic", 1), (": reliable", ": 1"),
    ):  # fmt: skip
        text = text.replace(name, str(number))
    assert from_yaml(text) == from_yaml(OF_ROSBAG2)


@pytest.mark.parametrize("text", ["[1", "- 1", "- {depth: 1}", "a: b", "- history: often"])
def test_a_text_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="offered_qos_profiles: "):
        from_yaml(text)


def test_a_subscription_gets_all_that_every_publisher_offers() -> None:
    def policies(*profiles: QoSProfile) -> tuple[str, str]:
        made = common(profiles, 5)
        assert made.depth == 5
        return made.reliability.name, made.durability.name

    assert policies(LATCHED, COMPLETE) == ("RELIABLE", "TRANSIENT_LOCAL")
    assert policies(LATCHED, RELIABLE) == ("RELIABLE", "VOLATILE")
    assert policies(LATCHED, SENSOR) == ("BEST_EFFORT", "VOLATILE")
    assert policies() == ("BEST_EFFORT", "VOLATILE")
