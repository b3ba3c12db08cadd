# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The quality of service that the publishers of a topic offer, as rosbag2 keeps it in bags."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import yaml
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

KEY = "offered_qos_profiles"
"""Key of a channel's metadata."""

_POLICIES = ("history", "reliability", "durability", "liveliness")
_DURATIONS = ("deadline", "lifespan", "liveliness_lease_duration")
_ORDER = (
    "history", "depth", "reliability", "durability", "deadline", "lifespan", "liveliness",
    "liveliness_lease_duration", "avoid_ros_namespace_conventions",
)  # fmt: skip


def to_yaml(profiles: Sequence[QoSProfile]) -> str:
    """Return profiles as YAML, as rosbag2 of Jazzy writes it."""
    return yaml.safe_dump([_plain(profile) for profile in profiles], sort_keys=False).rstrip()


def common(profiles: Sequence[QoSProfile], depth: int) -> QoSProfile:
    """Return the strictest QoS that all of these offer; the most permissive if there are none."""
    reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
    latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return QoSProfile(
        depth=depth,
        reliability=(
            ReliabilityPolicy.RELIABLE if profiles and reliable else ReliabilityPolicy.BEST_EFFORT
        ),
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if profiles and latched else DurabilityPolicy.VOLATILE
        ),
    )


def _plain(profile: QoSProfile) -> dict[str, Any]:
    values: dict[str, Any] = {
        "depth": profile.depth,
        "avoid_ros_namespace_conventions": bool(profile.avoid_ros_namespace_conventions),
    }
    values |= {name: getattr(profile, name).name.lower() for name in _POLICIES}
    for name in _DURATIONS:
        sec, nsec = divmod(getattr(profile, name).nanoseconds, 10**9)
        values[name] = {"sec": sec, "nsec": nsec}
    return {name: values[name] for name in _ORDER}
