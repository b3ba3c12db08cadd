# SPDX-License-Identifier: Apache-2.0
"""What the benchmark must show, and whether it does."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from benchmarks.speed import ratio

Figures = Mapping[str, Any]

_COMPARE: dict[str, Callable[[float, float], bool]] = {">=": operator.ge, "<=": operator.le}


@dataclass(frozen=True)
class Goal:
    """A figure and its bound.

    Attributes:
        what: Of what.
        sign: ">=" or "<=".
        bound: The bound.
        unit: What the bound is a multiple of, or its unit.
        measured: Reads the figure from the results, None where it was not measured.
    """

    what: str
    sign: str
    bound: float
    unit: str
    measured: Callable[[Figures], float | None]

    def text(self) -> str:
        """Return the bound in words."""
        return f"{self.sign} {self.bound:g} {self.unit}"

    def verdict(self, value: float | None) -> str:
        """Return "met", "missed" or "not measured"."""
        if value is None:
            return "not measured"
        return "met" if _COMPARE[self.sign](value, self.bound) else "missed"


def _speed(cell: tuple[int, int], of: str, to: str) -> Callable[[Figures], float | None]:
    return lambda figures: ratio(figures["speed"], cell, of, to)


def _lockstep(figures: Figures) -> float | None:
    rates = figures.get("lockstep", {}).get("20")
    return max(rates["sim_node"]) / max(rates["ping_pong"]) if rates else None


def _conversion(figures: Figures) -> float | None:
    found = figures.get("conversion")
    # The dearer map and the cheaper copy.
    return found["dense"]["message_s"] / found["dense"]["copy_s"] if found else None


def _growth(figures: Figures) -> float | None:
    grown = [
        run["growth_bytes_per_step"]
        for run in figures.get("memory", {}).values()
        if "growth_bytes_per_step" in run
    ]
    return max(grown) if grown else None


def _start_up(kind: str) -> Callable[[Figures], float | None]:
    return lambda figures: min(figures["start_up"][kind]) if "start_up" in figures else None


GOALS = (
    Goal("single env, G 40, N 5", ">=", 3.5, "x DSSE 1.1.9",
         _speed((40, 5), "single_v2", "dsse_1_1_9")),
    Goal("single env, G 40, N 5", ">=", 250, "x DSSE 0.1.13",
         _speed((40, 5), "single_v1", "dsse_0_1_13")),
    Goal("single env, G 100, N 5", ">=", 6, "x DSSE 1.1.9",
         _speed((100, 5), "single_v2", "dsse_1_1_9")),
    Goal("single env, G 40, N 50", ">=", 6, "x DSSE 1.1.9",
         _speed((40, 50), "single_v2", "dsse_1_1_9")),
    Goal("batch B 1024, G 40, N 5, one core, dense", ">=", 0.7, "x C floor",
         _speed((40, 5), "batch_one_core", "floor_batch")),
    Goal("batch B 1024, G 40, N 5, all cores, dense", ">=", 1.3, "x C floor",
         _speed((40, 5), "batch_all_cores", "floor_batch")),
    Goal("lazy batch B 1024, G 40, N 5, one core", ">=", 0.5, "x lazy C floor",
         _speed((40, 5), "lazy_one_core", "floor_lazy")),
    Goal("OccupancyGrid 1000 x 1000, world to message", "<=", 5, "x copying the bytes",
         _conversion),
    Goal("sim_node lockstep, 20 drones, all topics", ">=", 0.8, "x bare ping-pong", _lockstep),
    # No Python object and no allocation is smaller than that.
    Goal("memory growth over 10^6 steps: none", "<=", 1, "bytes per step", _growth),
    Goal("import without compiler cache to first step", "<=", 15, "s", _start_up("cold_s")),
    Goal("import with compiler cache to first step", "<=", 2, "s", _start_up("warm_s")),
)  # fmt: skip


def judge(figures: Figures) -> list[dict[str, Any]]:
    """Return every goal with what was measured and the verdict."""
    judged = []
    for goal in GOALS:
        value = goal.measured(figures)
        judged.append(
            {
                "figure": goal.what,
                "goal": goal.text(),
                "measured": value,
                "verdict": goal.verdict(value),
            }
        )
    return judged


def table(judged: list[dict[str, Any]]) -> str:
    """Return the verdicts as a table."""
    lines = [f"{'figure':46}{'goal':28}{'measured':>10}  verdict"]
    for row in judged:
        value = "-" if row["measured"] is None else f"{row['measured']:.3g}"
        lines.append(f"{row['figure']:46}{row['goal']:28}{value:>10}  {row['verdict']}")
    return "\n".join(lines)
