# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of an ensemble: where persons may go, as weighted tracks of particles.

An ensemble draws its tracks once for a scenario. The search draws those of the persons from the
same law by another seed, so that what a belief knows and what persons do cannot diverge.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

SUM_TOLERANCE = 1e-9
"""How far the sum of weights may be from 1."""


class Tracks(NamedTuple):
    """The tracks of M particles.

    Attributes:
        positions: (T, M, 2) float64, metres to the east and to the south of the grid's north-west
            corner at each step of the sea, the first one before any. What is not finite is nowhere.
        weights: (M,) float64, how probable each track is; they sum to 1.
    """

    positions: NDArray[np.float64]
    weights: NDArray[np.float64]


class TracksOf(Protocol):
    """Draws the tracks of particles."""

    def __call__(self, scenario: Any, steps: int, rng: np.random.Generator, count: int) -> Tracks:
        """Return tracks of at least one particle; the same generator gives the same.

        Args:
            scenario: The `ResolvedScenario`: last known cell, drift, spread, duration of a step.
            steps: T - 1, steps of the sea until the end of a mission, those before the search too.
            rng: What is drawn with, and nothing else.
            count: How many particles are asked for; one that has them from a file has its own
                number.
        """
        ...


class Ensemble(NamedTuple):
    """How persons move, as an ensemble.

    Attributes:
        doc: What a person does, without a subject.
        tracks: Draws the tracks.
    """

    doc: str
    tracks: TracksOf


def check_tracks(tracks: Tracks, steps: int) -> None:
    """Raise unless these are tracks of this many steps, with weights that are probabilities.

    Raises:
        ValueError: If they are not.
    """
    positions, weights = tracks
    if weights.ndim != 1 or not len(weights):
        raise ValueError(f"weights of shape {weights.shape} are not allowed; (M,) with M >= 1")
    shape = (steps + 1, len(weights), 2)
    if positions.shape != shape:
        raise ValueError(f"positions of shape {positions.shape} are not allowed; {shape}")
    # Also refuses NaN.
    if not (weights >= 0.0).all():
        raise ValueError("weights below 0 are not allowed")
    total = float(weights.sum())
    if not abs(total - 1.0) <= SUM_TOLERANCE:
        raise ValueError(f"weights that sum to {total:.9g} are not allowed; 1")
