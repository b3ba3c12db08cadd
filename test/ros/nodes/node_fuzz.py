# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fuzzes what the nodes subscribe to, while vehicles fly.

`PYTHONPATH=test/vehicles/control python test/ros/nodes/node_fuzz.py --minutes 60`

A relay stands between a simulation and the other nodes. It passes messages on, and adds copies with
fields replaced by extremes, with other JSON, and with damaged bytes.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import json
import math
import multiprocessing
import os
import random
import struct
import sys
import tempfile
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import rclpy
from bridge_rig import SEARCHED, Bridge, autopilots
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message
from rig import LATCHED, RELIABLE, TIMEOUT_S, Inbox, Rig, Sim
from sensor_msgs.msg import Image, PointCloud2, TimeReference
from std_msgs.msg import Float64MultiArray, Int32MultiArray, String
from std_srvs.srv import SetBool, Trigger

REAL = "/real"
"""Namespace of the simulation behind the relay."""
DRONES = 2
FROM_SIM = {
    "agents": String,
    "step_report": PointCloud2,
    "mission_report": PointCloud2,
    "vehicle_tasks": PointCloud2,
    "probability": Image,
    "probability_grid": OccupancyGrid,
    "belief": Image,
    "belief_grid": OccupancyGrid,
    "probability_of_success": Float64MultiArray,
}
"""Topics of `sim_node` that the planner, the bridge or the dashboard subscribe to."""
TO_SIM = {
    "joint_action": Int32MultiArray,
    **{
        f"drone{i}/{name}": kind
        for i in range(DRONES)
        for name, kind in {
            "cmd_action_name": String,
            "command_pose": PoseStamped,
            "vehicle_pose": PoseStamped,
            "vehicle_state": DiagnosticArray,
            "vehicle_time": TimeReference,
        }.items()
    },
}
"""Topics that `sim_node` subscribes to; the dashboard subscribes to those of the vehicles too."""
ODD = (math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e-300, 1e19, 1e308, -1e308, -1.0, 0.5)
WHOLE = (0, 1, -1, 2, 2**31 - 1, -(2**31), 2**32 - 1, 2**32, 2**63 - 1, 2**63, -(2**63), 10**30)


UP = f"..{os.sep}"


