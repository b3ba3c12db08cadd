# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Intervals agree with published examples and cover as often as they say."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.intervals import contains, of_mean, quantile


def test_the_interval_of_a_mean_covers_it_as_often_as_it_says() -> None:
    samples = np.random.default_rng(0).normal(3.0, 2.0, (20_000, 50))
    covered = np.mean([contains(of_mean(mean, 2.0, 50, 0.9), 3.0) for mean in samples.mean(axis=1)])
    assert covered == pytest.approx(0.9, abs=0.01)


def test_the_normal_quantile_is_that_of_the_tables() -> None:
    assert quantile(0.99) == pytest.approx(2.5758, abs=1e-4)
