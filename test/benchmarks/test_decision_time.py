# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mean times are those of the exact filter."""

from __future__ import annotations

import json

import pytest

from benchmarks.bench import RESULTS
from benchmarks.decision_time import mean_steps
from dsse_ros.planners.options import BeamOptions


def test_each_step_counts_with_the_probability_that_nobody_was_found_before() -> None:
    options = BeamOptions(samples=64, width=4)
    times = [mean_steps("santos_8", options, 0, most=most) for most in (1, 8, 16)]
    assert times[0] == pytest.approx(1.0)
    assert times[0] < times[1] <= 8.0 and times[1] < times[2] < 16.0


def test_the_last_gains_are_as_small_as_the_page_states() -> None:
    rows = json.loads((RESULTS / "decision_time.json").read_text(encoding="utf-8"))["rows"]
    assert 0.0 < max(row["gain"] for row in rows) < 0.1
