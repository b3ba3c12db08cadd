# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `CoverageDroneSwarmSearch` of DSSE 1.1.9 does over scripted episodes."""

from __future__ import annotations

import importlib
import random
import sys
import tempfile
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from oracle_common import Json, plain


def allow_without_opendrift() -> None:
    """Let the package start without OpenDrift: with a matrix from a file it never calls it."""
    for name in ("opendrift", "opendrift.models", "opendrift.models.oceandrift"):
        sys.modules.setdefault(name, ModuleType(name))
    vars(sys.modules["opendrift.models.oceandrift"])["OceanDrift"] = SimpleNamespace


def scripts() -> list[Json]:
    """Return 8 episodes: some visit every cell, some run out of time, some leave the grid."""
    rng = random.Random(4)
    episodes = []
    for n in range(8):
        grid, drones, limit = 3 + n % 3, 1 + n % 3, (60, 12)[n % 2]
        weights = [[rng.choice([0, 1, 2, 5]) for _ in range(grid)] for _ in range(grid)]
        weights[0][0] = 3
        total = sum(map(sum, weights))
        cells = [(x, y) for x in range(grid) for y in range(grid)]
        episodes.append(
            {
                "matrix": [[value / total for value in row] for row in weights],
                "drone_amount": drones,
                "timestep_limit": limit,
                "drones_positions": rng.sample(cells, drones),
                "actions": [[rng.randrange(9) for _ in range(drones)] for _ in range(60)],
            }
        )
    return episodes


def map_of(observations: Any) -> list[list[float]] | None:
    """Return the observed map; None where the package divides nothing by nothing."""
    probability = observations["drone0"][1]
    return None if np.isnan(probability).any() else probability.tolist()


def play(script: Json) -> Json:
    """Return the script with what each call gave."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "matrix.npy")
        np.save(path, np.array(script["matrix"]))
        env: Any = importlib.import_module("DSSE").CoverageDroneSwarmSearch(
            drone_amount=script["drone_amount"],
            timestep_limit=script["timestep_limit"],
            prob_matrix_path=path,
        )
    agents = list(env.possible_agents)
    cells = [tuple(cell) for cell in script["drones_positions"]]
    observations, infos = env.reset(options={"drones_positions": cells})
    steps: list[Json] = [{"map": map_of(observations), "info": infos["drone0"]}]
    for joint in script["actions"]:
        if not env.agents:
            break
        observations, rewards, terminated, truncated, infos = env.step(
            dict(zip(agents, joint, strict=True))
        )
        steps.append(
            {
                "positions": [observations[agent][0] for agent in agents],
                "map": map_of(observations),
                "rewards": [float(rewards[agent]) for agent in agents],
                "terminated": [terminated[agent] for agent in agents],
                "truncated": [truncated[agent] for agent in agents],
                "info": {name: plain(value) for name, value in infos["drone0"].items()},
            }
        )
    return {**script, "steps": steps}
