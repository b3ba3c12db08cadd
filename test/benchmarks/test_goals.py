# SPDX-License-Identifier: Apache-2.0
"""Goals are judged by what was measured, and by nothing that was not."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.bench import rounded
from benchmarks.goals import GOALS, judge, table

RATES = {
    "single_v1": 100_000.0,
    "single_v2": 100_000.0,
    "dsse_0_1_13": 500.0,
    "dsse_1_1_9": 10_000.0,
    "floor_batch": 1_000_000.0,
    "batch_one_core": 700_000.0,
    "batch_all_cores": 1_299_999.0,
    "floor_lazy": 4_000_000.0,
    "lazy_one_core": 2_000_000.0,
}


def figures() -> dict[str, Any]:
    """Results of a run with known ratios."""
    cells = [(40, 5), (100, 5), (40, 50)]
    return {
        "speed": [{"grid_size": g, "num_drones": n, "best": dict(RATES)} for g, n in cells],
        "start_up": {"cold_s": [16.0, 15.5], "warm_s": [1.5, 2.5]},
        "memory": {
            "dsse_1_1_9": {"peak_mib": 100.0},
            "single": {"peak_mib": 100.0, "growth_bytes_per_step": 0.0},
            "batch": {"peak_mib": 100.0, "growth_bytes_per_step": 16.0},
        },
        "conversion": {"dense": {"copy_s": 1.0, "new_copy_s": 2.0, "message_s": 6.0}},
        "lockstep": {"20": {"sim_node": [50.0, 80.0], "ping_pong": [100.0, 90.0]}},
    }


def test_every_figure_is_compared_with_its_own_bound() -> None:
    judged = judge(figures())
    assert [row["measured"] for row in judged] == pytest.approx(
        [10, 200, 10, 10, 0.7, 1.299999, 0.5, 6, 0.8, 16, 15.5, 1.5]
    )
    assert [row["verdict"] for row in judged] == [
        "met", "missed", "met", "met", "met", "missed",
        "met", "missed", "met", "missed", "missed", "met",
    ]  # fmt: skip


def test_what_was_not_measured_is_neither_met_nor_missed() -> None:
    assert {row["verdict"] for row in judge({"speed": []})} == {"not measured"}
    without = figures()
    del without["speed"][0]["best"]["dsse_0_1_13"]
    verdicts = [row["verdict"] for row in judge(without)]
    assert verdicts.count("not measured") == 1


def test_the_table_has_a_line_for_every_goal() -> None:
    lines = table(judge(figures())).splitlines()
    assert len(lines) == 1 + len(GOALS)
    assert [line.split()[-1] for line in lines[1:]] == [r["verdict"] for r in judge(figures())]


def test_rounding_keeps_five_digits_and_everything_else() -> None:
    assert rounded({"a": [123456.0, 0.00123456], "b": (True, 7, "x", None)}) == {
        "a": [123460.0, 0.0012346],
        "b": [True, 7, "x", None],
    }
