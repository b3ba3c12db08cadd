# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Prints digests of all that happens in long play: `play_trace.py RULES,... SEED...`."""

from __future__ import annotations

import hashlib
import sys

import numpy as np
from play import some_actions

from dsse_ros.search.environments.factories import parallel_env

STEPS = 1000


def digest(rules: str, seed: int) -> str:
    """SHA-256 over hidden states, observations and results of many steps and missions."""
    env = parallel_env(
        rules=rules,
        grid_size=12,
        num_drones=6,
        person_amount=3,
        vector=(0.2, -0.3),
        timestep_limit=40,
        # In v2 the map spreads instead.
        **({} if rules == "v2" else {"sigma": 2}),
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
            mask = np.asarray(infos[agent].get("action_mask", []))
            sha.update(agent.encode() + position.tobytes() + mask.tobytes())
    assert missions > 2
    return sha.hexdigest()


if __name__ == "__main__":
    for rules in sys.argv[1].split(","):
        for argument in sys.argv[2:]:
            print(rules, argument, digest(rules, int(argument)))
