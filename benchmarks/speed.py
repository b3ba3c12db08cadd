# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Environment steps per second of ours and of the baselines, by grid and number of drones."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.processes import BenchmarkError, CBaseline, Implementation, Limit, Process
from benchmarks.workload import batch_size, random_walks
from dsse_ros.world.scenario.rules import profile

LIMIT = 100
# Calls of an episode that ends by its time limit.
CALLS = {"v1": LIMIT + 2, "v2": LIMIT + 1}
WALKS = 64

DRONES = (1, 5, 20, 50, 400)
GRIDS = (20, 40, 100, 200, 1000)
# In a block of one cell a drone cannot move.
CELLS = [(g, n) for g in GRIDS for n in DRONES if 2 * n <= g * g]
GOAL_CELLS = [(40, 5), (100, 5), (40, 50), (40, 400)]
QUICK_CELLS = [*GOAL_CELLS, (20, 5), (200, 5), (1000, 5), (40, 1)]
# One step of 0.1.13 takes more than a second.
TOO_LARGE = {"dsse_0_1_13": 1000}


def configuration(rules: str, grid_size: int, num_drones: int) -> dict[str, Any]:
    """Return the common set-up: the scenario of the C baseline, or the defaults of v2.

    Nobody is found, so every episode lasts until its time limit.
    """
    fields: dict[str, Any] = {
        "rules": rules,
        "grid_size": grid_size,
        "person_initial_position": [grid_size // 2, grid_size // 2],
        "vector": [0.1, 0.1] if rules == "v1" else [1.1, 1.0],
        "timestep_limit": LIMIT,
        "probability_of_detection": 0.0,
    }
    if rules == "v1":
        fields["sigma"] = 3.0
    return {"fields": fields, "num_drones": num_drones}


def implementations(
    stack: ExitStack, pythons: Mapping[str, Path], programs: Mapping[str, Path]
) -> dict[str, tuple[str, dict[str, Any], Implementation]]:
    """Return all measured programs by name, with their rules and additions to the set-up.

    Args:
        stack: Ends their processes.
        pythons: Of the published packages, by the name of the baseline.
        programs: The C programs "baseline" and "limit".
    """

    def ours() -> Process:
        return stack.enter_context(Process("ours"))

    def worlds(lazy: bool, threads: int) -> dict[str, Any]:
        return {"worlds": {"lazy": lazy, "threads": threads}}

    entries: dict[str, tuple[str, dict[str, Any], Implementation]] = {}
    for module, rules in (("dsse_0_1_13", "v1"), ("dsse_1_1_9", "v2")):
        if module in pythons:
            process = stack.enter_context(Process(module, pythons[module]))
            entries[module] = (rules, {}, process)
        entries[f"single_{rules}"] = (rules, {}, ours())
    baseline, limit = programs.get("baseline"), programs.get("limit")
    if baseline is not None:
        entries["baseline_single"] = ("v1", {}, CBaseline(baseline, worlds=1))
        entries["baseline_batch"] = ("v1", worlds(False, 1), CBaseline(baseline))
    if limit is not None:
        entries["limit_one_core"] = ("v1", worlds(False, 1), Limit(limit))
    entries["batch_one_core"] = ("v1", worlds(False, 1), ours())
    entries["batch_two_cores"] = ("v1", worlds(False, 2), ours())
    if limit is not None:
        entries["limit_two_cores"] = ("v1", worlds(False, 2), Limit(limit))
    if baseline is not None:
        entries["baseline_lazy"] = ("v1", worlds(True, 1), CBaseline(baseline, lazy=True))
    entries["lazy_one_core"] = ("v1", worlds(True, 1), ours())
    entries["lazy_two_cores"] = ("v1", worlds(True, 2), ours())
    entries["batch_v2_one_core"] = ("v2", worlds(False, 1), ours())
    return entries


def measure(
    pythons: Mapping[str, Path],
    programs: Mapping[str, Path],
    *,
    cells: list[tuple[int, int]],
    rounds: int,
    seconds: float,
    log: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Return the rates of all at each cell (grid size, drones).

    They run in turn, in one order and then in the other, so that a slow phase of the machine slows
    all of them; the cells that have goals get twice as many rounds.
    """
    found = []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        entries = implementations(stack, pythons, programs)
        for grid_size, num_drones in cells:
            rates: dict[str, list[float]] = {}
            for name, (rules, extra, implementation) in entries.items():
                if grid_size >= TOO_LARGE.get(name, grid_size + 1):
                    continue
                config = configuration(rules, grid_size, num_drones)
                config["workload"] = str(_workload(folder, rules, grid_size, num_drones))
                if "worlds" in extra:
                    config["worlds"] = {"count": batch_size(grid_size), **extra["worlds"]}
                try:
                    implementation.set_up(config)
                    rates[name] = []
                except BenchmarkError as error:
                    log(f"G {grid_size} N {num_drones}: {error}")
            turns = rounds * (2 if (grid_size, num_drones) in GOAL_CELLS else 1)
            for turn in range(turns):
                for name in list(rates)[:: 1 if turn % 2 == 0 else -1]:
                    try:
                        rates[name].append(entries[name][2].rate(seconds))
                    except BenchmarkError as error:
                        log(f"G {grid_size} N {num_drones}: {error}")
                        del rates[name]
            found.append(
                {
                    "grid_size": grid_size,
                    "num_drones": num_drones,
                    "batch": batch_size(grid_size),
                    "rounds": turns,
                    "best": {name: max(measured) for name, measured in rates.items()},
                    "median": {name: median(measured) for name, measured in rates.items()},
                }
            )
            log(row(found[-1]))
    return found


def _workload(folder: Path, rules: str, grid_size: int, num_drones: int) -> Path:
    path = folder / f"{rules}-{grid_size}-{num_drones}.npz"
    if not path.exists():
        starts, actions = random_walks(
            grid_size, num_drones, profile(rules).actions, CALLS[rules], WALKS, seed=1
        )
        np.savez(path, starts=starts, actions=actions)
    return path


COLUMNS = (
    ("0.1.13", "dsse_0_1_13"),
    ("v1", "single_v1"),
    ("1.1.9", "dsse_1_1_9"),
    ("v2", "single_v2"),
    ("C", "baseline_single"),
    ("C batch", "baseline_batch"),
    ("1 core", "batch_one_core"),
    ("2 cores", "batch_two_cores"),
    ("limit 1", "limit_one_core"),
    ("limit 2", "limit_two_cores"),
    ("C lazy", "baseline_lazy"),
    ("1 core", "lazy_one_core"),
    ("2 cores", "lazy_two_cores"),
    ("v2 batch", "batch_v2_one_core"),
)


def heading() -> str:
    """Return the heading of the table, two lines."""
    names = "".join(f"{name:>10}" for name, _ in COLUMNS)
    groups = f"{'':12}{'one world':>40}{'':>10}{'dense batch':>50}{'lazy batch':>30}"
    return f"{groups}\n{'grid':>5}{'drones':>7}{names}   env steps/s"


def row(cell: Mapping[str, Any]) -> str:
    """Return a row of the table: the best rates, and the medians below."""
    lines = []
    for kind, label in (("best", f"{cell['grid_size']:>5}{cell['num_drones']:>7}"),
                        ("median", f"{'median':>12}")):  # fmt: skip
        rates = cell[kind]
        lines.append(label + "".join(
            f"{rates[key]:10.0f}" if key in rates else f"{'-':>10}" for _, key in COLUMNS
        ))  # fmt: skip
    return "\n".join(lines)


def ratio(
    cells: list[dict[str, Any]], cell: tuple[int, int], subject: str, to: str
) -> tuple[float, float] | None:
    """Return the ratio of two best rates and of their medians.

    Returns:
        None if one of them was not measured.
    """
    for found in cells:
        best, median = found["best"], found["median"]
        if (found["grid_size"], found["num_drones"]) == cell and subject in best and to in best:
            return best[subject] / best[to], median[subject] / median[to]
    return None
