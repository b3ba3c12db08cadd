# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The strips that drones in metres see on their paths."""

from __future__ import annotations

from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.search.flights import lateral_ranges


def strips_of(scenario: ResolvedScenario) -> tuple[float, ...]:
    """Return the width of the strip that each drone sees, in metres.

    It is the sweep width of an inverse cube law, else twice the definite range.
    """
    widths = [lateral.sweep_width_m or 2 * lateral.reach_m for lateral in lateral_ranges(scenario)]
    return tuple(widths[kind] for kind in scenario.kind_of)
