# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The goals of the benchmark, and whether it meets them."""

from __future__ import annotations

import json
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.speed import ratio

Figures = Mapping[str, Any]

_COMPARE: dict[str, Callable[[float, float], bool]] = {">=": operator.ge, "<=": operator.le}


@dataclass(frozen=True)
class Goal:
    """A figure and its bound.

    Attributes:
        what: Name of the figure.
        sign: ">=" or "<=".
        bound: The bound.
        unit: What the bound is a multiple of, or its unit.
        measured: Reads the figure from the results, for the best and for the median rounds,
            None if not measured. The best rounds count.
    """

    what: str
    sign: str
    bound: float
    unit: str
    measured: Callable[[Figures], tuple[float, float] | None]

    def text(self) -> str:
        """Return the bound as text."""
        return f"{self.sign} {self.bound:g} {self.unit}"

    def verdict(self, value: float | None) -> str:
        """Return "met", "missed" or "not measured"."""
        if value is None:
            return "not measured"
        return "met" if _COMPARE[self.sign](value, self.bound) else "missed"


def _speed(
    cell: tuple[int, int], subject: str, to: str
) -> Callable[[Figures], tuple[float, float] | None]:
    return lambda figures: ratio(figures["speed"], cell, subject, to)


def _rates(
    section: str, kind: str, subject: str, to: str
) -> Callable[[Figures], tuple[float, float] | None]:
    def measured(figures: Figures) -> tuple[float, float] | None:
        rates = figures.get(section, {}).get(kind, {})
        if not (rates.get(subject) and rates.get(to)):
            return None
        return max(rates[subject]) / max(rates[to]), median(rates[subject]) / median(rates[to])

    return measured


def _conversion(figures: Figures) -> tuple[float, float] | None:
    found = figures.get("conversion")
    if not found:
        return None
    dense = found["dense"]
    return (
        dense["message_s"] / dense["copy_s"],
        dense["median_message_s"] / dense["median_copy_s"],
    )


def _growth(figures: Figures) -> tuple[float, float] | None:
    grown = [run["growth_bytes_per_step"] for run in figures.get("memory", {}).values()]
    return (max(grown), max(grown)) if grown else None


def _seconds(section: str, kind: str) -> Callable[[Figures], tuple[float, float] | None]:
    def measured(figures: Figures) -> tuple[float, float] | None:
        times = figures.get(section, {}).get(kind)
        return (min(times), median(times)) if times else None

    return measured


