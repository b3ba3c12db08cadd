# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lockstep steps per second of `sim_node` while `recorder` writes all of it to a bag."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from benchmarks.lockstep import _environment, _node, _parameters, _take_turns, _write_walk
from benchmarks.processes import Process

DRONES = 20


def measure(
    *, rounds: int, seconds: float, log: Callable[[str], None]
) -> dict[str, dict[str, list[float]]]:
    """Return steps per second by number of drones, without and with a recorder in turns."""
    rates: dict[str, list[float]] = {"plain": [], "recorded": []}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        workload = folder / "walk.npz"
        starts = _write_walk(workload, "paper", DRONES)
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
        _take_turns(peers, rounds, seconds, rates)
    log(
        f"{DRONES:>7} drones{max(rates['plain']):10.1f} plain"
        f"{max(rates['recorded']):10.1f} recorded   steps/s"
    )
    return {str(DRONES): rates}
