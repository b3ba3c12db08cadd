# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of an ensemble: possible motions of persons as weighted tracks of particles.

An ensemble draws its tracks once per scenario. The search draws the persons' tracks from the same
model with another seed, so that beliefs and persons cannot diverge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

SUM_TOLERANCE = 1e-9
"""Tolerance for the sum of the weights, which is 1."""


class WeightedTracks(NamedTuple):
    """The tracks of M particles.

    Attributes:
        positions: (T, M, 2) float64, metres to the east and to the south of the grid's north-west
            corner, before the first step of the sea and after each one. A particle with a position
            that is not finite is nowhere.
        weights: (M,) float64, probability of each track; they sum to 1.
        objects: (M,) int8, number of each particle's object among those that the scenario's
            incident may be about; None if all are alike.
        dies_s: (M,) float64, seconds from the first position until the person of each particle is
            no longer alive, as far as the scenario's incident states it; None if it does not.
    """

    positions: NDArray[np.float64]
    weights: NDArray[np.float64]
    objects: NDArray[np.int8] | None = None
    dies_s: NDArray[np.float64] | None = None


class TracksBySteps(NamedTuple):
    """The tracks of M particles, one step of the sea after the other: all at once may be large.

    Attributes:
        positions: (M, 2) float64 of each step; see `WeightedTracks`. They are computed as they are
            taken.
        weights: See there.
        objects: See there.
        dies_s: Returns those there once all positions have been taken; None if nobody dies.
    """

    positions: Iterable[NDArray[np.float64]]
    weights: NDArray[np.float64]
    objects: NDArray[np.int8] | None = None
    dies_s: Callable[[], NDArray[np.float64]] | None = None


class TracksOf(Protocol):
    """Draws the tracks of particles."""

    def __call__(
        self, scenario: Any, steps: int, rng: np.random.Generator, count: int
    ) -> WeightedTracks:
        """Return tracks of at least one particle; the same generator gives the same tracks.

        Args:
            scenario: The `ResolvedScenario`: last known cell, drift, spread, duration of a step.
            steps: T - 1, steps of the sea until the end of a mission, including those before the
                search.
            rng: Generator of the draws; use no other.
            count: Requested number of particles; an ensemble that reads them from a file may return
                another number.
        """
        ...


def requested(scenario: Any) -> int:
    """Return the number of tracks that a `ResolvedScenario` requests."""
    return int(scenario.particles)


class Ensemble(NamedTuple):
    """A target model that is an ensemble.

    Attributes:
        doc: Motion of a person, as a phrase without a subject.
        tracks: Function that draws the tracks.
        count: Function that returns an upper bound of their number for a `ResolvedScenario`.
        reads: Names of the arrays among the fields of a scenario that `tracks` reads.
        of_incident: Whether the tracks are those of the scenario's incident, if it has one.
        by_steps: Function that draws the same tracks as `tracks`, with the same arguments, one step
            after the other; None if there is none.
    """

    doc: str
    tracks: TracksOf
    count: Callable[[Any], int] = requested
    reads: tuple[str, ...] = ()
    of_incident: bool = False
    by_steps: Callable[[Any, int, np.random.Generator, int], TracksBySteps] | None = None

    def drawn(
        self, scenario: Any, steps: int, rng: np.random.Generator, count: int
    ) -> WeightedTracks | TracksBySteps:
        """Return the tracks by steps if there are such, else all at once and checked.

        Args:
            scenario: See `TracksOf`.
            steps: See there.
            rng: See there.
            count: See there.

        Raises:
            ValueError: If the tracks break their contract.
        """
        if self.by_steps is not None:
            return self.by_steps(scenario, steps, rng, count)
        tracks = WeightedTracks(*self.tracks(scenario, steps, rng, count))
        check_tracks(tracks, steps)
        return tracks


def check_tracks(tracks: WeightedTracks, steps: int) -> None:
    """Raise unless these tracks have this many steps, and weights that are probabilities.

    Raises:
        ValueError: If they do not.
    """
    positions, weights, objects, dies_s = tracks
    if weights.ndim != 1 or not len(weights):
        raise ValueError(f"weights must be (M,) with M >= 1, got {weights.shape}")
    shape = (steps + 1, len(weights), 2)
    if positions.shape != shape:
        raise ValueError(f"positions must be {shape}, got {positions.shape}")
    for name, values in (("objects", objects), ("dies_s", dies_s)):
        if values is not None and values.shape != weights.shape:
            raise ValueError(f"{name} must be {weights.shape}, got {values.shape}")
    # This form of the comparison also refuses NaN.
    if not (weights >= 0.0).all():
        raise ValueError(f"weights must be >= 0, got {weights.min():g}")
    total = float(weights.sum())
    if not abs(total - 1.0) <= SUM_TOLERANCE:
        raise ValueError(f"weights must sum to 1, got {total:.9g}")
