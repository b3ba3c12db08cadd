# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The kinds of drones by name."""

from __future__ import annotations

from dsse_ros.base.registry import Registry
from dsse_ros.world.searchers.searcher import Searcher

DEFAULT = "drone"
"""The kind with all values from the scenario."""

SEARCHERS = Registry[Searcher](
    "searcher",
    Searcher,
    {
        DEFAULT: Searcher(doc="has the speed, altitude and sensor of the scenario"),
        "fixed_wing": Searcher(
            doc="cannot hover, and turns within 80 m", speed=22.0, min_speed=16.0, turn_radius=80.0
        ),
    },
)
