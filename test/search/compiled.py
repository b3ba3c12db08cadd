# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compiles what the tests use of the search, so that they find it in the cache.

`python test/search/compiled.py`
"""

from __future__ import annotations

from multiprocessing import Pool
from typing import Any

import numpy as np
from areas import CELL_M, ORIGIN, geojson_of

from dsse_ros.planners import planner_for
from dsse_ros.search import Scenario, parallel_env, profile, vector_env
from dsse_ros.search.compiler import prepared_env

FIELDS: dict[str, Any] = {"grid_size": 8, "num_drones": 2, "person_initial_position": (5, 5)}
AREA: dict[str, Any] = {
    "area": geojson_of(~np.eye(8, dtype=bool)[::-1]),
    "cell_size": CELL_M,
    "origin_lat": ORIGIN[0],
    "origin_lon": ORIGIN[1],
}
"""Where only a part of the grid is searched, other functions are compiled."""


COVERAGE: dict[str, Any] = {"rules": "coverage"}
"""Where the task is coverage, too."""


def use(fields: dict[str, Any]) -> None:
    """Use what is compiled: one environment with a belief, a planner and a batch."""
    for faults in ({}, {"battery_move": 1.0}):
        batch = vector_env(2, **fields, **faults)
        batch.reset(seed=1)
        batch.step(np.zeros((2, 2), np.int8))
    if batch.rules.covers:
        return
    prepared_env(Scenario(**fields), profile("paper"), lambda _: None, has_belief=bool)
    env = parallel_env(**fields)
    for name in ("belief_greedy", "belief"):
        planner = planner_for(env, name, seed=1)
        observations, infos = env.reset(seed=1)
        for _ in range(3):
            observations, _, _, _, infos = env.step(planner(observations, infos))


if __name__ == "__main__":
    with Pool(2) as pool:
        tasks = [FIELDS, FIELDS | AREA, FIELDS | COVERAGE, FIELDS | AREA | COVERAGE]
        pool.map(use, tasks, chunksize=1)
