# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""DSSE 1.1.9 as its users call it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from DSSE import DroneSwarmSearch  # type: ignore[import-not-found]

from benchmarks.worker import play_walks, serve


def make(config: dict[str, Any]) -> Iterator[int]:
    """Yield 1 for every call of `step`; episodes last until the time limit."""
    fields = config["fields"]
    with np.load(config["workload"]) as file:
        starts, actions = file["starts"], file["actions"]
    agents = [f"drone{i}" for i in range(len(starts))]
    walks = [
        [dict(zip(agents, joint, strict=True)) for joint in walk]
        for walk in actions.swapaxes(0, 1).tolist()
    ]
    env = DroneSwarmSearch(
        grid_size=fields["grid_size"],
        drone_amount=len(agents),
        vector=tuple(fields["vector"]),
        person_initial_position=tuple(fields["person_initial_position"]),
        probability_of_detection=fields["probability_of_detection"],
        timestep_limit=fields["timestep_limit"],
    )
    options = {"drones_positions": [tuple(cell) for cell in starts.tolist()]}
    env.reset(options=options)
    yield from play_walks(env, walks, partial(env.reset, options=options))


if __name__ == "__main__":
    serve(make)
