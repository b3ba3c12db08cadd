# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mean times are those of the exact filter, and a page keeps what surrounds the table."""

from __future__ import annotations

import json

import pytest

from benchmarks.bench import RESULTS
from benchmarks.compare import RESULTS_PAGE
from benchmarks.decision_time import mean_steps, table
from benchmarks.pages import with_table
from dsse_ros.planners.options import BeamOptions

ROW = {
    "title": "santos", "seeds": 4, "belief": 15.1, "forward_backward": 15.0, "gain": 0.1,
    "interval": [0.05, 0.15],
}  # fmt: skip


def test_each_step_counts_with_the_probability_that_nobody_was_found_before() -> None:
    options = BeamOptions(samples=64, width=4)
    times = [mean_steps("santos_8", options, 0, most=most) for most in (1, 8, 16)]
    assert times[0] == pytest.approx(1.0)
    assert times[0] < times[1] <= 8.0 and times[1] < times[2] < 16.0


def test_the_table_replaces_the_one_between_its_comments() -> None:
    page = "before\n<!-- decision time -->\nold\n<!-- end -->\nafter\n"
    replaced = with_table(page, "decision time", table([ROW]))
    assert "| santos | 15.10 | 15.00 | 0.100 ± 0.050 | 4 |" in table([ROW]) in replaced
    assert replaced.startswith("before\n") and replaced.endswith("after\n")
    assert "old" not in replaced


def test_the_page_has_the_last_results() -> None:
    rows = json.loads((RESULTS / "decision_time.json").read_text(encoding="utf-8"))["rows"]
    page = RESULTS_PAGE.read_text(encoding="utf-8")
    assert table(rows) in with_table(page, "decision time", table(rows)) == page
