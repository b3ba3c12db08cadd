# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Memory and CPU time that an incident takes until its search can begin.

`python -m benchmarks.incident_size` prints the table of docs/drift.md, each row in a fresh process.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from datetime import datetime, timedelta, timezone

from benchmarks import ROOT
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.cell_tracks import Draw

START = datetime(2026, 1, 17, 14, 0, tzinfo=timezone.utc)
CASES = ((760, 10_000, 200), (760, 100_000, 200), (4320, 10_000, 700), (4320, 100_000, 700))
"""Minutes of drift before the search, particles, and cells along a side of the grid."""


def row(minutes: int, particles: int, grid_size: int) -> str:
    """Return a row of the table, measured in this process from its start."""
    seen = {"lat": -24.0, "lon": -46.3, "radius": 500,
            "time": (START - timedelta(minutes=minutes)).isoformat()}  # fmt: skip
    incident = {
        "object": "PIW-1", "search_start": START.isoformat(), "seen": seen,
        "wind": {"speed": 8, "from": 90, "error": 1},
        "current": {"speed": 0.2, "toward": 30, "error": 0.05},
    }  # fmt: skip
    env = parallel_env(
        {"incident": incident, "particles": particles, "grid_size": grid_size,
         "num_drones": 4, "timestep_limit": 180}
    )  # fmt: skip
    forecast = EnsembleForecast(env.scenario, env.rules, draw=Draw.POS)
    for step in range(len(forecast.cells)):
        forecast.particles(step, step)
    memory_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return (
        f"| {minutes // 60} h {minutes % 60} min | {particles} | {grid_size} x {grid_size} "
        f"| {memory_mib:.0f} MiB | {time.process_time():.0f} s |"
    )


def main(arguments: list[str]) -> int:
    """Print the table, or a row of it."""
    if arguments:
        print(row(*map(int, arguments)))
        return 0
    print("| Drift before the search | Particles | Cells | Memory | CPU time |")
    print("| --- | --- | --- | --- | --- |", flush=True)
    for case in CASES:
        command = [sys.executable, "-m", "benchmarks.incident_size", *map(str, case)]
        subprocess.run(command, cwd=ROOT, check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
