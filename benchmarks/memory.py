# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Growth of the memory over a long run, each in a fresh process."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.processes import Process
from benchmarks.speed import CALLS, configuration
from benchmarks.workload import random_walks
from dsse_ros.world.scenario.rules import profile

GRID_SIZE, NUM_DRONES, BATCH = 40, 5, 1024
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "single": ("v2", {}),
    "batch": ("v1", {"worlds": {"count": BATCH, "lazy": False, "threads": 1}}),
    "lazy": ("v1", {"worlds": {"count": BATCH, "lazy": True, "threads": 1}}),
}
"""Rules and further configuration of the worker, by kind of environment."""


def measure(long_run: int) -> dict[str, dict[str, float]]:
    """Return the growth of each kind of environment in bytes per step.

    Growth is measured after the first tenth of `long_run` environment steps, when every
    buffer has its final size.
    """
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, (rules, options) in RUNS.items():
            config = {**configuration(rules, GRID_SIZE, NUM_DRONES), **options}
            starts, actions = random_walks(
                GRID_SIZE, NUM_DRONES, profile(rules).actions, CALLS[rules], 8, seed=1
            )
            workload = Path(folder, f"{name}.npz")
            np.savez(workload, starts=starts, actions=actions)
            config["workload"] = str(workload)
            with Process("ours") as process:
                process.set_up(config)
                early = process.ask("memory", long_run // 10)["present"]
                answer = process.ask("memory", long_run - long_run // 10)
                grown = (answer["present"] - early) / answer["steps"]
                found[name] = {"growth_bytes_per_step": grown}
    return found
