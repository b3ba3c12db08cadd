# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search at sea: the decisions of `belief`, and the step of many worlds."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from itertools import islice
from typing import Any

import numpy as np

from benchmarks import ROOT
from dsse_ros.planners.planner import Infos, Observations
from dsse_ros.planners.play import play
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_and_rules

KAYAK = ROOT / "config" / "kayak.yaml"
BATCH, STEPS = 1024, 50
PARTICLES, DECISIONS = 20_000, 40


def measure(*, rounds: int, log: Callable[[str], None], batch: int = BATCH) -> dict[str, Any]:
    """Return batch steps per second and seconds of a decision, by round."""
    found: dict[str, Any] = {
        "batch": _batches(rounds, batch),
        "decision_s": [_decision(seed) for seed in range(rounds + 1)][1:],
    }
    rates = {name: max(values) for name, values in found["batch"].items()}
    log(f"batch {batch}: sea {rates['sea']:.0f}, paper {rates['paper']:.0f} steps/s")
    log(f"belief, {PARTICLES} particles: {1e3 * min(found['decision_s']):.1f} ms")
    return found


def _batches(rounds: int, batch: int) -> dict[str, list[float]]:
    """Return steps per second of a batch whose drones search in vain, by rules."""
    at_sea, sea = scenario_and_rules(str(KAYAK), probability_of_detection=0.0)
    resolved, paper = at_sea.resolve(sea), profile("paper")
    alike = Scenario(
        grid_size=resolved.grid_size, num_drones=resolved.num_drones, probability_of_detection=0.0,
        timestep_limit=resolved.timestep_limit,
    )  # fmt: skip
    worlds = {"sea": World(resolved, sea, batch), "paper": World(alike, paper, batch)}
    rates: dict[str, list[float]] = {name: [] for name in worlds}
    actions = np.full((batch, resolved.num_drones), sea.action_set.search, np.int8)
    # The first round compiles.
    for turn in range(rounds + 1):
        for name in list(worlds)[:: -1 if turn % 2 else 1]:
            world = worlds[name]
            world.seed(turn)
            world.reset()
            start = time.perf_counter()
            for _ in range(STEPS):
                world.step(actions)
            taken = time.perf_counter() - start
            if turn:
                rates[name].append(STEPS / taken)
    return rates


def _decision(seed: int) -> float:
    """Return the median seconds of a decision of `belief` for four drones."""
    env = parallel_env(str(KAYAK), particles=PARTICLES)
    planner = planner_for(env, "belief", seed=seed)
    seconds: list[float] = []

    def timed(observations: Observations, infos: Infos) -> dict[str, int]:
        start = time.perf_counter()
        actions = planner(observations, infos)
        seconds.append(time.perf_counter() - start)
        return actions

    deque(islice(play(env, timed, seed=seed), DECISIONS), maxlen=0)
    return float(np.median(seconds))
