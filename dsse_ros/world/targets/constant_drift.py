# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ensemble of a constant drift, with a small velocity error per person."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dsse_ros.world.targets.ensemble import Ensemble, WeightedTracks


def tracks(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> WeightedTracks:
    """Return tracks of equal weight; see `targets.ensemble.TracksOf`.

    A particle starts at a normally distributed position around the centre of the last known cell
    (`sigma_x`, `sigma_y`). Each step adds the mean drift of the datum (`drift`), a velocity error
    drawn once per particle (`dispersion_inc`, so that the spread grows with time) and a random walk
    (`diffusivity` D: a variance of 2 D dt along each axis).
    """
    cell, dt = scenario.cell_size, scenario.step_duration_s
    start = (np.array(scenario.person_initial_position) + 0.5) * cell
    spread = np.array([scenario.sigma_x, scenario.sigma_y]) * cell
    drift = np.array(scenario.drift) * cell
    positions = np.empty((steps + 1, count, 2))
    positions[0] = start + spread * rng.standard_normal((count, 2))
    per_step = drift + scenario.dispersion_inc * cell * rng.standard_normal((count, 2))
    walk = math.sqrt(2.0 * scenario.diffusivity * dt)
    for step in range(steps):
        positions[step + 1] = positions[step] + per_step
        positions[step + 1] += walk * rng.standard_normal((count, 2))
    return WeightedTracks(positions, np.full(count, 1.0 / count))


CONSTANT_DRIFT = Ensemble(
    "drifts with the current, with an error of its own velocity and a random walk", tracks
)
