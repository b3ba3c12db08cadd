# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Processes that join a mission late."""

from __future__ import annotations

import os
import subprocess
import sys

from soak import ROOT
from soak.rigs import ENVIRONMENT, Rig, domain
from soak.row import Figures, Goal, Row, Run
from soak.traffic import SEARCHED

WITHIN_S = 2.0
GIVE_UP_S = 60.0

PROGRAM = """
import os, signal, sys, time
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2

begin = time.monotonic()
rclpy.init()
node = rclpy.create_node("joiner")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
got = set()
kinds = {"probability_grid": OccupancyGrid, "step_report": PointCloud2}
for i in range(int(sys.argv[1])):
    kinds[f"drone{i}/pose"] = PoseStamped
for topic, kind in kinds.items():
    node.create_subscription(kind, topic, lambda _, topic=topic: got.add(topic), latched)
while len(got) < len(kinds) and time.monotonic() < begin + float(sys.argv[2]):
    rclpy.spin_once(node, timeout_sec=0.1)
print(len(kinds) - len(got), time.monotonic() - begin, flush=True)
if sys.argv[3:] == ["killed"]:
    os.kill(os.getpid(), signal.SIGKILL)
node.destroy_node()
rclpy.try_shutdown()
"""
"""Prints the number of latched topics without a message, and the time until all had one."""


def join(rig: Rig, drones: int, *ending: str) -> tuple[int, float]:
    """Join with a process that uses only rclpy.

    Args:
        rig: Defines the ROS domain.
        drones: Number of drones whose poses it waits for, besides grid and report.
        ending: `killed` for a process that ends without notice.

    Returns:
        Number of topics without a message, and the seconds until all had one.
    """
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(drones), str(GIVE_UP_S), *ending],
        cwd=ROOT,
        env=os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": str(rig.domain)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
        timeout=3 * GIVE_UP_S,
        check=not ending,
    )
    left, time_s = done.stdout.split()
    return int(left), float(time_s)


def late_joiner(run: Run) -> Figures:
    """Let one process after the other join a running mission."""
    drones, joiners = 10, run.size(100, 3)
    times_s, missing = [], 0
    with domain(run.folder) as rig:
        sim = rig.sim(SEARCHED | {"grid_size": 20, "num_drones": drones})
        sim.fly(*[1] * drones)
        for _ in run.each(range(joiners), "joiners"):
            left, time_s = join(rig, drones)
            missing += left > 0
            times_s.append(time_s)
    return {
        "joiners": joiners,
        "missing": missing,
        "in_time": sum(time_s <= WITHIN_S for time_s in times_s),
        "late": sum(time_s > WITHIN_S for time_s in times_s),
        "slowest_s": max(times_s),
    }


ROWS = (
    Row(
        "late_joiner",
        "Processes that join late get grid, poses and report within 2 s",
        late_joiner,
        "{in_time} of {joiners}, the slowest after {slowest_s:.2f} s",
        (Goal("missing", most=0), Goal("late", most=0, timed=True)),
    ),
)
