# SPDX-License-Identifier: Apache-2.0
"""Prints a digest of everything that happens in long play, one line per seed given."""

from __future__ import annotations

import hashlib
import sys

import numpy as np
from play import some_actions

from dsse_ros.search import parallel_env

STEPS = 320


def digest(seed: int) -> str:
    """SHA-256 over hidden states, observations and results of many steps and missions."""
    env = parallel_env(
        grid_size=12, num_drones=6, person_amount=3, vector=(0.2, -0.3), sigma=2, timestep_limit=40
    )
    generator = np.random.default_rng(seed)
    sha = hashlib.sha256()
    observations, infos = env.reset(seed=seed)
    missions = 0
    for _ in range(STEPS):
        if not env.agents:
            observations, infos = env.reset()
            missions += 1
        else:
            observations, *results, infos = env.step(some_actions(env, generator, careful=True))
            sha.update(repr(results).encode())
        sha.update(env.world.state_bytes())
        sha.update(env.probability.tobytes())
        for agent, (position, _) in observations.items():
            sha.update(agent.encode() + position.tobytes() + infos[agent]["action_mask"].tobytes())
    assert missions > 2
    return sha.hexdigest()


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        print(argument, digest(int(argument)))
