# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The promises of a belief, tested for any target model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.belief.protocol import LooksToCome, TargetBelief
from dsse_ros.search.step.looks import Looked

STEPS = 12
FUTURES = 20_000
TOLERANCE = 1e-9
SAMPLED = 5.0 * FUTURES**-0.5
"""Largest error of a share of the futures."""


def belief_test(belief: TargetBelief, *, horizon: int = 4, seed: int = 0) -> None:
    """Test that a belief follows Bayes' rule and that its expectations come true.

    Args:
        belief: A belief at the start of a mission for one person. The test resets it at the end.
        horizon: Steps that its forecast can look ahead.
        seed: Seed of the looks.

    Raises:
        AssertionError: If the belief breaks a promise; one line names it.
    """
    persons = belief.forecast.scenario.person_amount
    assert persons == 1, f"person_amount must be 1, got {persons}"
    rng, first = np.random.default_rng(seed), belief.poc()
    _test_start(belief)
    for step in range(STEPS):
        assert belief.step == step, f"step: {belief.step} after {step} steps"
        _test_expectation(belief, horizon, rng)
        _test_looks(belief, rng)
        _test_futures(belief, horizon, rng)
        _test_copy(belief)
        belief.advance()
    belief.reset()
    _test_start(belief)
    assert np.array_equal(belief.poc(), first), "reset: the belief does not start as it did"


def _test_start(belief: TargetBelief) -> None:
    assert belief.step == 0 and belief.pos == 0.0, "a mission starts at step 0 with POS 0"
    _test_sum(belief)


def _test_sum(belief: TargetBelief) -> None:
    poc, outside = belief.poc(), belief.outside
    shape = belief.forecast.scenario.grid_size.matrix
    assert poc.shape == shape, f"poc: shape {poc.shape}, not {shape}"
    assert (poc >= 0.0).all() and outside >= 0.0, "poc: a probability is below 0"
    total = float(poc.sum()) + outside
    assert abs(total - 1.0) <= TOLERANCE, f"poc and outside sum to {total:.12g}, not 1"


def _test_looks(belief: TargetBelief, rng: np.random.Generator) -> None:
    """Test Bayes' rule for looks that found nobody, one by one and together."""
    grid = belief.forecast.scenario.grid_size
    together, alone = belief.copy(), belief.copy()
    poc, outside, pos = belief.poc(), belief.outside, belief.pos
    likely = np.flatnonzero(poc.ravel() > 1e-6)
    assert len(likely), "poc: no cell is possible"
    cells = [divmod(int(i), grid.columns) for i in rng.choice(likely, 2)]
    looks = [Looked((col, row), rng.uniform(0.0, 0.9, 1)) for row, col in cells]
    left = poc.copy()
    for (col, row), pods in looks:
        left[row, col] *= 1.0 - pods[0]
    missed = float(left.sum()) + outside
    together.update(looks)
    for look in looks:
        alone.update([look])
    for learnt in (together, alone):
        off = float(np.abs(learnt.poc() - left / missed).max())
        assert off <= TOLERANCE, f"update: POC is {off:.3g} off Bayes' rule"
        gained = pos + (1.0 - pos) * (1.0 - missed)
        assert abs(learnt.pos - gained) <= TOLERANCE, f"pos: {learnt.pos:.12g}, not {gained:.12g}"
        _test_sum(learnt)
    area = belief.forecast.area
    excluded = [] if area is None else [(int(x), int(y)) for y, x in np.argwhere(~area)]
    nowhere = belief.copy()
    nowhere.update([Looked(cell, np.ones(1)) for cell in [(-1, grid.rows), *excluded]])
    off = max(float(np.abs(nowhere.poc() - poc).max()), abs(nowhere.pos - pos))
    assert off <= TOLERANCE, "update: a look off the grid or outside the area changes the belief"
    belief.update(looks)


def _test_expectation(belief: TargetBelief, horizon: int, rng: np.random.Generator) -> None:
    """Test that the expected finds of looks equal the gain in POS after the looks."""
    forecast, ahead = belief.forecast, belief.copy()
    before = belief.poc()
    steps = np.sort(rng.integers(0, horizon, 6))
    cells = [
        (int(col), int(row)) for col, row in rng.integers(0, forecast.scenario.grid_size, (6, 2))
    ]
    pods = rng.uniform(0.0, 1.0, (6, 1))
    columns = np.array([forecast.column(cell) for cell in cells])
    expected = belief.outlook(horizon, 1.0)(LooksToCome(np.array([0, 6]), steps, columns, pods))
    for h in range(horizon):
        ahead.update([Looked(cells[q], pods[q]) for q in np.flatnonzero(steps == h)])
        ahead.advance()
    gained = (ahead.pos - belief.pos) / (1.0 - belief.pos)
    assert abs(expected.finds[0] - gained) <= TOLERANCE, (
        f"outlook: {expected.finds[0]:.12g} finds, and {gained:.12g} once the looks are done"
    )
    left = float(expected.left.sum())
    assert abs(left + gained - 1.0) <= TOLERANCE, f"outlook: left sums to {left:.12g}"
    assert np.array_equal(belief.poc(), before), "outlook: it changes the belief"


def _test_futures(belief: TargetBelief, horizon: int, rng: np.random.Generator) -> None:
    """Test that futures start from the belief, and that equal generators draw equal futures."""
    seed = int(rng.integers(1 << 30))
    drawn = [belief.futures(FUTURES, horizon, np.random.default_rng(seed)) for _ in range(2)]
    cells, persons, *_ = drawn[0]
    assert cells.shape == (horizon + 1, FUTURES), f"futures: shape {cells.shape}"
    assert (persons == 0).all(), "futures: a person other than the only one"
    assert np.array_equal(cells, drawn[1].cells), "futures: the same generator draws different ones"
    off = float(np.abs(_shares(belief, cells[0]) - belief.poc()).max())
    assert off <= SAMPLED, f"futures: a cell's share is {off:.3g} off its POC at the start"


def _shares(belief: TargetBelief, columns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the share of these columns in each cell of the grid, (R, C)."""
    counts = np.bincount(columns, minlength=belief.forecast.padded.cells)
    return _inner(belief, counts / len(columns))


def _inner(belief: TargetBelief, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of the cells of the grid, (R, C), from those of all columns."""
    padded, grid = belief.forecast.padded, belief.forecast.scenario.grid_size
    margin = (padded.columns - grid.columns) // 2
    inner: NDArray[np.float64] = values.reshape(padded.matrix)[
        margin : margin + grid.rows, margin : margin + grid.columns
    ]
    return inner


def _test_copy(belief: TargetBelief) -> None:
    """Test that a copy is independent."""
    poc, pos, step = belief.poc(), belief.pos, belief.step
    twin = belief.copy()
    assert np.array_equal(twin.poc(), poc) and twin.pos == pos, "copy: another belief"
    row, col = divmod(int(poc.argmax()), poc.shape[1])
    twin.update([Looked((col, row), np.full(1, 0.5))])
    twin.advance()
    same = np.array_equal(belief.poc(), poc) and belief.pos == pos and belief.step == step
    assert same, "copy: it changes the belief that it was copied from"
