# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Goals are judged by what was measured, and by nothing that was not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.bench import rounded
from benchmarks.goals import GOALS, judge, markdown, table

RATES = {
    "single_v1": 100_000.0,
    "single_v2": 100_000.0,
    "dsse_0_1_13": 500.0,
    "dsse_1_1_9": 10_000.0,
    "baseline_batch": 1_000_000.0,
    "batch_one_core": 700_000.0,
    "batch_two_cores": 1_119_999.0,
    "limit_one_core": 1_400_000.0,
    "baseline_lazy": 4_000_000.0,
    "lazy_one_core": 2_000_000.0,
}


def figures() -> dict[str, Any]:
    """Results of a run with known ratios; in the median all but ours did half as much."""
    cells = [(40, 5), (100, 5), (40, 50), (40, 400)]
    ours = {name for name in RATES if name.startswith(("single", "batch", "lazy"))}
    return {
        "speed": [
            {
                "grid_size": g,
                "num_drones": n,
                "best": dict(RATES),
                "median": {name: r if name in ours else r / 2 for name, r in RATES.items()},
            }
            for g, n in cells
        ],
        "seeding": {"seconds": [0.1, 0.3, 0.4]},
        "start_up": {"cold_s": [16.0, 15.5], "warm_s": [1.5, 2.5]},
        "memory": {
            "single": {"growth_bytes_per_step": 0.0},
            "batch": {"growth_bytes_per_step": 16.0},
        },
        "conversion": {
            "dense": {
                "copy_s": 1.0,
                "message_s": 6.0,
                "median_copy_s": 2.0,
                "median_message_s": 8.0,
            }
        },
        "lockstep": {"20": {"sim_node": [50.0, 80.0], "ping_pong": [100.0, 90.0]}},
        "belief_over_ros": {
            "paper": {"published": [70.0, 90.0], "none": [80.0, 100.0]},
            "v2": {"published": [70.0], "none": [100.0]},
        },
        "recorded": {
            "20": {
                "recorded": [70.0, 90.0],
                "dashboard": [60.0, 85.0],
                "page_open": [50.0, 79.0],
                "plain": [80.0, 100.0],
            }
        },
        "belief_step": {
            rules: {"one_core": [10.0, 15.0], "two_cores": [20.0, 30.0], "numpy": [1.0, 0.5]}
            for rules in ("paper", "v2")
        },
        "sea": {
            "batch": {"sea": [12.0, 15.0], "paper": [10.0, 10.0]},
            "decision_s": [0.005, 0.02],
        },
    }


def test_every_figure_is_compared_with_its_own_bound_and_has_its_median_beside_it() -> None:
    judged = judge(figures())
    c_baseline, memset, two_cores = [0.7] * 3 + [1.119999], [0.5] * 2, [1.599999] * 4
    assert [row["best"] for row in judged] == pytest.approx(
        [
            *[10, 200, 10, 10, *c_baseline, *memset, *two_cores, 0.5, 0.1, 6],
            *[0.8, 0.9, 0.7, 30, 30, 1.5, 0.005, 0.9, 0.85, 0.79, 16, 15.5, 1.5],
        ],
        rel=1e-6,
    )
    assert [row["median"] for row in judged] == pytest.approx(
        [
            *[20, 400, 20, 20, 1.4, 1.4, 1.4, 2.239998, 1, 1, *two_cores],
            *[1, 0.3, 4, 65 / 95, 80 / 90, 0.7, *[25 / 0.75] * 2, 1.35, 0.0125],
            *[80 / 90, 72.5 / 90, 64.5 / 90, 16, 15.75, 2],
        ],
        rel=1e-6,
    )
    assert [row["verdict"] for row in judged] == [
        "met", "missed", "met", "met", "met", "missed", "missed", "missed", "met", "missed",
        "missed", "missed", "missed", "missed", "met", "met", "missed", "met", "met", "missed",
        "met", "met", "met", "met", "met", "met", "missed", "missed", "missed", "met",
    ]  # fmt: skip


def test_what_was_not_measured_is_neither_met_nor_missed() -> None:
    assert {row["verdict"] for row in judge({"speed": []})} == {"not measured"}
    without = figures()
    del without["speed"][0]["best"]["dsse_0_1_13"]
    del without["recorded"]["20"]["page_open"]
    verdicts = [row["verdict"] for row in judge(without)]
    assert verdicts.count("not measured") == 2


def test_the_table_has_a_line_for_every_goal() -> None:
    lines = table(judge(figures())).splitlines()
    assert len(lines) == 1 + len(GOALS)
    assert [line.split()[-1] for line in lines[1:]] == [r["verdict"] for r in judge(figures())]


def test_rounding_keeps_five_digits_and_everything_else() -> None:
    assert rounded({"a": [123456.0, 0.00123456], "b": (True, 7, "x", None)}) == {
        "a": [123460.0, 0.0012346],
        "b": [True, 7, "x", None],
    }


def test_the_page_on_benchmarks_states_every_goal_with_best_and_median() -> None:
    page = (Path(__file__).parents[2] / "benchmarks" / "README.md").read_text(encoding="utf-8")
    lines = markdown(judge({"speed": []})).splitlines()
    first = page.splitlines().index(lines[0])
    stated = page.splitlines()[first : first + len(lines)]
    # Two figures stand behind each goal.
    assert [line.rsplit("|", 3)[0] for line in stated] == [line.rsplit("|", 3)[0] for line in lines]
