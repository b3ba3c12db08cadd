# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The motion of the persons of a belief as a Markov chain."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled
from dsse_ros.search.belief.belief import Belief
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief
from dsse_ros.search.belief.motion_kernels import NEGLIGIBLE, ROW, move_probabilities, offset_of
from dsse_ros.search.belief.protocol import TargetBelief
from dsse_ros.world.targets.motion import NO_STEP, STAND_STILL, STEPS


class TargetChain(NamedTuple):
    """The persons' motion in the next H steps as a Markov chain, without any look.

    It has N states in H + 1 layers, one per step from now on. The states of layer h in column i are
    starts[h, i] .. starts[h, i + 1] - 1, and layer h + 1 follows layer h.

    Attributes:
        starts: (H + 1, C + 1) int64, for C columns, see `TargetForecast`.
        prior: Probabilities of the states of layer 0, float64.
        persons: (N,) int64, number of a person with the POD of the person in each state.
        first: (N + 1,) int64, the steps from state s are first[s] .. first[s + 1] - 1; there are
            none from the last layer.
        to: (E,) int64, the state that each step leads to.
        chance: (E,) float64, its probability.
    """

    starts: NDArray[np.int64]
    prior: NDArray[np.float64]
    persons: NDArray[np.int64]
    first: NDArray[np.int64]
    to: NDArray[np.int64]
    chance: NDArray[np.float64]


def chain_of(belief: TargetBelief, horizon: int) -> TargetChain:
    """Return the missing persons' motion in the next steps, without what is negligible.

    Args:
        belief: The belief; it stays as it is.
        horizon: H, at most that of its forecast.
    """
    if isinstance(belief, EnsembleBelief):
        return _chain_of_tracks(belief, horizon)
    assert isinstance(belief, Belief)
    return _chain_of_cells(belief, horizon)


def _chain_of_tracks(belief: EnsembleBelief, horizon: int) -> TargetChain:
    """Return the tracks of the particles as a chain, in which each state has one step."""
    forecast, weights = belief.forecast, belief.of_missing()
    members = forecast.particles().members
    kept = weights.max(axis=0) > NEGLIGIBLE
    first_step = forecast.first_step + belief.step
    rows = np.minimum(first_step + np.arange(horizon + 1), len(members) - 1)
    # (H + 1, M), the particles of each layer; each has a state for every detection class.
    order = members[rows][kept[members[rows]]].reshape(horizon + 1, -1)
    classes, (layers, count) = len(weights), order.shape
    place = np.empty((layers, len(kept)), np.int64)
    np.put_along_axis(place, order, np.arange(count), axis=1)
    after = np.take_along_axis(place[1:], order[:-1], axis=1)
    after += count * np.arange(1, layers)[:, None]
    to = (classes * after[..., None] + np.arange(classes)).ravel()
    edges = np.arange(forecast.padded.cells + 1)
    starts = [
        layer * count + np.searchsorted(forecast.columns(forecast.cells[row, particles]), edges)
        for layer, (row, particles) in enumerate(zip(rows, order, strict=True))
    ]
    return TargetChain(
        classes * np.stack(starts), weights.T[order[0]].ravel(),
        np.tile(belief.examples, layers * count),
        np.minimum(np.arange(classes * layers * count + 1), len(to)), to, np.ones(len(to)),
    )  # fmt: skip


def _chain_of_cells(belief: Belief, horizon: int) -> TargetChain:
    """Return the motion from cell to cell as a chain."""
    forecast, ahead = belief.forecast, belief.copy()
    ahead.density = _kept(belief.of_missing())
    density = ahead.of_missing()
    drifts = len(density) // len(belief.examples)
    starts = np.zeros((horizon + 1, density.shape[1] + 1), np.int64)
    prior = density.T[density.T > 0.0]
    numbers, rows = number_states(density, starts[0])
    layers = []
    for h in range(horizon):
        step = forecast.moves.at(forecast.prepare(forecast.first_step + ahead.step))
        ahead.advance()
        density = _kept(ahead.of_missing())
        before, starts[h + 1, 0] = rows, starts[h, -1]
        numbers, rows = number_states(density, starts[h + 1])
        steps = chain_layer(forecast.constants, forecast.sea, step, starts[h], before, numbers)
        layers.append((before, *steps))
    layers.append((rows, np.zeros(len(rows), np.int64), *np.empty((2, 0))))
    of_rows, counts, to, chance = (np.concatenate(arrays) for arrays in zip(*layers, strict=True))
    first = np.concatenate([[0], np.cumsum(counts)])
    persons = belief.examples[of_rows // drifts]
    return TargetChain(starts, prior, persons, first, to.astype(np.int64), chance)


def _kept(density: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(density > NEGLIGIBLE, density, 0.0)


@compiled()
def number_states(density, starts):
    """Number the states of a layer, the cells with a probability, column by column.

    Args:
        density: (C K, S S) float64.
        starts: (S S + 1,) int64 in and out: the first number is in, see `TargetChain`.

    Returns:
        (C K, S S) int64, the number of each cell's state, -1 for none, and (N,) int64, the row of
        each state.
    """
    numbers = np.full(density.shape, -1)
    rows = np.empty(density.size, np.int64)
    state = starts[0]
    for i in range(density.shape[1]):
        starts[i] = state
        for k in range(len(density)):
            if density[k, i] > 0.0:
                numbers[k, i], rows[state - starts[0]] = state, k
                state += 1
    starts[-1] = state
    return numbers, rows[: state - starts[0]].copy()


@compiled()
def chain_layer(constants, sea, step, starts, rows, numbers):
    """Return the steps from the states of a layer.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of a `Forecast`.
        step: One step of a `Forecast`.
        starts: (S S + 1,) of `number_states`.
        rows: (N,) of `number_states`.
        numbers: (C K, S S) of `number_states`, for the next layer.

    Returns:
        (N,) int64, the number of steps from each state; (E,) int64, the states that they lead to;
        (E,) float64, their probabilities.
    """
    directions, count, base = step.directions, 0, starts[0]
    row = np.empty(ROW)
    counts = np.zeros(len(rows), np.int64)
    to, chance = np.empty(STEPS * len(rows), np.int64), np.empty(STEPS * len(rows))
    for i in range(len(starts) - 1):
        for s in range(starts[i] - base, starts[i + 1] - base):
            k = rows[s]
            direction = directions[k % len(directions)]
            if direction == STAND_STILL:
                row[:STEPS] = 0.0
                row[NO_STEP] = 1.0
            else:
                move_probabilities(constants[0], sea, step, i, direction, row)
            for number in range(STEPS):
                if row[number] > 0.0:
                    n = numbers[k, i + offset_of(constants[0], number)]
                    if n >= 0:
                        to[count], chance[count] = n, row[number]
                        counts[s] += 1
                        count += 1
    return counts, to[:count].copy(), chance[:count].copy()
