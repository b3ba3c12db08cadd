# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lockstep steps per second of `sim_node`, and of bare rclpy that sends the same messages."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import ROOT
from benchmarks.processes import BenchmarkError, Process, last_line
from benchmarks.workload import random_walks
from dsse_ros.world.scenario.rules import profile

DRONES = 20
GRID_SIZE = 40
LIMIT = 100
STEPS = LIMIT + 1
CAPTURE_TIMEOUT_S = 120

# Nobody is found, but beliefs learn from each search.
UNLIKELY = {"scenario.probability_of_detection": 1e-12}
BELIEFS: dict[str, dict[str, Any]] = {
    "none": {"compute_pos": "never", **UNLIKELY},
    "published": {"publish_belief": "true", **UNLIKELY},
}


def measure(
    *,
    rounds: int,
    seconds: float,
    log: Callable[[str], None],
    drones: Sequence[int] = (DRONES,),
) -> dict[str, dict[str, Any]]:
    """Return steps per second by number of drones; both run in turn."""
    found = {}
    for num_drones in drones:
        try:
            found[str(num_drones)] = figures = _measure(num_drones, rounds, seconds)
        except (BenchmarkError, subprocess.SubprocessError) as error:
            log(f"lockstep with {num_drones} drones: {error}")
            continue
        log(
            f"{num_drones:>7} drones{max(figures['sim_node']):10.1f} sim_node"
            f"{max(figures['ping_pong']):10.1f} ping-pong   steps/s"
            f"{figures['messages_per_step']:8.1f} messages per step"
        )
    return found


def _measure(num_drones: int, rounds: int, seconds: float) -> dict[str, Any]:
    rates: dict[str, list[float]] = {"sim_node": [], "ping_pong": []}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        workload, recording = folder / "walk.npz", folder / "recording.json"
        starts = _write_walk(workload, "paper", num_drones)
        domains = {"sim_node": _environment(0), "ping_pong": _environment(1)}
        stack.enter_context(
            _node("dsse_ros.ros.nodes.sim_node", _parameters(starts), domains["sim_node"])
        )
        subprocess.run(
            [sys.executable, "-m", "benchmarks.ros.capture", "sim_node", workload, recording],
            cwd=ROOT,
            env=domains["sim_node"],
            check=True,
            timeout=CAPTURE_TIMEOUT_S,
            stdin=subprocess.DEVNULL,
        )
        arguments = [str(recording), str(STEPS)]
        stack.enter_context(_node("benchmarks.ros.ping_pong", arguments, domains["ping_pong"]))

        peers = {}
        for name, node in (("sim_node", "sim_node"), ("ping_pong", "ping_pong")):
            peers[name] = stack.enter_context(Process("lockstep", environment=domains[name]))
            peers[name].set_up({"node": node, "workload": str(workload)})
            peers[name].rate(seconds)
        _take_turns(peers, rounds, seconds, rates)
        topics = json.loads(recording.read_text())
    return {
        **rates,
        "messages_per_step": float(sum(topic["per_step"] for topic in topics)),
        "bytes_per_step": sum(len(t["message"]) * 3 // 4 for t in topics if t["per_step"]),
    }


def measure_belief(
    *, rounds: int, seconds: float, log: Callable[[str], None]
) -> dict[str, dict[str, list[float]]]:
    """Return steps per second by rules, of missions without a belief and of one that goes out.

    Both run in turn, with `DRONES` drones.
    """
    found = {}
    for rules in ("paper", "v2"):
        rates: dict[str, list[float]] = {name: [] for name in BELIEFS}
        try:
            with ExitStack() as stack:
                workload = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "walk.npz"
                starts = _write_walk(workload, rules, DRONES)
                peers = {}
                for offset, (name, parameters) in enumerate(BELIEFS.items()):
                    domain = _environment(offset)
                    arguments = _parameters(starts, rules=rules, **parameters)
                    stack.enter_context(_node("dsse_ros.ros.nodes.sim_node", arguments, domain))
                    peers[name] = stack.enter_context(Process("lockstep", environment=domain))
                    peers[name].set_up({"node": "sim_node", "workload": str(workload)})
                    peers[name].rate(seconds)
                _take_turns(peers, rounds, seconds, rates)
        except (BenchmarkError, subprocess.SubprocessError) as error:
            log(f"belief over ROS, {rules}: {error}")
            continue
        found[rules] = rates
        log(
            f"{rules:>7}{max(rates['none']):10.1f} without belief"
            f"{max(rates['published']):10.1f} with belief   steps/s"
        )
    return found


def _take_turns(
    peers: dict[str, Process], rounds: int, seconds: float, rates: dict[str, list[float]]
) -> None:
    """Add the rates of each peer, in one order and then in the other."""
    for turn in range(rounds):
        for name in list(peers)[:: 1 if turn % 2 == 0 else -1]:
            rates[name].append(peers[name].rate(seconds))


def _write_walk(path: Path, rules: str, num_drones: int) -> NDArray[np.int64]:
    """Write the actions of a mission, and return the cells (N, 2) where the drones start."""
    starts, actions = random_walks(
        GRID_SIZE, num_drones, profile(rules).actions, STEPS, worlds=1, seed=1
    )
    np.savez(path, starts=starts, actions=actions)
    return starts


def _environment(offset: int) -> dict[str, str]:
    """Return the variables of a domain that no other run here uses."""
    domain = 10 + (2 * os.getpid() + offset) % 90
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


def _parameters(starts: NDArray[np.int64], **others: Any) -> list[str]:
    values = {
        "rules": "paper",
        "scenario.grid_size": GRID_SIZE,
        "scenario.drones_positions": starts.ravel().tolist(),
        "scenario.timestep_limit": LIMIT,
        "scenario.probability_of_detection": 0.0,
        "auto_reset": "true",
        "seed": 1,
        **others,
    }
    arguments = [part for name, value in values.items() for part in ("-p", f"{name}:={value}")]
    return ["--ros-args", "--log-level", "warn", *arguments]


@contextmanager
def _node(module: str, arguments: list[str], environment: dict[str, str]) -> Iterator[None]:
    """Run a node while the block lasts.

    Raises:
        BenchmarkError: If the block fails because the node has ended.
    """
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        try:
            yield
        except Exception:
            if process.poll() is not None:
                raise BenchmarkError(f"{module}: {last_line(errors)}") from None
            raise
        finally:
            process.terminate()
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
