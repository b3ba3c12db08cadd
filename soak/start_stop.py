# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start and stop nodes repeatedly, with every signal and at any moment."""

from __future__ import annotations

import contextlib
import random
import signal
import time
from pathlib import Path
from typing import Any

from soak.rigs import Process, Rig, domain, shared_files, until
from soak.row import Figures, Row, Run, zero

SIGNALS = {
    "SIGINT": [signal.SIGINT],
    "SIGTERM": [signal.SIGTERM],
    # Under nohup the nodes would inherit that SIGHUP is ignored.
    **({} if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else {"SIGHUP": [signal.SIGHUP]}),
    "SIGINT twice": [signal.SIGINT, signal.SIGINT],
}
NODES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("sim_node", {"num_drones": 5, "grid_size": 12, "step_mode": "realtime", "step_rate": 50.0}),
    ("planner_node", {}),
    ("mavlink_bridge", {"connections": ["udpin:127.0.0.1:0"]}),
    ("recorder", {}),
)
MOMENTS_S = 1.5
"""Wall time after its first line within which a node is stopped."""


def start_stop(run: Run) -> Figures:
    """Start a simulation with other nodes, and stop all by a signal at a random moment."""
    cycles = run.size(200, 10)
    draw = random.Random(8)
    failed: list[str] = []
    orphans = left = stopped = 0
    with domain(run.folder) as rig:
        for cycle in run.each(range(cycles), "cycles"):
            name = list(SIGNALS)[cycle % len(SIGNALS)]
            processes = started(rig, run, cycle)
            watched = processes[0]
            stopped += len(processes)
            until(lambda p=watched: "mission 1" in p.output or not p.running, "its first line")
            time.sleep(draw.random() * MOMENTS_S if cycle % 5 else 0.0)
            files = {file for p in processes for file in shared_files(p.child.pid)}
            children = {pid for p in processes for pid in descendants(p.child.pid)}
            for process in processes:
                with contextlib.suppress(ProcessLookupError):
                    process.signal(*SIGNALS[name])
            for process in processes:
                if not in_peace(process, SIGNALS[name][0]):
                    failed.append(f"{name}: {process.log.name}: {process.output[-400:]}")
            orphans += sum(Path(f"/proc/{pid}").exists() for pid in children)
            others = {
                file for path in Path("/proc").glob("[0-9]*") for file in shared_files(path.name)
            }
            left += sum(Path(file).exists() for file in files - others)
    return {
        "cycles": cycles,
        "processes": stopped,
        "failed": len(failed),
        "orphans": orphans,
        "shared_memory_left": left,
        "failures": failed[:5],
    }


def started(rig: Rig, run: Run, cycle: int) -> list[Process]:
    """Start a simulation and one other node; the short form has only a few."""
    if run.quick and cycle % 4:
        return [rig.start(*NODES[0])]
    name, parameters = NODES[1 + cycle % (len(NODES) - 1)]
    if name == "recorder":
        parameters = {"bag": str(run.folder / f"{cycle}.mcap")}
    if name == "mavlink_bridge":
        from autopilot.running import free_udp_port

        parameters = {
            "connections": [f"udpin:127.0.0.1:{free_udp_port()}"],
            "state_directory": str(run.folder / "state"),
        }
    return [rig.start(*NODES[0]), rig.start(name, parameters)]


def in_peace(process: Process, number: signal.Signals) -> bool:
    """Return whether a process ends with code 0, or by the signal while it starts."""
    code = process.wait()
    words = ("Traceback", "FATAL", "terminate called", "Exception ignored")
    return code in (0, 128 + number) and not any(word in process.output for word in words)


def descendants(pid: int) -> set[int]:
    """Return the child processes of a process."""
    found: set[int] = set()
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found.update(int(child) for child in path.read_text().split())
    return found | {process for child in set(found) for process in descendants(child)}


ROWS = (
    Row(
        "start_stop",
        "Nodes are started and stopped by SIGINT, SIGTERM, SIGHUP and SIGINT twice: no failure, no "
        "orphan process, no file left in shared memory",
        start_stop,
        "{cycles} cycles, {processes} nodes: {failed} failures, {orphans} orphans, "
        "{shared_memory_left} files left",
        zero("failed", "orphans", "shared_memory_left"),
    ),
)
