# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Figures that the authors of DSSE published, and the results of an independent replay."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """Figures of one source.

    Attributes:
        name: The source.
        episodes: Number of episodes.
        found: Share of the episodes in which every person was found.
        steps: Mean number of calls of `step` per episode.
        steps_when_found: The same of the episodes with a find, None if not given.
        median_steps: Median of all episodes or, where `steps_when_found` is given, of those.
        reward: Mean sum of rewards per episode, None if not given.
    """

    name: str
    episodes: int
    found: float
    steps: float
    steps_when_found: float | None = None
    median_steps: float | None = None
    reward: float | None = None


SWEEP = (
    Source("published", 10_000, 0.0562, 195.82, 92.07, 95),
    Source("replay", 100_000, 0.0542, 196.05, 92.30),
)
"""DSSE 0.1.13, one drone, parallel sweep, grid 20 (2023)."""

GREEDY = {
    0.05: (
        Source("published", 5_000, 0.5018, 65.07, None, 94, 0.86),
        Source("replay", 3_000, 0.5073, 64.74, None, 90, 0.870),
    ),
    0.1: (Source("published", 5_000, 0.3584, 77.48, None, 100, 0.59),),
}
"""DSSE 1.1.9, four drones, greedy, grid 40 (2024), by the dispersion's growth per step."""

REINFORCE = Source("REINFORCE", 10_000, 0.9513, 51.96)
"""Learned with DSSE 0.1.13, one drone, grid 20 (2023); the episodes of `SWEEP`."""

PPO = Source("PPO", 5_000, 0.83, 35.91, None, 22, 1.48)
"""Learned with DSSE 1.1.9, four drones, grid 40, a dispersion that grows by .05 (2024)."""
