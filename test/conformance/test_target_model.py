# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The conformance test of target models passes the shipped ones, and sees what is broken."""

from __future__ import annotations

import itertools
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.conformance.target_model import target_model_test
from dsse_ros.world.targets.best_cell import BEST_CELL
from dsse_ros.world.targets.constant_drift import tracks
from dsse_ros.world.targets.ensemble import Ensemble, WeightedTracks
from dsse_ros.world.targets.registry import TARGET_MODELS


@pytest.mark.slow
@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
@pytest.mark.parametrize("name", TARGET_MODELS)
def test_shipped_models_keep_their_promises(name: str, rules: str) -> None:
    target_model_test(TARGET_MODELS[name], rules=rules)


@pytest.mark.slow
def test_an_ensemble_need_not_be_registered_and_is_not_afterwards() -> None:
    before = dict(TARGET_MODELS)
    target_model_test(Ensemble("drifts", tracks))
    assert before == TARGET_MODELS


def test_a_motion_must_be_registered() -> None:
    with pytest.raises(AssertionError, match="must be registered in MOTIONS"):
        target_model_test(BEST_CELL._replace(doc="another"))


@pytest.mark.slow
def test_a_motion_that_breaks_a_promise_is_seen(tmp_path: Path) -> None:
    script = Path(__file__).with_name("broken_motions.py")
    # What is compiled for this run alone is not worth optimising.
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_OPT": "0"}
    run = subprocess.run([sys.executable, script], env=env, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    lines = dict(line.split(": ", 1) for line in run.stdout.splitlines())
    assert lines.keys() == {"window", "drift", "random_walk", "markov_chain"}
    for name, line in lines.items():
        assert re.search("not where the belief has them|is below 0|the outside -", line), name


class EachAnother:
    """Tracks that drift further each time they are drawn."""

    def __init__(self) -> None:
        self._calls = itertools.count()

    def __call__(
        self, scenario: Any, steps: int, rng: np.random.Generator, count: int
    ) -> WeightedTracks:
        positions, weights, *_ = tracks(scenario, steps, rng, count)
        # The first two are drawn with one generator, the others for the truth and the belief.
        east = 0.2 * scenario.cell_size * max(next(self._calls) - 2, 0)
        return WeightedTracks(positions + np.array([east, 0.0]), weights)


def of_global_state(
    scenario: Any, steps: int, rng: np.random.Generator, count: int
) -> WeightedTracks:
    positions, weights, *_ = tracks(scenario, steps, rng, count)
    return WeightedTracks(positions + np.random.standard_normal(positions.shape), weights)  # noqa: NPY002


def too_heavy(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> WeightedTracks:
    positions, weights, *_ = tracks(scenario, steps, rng, count)
    return WeightedTracks(positions, 1.01 * weights)


def too_short(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> WeightedTracks:
    positions, weights, *_ = tracks(scenario, steps, rng, count)
    return WeightedTracks(positions[:-1], weights)


def negative(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> WeightedTracks:
    positions, weights, *_ = tracks(scenario, steps, rng, count)
    weights[:2] = -weights[0], 3 * weights[0]
    return WeightedTracks(positions, weights)


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
