# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A foreign clock that jumps, stands still and starts again."""

from __future__ import annotations

import time
from typing import Any

from rosgraph_msgs.msg import Clock

from msg_adapters.stamps import to_stamp
from msg_adapters.step_report import step_report_from_message
from soak.rigs import Rig, Sim, domain
from soak.row import Figures, Goal, Row, Run, zero
from soak.traffic import SEARCHED, gaps

HOUR_S = 3600.0
RATE = 10.0


def clock_jumps(run: Run) -> Figures:
    """Let a simulation in real time and a planner follow an unreliable clock."""
    pause_s = run.size(10.0, 1.5)
    jumps = [HOUR_S, -HOUR_S, HOUR_S, None, HOUR_S, -HOUR_S, 1e9, None]
    caught_up, step_s = 0, run.size(1.0, 0.3)
    with domain(run.folder) as rig:
        clock = ForeignClock(rig)
        sim_time = {"use_sim_time": True}
        sim = rig.sim(
            SEARCHED
            | sim_time
            | {
                "grid_size": 12,
                "num_drones": 2,
                "publish_clock": False,
                "step_mode": "realtime",
                "step_rate": RATE,
            }
        )
        planner = rig.start("planner_node", sim_time | {"planner": "greedy"})
        clock.run(1.0)
        for jump in run.each(jumps * run.size(3, 1), "jumps"):
            before, began_s = sim.step_number, time.monotonic()
            if jump is None:
                clock.now_s = 0.0
            else:
                clock.now_s = max(clock.now_s + jump, 0.0)
            clock.run(step_s)
            caught_up = max(caught_up, steps_too_many(sim, before, began_s))
        before, began_s = sim.step_number, time.monotonic()
        rig.until(lambda: time.monotonic() > began_s + pause_s)
        caught_up = max(caught_up, steps_too_many(sim, before, began_s))
        before, began_s = sim.step_number, time.monotonic()
        clock.now_s += pause_s
        clock.run(1.0)
        caught_up = max(caught_up, steps_too_many(sim, before, began_s))
        stopped = sim.step_number
        rig.until(lambda: sim.step_number > stopped, "a step after all that")
        crashed = sum(not process.running for process in (sim.process, planner))
        reports = [step_report_from_message(message) for message in sim.reports]
    return {
        "jumps": len(jumps) * run.size(3, 1),
        "pause_s": pause_s,
        "crashed": crashed,
        "gaps": gaps(reports),
        "caught_up": caught_up,
        "caught_up_too_much": max(caught_up - 1, 0),
    }


def steps_too_many(sim: Sim, before: int, began_s: float) -> int:
    """Return the number of steps beyond those that fit into the wall time."""
    sim.rig.drain()
    due = (time.monotonic() - began_s) * RATE
    return max(sim.step_number - before - int(due) - 1, 0)


class ForeignClock:
    """A clock that another publisher sends.

    Attributes:
        now_s: Its current time.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._publisher: Any = rig.node.create_publisher(Clock, "/clock", 10)
        self.now_s = 1000.0

    def run(self, seconds: float) -> None:
        """Let it run for a while."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self._publisher.publish(Clock(clock=to_stamp(round(self.now_s * 1e9))))
            self._rig.executor.spin_once(timeout_sec=0.02)
            self.now_s += 0.02


ROWS = (
    Row(
        "clock",
        "A foreign /clock jumps by an hour to and fro, to zero and by 30 years, and stands still "
        "for 10 s: no crash, at most one step is caught up",
        clock_jumps,
        "{jumps} jumps, {crashed} crashes, {caught_up} steps caught up at once",
        (*zero("crashed", "gaps"), Goal("caught_up_too_much", most=0, timed=True)),
    ),
)
