# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Kill planner, node and bridge, and start them again."""

from __future__ import annotations

import random
import time
from pathlib import Path
from typing import Any

import numpy as np

from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.step.constants import NO_ACTION
from msg_adapters.step_report import step_report_from_message
from soak.late_joiner import join
from soak.rigs import DOWN, SEARCH, UP, Bridge, Process, Rig, Sim, autopilots, domain, fly
from soak.row import Figures, Goal, Row, Run, zero
from soak.traffic import ACTIONS, SEARCHED

COMMAND_TIMEOUT_S = 0.5
RECOVERY_S = 2.0


# The planner


def planner_killed(run: Run) -> Figures:
    """Kill the planner of three drones, two of which another node commands as well.

    Also measures how long a bare rclpy process that replaces a killed one waits for its topics.
    """
    kills = run.size(20, 2)
    policy_s: list[float] = []
    recovery_s: list[float] = []
    disturbed = unheld = 0
    with domain(run.folder) as rig:
        sim = rig.sim(
            SEARCHED
            | {
                "grid_size": 20,
                "num_drones": 3,
                "command_timeout": COMMAND_TIMEOUT_S,
                "missing_action": "hold",
                "step_rate": 20.0,
            }
        )
        planner = start_planner(rig, sim)
        for kill in run.each(range(kills), "kills"):
            planner.kill()
            sim.wait_until_quiet()
            # Its earlier messages may still command a step.
            for _ in range(2):
                others_fly(sim, kill)
            began_s = time.monotonic()
            report = others_fly(sim, kill)
            policy_s.append(time.monotonic() - began_s)
            unheld += int(report["action"][0]) != NO_ACTION
            disturbed += report["action"][1:].tolist() != [kill % ACTIONS] * 2
            began_s = time.monotonic()
            planner = start_planner(rig, sim)
            recovery_s.append(time.monotonic() - began_s)
        rclpy_s = [join(rig, 0, "killed")[1] for _ in run.each(range(kills), "bare rclpy")]
    return {
        "kills": kills,
        "unheld": unheld,
        "disturbed": disturbed,
        "policy_s": max(policy_s),
        "recovery_s": max(recovery_s),
        "recovery_median_s": float(np.median(recovery_s)),
        "rclpy_recovery_s": max(rclpy_s),
    }


def start_planner(rig: Rig, sim: Sim) -> Process:
    """Start a planner and return when a step carries out its command."""
    planner = rig.start("planner_node", {"planner": "greedy", "resend_period": 0.1})
    seen = len(sim.reports)

    def led() -> bool:
        return any(
            step_report_from_message(message)["action"][0] != NO_ACTION
            for message in sim.reports[seen:]
        )

    rig.until(led, "a step that the planner leads")
    return planner


def others_fly(sim: Sim, turn: int) -> Any:
    """Command the other two drones and return the report of the step."""
    seen = len(sim.reports)
    for drone in (1, 2):
        sim.command(drone, turn % ACTIONS)
    return sim.next_report(seen)


# The simulation

FIELDS: dict[str, Any] = {
    "rules": "v2",
    "grid_size": 20,
    "num_drones": 4,
    "vector": (0.2, -0.1),
    "person_amount": 2,
    "probability_of_detection": 1e-9,
    "timestep_limit": 10**6,
}