class Mutator:
    """Makes hostile copies of messages.

    Args:
        draw: Source of the choices.
        texts: Hostile texts, such as names of files.
    """

    def __init__(self, draw: random.Random, texts: list[str]) -> None:
        self._draw = draw
        self._texts = ["", "a b", f"{UP}x", "{}", "9" * 5000, "drone0", "map", "é😀", *texts]

    def hostile(self, message: Any) -> Any:
        """Return a hostile copy of a message, or its damaged bytes."""
        if self._draw.random() < 0.15:
            return self._damaged(bytes(serialize_message(message)))
        changed = copy.deepcopy(message)
        for _ in range(self._draw.choice([1, 1, 1, 2, 5])):
            self._replace(changed)
        return changed

    def _damaged(self, data: bytes) -> bytes:
        changed = bytearray(data)
        for _ in range(self._draw.choice([1, 2, 8])):
            # The first four bytes say how the rest is encoded.
            at = self._draw.randrange(4, max(len(changed), 5))
            changed[at : at + 1] = bytes([self._draw.choice([0, 1, 127, 128, 255])])
        return bytes(
            changed[: self._draw.randrange(4, len(changed) + 1)] if at % 3 == 0 else changed
        )

    def _replace(self, message: Any) -> None:
        """Replace a field of a message, or of one inside it."""
        types = message.get_fields_and_field_types()
        if not types:
            return
        name = self._draw.choice(list(types))
        value, kind = getattr(message, name), types[name]
        if hasattr(value, "get_fields_and_field_types"):
            self._replace(value)
        elif kind == "boolean":
            setattr(message, name, not value)
        elif kind in ("double", "float"):
            odd = self._draw.choice([*ODD, value + 1e-9, -value])
            too_large = kind == "float" and math.isfinite(odd) and abs(odd) > 3e38
            setattr(message, name, 3e38 if too_large else odd)
        elif kind == "string":
            setattr(message, name, self.text(value))
        elif kind in ("byte", "octet"):
            setattr(message, name, bytes([self._draw.choice([0, 1, 2, 3, 4, 255])]))
        elif "int" in kind and "<" not in kind and "[" not in kind:
            setattr(message, name, self._integer(kind, value))
        else:
            self._replace_items(message, name, value, kind)

    def _integer(self, kind: str, value: int) -> int:
        bits = int(kind.lstrip("uint"))
        low, high = (
            (0, 2**bits - 1) if kind[0] == "u" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        )
        drawn = self._draw.choice([*WHOLE, value + 1, value - 1, value * 1000])
        return min(max(drawn, low), high)

    def _replace_items(self, message: Any, name: str, value: Any, kind: str) -> None:
        """Replace some of the items of a sequence."""
        items = list(value)
        inner = [item for item in items if hasattr(item, "get_fields_and_field_types")]
        turn = self._draw.random()
        if inner and turn < 0.6:
            self._replace(self._draw.choice(inner))
            return
        if "[" in kind:
            # A sequence of fixed length.
            changed = [self._draw.choice(ODD) if "double" in kind else item for item in items]
        elif turn < 0.7:
            changed = items[: self._draw.randrange(len(items) + 1)]
        elif turn < 0.8 or not items or inner:
            changed = (items * 3)[:5000]
        elif "uint8" in kind:
            changed = list(self._packed(bytes(items)))
        else:
            of_floats = "double" in kind or "float" in kind
            pool = ODD if of_floats else [self._integer(kind.split("<")[1][:-1], 0)]
            at = self._draw.randrange(len(items))
            changed = [*items[:at], self._draw.choice(list(pool)), *items[at + 1 :]]
        setattr(message, name, changed)

    def _packed(self, data: bytes) -> bytes:
        """Replace a packed number."""
        form = self._draw.choice(["<f", "<d", "<i", "<q", "<b"])
        size = struct.calcsize(form)
        if len(data) < size:
            return data
        at = self._draw.randrange(len(data) // size) * size
        if form in ("<f", "<d"):
            numbers = [odd for odd in ODD if form == "<d" or not abs(odd) > 3e38 or odd != odd]
            packed = struct.pack(form, self._draw.choice(numbers))
        else:
            bits = 8 * size - 1
            packed = struct.pack(form, min(max(self._draw.choice(WHOLE), -(2**bits)), 2**bits - 1))
        return data[:at] + packed + data[at + size :]

    def text(self, value: str) -> str:
        """Return a hostile text; where it was JSON, most often JSON again."""
        if self._draw.random() < 0.9:
            # A text that was replaced before need not be JSON.
            with contextlib.suppress(ValueError):
                return json.dumps(self._json(json.loads(value)))
        return self._draw.choice([*self._texts, value[: len(value) // 2], value * 3])

    def _json(self, value: Any) -> Any:
        """Replace a value in JSON."""
        if isinstance(value, dict) and value and self._draw.random() < 0.9:
            name = self._draw.choice(list(value))
            if self._draw.random() < 0.05:
                return {key: item for key, item in value.items() if key != name}
            return value | {name: self._json(value[name])}
        if isinstance(value, list) and value and self._draw.random() < 0.7:
            at = self._draw.randrange(len(value))
            return [*value[:at], self._json(value[at]), *value[at + 1 :]]
        path = self._draw.choice(self._texts)
        near = [value + 1, value - 1, value * 10, -value] if isinstance(value, int | float) else []
        return self._draw.choice(
            [
                None, True, "", "\ud800", "a\0b", "x" * 2000, path, [], {}, [value] * 3,
                {"a": value}, {"path": path, "sha256": "0" * 64}, *ODD, *WHOLE, *near, *near,
            ]
        )  # fmt: skip


class Relay:
    """Passes on what a simulation and its peers publish, with hostile copies beside.

    Args:
        rig: The domain.
        mutator: Makes the copies.
    """

    def __init__(self, rig: Rig, mutator: Mutator) -> None:
        self.sent = 0
        self._mutator = mutator
        self._draw = random.Random(0)
        node = rig.node
        # By topic: the publishers of copies, and the last message seen.
        self._outlets: dict[str, list[Any]] = {}
        self._seen: dict[str, Any] = {}
        for name, kind in FROM_SIM.items():
            self._outlets[name] = [node.create_publisher(kind, name, LATCHED)]
            node.create_subscription(kind, f"{REAL}/{name}", self._passing(name, 0), LATCHED)
        for name, kind in TO_SIM.items():
            qos = LATCHED if kind is DiagnosticArray else RELIABLE
            to_sim = node.create_publisher(kind, f"{REAL}/{name}", qos)
            if "vehicle" in name:
                self._outlets[name] = [to_sim, node.create_publisher(kind, name, qos)]
            else:
                self._outlets[name] = [to_sim]
            self._seen[name] = kind()
            if "vehicle" in name or name == "joint_action":
                node.create_subscription(kind, name, self._passing(name, 0), RELIABLE)
        self._hostile: set[bytes] = set()

    def _passing(self, name: str, outlet: int) -> Any:
        def passing(message: Any) -> None:
            if bytes(serialize_message(message)) in self._hostile:
                # Our own copy, which came back.
                return
            self._seen[name] = message
            self._outlets[name][outlet].publish(message)

        return passing

    def attack(self) -> None:
        """Send a hostile copy of a message; for some, pass the true one on again."""
        name = self._draw.choice(list(self._seen))
        hostile = self._mutator.hostile(self._seen[name])
        sent = hostile if isinstance(hostile, bytes) else bytes(serialize_message(hostile))
        if len(self._outlets[name]) > 1:
            self._hostile.add(sent)
        for outlet in self._outlets[name]:
            outlet.publish(hostile)
        self.sent += 1
        if self._draw.random() < 0.5:
            self._outlets[name][0].publish(self._seen[name])


class Operator:
    """Calls `~/hold` from a process of its own, which has nothing else to do.

    Args:
        domain: The domain of the bridge.
    """

    def __init__(self, domain: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._asked, asked = context.Pipe()
        self._process = context.Process(target=_hold, args=(domain, asked), daemon=True)
        self._process.start()

    def hold(self) -> float:
        """Return the time to the answer, s."""
        self._asked.send(True)
        assert self._asked.poll(TIMEOUT_S), "no answer of ~/hold"
        answered_s: float = self._asked.recv()
        return answered_s

    def close(self) -> None:
        """End the process."""
        self._asked.send(False)
        self._process.join()


def _hold(domain: int, asked: Connection) -> None:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = rclpy.create_node("operator", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    client = node.create_client(Trigger, "/mavlink_bridge/hold")
    client.wait_for_service()
    while asked.recv():
        begun_s = time.monotonic()
        answer = client.call_async(Trigger.Request())
        # Not spin_until_future_complete, which spins without waiting.
        while not answer.done():
            executor.spin_once(timeout_sec=1.0)
        asked.send(time.monotonic() - begun_s)
    rclpy.shutdown(context=context)


class Attack:
    """A flight under attack.

    Args:
        rig: The domain.
        inboxes: What the rig keeps of the flight.
        seed: Of the choices.

    Attributes:
        slowest_s: Longest time in which `~/hold` was answered.
    """

    def __init__(self, rig: Rig, inboxes: list[Inbox], seed: int) -> None:
        self.rig = rig
        self.slowest_s = 0.0
        self._inboxes = inboxes
        self._operator = Operator(rig.domain)
        self._guarded = rig.folder / "precious"
        self._guarded.mkdir()
        (self._guarded / "file.npy").write_bytes(b"precious")
        os.mkfifo(self._guarded / "pipe.npy")
        texts = [str(self._guarded / name) for name in ("file.npy", "pipe.npy", "new.npy", "")]
        self._files = self._found()
        self.relay = Relay(
            rig,
            Mutator(
                random.Random(seed), [*texts, "/dev/zero", f"{UP}{rig.folder.name}{os.sep}precious"]
            ),
        )

    def _found(self) -> dict[str, tuple[int, int]]:
        return {
            path.name: (path.lstat().st_mtime_ns, path.lstat().st_size)
            for path in self._guarded.iterdir()
        }

    def run(self, messages: int, turn: int = 50) -> None:
        """Send so many hostile messages, and hold the nodes to what they promise meanwhile."""
        for i in range(messages):
            self.relay.attack()
            self.rig.executor.spin_once(timeout_sec=0.005)
            if i % turn == turn - 1:
                self.check()

    def check(self) -> None:
        """Check that the nodes run and answer, and that no file was touched."""
        self.slowest_s = max(self.slowest_s, self._operator.hold())
        for inbox in self._inboxes:
            del inbox[:-1]
        for process in self.rig.processes:
            assert process.running, process.output[-5000:]
            for word in ("Traceback", "defect", "FATAL"):
                assert word not in process.output, process.output[-20000:]
        assert self._found() == self._files
        # Where the nodes run they leave their logs, and the bridge its state.
        files = {path.name for path in self.rig.folder.iterdir() if path.suffix != ".log"}
        assert files <= {self._guarded.name, "state"}
        # The flight goes on.
        self.rig.call(SetBool, "/mavlink_bridge/arm", data=True)

    def close(self) -> None:
        """End what the attack started beside the rig."""
        self._operator.close()


def attacks(rig: Rig, seed: int) -> Iterator[Attack]:
    """Yield a flight under attack, with each node that subscribes to anything."""
    with autopilots(*[()] * DRONES, speedup=5.0) as vehicles:
        search = {"vehicle_time": "followed", "num_drones": DRONES, "timestep_limit": 10**6}
        sim = Sim(
            rig,
            rig.start(
                "sim_node",
                SEARCHED | search | {"publish_belief": True, "auto_reset": True},
                "-r",
                f"__ns:={REAL}",
            ),
            REAL,
        )
        bridge = Bridge(rig, vehicles, arm=True)
        attack = Attack(rig, [sim.reports, *bridge.states, *bridge.poses], seed)
        rig.start("planner_node", {"planner": "random"})
        rig.start("dashboard", {"port": 0})
        rig.until(lambda: sim.step_number > 0, "the first step")
        try:
            attack.check()
            yield attack
        finally:
            attack.close()


def main() -> int:
    """Fuzz for a while, and print what was sent and how fast `~/hold` was answered."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    end_s = time.monotonic() + 60.0 * options.minutes
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(Path(folder))
        try:
            for attack in attacks(rig, options.seed):
                while time.monotonic() < end_s:
                    attack.run(500)
                    print(
                        f"{attack.relay.sent} messages, ~/hold answered within "
                        f"{attack.slowest_s:.2f} s",
                        flush=True,
                    )
        finally:
            rig.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
