# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Intervals agree with published examples and cover as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.intervals import contains, of_mean, of_share, quantile


def test_wilsons_interval_agrees_with_newcombes_examples() -> None:
    # Newcombe 1998, table I, method 3: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
    for found, count, low, high in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):
        assert of_share(found / count, count, 0.95) == pytest.approx((low, high), abs=5e-5)


@given(st.floats(0.0, 1.0), st.integers(1, 10**6))
def test_a_share_lies_in_its_interval_within_0_and_1(share: float, count: int) -> None:
    low, high = of_share(share, count)
    assert -1e-12 <= low <= share + 1e-12
    assert share - 1e-12 <= high <= 1 + 1e-12


def test_the_interval_of_a_mean_covers_it_as_often_as_it_says() -> None:
    samples = np.random.default_rng(0).normal(3.0, 2.0, (20_000, 50))
    covered = np.mean([contains(of_mean(mean, 2.0, 50, 0.9), 3.0) for mean in samples.mean(axis=1)])
    assert covered == pytest.approx(0.9, abs=0.01)


def test_the_normal_quantile_is_that_of_the_tables() -> None:
    assert quantile(0.99) == pytest.approx(2.5758, abs=1e-4)