def node_killed(run: Run) -> Figures:
    """Kill a node at random moments, and compare its next steps with a mission never killed.

    Each kill is in a separate mission, because a snapshot has all steps of its mission.
    """
    kills, steps = run.size((50, 1000), (2, 60))
    draw = random.Random(3)
    different = lost_steps = 0
    resumed_s = []
    with domain(run.folder) as rig:
        for kill in run.each(range(kills), "kills"):
            flown = Unbroken(seed=kill)
            parameters = {
                **FIELDS,
                "seed": kill,
                "compute_pos": "never",
                "snapshot_file": str(run.folder / f"{kill}.snapshot"),
                "snapshot_every": 1,
            }
            sim = rig.sim(parameters, namespace=f"/before{kill}")
            for _ in range(draw.randrange(3, 30)):
                sim.fly(*flown.command(sim.step_number))
            # It is killed at any point of its work, with a command under way.
            sim.joint(*flown.command(sim.step_number))
            killed_s = time.monotonic() + draw.random() * 0.02
            while time.monotonic() < killed_s:
                rig.executor.spin_once(timeout_sec=0.001)
            sim.process.kill()
            rig.drain()
            before = sim.step_number
            began_s = time.monotonic()
            sim = rig.sim(parameters | {"resume": True}, namespace=f"/after{kill}")
            resumed_s.append(time.monotonic() - began_s)
            lost_steps = max(lost_steps, before - sim.step_number)
            different += not same(sim.report, flown.results[sim.step_number])
            for _ in range(steps):
                step = sim.step_number
                report = sim.fly(*flown.command(step))
                different += not same(report, flown.results[step + 1])
            sim.process.stop()
        snapshot = flown.mission.snapshot().to_bytes()
    return {
        "kills": kills,
        "steps_compared": kills * (steps + 1),
        "different": different,
        "lost_steps": lost_steps,
        "resumed_s": max(resumed_s),
        **damaged(snapshot, run.size(1000, 100), run.folder),
    }


class Unbroken:
    """A mission without kills, with random commands.

    Attributes:
        mission: The mission.
        results: Results of its start and of each commanded step.
    """

    def __init__(self, seed: int) -> None:
        self.mission = Mission(parallel_env(**FIELDS), seed, belief=False)
        self.results = [self.mission.result]
        self._draw = np.random.default_rng(seed)
        self._joint: list[list[int]] = []

    def command(self, step: int) -> list[int]:
        """Return the commands of a step, and make the step."""
        while len(self._joint) <= step:
            self._joint.append(self._draw.integers(0, ACTIONS, FIELDS["num_drones"]).tolist())
            self.mission.command_all(self._joint[-1])
            self.results.append(self.mission.advance("hold"))
        return list(self._joint[step])


def same(report: Any, result: Any) -> bool:
    """Return whether a report equals the result of a step, bit for bit."""
    pairs = (("action", "actions"), ("reward", "rewards"), ("found", "found"), ("held", "held"))
    cells = np.stack([report["col"], report["row"]], axis=1)
    return (
        int(report["step"][0]) == result.step
        and cells.tolist() == result.cells.tolist()
        and all(
            np.array_equal(
                report[ours].astype(getattr(result, theirs).dtype), getattr(result, theirs)
            )
            for ours, theirs in pairs
        )
    )


def damaged(snapshot: bytes, number: int, folder: Path) -> Figures:
    """Load snapshots that are truncated, changed, doubled, swapped or not ours."""
    draw = random.Random(6)
    path = folder / "damaged.snapshot"
    refused = 0
    for _ in range(number):
        path.write_bytes(damage(snapshot, draw))
        try:
            Snapshot.load(path)
        except SnapshotError as error:
            refused += "\n" not in str(error)
    return {"damaged": number, "damaged_taken": number - refused}


def damage(snapshot: bytes, draw: random.Random) -> bytes:
    """Return a damaged snapshot."""
    data = bytearray(snapshot)
    at, to = sorted(draw.randrange(len(data)) for _ in range(2))
    match draw.randrange(6):
        case 0:
            return bytes(data[:at])
        case 1:
            data[at] ^= draw.randrange(1, 256)
        case 2:
            del data[at : max(to, at + 1)]
        case 3:
            data[at:at] = draw.randbytes(draw.randrange(1, 100))
        case 4:
            data += draw.randbytes(draw.randrange(1, 100))
        case _:
            return draw.randbytes(draw.randrange(2000))
    return bytes(data)


# The bridge


