# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Peak memory, and growth over a long run, each in a fresh process."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.processes import Process
from benchmarks.speed import CALLS, configuration
from benchmarks.workload import random_walks
from dsse_ros.scenario.rules import profile

GRID_SIZE, NUM_DRONES, BATCH = 40, 5, 1024
PEAK_STEPS = 300


def measure(pythons: Mapping[str, Path], long_run: int) -> dict[str, dict[str, float]]:
    """Return the peak memory of all in MiB, and the growth of ours in bytes per step.

    Growth is measured after the first tenth of `long_run` environment steps, when every
    buffer has its final size.
    """
    single, batch = {"rules": "v2"}, {"rules": "v1"}
    runs: list[tuple[str, str, dict[str, Any], int]] = [
        ("dsse_0_1_13", "dsse_0_1_13", {"rules": "v1"}, 0),
        ("dsse_1_1_9", "dsse_1_1_9", {"rules": "v2"}, 0),
        ("single", "ours", single, long_run),
        ("batch", "ours", {**batch, "lazy": False}, long_run),
        ("lazy", "ours", {**batch, "lazy": True}, long_run),
    ]
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, module, options, steps in runs:
            if module != "ours" and module not in pythons:
                continue
            rules = options["rules"]
            config = configuration(rules, GRID_SIZE, NUM_DRONES)
            if "lazy" in options:
                config["worlds"] = {"count": BATCH, "lazy": options["lazy"], "threads": 1}
            starts, actions = random_walks(
                GRID_SIZE, NUM_DRONES, profile(rules).actions, CALLS[rules], 8, seed=1
            )
            workload = Path(folder, f"{name}.npz")
            np.savez(workload, starts=starts, actions=actions)
            config["workload"] = str(workload)
            with Process(module, pythons.get(module)) as process:
                process.set_up(config)
                answer = process.ask("memory", max(steps // 10, PEAK_STEPS))
                found[name] = {"peak_mib": answer["peak"] / 2**20}
                if steps:
                    early = answer["present"]
                    answer = process.ask("memory", steps - steps // 10)
                    found[name] = {
                        "peak_mib": answer["peak"] / 2**20,
                        "growth_bytes_per_step": (answer["present"] - early) / answer["steps"],
                    }
    return found
