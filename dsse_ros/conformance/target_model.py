# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The promises of a target model, either a motion of persons or an ensemble, tested."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.conformance.registered import registered
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.belief.protocol import TargetBelief
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.cell_tracks import last_step_of, tracks_of
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.rules import Rules, profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.targets.ensemble import Ensemble, WeightedTracks, check_tracks
from dsse_ros.world.targets.motion import PersonMotion
from dsse_ros.world.targets.registry import ENSEMBLES, MOTIONS, TargetModel

STEPS = 30
WORLDS = 4000
FUTURES = 20_000
HORIZON = 8
SUM_TOLERANCE = 1e-6

_LEAST = 10.0
"""Cells with a smaller expected count are pooled."""
SIGMAS = 6.0
"""Samples of the same distribution differ by more than this once in a billion times."""

SCENARIO = Scenario(
    grid_size=15, person_initial_position=(5, 5), timestep_limit=STEPS, pre_search_minutes=1.0
)


def target_model_test(
    model: TargetModel,
    *,
    rules: str | Rules = "v2",
    seed: int = 0,
    scenario: Scenario = SCENARIO,
) -> None:
    """Test that a target model keeps the promises that the search and the beliefs rely on.

    A motion must be registered in `MOTIONS`, because the search and the beliefs have the registered
    motions compiled in. An ensemble need not be, and the test does not leave it registered.

    Args:
        model: The model.
        rules: The rules of the search, or the name of their profile; persons move by the model.
        seed: Seed of all draws.
        scenario: The scenario, with a mission of at least `STEPS` steps.

    Raises:
        AssertionError: If a promise is broken; one line names it.
    """
    chosen = rules if isinstance(rules, Rules) else profile(rules)
    if isinstance(model, PersonMotion):
        names = [name for name, motion in MOTIONS.items() if motion is model]
        assert names, "the motion must be registered in MOTIONS before the search is imported"
        _test_search(scenario, chosen.override(person_motion=names[0]), seed)
        return
    with registered(ENSEMBLES, model) as name:
        ruled = chosen.override(person_motion=name)
        _test_tracks(model, scenario, ruled, seed)
        _test_search(scenario, ruled, seed)


def _test_tracks(model: Ensemble, stated: Scenario, rules: Rules, seed: int) -> None:
    """Test the draws of an ensemble on its own."""
    scenario = stated.resolve(rules)
    steps = last_step_of(scenario, rules)
    draws = []
    for _ in range(2):
        drawn = model.tracks(scenario, steps, np.random.default_rng(seed), 1000)
        tracks = WeightedTracks(*drawn)
        try:
            check_tracks(tracks, steps)
        except ValueError as error:
            raise AssertionError(f"tracks: {error}") from None
        draws.append(tracks)
        # Detect models that draw from NumPy's global generator.
        np.random.random()  # noqa: NPY002
    first, second = draws
    same = np.array_equal(first.positions, second.positions, equal_nan=True)
    assert same and np.array_equal(first.weights, second.weights), (
        "tracks: the same generator gives different tracks"
    )


def _test_search(stated: Scenario, rules: Rules, seed: int) -> None:
    """Test that the persons' positions agree with a belief without updates, step after step."""
    scenario = stated.override(ensemble_seed=seed).resolve(rules)
    world, twin = (World(scenario, rules, WORLDS, write_maps=False) for _ in range(2))
    for each in (world, twin):
        each.seed(seed)
        each.reset()
    belief = forecast_for(scenario, rules, horizon=HORIZON).belief()
    hold = np.full(world.drones.shape, NO_ACTION, np.int8)
    inflation = _inflation(scenario, rules)
    for step in range(STEPS):
        poc, outside = _poc(belief)
        persons = world.persons
        cells = _counted(persons["x"].ravel(), persons["y"].ravel(), world.grid_size)
        beyond = _excess(cells, np.append(poc.ravel(), outside), inflation)
        assert beyond <= SIGMAS, (
            f"step {step}: persons are not where the belief has them, by {beyond:.1f} sigmas"
        )
        if step == STEPS // 2:
            _test_futures(belief, seed)
        for each in (world, twin):
            each.step(hold)
        belief.advance()
        assert world.state_bytes() == twin.state_bytes(), (
            f"step {step + 1}: the same seed gives a different mission"
        )
        if rules.ends_together and world.worlds["done"].any():
            break


