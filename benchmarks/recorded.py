# SPDX-License-Identifier: Apache-2.0
"""Lockstep steps per second of `sim_node` while `recorder` writes all of it to a bag."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from benchmarks.lockstep import GRID_SIZE, STEPS, _environment, _node, _parameters
from benchmarks.processes import Process
from benchmarks.workload import random_walks
from dsse_ros.search.rules import profile

DRONES = 20


def measure(*, rounds: int, seconds: float, log: Callable[[str], None]) -> dict[str, list[float]]:
    """Return steps per second without and with a recorder; both take turns."""
    rates: dict[str, list[float]] = {"plain": [], "recorded": []}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        starts, actions = random_walks(
            GRID_SIZE, DRONES, profile("paper").actions, STEPS, worlds=1, seed=1
        )
        workload = folder / "walk.npz"
        np.savez(workload, starts=starts, actions=actions)
        peers = {}
        for offset, name in enumerate(rates):
            domain = _environment(offset)
            if name == "recorded":
                bag = ["--ros-args", "-p", f"bag:={folder / 'bag.mcap'}"]
                stack.enter_context(_node("dsse_ros.nodes.recorder", bag, domain))
            stack.enter_context(_node("dsse_ros.nodes.sim_node", _parameters(starts), domain))
            peers[name] = stack.enter_context(Process("lockstep", environment=domain))
            peers[name].set_up({"node": "dsse_sim", "workload": str(workload)})
            peers[name].rate(seconds)
        for turn in range(rounds):
            for name in list(peers)[:: 1 if turn % 2 == 0 else -1]:
                rates[name].append(peers[name].rate(seconds))
    log(
        f"{DRONES:>7} drones{max(rates['plain']):10.1f} plain"
        f"{max(rates['recorded']):10.1f} recorded   steps/s"
    )
    return rates
