# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the observation wrappers of DSSE 1.1.9 hand out over scripted episodes."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from oracle_common import Json

N_STEPS = 4
N_POSITIONS = 5


def scripts() -> list[Json]:
    """Return 20 episodes. With a probability of detection of 0 nothing that is random shows."""
    rng = random.Random(20)
    episodes = []
    for n in range(20):
        grid, drones = rng.choice([5, 6, 7, 8]), 1 + n % 4
        cells = rng.sample([(x, y) for x in range(grid) for y in range(grid)], drones)
        limit = rng.choice([6, 8, 20])
        episodes.append(
            {
                "arguments": {
                    "grid_size": grid,
                    "drone_amount": drones,
                    "vector": [round(rng.uniform(-2, 2), 1) for _ in range(2)],
                    "dispersion_inc": rng.choice([0.05, 0.1, 0.3]),
                    "dispersion_start": rng.choice([0.5, 1.0]),
                    "person_initial_position": [rng.randrange(grid) for _ in range(2)],
                    "probability_of_detection": 0.0,
                    "timestep_limit": limit,
                },
                "drones_positions": cells,
                "actions": [[rng.randrange(9) for _ in range(drones)] for _ in range(9)],
            }
        )
    return episodes


def wrappers(cells: list[Any]) -> dict[str, Callable[[Any], Any]]:
    """Return how each wrapper is put on an environment; all but one are put on the first, too."""
    package = importlib.import_module("DSSE.environment.wrappers")
    communication = importlib.import_module("DSSE.environment.wrappers.communication_wrapper")

    def retained(env: Any) -> Any:
        return package.RetainDronePosWrapper(env, cells)

    return {
        "retain": retained,
        "all_positions": lambda env: package.AllPositionsWrapper(retained(env)),
        "flatten": lambda env: package.AllFlattenWrapper(retained(env)),
        "top": lambda env: package.TopNProbsWrapper(retained(env), N_POSITIONS),
        "communication": lambda env: communication.CommunicationWrapper(retained(env), N_STEPS),
        "matrix": lambda env: package.MatrixEncodeWrapper(retained(env)),
        "communication_all_positions": lambda env: package.AllPositionsWrapper(
            communication.CommunicationWrapper(retained(env), N_STEPS)
        ),
    }


def play(script: Json) -> dict[str, np.ndarray]:
    """Return by wrapper what all agents observed, (K, N, ...) with K observations.

    Of a pair of cells and map the map is stored once, under the name with `_map`: it is asserted
    that all agents have the same one.
    """
    cells = [tuple(cell) for cell in script["drones_positions"]]
    out: dict[str, np.ndarray] = {}
    for name, wrap in wrappers(cells).items():
        arguments = dict(script["arguments"])
        for cell in ("vector", "person_initial_position"):
            arguments[cell] = tuple(arguments[cell])
        with contextlib.redirect_stdout(io.StringIO()):
            env = wrap(importlib.import_module("DSSE").DroneSwarmSearch(**arguments))
        agents = list(env.possible_agents)
        observed = [env.reset()[0]]
        for joint in script["actions"]:
            if not env.agents:
                break
            observed.append(env.step(dict(zip(agents, joint, strict=True)))[0])
        values = [[each[agent] for agent in agents] for each in observed]
        if isinstance(values[0][0], tuple):
            maps = np.array([[value[1] for value in each] for each in values])
            assert (maps == maps[:, :1]).all()
            out[f"{name}_map"] = maps[:, 0]
            values = [[value[0] for value in each] for each in values]
        out[name] = np.array(values)
    return out


def write(path: Path, source: Json) -> None:
    """Write arrays `NN/name`, and `meta`, a JSON text with provenance, numbers and scripts."""
    episodes = scripts()
    meta = {
        "provenance": source,
        "n_steps": N_STEPS,
        "n_positions": N_POSITIONS,
        "scripts": episodes,
    }
    arrays: dict[str, Any] = {
        f"{n:02d}/{name}": array
        for n, script in enumerate(episodes)
        for name, array in play(script).items()
    }
    np.savez_compressed(path, meta=np.array(json.dumps(meta)), **arrays)
