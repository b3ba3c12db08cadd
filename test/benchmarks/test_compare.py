# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `make compare` makes of missions, and that the pages show its results."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.compare import (
    CASES,
    CSV,
    DISTURBANCES,
    PAGES,
    RESULTS,
    figures,
    merged,
    tables,
)
from benchmarks.planner_tables import (
    NO_DIFFERENCE,
    NO_STATEMENT,
    as_csv,
    difference,
    share,
    with_tables,
)
from dsse_ros.planners.mission_batches import PlayedMissions


def test_the_difference_is_one_of_pairs() -> None:
    steps = np.array([10, 20, 60, 40] * 50)
    none = np.zeros(200, np.int64)
    ours = PlayedMissions(steps < 60, steps - 3, none, none * 1.0, none, none - 1)
    beside = PlayedMissions(steps < 60, steps, none, none * 1.0, none, none - 1)
    row = figures(ours, beside)
    assert row["difference"] == -3
    assert row["difference_interval"] == (-3, -3)
    low, high = row["steps_interval"]
    assert high - low > 1


def test_a_disturbance_misleads_the_planner_and_leaves_the_world_as_it_is() -> None:
    case = CASES["santos_4"]
    vector = np.array(case.scenario.resolve(case.rules).vector)
    for key, length, turn in (("speed", 1.3, 0), ("slow", 0.7, 0), ("direction", 1, 30)):
        world, assumed = DISTURBANCES[key].apply(case.scenario, case.rules)
        assert world.resolve(case.rules) == case.scenario.resolve(case.rules)
        wrong = np.array(assumed.resolve(case.rules).vector)
        assert np.linalg.norm(wrong) == pytest.approx(length * np.linalg.norm(vector))
        cosine = wrong @ vector / np.linalg.norm(wrong) / np.linalg.norm(vector)
        assert np.degrees(np.arccos(min(1.0, cosine))) == pytest.approx(turn, abs=1e-5)
    fast = CASES["v2"]
    _, assumed = DISTURBANCES["speed"].apply(fast.scenario, fast.rules)
    drifts = [np.linalg.norm(x.resolve(fast.rules).vector) ** 2 for x in (assumed, fast.scenario)]
    assert drifts[0] == pytest.approx(1.3 * drifts[1])
    for key, known in (("pod", 1.0), ("pod_known", 0.8)):
        world, assumed = DISTURBANCES[key].apply(case.scenario, case.rules)
        assert world.probability_of_detection == 0.8
        assert assumed.resolve(case.rules).probability_of_detection == known


def test_the_drifts_of_table_a_are_drawn_as_published() -> None:
    parts = list(CASES["v1"].parts(10_000))
    assert len(parts) == 9
    assert sorted(int(n) for _, numbers in parts for n in numbers) == list(range(10_000))
    still = next(len(n) for s, n in parts if s.vector == (0.0, 0.0))
    assert still == pytest.approx(2500, abs=200)


def test_the_rows_of_a_planner_are_replaced_and_those_of_the_others_are_kept() -> None:
    kept = {"cases": {"v1": {"sweep": {"steps": 1}, "belief": {"steps": [2, 3]}}}, "seconds": 9}
    played = {"cases": {"v1": {"greedy": {"steps": 4}, "sweep": {"steps": 5}}}}
    rows = {"sweep": {"steps": 5}, "greedy": {"steps": 4}, "belief": {"steps": [2, 3]}}
    both = merged(kept, played)
    assert both == {"cases": {"v1": rows}, "seconds": 9}
    assert list(both["cases"]["v1"]) == list(rows)


def test_the_pages_show_the_kept_results() -> None:
    results = json.loads((RESULTS / "compare.json").read_text(encoding="utf-8"))
    written = tables(results)
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert with_tables(text, written, results["missions"]) == text
    pages = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [name for name in written if f"<!-- compare: {name} -->" not in pages] == []
    assert CSV.read_text(encoding="utf-8") == as_csv(results)


def test_wrong_assumptions_cost_what_the_page_states() -> None:
    rows = json.loads((RESULTS / "compare.json").read_text(encoding="utf-8"))["disturbed"]["v2"]
    for key in ("speed", "slow", "direction"):
        assert rows[key]["belief"]["difference_interval"][1] <= 1.1
    for key, (least, most) in {"pod": (2, 3), "pod_known": (2, 3), "lost": (3, 4)}.items():
        assert least <= rows[key]["belief"]["difference"] <= most


def test_the_table_of_the_incidents_is_short() -> None:
    written = tables(json.loads((RESULTS / "compare.json").read_text(encoding="utf-8")))
    head, _, *rows = written["incidents"].splitlines()
    assert head.count("|") == 5
    assert 4 <= len(rows) <= 6


def test_a_table_states_only_what_its_intervals_support() -> None:
    assert difference(-0.3, (-0.7, 0.1), 1) == NO_DIFFERENCE
    assert difference(-0.3, (-0.4, -0.1), 1) == "-0.3 ± 0.2"
    assert share({"found": 1.0, "found_interval": (0.83, 1.0)}) == NO_STATEMENT
    assert share({"found": 0.5, "found_interval": (0.48, 0.52)}) == "50.0"
    assert share({"found": 0.9998, "found_interval": (0.999, 1.0)}) == "> 99.9"


def test_the_pos_of_every_planner_agrees_with_the_share_found_at_sea() -> None:
    rows = json.loads((RESULTS / "compare.json").read_text(encoding="utf-8"))["incidents"]
    for row in rows.values():
        low, high = row["found_over_pos_interval"][-1]
        assert low <= 0.0 <= high
