# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Time from the start of a Python process to the end of its first step."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

from benchmarks import ROOT

FIRST_STEP = """
from dsse_ros.search.environments.factories import parallel_env
env = parallel_env()
env.reset(seed=0)
env.step({agent: 0 for agent in env.agents})
"""


def measure(rounds: int) -> dict[str, list[float]]:
    """Return the seconds without (`cold_s`) and with (`warm_s`) a compiler cache."""
    cold, warm = [], []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as cache:
            cold.append(_first_step_s(cache))
            warm += [_first_step_s(cache) for _ in range(3)]
    return {"cold_s": cold, "warm_s": warm}


def _first_step_s(cache: str) -> float:
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", FIRST_STEP],
        cwd=ROOT,
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
        check=True,
        timeout=180,
        stdin=subprocess.DEVNULL,
    )
    return time.perf_counter() - start