def _poc(belief: TargetBelief) -> tuple[NDArray[np.float64], float]:
    """Return the probability of each cell, and that outside all cells."""
    poc = belief.poc()
    assert (poc >= 0.0).all(), f"step {belief.step}: a probability of containment is below 0"
    total = float(poc.sum())
    outside = belief.outside if isinstance(belief, EnsembleBelief) else 1.0 - total
    assert abs(total + outside - 1.0) <= SUM_TOLERANCE and outside >= -SUM_TOLERANCE, (
        f"step {belief.step}: the grid has {total:.6f} and the outside {outside:.6f}, not 1 in all"
    )
    return poc, max(outside, 0.0)


def _inflation(scenario: Scenario, rules: Rules) -> float:
    """Return the variance of counts divided by that of draws from exact chances."""
    tracks = tracks_of(scenario.resolve(rules), rules)
    if tracks is None:
        return 1.0
    truth = np.diff(tracks.cumulative, prepend=0.0)
    return 1.0 + WORLDS * float((truth**2).sum() + (tracks.weights**2).sum())


def _counted(x: NDArray[Any], y: NDArray[Any], grid: GridShape) -> NDArray[np.int64]:
    """Return the number of persons in each cell of a grid, and last the number outside it."""
    inside = (x >= 0) & (x < grid.columns) & (y >= 0) & (y < grid.rows)
    cells = np.where(inside, y * grid.columns + x, grid.cells)
    return np.bincount(cells, minlength=grid.cells + 1)


def _test_futures(belief: TargetBelief, seed: int) -> None:
    """Test that futures start from the belief and, for an ensemble, follow it."""
    forecast, ahead = belief.forecast, belief.copy()
    grid = forecast.scenario.grid_size
    rng = np.random.default_rng(seed)
    cells, persons, *_ = belief.futures(FUTURES, HORIZON, rng)
    assert cells.shape == (HORIZON + 1, FUTURES) and persons.shape == (FUTURES,), (
        f"futures of shape {cells.shape}, not {(HORIZON + 1, FUTURES)}"
    )
    exact = HORIZON if isinstance(belief, EnsembleBelief) else 0
    for h in range(exact + 1):
        row, col = np.divmod(cells[h], forecast.padded.columns)
        margin = (forecast.padded.columns - grid.columns) // 2
        poc, outside = _poc(ahead)
        counts = _counted(col - margin, row - margin, grid)
        beyond = _excess(counts, np.append(poc.ravel(), outside))
        assert beyond <= SIGMAS, (
            f"futures are not where the belief is after {h} steps, by {beyond:.1f} sigmas"
        )
        ahead.advance()


def _excess(
    counts: NDArray[np.int64], chances: NDArray[np.float64], inflation: float = 1.0
) -> float:
    """Return the excess of chi-square over its mean, in standard deviations.

    Args:
        counts: (K,) count of each of K results.
        chances: (K,) probability of each result; they sum to 1.
        inflation: Variance of a count over that of N independent draws from the chances; above 1
            if the chances are estimated from a sample.
    """
    total = int(counts.sum())
    expected = chances * total
    few = expected < _LEAST
    counted = np.append(counts[~few], counts[few].sum()).astype(np.float64)
    wanted = np.append(expected[~few], expected[few].sum())
    # Limit the weight of a few counts where hardly any are expected.
    spread = np.maximum(wanted, 1.0) * inflation
    chi_square = float(((counted - wanted) ** 2 / spread).sum())
    freedom = max(len(counted) - 1, 1)
    return (chi_square - freedom) / math.sqrt(2.0 * freedom)
