# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where persons are whom earlier searches have not found: particles that have drifted on, weighted.

The particles drift from the first of these searches on, so each search counts where a particle was
at the time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.search_plan.optimiser import PARTICLES
from dsse_ros.planners.search_plan.plan_file import begins_s
from dsse_ros.planners.search_plan.timed_tracks import TrackSearch
from dsse_ros.search.belief import passing_kernels
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.belief.particle_kernels import BinnedParticles
from dsse_ros.search.belief.passing_kernels import ParticlePositions
from dsse_ros.search.step.cell_tracks import (
    CellParticles,
    Draw,
    check_memory,
    generator_of,
    given_particles,
    last_step_of,
)
from dsse_ros.search.step.metres_detection import detectors_of
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.drift.leeway import systematic
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.targets.ensemble import TracksBySteps

Floats = NDArray[np.float64]

BETWEEN_S = 30.0
"""Time in which particles are taken to drift straight during earlier searches."""
FARTHEST_M = 2e5
"""Farthest along an axis from the grid that earlier searches find particles."""
LEAST_LEFT = 1e-3
"""Least probability of being missed so far with which the particles still say where persons are."""


class Missed(NamedTuple):
    """Persons whom earlier searches may have missed.

    Attributes:
        forecast: Their particles; those of its `of_pos` state the POS.
        planned: Other particles, as many as plans are compared by.
        pos: The POS of the earlier searches.
    """

    forecast: EnsembleForecast
    planned: EnsembleForecast
    pos: float


def missed_persons(
    scenario: ResolvedScenario, rules: Rules, searches: Sequence[TrackSearch]
) -> Missed:
    """Return the persons of a search that begins after others.

    Args:
        scenario: The scenario of the search, with an incident.
        rules: Its rules, in metres.
        searches: The earlier searches; their times count from the beginning of this one.

    Raises:
        FieldError: If one of them is not over by then, or they have found nearly everybody.
    """
    ends_s = max(float(search.track.times_s[-1]) for search in searches)
    if ends_s > 0:
        now_s = begins_s(scenario)
        raise FieldError(
            f"begins must be at least {utc(math.ceil(now_s + ends_s))}, the end of the earlier "
            f"searches, got {utc(now_s)}"
        )
    check_memory(scenario, rules)
    weighted, left = {}, {}
    for draw in (Draw.BELIEF, Draw.PLANNING, Draw.POS):
        weighted[draw], left[draw] = _weighted(scenario, rules, searches, draw)
        if left[draw] < LEAST_LEFT:
            raise FieldError(
                f"after: the earlier searches must leave a probability of at least "
                f"{LEAST_LEFT:.1%}, got {left[draw]:.2%}"
            )
    rng = np.random.default_rng(scenario.ensemble_seed)
    weighted[Draw.PLANNING] = _drawn_from(weighted[Draw.PLANNING], PARTICLES, rng)
    forecast, planned = (
        EnsembleForecast(scenario, rules, draw=draw, given=weighted.__getitem__)
        for draw in (Draw.BELIEF, Draw.PLANNING)
    )
    return Missed(forecast, planned, 1.0 - left[Draw.POS])


def _weighted(
    scenario: ResolvedScenario, rules: Rules, searches: Sequence[TrackSearch], draw: Draw
) -> tuple[CellParticles, float]:
    """Return particles weighted by how likely the searches miss them, and the mean of that."""
    first_s = min(float(search.track.times_s[0]) for search in searches)
    last_s = max(float(search.track.times_s[-1]) for search in searches)
    numbers = np.arange(math.floor(first_s / BETWEEN_S), math.ceil(last_s / BETWEEN_S) + 1)
    before = BETWEEN_S * numbers.astype(np.float64)
    after = scenario.step_duration_s * np.arange(last_step_of(scenario, rules) + 1)
    drawn, objects, dies_s = scenario.incident_positions(
        np.concatenate([before, after]), generator_of(scenario, draw), scenario.particles
    )
    positions = iter(drawn)
    missed = _missed(searches, before, positions, scenario)
    left = float(missed.mean())
    tracks = TracksBySteps(
        positions, missed / max(missed.sum(), np.finfo(np.float64).tiny), objects,
        # They count from the first time.
        None if dies_s is None else lambda: dies_s() + before[0],
    )  # fmt: skip
    return given_particles(tracks, scenario, rules), left


def _missed(
    searches: Sequence[TrackSearch],
    times_s: Floats,
    positions: Iterator[Floats],
    scenario: ResolvedScenario,
) -> Floats:
    """Return the mean probability over the persons that searches miss each particle, (M,).

    Args:
        searches: The searches.
        times_s: (T,) float64.
        positions: Of the particles; those at these times are taken.
        scenario: The scenario.
    """
    multipliers = np.array(scenario.person_pod_multipliers)
    at_start = next(positions)
    count = len(at_start)
    missed = np.ones((len(multipliers), count))
    # A single cell holds all particles.
    starts, members = np.zeros((2, 1, 1), np.int32)
    binned = BinnedParticles(starts, members, np.zeros(count), np.zeros(count, np.int8))
    area = np.ones((1, 1), np.bool_)
    for start_s, end_s in pairwise(times_s.tolist()):
        at_end = next(positions)
        moves = np.array([at_start, at_end]) + FARTHEST_M
        places = ParticlePositions(
            binned, 2 * FARTHEST_M, moves.astype(np.float32), np.zeros(2), multipliers
        )
        for search in searches:
            track, lateral, goes_on = search.between(start_s, end_s)
            if len(track.times_s):
                passing_kernels.multiply_missed(
                    detectors_of([lateral], BETWEEN_S), track.points + FARTHEST_M,
                    (track.times_s - start_s) / BETWEEN_S, places, area, BETWEEN_S,
                    np.array([goes_on, True]), missed,
                )  # fmt: skip
        at_start = at_end
    of_mean: Floats = missed.mean(axis=0)
    return of_mean


def _drawn_from(particles: CellParticles, count: int, rng: np.random.Generator) -> CellParticles:
    """Return at most so many particles of equal weight, drawn from others by their weights."""
    count = min(count, len(particles.weights))
    chosen = systematic(particles.weights.tolist(), count, rng)
    assert particles.particles_m is not None
    return replace(
        particles, particles=particles.particles.take(chosen, axis=1),
        weights=np.full(count, 1.0 / count),
        objects=None if particles.objects is None else particles.objects[chosen],
        appearances=particles.appearances[chosen],
        particles_m=particles.particles_m.take(chosen, axis=1),
        dies=None if particles.dies is None else particles.dies[chosen],
    )  # fmt: skip
