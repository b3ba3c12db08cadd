# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A day of missions, one after the other, with all options on."""

from __future__ import annotations

import time
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray

from soak.rigs import Process, Rig, domain, open_files, resident_bytes, threads, until
from soak.row import Figures, Goal, Row, Run

DAY_STEPS = 24 * 60 * 60 * 10
MISSION_STEPS = 1000
STALLED_S = 300.0


@dataclass
class Watched:
    """A process and its resources after warm-up."""

    process: Process
    memory: int = 0
    files: int = 0
    threads: int = 0

    def begin(self) -> None:
        """Start to measure."""
        pid = self.process.child.pid
        self.memory, self.files, self.threads = resident_bytes(pid), open_files(pid), threads(pid)

    def end(self, name: str) -> Figures:
        """Return the growth of its resources."""
        pid = self.process.child.pid
        return {
            f"{name}_growth_mib": (resident_bytes(pid) - self.memory) / 2**20,
            f"{name}_more_files": open_files(pid) - self.files,
            f"{name}_more_threads": threads(pid) - self.threads,
        }


def _start(rig: Rig, run: Run, mission_steps: int) -> dict[str, Process]:
    """Return the nodes of a search by name, started."""
    watched = {
        "sim_node": rig.start(
            "sim_node",
            {
                "grid_size": 10,
                "num_drones": 2,
                "rules": "v2",
                "probability_of_detection": 1e-9,
                "timestep_limit": mission_steps,
                "auto_reset": True,
                "publish_belief": True,
                "seed": 1,
            },
        ),
        "planner_node": rig.start("planner_node", {"planner": "sweep"}),
        "recorder": rig.start(
            "recorder",
            {
                "bag": str(run.folder / f"{time.time_ns()}.mcap"),
                "exclude": ["*/odom", "*/fix", "*/path", "*/markers", "*/pose"],
            },
        ),
    }
    if not run.quick:
        watched["dashboard"] = rig.start("dashboard", {"port": 0})
    return watched


def endurance(run: Run) -> Figures:
    """Fly missions in lockstep with belief, planner, recorder and, in the long form, dashboard.

    Measures growth after the first tenth of the steps, or after half of them in the short form.
    """
    steps, mission_steps = run.size((DAY_STEPS, MISSION_STEPS), (600, 100))
    with domain(run.folder) as rig:
        health = rig.listen(DiagnosticArray, "/diagnostics")
        watched = _start(rig, run, mission_steps)
        until(lambda: "recording" in watched["recorder"].output, "the recorder")
        processes = {name: Watched(process) for name, process in watched.items()}
        done = before = 0
        warm, began_s, last_s = False, time.monotonic(), time.monotonic()
        for _ in run.each(range(steps // mission_steps), f"missions of {mission_steps} steps"):
            before += mission_steps
            while done < before:
                rig.executor.spin_once(timeout_sec=0.5)
                for name, monitor in processes.items():
                    assert monitor.process.running, f"{name}: {monitor.process.output[-2000:]}"
                while health:
                    seen = steps_of(health.pop(0), mission_steps)
                    if seen > done:
                        done, last_s = seen, time.monotonic()
                assert time.monotonic() < last_s + STALLED_S, f"no step after {done}"
            if not warm and done >= run.size(0.1, 0.5) * steps:
                warm = True
                for monitor in processes.values():
                    monitor.begin()
        seconds = time.monotonic() - began_s
        figures = {k: v for n, monitor in processes.items() for k, v in monitor.end(n).items()}
        for process in watched.values():
            process.stop()
    worst = {
        what: max(value for key, value in figures.items() if key.endswith(what))
        for what in ("growth_mib", "more_files", "more_threads")
    }
    return {"steps": done, "steps_per_s": done / seconds, **worst, **figures}


def steps_of(array: DiagnosticArray, mission_steps: int) -> int:
    """Return the number of steps of a simulation, 0 for the diagnostics of another node."""
    for status in array.status:
        if status.name == "dsse_ros: sim_node":
            values = {pair.key: pair.value for pair in status.values}
            return (int(values["mission"]) - 1) * (mission_steps + 1) + int(values["step"])
    return 0


ROWS = (
    Row(
        "endurance",
        "864 000 steps, a day at 10 Hz, with belief, planner, recorder and dashboard: memory grows "
        "by 5 MB at most, no new descriptors or threads",
        endurance,
        "{steps} steps at {steps_per_s:.0f}/s: memory {growth_mib:+.1f} MiB, descriptors "
        "{more_files:+d}, threads {more_threads:+d} in the node where they grow most",
        (
            Goal("growth_mib", most=5.0, timed=True),
            Goal("more_files", most=0),
            Goal("more_threads", most=0),
        ),
    ),
)
