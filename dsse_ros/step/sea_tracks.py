# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ensemble of a scenario, drawn once for the truth and once for the belief, and cached."""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.fields import FieldError
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.step.ensemble_kernels import FAR
from dsse_ros.targets.ensemble import Ensemble, Tracks, check_tracks
from dsse_ros.targets.registry import TARGET_MODELS

LARGEST_BYTES = 1 << 30
"""Memory limit of a cached ensemble."""
KEPT = 4
"""Number of cached ensembles, the most recent ones."""


class SeaTracks(NamedTuple):
    """The tracks of a scenario in cells, by step of the sea from the start of its drift.

    After the last step nothing moves.

    Attributes:
        truth: (T, M, 2) int16, cells (x, y) of the tracks that persons follow.
        cumulative: (M,) float64, cumulative sums of the tracks' weights.
        particles: (T, M', 2) int16, cells of a belief's particles, drawn with another seed.
        weights: (M',) float64, weights of the particles.
        maps: (T, G, G) float32 as [y, x], the probability of each cell by the particles. They leave
            out probability outside the grid or the area and are not scaled to sum to 1.
    """

    truth: NDArray[np.int16]
    cumulative: NDArray[np.float64]
    particles: NDArray[np.int16]
    weights: NDArray[np.float64]
    maps: NDArray[np.float32]


_kept: list[tuple[Ensemble, ResolvedScenario, Rules, SeaTracks]] = []
_lock = threading.Lock()


def tracks_of(scenario: ResolvedScenario, rules: Rules) -> SeaTracks | None:
    """Return the tracks of a scenario, or None if its persons do not follow an ensemble.

    Truth and particles are drawn from the same model, with the two seeds that
    `np.random.SeedSequence(ensemble_seed)` spawns; an incident may state another law for the truth.

    Raises:
        FieldError: If they would take too much memory.
        ValueError: If the ensemble breaks its contract.
    """
    model = TARGET_MODELS[rules.person_motion]
    if not isinstance(model, Ensemble):
        return None
    with _lock:
        for of_model, of_scenario, of_rules, kept in _kept:
            if of_model is model and of_scenario == scenario and of_rules == rules:
                return kept
        made = _made(model, scenario, rules)
        _kept.append((model, scenario, rules, made))
        del _kept[:-KEPT]
        return made


def last_step_of(scenario: ResolvedScenario, rules: Rules) -> int:
    """Return the number of steps of the sea until the time limit of a mission."""
    mission = scenario.timestep_limit + rules.time_out_grace + 1
    return scenario.pre_search_steps + rules.reset_sea_steps + mission


def _made(model: Ensemble, scenario: ResolvedScenario, rules: Rules) -> SeaTracks:
    steps, g = last_step_of(scenario, rules), scenario.grid_size
    size = (steps + 1) * (8 * scenario.particles + 4 * g * g)
    if size > LARGEST_BYTES:
        raise FieldError(
            f"tracks and maps of person_motion {rules.person_motion} must be at most "
            f"{LARGEST_BYTES >> 20} MiB, got {scenario.particles} particles, {steps} steps and a "
            f"grid of {g}"
        )
    of_truth, of_belief = _generators(scenario)
    truth, truth_weights = _drawn(model, scenario.truth, steps, of_truth)
    particles, weights = _drawn(model, scenario, steps, of_belief)
    maps = np.empty((steps + 1, g, g), np.float32)
    for step in range(steps + 1):
        maps[step] = poc_of_cells(particles[step], weights, g, scenario.area_mask)
    return SeaTracks(truth, np.cumsum(truth_weights), particles, weights, maps)


def _generators(scenario: ResolvedScenario) -> tuple[np.random.Generator, np.random.Generator]:
    """Return the generators of truth and belief."""
    truth, belief = np.random.SeedSequence(scenario.ensemble_seed).spawn(2)
    return np.random.default_rng(truth), np.random.default_rng(belief)


def particle_positions(scenario: ResolvedScenario, rules: Rules) -> NDArray[np.float32]:
    """Return the positions of a belief's particles in metres, by step of the sea.

    The search keeps only their cells, so they are drawn again, with the same seed.

    Args:
        scenario: The scenario.
        rules: The rules of the search; persons must follow an ensemble.

    Returns:
        (T, M, 2) float32, to the east and to the north of the grid's south-west corner.
    """
    model = TARGET_MODELS[rules.person_motion]
    assert isinstance(model, Ensemble)
    steps, (_, of_belief) = last_step_of(scenario, rules), _generators(scenario)
    drawn = Tracks(*model.tracks(scenario, steps, of_belief, scenario.particles)).positions
    made = drawn.astype(np.float32)
    made[..., 1] = scenario.grid_size * scenario.cell_size - drawn[..., 1]
    return made


def _drawn(
    model: Ensemble, scenario: ResolvedScenario, steps: int, rng: np.random.Generator
) -> tuple[NDArray[np.int16], NDArray[np.float64]]:
    """Return cells and weights of tracks.

    Raises:
        ValueError: If the ensemble breaks its contract.
    """
    tracks = Tracks(*model.tracks(scenario, steps, rng, scenario.particles))
    check_tracks(tracks, steps)
    cells = np.floor(tracks.positions / scenario.cell_size)
    lost = ~np.isfinite(cells).all(axis=2)
    np.clip(cells, -FAR, FAR, out=cells)
    cells[lost] = -FAR
    # Copy the weights: the compiled functions do not accept read-only arrays.
    return cells.astype(np.int16), np.array(tracks.weights, np.float64)


def poc_of_cells(
    cells: NDArray[np.int16],
    weights: NDArray[np.float64],
    grid_size: int,
    area: NDArray[np.bool_] | None,
) -> NDArray[np.float64]:
    """Return the weight in each cell, (G, G) float64 as [y, x], 0 outside the area.

    Args:
        cells: (M, 2) cells (x, y).
        weights: (M,) float64.
        grid_size: G.
        area: (G, G) bool, the searched cells; None for all.
    """
    x, y = cells[:, 0].astype(np.int64), cells[:, 1].astype(np.int64)
    inside = (x >= 0) & (x < grid_size) & (y >= 0) & (y < grid_size)
    column = (y * grid_size + x)[inside]
    poc = np.bincount(column, weights[inside], grid_size**2).astype(np.float64)
    poc = poc.reshape(grid_size, grid_size)
    if area is not None:
        poc[~area] = 0.0
    return poc