def bridge_killed(run: Run) -> Figures:
    """Kill the bridge of three vehicles in flight; a pilot has landed one of them before."""
    kills = run.size(20, 2)
    draw = random.Random(7)
    route = [UP, UP, UP, UP, DOWN, DOWN, DOWN, DOWN]
    taken_off = rearmed = dropped = 0
    taken_up_s = []
    with domain(run.folder) as rig, autopilots((), (), ("pilot@airborne:20=LAND",)) as vehicles:
        sim = rig.sim(
            SEARCH_OF_VEHICLES
            | {"drones_positions": [0, 5, 1, 5, 2, 5], "timestep_limit": kills + 4}
        )
        bridge = Bridge(rig, vehicles)
        rig.until(lambda: bridge.state(2).get("lost"), "the loss of drone2")
        bridge.until(2, armed="false")
        for i in (0, 1):
            bridge.until(i, arrived="true", flying="true")
        for kill in run.each(range(kills), "kills"):
            step = sim.step_number
            sim.joint(*[route[kill % len(route)]] * 3)
            end_s = time.monotonic() + draw.random() * 1.5
            while time.monotonic() < end_s:
                rig.executor.spin_once(timeout_sec=0.02)
            bridge.process.kill()
            bridge = Bridge(rig, vehicles)
            began_s = time.monotonic()
            for i in (0, 1):
                bridge.until(i, connected="true", flying="true", arrived="true")
            taken_up_s.append(time.monotonic() - began_s)
            bridge.until(2, connected="true")
            rig.until(lambda s=step: sim.step_number == s + 1, "the step")
            rearmed += bridge.state(2)["armed"] != "false"
            taken_off += bridge.process.output.count(": TakeOff(")
            dropped += sim.report["terminated"][:2].any()
        while sim.flying:
            fly(sim, SEARCH, SEARCH, SEARCH)
        for i in range(3):
            bridge.until(i, armed="false", flying="false")
        report = sim.report
    return {
        "kills": kills,
        "steps": int(report["step"][0]),
        "steps_missing": kills + 5 - int(report["step"][0]),
        "taken_off_again": taken_off,
        "armed_again": rearmed,
        "dropped": int(dropped),
        "taken_up_s": max(taken_up_s),
    }


SEARCH_OF_VEHICLES: dict[str, Any] = {
    "grid_size": 6,
    "cell_size": 130.0,
    "altitude": 120.0,
    "origin_lat": -24.04,
    "origin_lon": -46.17,
    "person_initial_position": [5, 0],
    "probability_of_detection": 0.0,
    "seed": 1,
    "vehicle_time": "awaited",
}

ROWS = (
    Row(
        "planner_killed",
        "Planner killed: missing_action within command_timeout, other drones unaffected, "
        "recovery within 2 s of the restart",
        planner_killed,
        "{kills} kills: policy after {policy_s:.2f} s of a time-out of 0.5 s, {disturbed} others "
        "disturbed, recovery within {recovery_s:.2f} s, {recovery_median_s:.2f} s in the median "
        "(bare rclpy, without the start of a process, up to {rclpy_recovery_s:.2f} s)",
        (
            *zero("unheld", "disturbed"),
            Goal("policy_s", most=COMMAND_TIMEOUT_S + 0.1, timed=True),
            Goal("recovery_s", most=RECOVERY_S, timed=True),
        ),
    ),
    Row(
        "node_killed",
        "Node killed at random moments: it resumes from its snapshot, and the next 1000 steps are "
        "bit for bit those of a run that was not killed; damaged snapshots are refused",
        node_killed,
        "{kills} kills, {different} of {steps_compared} steps differ; {damaged_taken} of {damaged} "
        "damaged snapshots taken",
        (*zero("different", "damaged_taken"), Goal("lost_steps", most=1)),
    ),
    Row(
        "bridge_killed",
        "Bridge killed in mid-flight and started again: vehicles are taken up where they are, the "
        "mission ends with every step flown, nothing is armed that was not",
        bridge_killed,
        "{kills} kills, {steps_missing} of {steps} steps missing, {armed_again} armed again, taken "
        "up within {taken_up_s:.1f} s",
        zero("steps_missing", "taken_off_again", "armed_again", "dropped"),
    ),
)
