# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The conformance test of target models passes the shipped ones, and sees what is broken."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numba import njit

from dsse_ros.conformance.target_model import target_model_test
from dsse_ros.targets.best_cell import best_cell_chances, move_to_best_cell
from dsse_ros.targets.constant_drift import tracks
from dsse_ros.targets.drawn_cell import drift_chances, move_with_drift
from dsse_ros.targets.ensemble import Ensemble, Tracks
from dsse_ros.targets.motion import PersonMotion
from dsse_ros.targets.registry import MOTIONS, TARGET_MODELS


@pytest.mark.slow
@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
@pytest.mark.parametrize("name", TARGET_MODELS)
def test_shipped_models_keep_their_promises(name: str, rules: str) -> None:
    target_model_test(TARGET_MODELS[name], rules=rules)


@pytest.mark.slow
def test_a_model_need_not_be_registered_and_is_not_afterwards() -> None:
    before = dict(TARGET_MODELS)
    target_model_test(PersonMotion("drifts", move_with_drift, drift_chances, own_drift=True))
    target_model_test(Ensemble("drifts", tracks))
    assert before == TARGET_MODELS


@njit
def more_drift(
    constants: Any, sea: Any, x: int, y: int, window: Any, out: Any, scratch: Any
) -> None:
    drift_chances(constants, sea, x, y, window, out, scratch)
    out[:9] *= 0.95
    out[9] = 1.0 - out[:9].sum()


@njit
def not_one(constants: Any, sea: Any, x: int, y: int, window: Any, out: Any, scratch: Any) -> None:
    drift_chances(constants, sea, x, y, window, out, scratch)
    out[4] *= 0.9


@njit
def below_zero(
    constants: Any, sea: Any, x: int, y: int, window: Any, out: Any, scratch: Any
) -> None:
    drift_chances(constants, sea, x, y, window, out, scratch)
    out[0], out[8] = out[0] + 1.0, out[8] - 1.0


@njit
def stay(constants: Any, sea: Any, x: int, y: int, window: Any, out: Any, scratch: Any) -> None:
    out[:] = 0.0
    out[4] = 1.0


@njit
def leap(constants: Any, world: Any, sea: Any, person: Any, direction: int) -> None:
    person.x += 2


WRONG_MOTIONS = {
    "not where they should be": PersonMotion("", move_with_drift, more_drift, own_drift=True),
    "do not sum to 1": PersonMotion("", move_with_drift, not_one, own_drift=True),
    "not from 0 to 1": PersonMotion("", move_with_drift, below_zero, own_drift=True),
    "a step of probability 0": PersonMotion("", move_to_best_cell, stay),
    "further than to a cell of the window": PersonMotion("", leap, best_cell_chances),
}


@pytest.mark.slow
@pytest.mark.parametrize("broken", WRONG_MOTIONS)
def test_a_motion_that_breaks_a_promise_is_seen(broken: str) -> None:
    assert set(map(id, WRONG_MOTIONS.values())).isdisjoint(map(id, MOTIONS.values()))
    with pytest.raises(AssertionError, match=broken) as raised:
        target_model_test(WRONG_MOTIONS[broken])
    assert "\n" not in str(raised.value)


class EachAnother:
    """Tracks that drift further each time they are drawn."""

    def __init__(self) -> None:
        self._calls = itertools.count()

    def __call__(self, scenario: Any, steps: int, rng: np.random.Generator, count: int) -> Tracks:
        positions, weights = tracks(scenario, steps, rng, count)
        # The first two are drawn with one generator, the others for the truth and the belief.
        east = 0.2 * scenario.cell_size * max(next(self._calls) - 2, 0)
        return Tracks(positions + np.array([east, 0.0]), weights)


def of_global_state(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> Tracks:
    positions, weights = tracks(scenario, steps, rng, count)
    return Tracks(positions + np.random.standard_normal(positions.shape), weights)  # noqa: NPY002


def too_heavy(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> Tracks:
    positions, weights = tracks(scenario, steps, rng, count)
    return Tracks(positions, 1.01 * weights)


def too_short(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> Tracks:
    positions, weights = tracks(scenario, steps, rng, count)
    return Tracks(positions[:-1], weights)


def negative(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> Tracks:
    positions, weights = tracks(scenario, steps, rng, count)
    weights[:2] = -weights[0], 3 * weights[0]
    return Tracks(positions, weights)


WRONG_ENSEMBLES = {
    "persons are not where the belief has them": EachAnother(),
    "the same generator gives different tracks": of_global_state,
    "weights must sum to 1, got 1.01": too_heavy,
    "positions must be": too_short,
    "weights must be >= 0": negative,
}


@pytest.mark.parametrize("broken", WRONG_ENSEMBLES)
def test_an_ensemble_that_breaks_a_promise_is_seen(broken: str) -> None:
    before = dict(TARGET_MODELS)
    with pytest.raises(AssertionError, match=broken) as raised:
        target_model_test(Ensemble("", WRONG_ENSEMBLES[broken]))
    assert "\n" not in str(raised.value)
    assert before == TARGET_MODELS
