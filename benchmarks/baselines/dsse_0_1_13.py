# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""DSSE 0.1.13 as its users call it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from typing import Any

import numpy as np
from DSSE.env import DroneSwarmSearch  # type: ignore[import-not-found]

from benchmarks.worker import serve


def make(config: dict[str, Any]) -> Iterator[int]:
    """Yield 1 for every call of `step`.

    Its episodes do not end by themselves: a flag is only reported, and each drone's work is the
    same after it.
    """
    fields = config["fields"]
    with np.load(config["workload"]) as file:
        starts, actions = file["starts"], file["actions"]
    agents = [f"drone{i}" for i in range(len(starts))]
    walks = [
        [dict(zip(agents, joint)) for joint in walk]  # noqa: B905
        for walk in actions.swapaxes(0, 1).tolist()
    ]
    env = DroneSwarmSearch(
        grid_size=fields["grid_size"],
        n_drones=len(agents),
        vector=fields["vector"],
        person_initial_position=fields["person_initial_position"],
        disperse_constant=fields["sigma"],
        timestep_limit=fields["timestep_limit"],
    )
    places = [tuple(cell) for cell in starts.tolist()]
    for walk in cycle(walks):
        env.reset(drones_positions=places, vector=fields["vector"])
        for joint in walk:
            env.step(joint)
            yield 1


if __name__ == "__main__":
    serve(make)
