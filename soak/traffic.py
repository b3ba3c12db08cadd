# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many commands at once, many drones, and repeated or reordered commands."""

from __future__ import annotations

import random
import time
from typing import Any

import numpy as np
from std_msgs.msg import Int32MultiArray, String

from benchmarks import lockstep
from dsse_ros.world.scenario.rules import profile
from msg_adapters.step_report import step_report_from_message
from soak.rigs import Rig, domain
from soak.row import Figures, Goal, Row, Run, zero

ACTIONS = 9
HERTZ = 10
SEARCHED: dict[str, Any] = {
    "rules": "v2",
    "probability_of_detection": 0.0,
    "timestep_limit": 10**6,
    "seed": 1,
}
"""Nobody is found, drones neither collide nor leave the grid: every command is valid."""


def load(run: Run) -> Figures:
    """Command each of 100 drones on its own topic, ten times a second.

    The short form waits for each step, even on a busy machine.
    """
    drones, steps = run.size((100, 60 * HERTZ), (100, 2 * HERTZ))
    commands = np.random.default_rng(1).integers(0, ACTIONS, (steps, drones), np.int8)
    with domain(run.folder) as rig:
        sim = rig.sim(SEARCHED | {"grid_size": 40, "num_drones": drones})
        publishers = [sim.talk(String, f"drone{i}/cmd_action_name") for i in range(drones)]
        messages = [String(data=name) for name in profile("v2").actions]
        took_s = []
        begin_s = time.monotonic()
        for step in run.each(range(steps), "steps"):
            wait_until(rig, begin_s + step / HERTZ)
            sent_s, seen = time.monotonic(), len(sim.reports)
            for publisher, action in zip(publishers, commands[step].tolist(), strict=True):
                publisher.publish(messages[action])
            if run.quick:
                sim.next_report(seen)
            while len(sim.reports) <= seen and time.monotonic() < begin_s + (step + 1) / HERTZ:
                rig.executor.spin_once(timeout_sec=0.001)
            took_s.append(time.monotonic() - sent_s)
        wait_until(rig, time.monotonic() + 1.0)
        health = sim.health()
        reports = [step_report_from_message(message) for message in sim.reports]
    return {
        "drones": drones,
        "hertz": HERTZ,
        "sent": steps * drones,
        "lost": steps * drones - taken_in_turn(reports, commands),
        "gaps": gaps(reports),
        "refused": int(health["rejected"]),
        "step_p50_ms": 1e3 * float(np.percentile(took_s, 50)),
        "step_p99_ms": 1e3 * float(np.percentile(took_s, 99)),
    }


def wait_until(rig: Rig, time_s: float) -> None:
    """Receive messages until then."""
    while (left_s := time_s - time.monotonic()) > 0:
        rig.executor.spin_once(timeout_sec=left_s)


def taken_in_turn(reports: list[Any], commands: Any) -> int:
    """Return how many commands (K, N) the drones carried out in sequence.

    A command that the next one replaces before its step is lost, and later ones are a step late.
    """
    done = [report["action"] for report in reports[1:]]
    found = 0
    for drone in range(commands.shape[1]):
        following = iter(commands[:, drone].tolist())
        for action in (int(actions[drone]) for actions in done):
            if action not in following:
                break
            found += 1
    return found


def taken(reports: list[Any], commands: Any) -> int:
    """Return how many commands (K, N) the drones carried out in their steps."""
    done = {int(report["step"][0]): report["action"] for report in reports}
    return sum(
        int((done[step] == actions).sum())
        for step, actions in enumerate(commands, start=1)
        if step in done
    )


def gaps(reports: list[Any]) -> int:
    """Return how many reports are missing, repeated or reordered."""
    steps = [int(report["step"][0]) for report in reports]
    return sum(after != before + 1 for before, after in zip(steps, steps[1:], strict=False))


def big_swarm(run: Run) -> Figures:
    """Let 400 drones step at full speed; compare with rclpy that only sends as many messages."""
    drones = run.size(400, 20)
    found = lockstep.measure(
        rounds=run.size(3, 1), seconds=run.size(10.0, 0.5), log=_raise, drones=(drones,)
    )[str(drones)]
    rate, limit = max(found["sim_node"]), max(found["ping_pong"])
    return {
        "drones": drones,
        "steps_per_s": rate,
        "rclpy_steps_per_s": limit,
        "share": rate / limit,
        "messages_per_step": found["messages_per_step"],
    }


def _raise(line: str) -> None:
    if ": " in line and "drones: " in line:
        raise AssertionError(line)


def duplicates(run: Run) -> Figures:
    """Send joint actions shuffled within a window of steps, and a fifth of them twice.

    Actions that a step still needs after its window are sent again, as by a planner.
    """
    steps, window, drones = run.size(10_000, 200), 5, 5
    draw = random.Random(1)
    commands = np.random.default_rng(2).integers(0, ACTIONS, (steps, drones), np.int8)
    sent = 0
    with domain(run.folder) as rig:
        sim = rig.sim(SEARCHED | {"grid_size": 20, "num_drones": drones, "compute_pos": "never"})
        sim.talk(Int32MultiArray, "joint_action")

        def send(step: int) -> None:
            nonlocal sent
            sent += 1
            sim.joint(*commands[step].tolist(), step=step)

        for first in run.each(range(0, steps, window), "windows"):
            batch = list(range(first, min(first + window, steps)))
            shuffled = batch + draw.sample(batch, k=max(len(batch) // 5, 1))
            draw.shuffle(shuffled)
            for step in shuffled:
                send(step)
            sim.wait_until_quiet()
            while (step := len(sim.reports) - 1) <= batch[-1]:
                send(step)
                sim.next_report(step + 1)
        sim.wait_until_quiet()
        health = sim.health_when(lambda h: int(h["step"]) == steps)
        reports = [step_report_from_message(message) for message in sim.reports]
    refused, again = int(health.get("rejected.stale_step", 0)), int(health["duplicates"])
    return {
        "sent": sent,
        "steps": steps,
        "taken": taken(reports, commands) // drones,
        "wrong": steps * drones - taken(reports, commands),
        "gaps": gaps(reports),
        "stale_refused": refused,
        "duplicates": again,
        "unaccounted": abs(sent - steps - refused - again),
    }


ROWS = (
    Row(
        "load",
        "Commands of 100 drones at 10 Hz for 60 s: none is lost",
        load,
        "{lost} of {sent} commands lost, {gaps} gaps, step p99 {step_p99_ms:.0f} ms",
        (*zero("lost", "gaps", "refused"), Goal("step_p99_ms", most=50, timed=True)),
    ),
    Row(
        "big_swarm",
        "400 drones in lockstep, all topics",
        big_swarm,
        "{steps_per_s:.1f} steps/s, {share:.2f} of bare rclpy with as many messages",
        (Goal("steps_per_s", least=1, timed=True),),
    ),
    Row(
        "duplicates",
        "10 000 joint actions, a fifth of them doubled, all shuffled: each is applied at most "
        "once, and stale ones are refused",
        duplicates,
        "{taken} of {sent} taken, {stale_refused} stale ones refused, {duplicates} duplicates, "
        "{wrong} wrong",
        zero("wrong", "gaps", "unaccounted"),
    ),
)
