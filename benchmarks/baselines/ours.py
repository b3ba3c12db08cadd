# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""This package: one world through PettingZoo's interface, or a batch of worlds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.worker import play_walks, serve
from dsse_ros.search.environments.factories import parallel_env, vector_env


def make(config: dict[str, Any]) -> Iterator[int]:
    """Return one world or, where the set-up has `worlds`, a batch."""
    with np.load(config["workload"]) as file:
        starts, actions = file["starts"], file["actions"]
    fields = {**config["fields"], "drones_positions": starts.tolist()}
    if "worlds" in config:
        return batch(fields, actions, **config["worlds"])
    return single(fields, actions)


def single(fields: dict[str, Any], actions: Any) -> Iterator[int]:
    """Yield 1 for every call of `SearchEnv.step`; episodes last until the time limit."""
    env = parallel_env(**fields)
    walks = [
        [dict(zip(env.possible_agents, joint, strict=True)) for joint in walk]
        for walk in actions.swapaxes(0, 1).tolist()
    ]
    env.reset(seed=1)
    yield from play_walks(env, walks, env.reset)


def batch(
    fields: dict[str, Any], actions: Any, count: int, lazy: bool, threads: int
) -> Iterator[int]:
    """Yield the number of worlds that made a step for every call of `VectorEnv.step`."""
    env = vector_env(count, **fields, lazy=lazy, threads=threads)
    repeats = -(-count // actions.shape[1])
    joints = list(np.tile(actions, (1, repeats, 1))[:, :count])
    done = env.world.worlds["done"]
    env.reset(seed=1)
    while True:
        for joint in joints:
            env.step(joint)
            yield count
        if not done.all():
            raise RuntimeError(f"{count - done.sum()} worlds go on after {len(joints)} calls")
        # All worlds reset, and none makes a step.
        env.step(joints[0])
        yield 0


if __name__ == "__main__":
    serve(make)