GOALS = (
    Goal("single env, G 40, N 5", ">=", 3.5, "x DSSE 1.1.9",
         _speed((40, 5), "single_v2", "dsse_1_1_9")),
    Goal("single env, G 40, N 5", ">=", 250, "x DSSE 0.1.13",
         _speed((40, 5), "single_v1", "dsse_0_1_13")),
    Goal("single env, G 100, N 5", ">=", 6, "x DSSE 1.1.9",
         _speed((100, 5), "single_v2", "dsse_1_1_9")),
    Goal("single env, G 40, N 50", ">=", 6, "x DSSE 1.1.9",
         _speed((40, 50), "single_v2", "dsse_1_1_9")),
    *(
        Goal(f"batch B 1024, G {g}, N {n}, {cores}", ">=", bound, unit, _speed((g, n), subject, to))
        for g, n, cores, bound, unit, subject, to in (
            (40, 5, "one core", 0.7, "x C baseline", "batch_one_core", "baseline_batch"),
            (40, 50, "one core", 1.0, "x C baseline", "batch_one_core", "baseline_batch"),
            (40, 400, "one core", 1.0, "x C baseline", "batch_one_core", "baseline_batch"),
            (40, 5, "two cores", 1.3, "x C baseline", "batch_two_cores", "baseline_batch"),
            (40, 5, "one core", 0.5, "x memset limit", "batch_one_core", "limit_one_core"),
            (100, 5, "one core", 0.6, "x memset limit", "batch_one_core", "limit_one_core"),
            (40, 5, "two cores", 1.6, "x one core", "batch_two_cores", "batch_one_core"),
            (40, 50, "two cores", 1.6, "x one core", "batch_two_cores", "batch_one_core"),
            (40, 400, "two cores", 1.6, "x one core", "batch_two_cores", "batch_one_core"),
            (100, 5, "two cores", 1.6, "x one core", "batch_two_cores", "batch_one_core"),
        )
    ),
    Goal("lazy batch B 1024, G 40, N 5, one core", ">=", 0.5, "x lazy C baseline",
         _speed((40, 5), "lazy_one_core", "baseline_lazy")),
    Goal("seeding 100 000 worlds", "<=", 0.2, "s", _seconds("seeding", "seconds")),
    Goal("OccupancyGrid 1000 x 1000, world to message", "<=", 5, "x copying the bytes",
         _conversion),
    Goal("sim_node lockstep, 20 drones, all topics", ">=", 0.8, "x bare ping-pong",
         _rates("lockstep", "20", "sim_node", "ping_pong")),
    *(
        Goal(f"sim_node lockstep, 20 drones, belief, {rules}", ">=", 0.8, "x without",
             _rates("belief_over_ros", rules, "published", "none"))
        for rules in ("paper", "v2")
    ),
    *(
        Goal(f"beliefs B 1024, G 40, {rules}, two cores", ">=", 20, "x NumPy",
             _rates("belief_step", rules, "two_cores", "numpy"))
        for rules in ("paper", "v2")
    ),
    Goal("batch B 1024, kayak, one ensemble", ">=", 1, "x paper",
         _rates("sea", "batch", "sea", "paper")),
    Goal("belief decides, 4 drones, 20 000 particles", "<=", 0.01, "s",
         _seconds("sea", "decision_s")),
    *(
        Goal(f"sim_node lockstep, 20 drones, recorded{more}", ">=", 0.8, "x not recorded",
             _rates("recorded", "20", kind, "plain"))
        for kind, more in (
            ("recorded", ""), ("dashboard", ", dashboard"), ("page_open", ", page open")
        )
    ),
    # No Python object and no allocation is smaller.
    Goal("memory growth over 10^6 steps: none", "<=", 1, "bytes per step", _growth),
    Goal("import without compiler cache to first step", "<=", 15, "s",
         _seconds("start_up", "cold_s")),
    Goal("import with compiler cache to first step", "<=", 2, "s",
         _seconds("start_up", "warm_s")),
)  # fmt: skip


def judge(figures: Figures) -> list[dict[str, Any]]:
    """Return every goal with its figures and the verdict."""
    judged = []
    for goal in GOALS:
        best, middle = goal.measured(figures) or (None, None)
        judged.append(
            {
                "figure": goal.what,
                "goal": goal.text(),
                "best": best,
                "median": middle,
                "verdict": goal.verdict(best),
            }
        )
    return judged


def table(judged: list[dict[str, Any]]) -> str:
    """Return the verdicts as a table."""
    lines = [f"{'figure':46}{'goal':28}{'best':>10}{'median':>10}  verdict"]
    for row in judged:
        values = ("-" if row[kind] is None else f"{row[kind]:.3g}" for kind in ("best", "median"))
        shown = "".join(f"{value:>10}" for value in values)
        lines.append(f"{row['figure']:46}{row['goal']:28}{shown}  {row['verdict']}")
    return "\n".join(lines)


def markdown(judged: list[dict[str, Any]]) -> str:
    """Return the figures as the table in README.md."""
    lines = ["| Figure | Goal | Best | Median |", "| --- | --- | --- | --- |"]
    for row in judged:
        values = ("-" if row[kind] is None else f"{row[kind]:.3g}" for kind in ("best", "median"))
        goal = row["goal"].replace(">=", "≥").replace("<=", "≤")
        lines.append(f"| {row['figure']} | {goal} | {' | '.join(values)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    results = Path(__file__).with_name("results") / "bench.json"
    print(markdown(json.loads(results.read_text(encoding="utf-8"))["goals"]))
