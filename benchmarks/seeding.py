# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The time to seed many worlds."""

from __future__ import annotations

import time

from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

WORLDS = 100_000


def measure(rounds: int) -> dict[str, list[float]]:
    """Return the seconds to seed `WORLDS` worlds with one number, round by round."""
    world = World(Scenario(), profile("paper"), WORLDS, write_maps=False)
    seconds = []
    for seed in range(rounds):
        start = time.perf_counter()
        world.seed(seed)
        seconds.append(time.perf_counter() - start)
    return {"seconds": seconds}
