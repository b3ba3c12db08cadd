# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compiles what the tests use of the search, so that they find it in the cache.

`python test/search/environments/compiled.py`; with `worlds` without beliefs, planners, faults.
"""

from __future__ import annotations

import sys
from multiprocessing import Pool
from typing import Any

import numpy as np
from areas import CELL_M, ORIGIN, geojson_of

from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.compiler import prepared_env
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.vector_env import VectorEnv

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

SEA: dict[str, Any] = {"rules": "sea", "particles": 100}
"""Where persons follow an ensemble, too."""

CHAIN: dict[str, Any] = {
    "person_motion": "markov_chain",
    "transition_probabilities": np.full((8, 8, 9), 1 / 9),
}
"""Where the motion of persons differs from cell to cell, too."""

METRES: dict[str, Any] = {"rules": "flight", "particles": 100}
"""Where drones fly in metres, too."""


def use_world(fields: dict[str, Any]) -> VectorEnv:
    """Use what is compiled for a batch."""
    batch = vector_env(2, **fields)
    batch.reset(seed=1)
    batch.step(np.zeros((2, 2), np.int8))
    return batch


def use(fields: dict[str, Any]) -> None:
    """Use what is compiled: one environment with a belief, a planner and a batch."""
    if fields.get("rules") == METRES["rules"]:
        use_planners(fields, "belief")
        return
    use_world(fields)
    batch = use_world(fields | {"battery_move": 1.0})
    if batch.rules.covers:
        return
    prepared_env(batch.scenario, batch.rules, has_belief=bool)
    use_planners(fields, "belief_greedy", "belief")


def use_planners(fields: dict[str, Any], *names: str) -> None:
    """Use what is compiled of an environment that planners play."""
    env = parallel_env(**fields)
    for name in names:
        planner = planner_for(env, name, seed=1)
        observations, infos = env.reset(seed=1)
        for _ in range(3):
            observations, _, _, _, infos = env.step(planner(observations, infos))


if __name__ == "__main__":
    with Pool(2) as pool:
        others, used = [AREA, SEA, COVERAGE, AREA | COVERAGE, CHAIN, METRES], use
        if sys.argv[1:] == ["worlds"]:
            others, used = [AREA, SEA, COVERAGE], use_world
        pool.map(used, [FIELDS, *(FIELDS | other for other in others)], chunksize=1)
