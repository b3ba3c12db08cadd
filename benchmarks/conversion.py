# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""World to message: the map of a large world as an OccupancyGrid, and a copy of its bytes."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from statistics import median

import numpy as np
from std_msgs.msg import Header

from dsse_ros.search.environments.factories import parallel_env
from msg_adapters.occupancy import occupancy_grid

GRID_SIZE = 1000
STEPS = 50


def measure(rounds: int) -> dict[str, dict[str, float]]:
    """Return the seconds of each conversion, for a map without zeros.

    Gives the minimum and, with the prefix `median_`, the median. `copy_s` copies the float32
    map into allocated memory.
    """
    env = parallel_env(grid_size=GRID_SIZE, rules="v2", sigma=200.0)
    env.reset(seed=1)
    for _ in range(STEPS):
        env.step(dict.fromkeys(env.agents, 1))
    target = np.empty_like(env.probability)
    ways: dict[str, Callable[[], object]] = {
        "copy_s": partial(np.copyto, target, env.probability),
        "message_s": partial(occupancy_grid, Header(), env.scenario.cell_size, env.probability),
    }
    taken: dict[str, list[float]] = {way: [] for way in ways}
    for _ in range(rounds):
        for way, do in ways.items():
            start = time.perf_counter()
            do()
            taken[way].append(time.perf_counter() - start)
    found = {way: min(times) for way, times in taken.items()}
    return {"dense": found | {f"median_{way}": median(times) for way, times in taken.items()}}
