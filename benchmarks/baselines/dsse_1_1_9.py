# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""DSSE 1.1.9 as its users call it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from typing import Any

import numpy as np
from DSSE import DroneSwarmSearch  # type: ignore[import-not-found]

from benchmarks.worker import serve


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
    for walk in cycle(walks):
        env.reset(options=options)
        for call, joint in enumerate(walk, start=1):
            env.step(joint)
            yield 1
            if not env.agents and call < len(walk):
                raise RuntimeError(f"the episode ended after {call} calls of {len(walk)}")
        if env.agents:
            raise RuntimeError(f"the episode goes on after {len(walk)} calls")


if __name__ == "__main__":
    serve(make)
