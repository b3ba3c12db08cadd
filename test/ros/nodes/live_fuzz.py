# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fuzzes the inputs of a live search, and samples the memory of its nodes.

`PYTHONPATH=test/vehicles/control python test/ros/nodes/live_fuzz.py --minutes 60`

It sends what once ended a node, inputs that are right, and copies of them with values replaced. One
mission follows the other, so that memory must not grow from one to the next.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

from node_fuzz import Mutator
from rig import EVERY, Inbox, Process, Rig
from std_msgs.msg import String

from dsse_ros.mission.live.inputs import KINDS

INCIDENT = {
    "object": "PIW-1", "search_start": "2026-01-17T14:00Z",
    "wind": {"speed": 4, "from": 90, "error": 1},
    "seen": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:50Z", "radius": 150},
}  # fmt: skip
FIELDS: dict[str, Any] = {
    "scenario.incident": json.dumps(INCIDENT), "particles": 2000, "num_drones": 2, "seed": 1,
    "truth": "none", "timestep_limit": 150, "step_rate": 10.0, "grid_size": 15,
    "auto_reset": True, "publish_belief": True, "false_alarm_rate": 0.05,
}  # fmt: skip
RING = [[-46.31, -24.01], [-46.3, -24.01], [-46.3, -23.99], [-46.31, -23.99], [-46.31, -24.01]]
POLYGON = {"type": "Polygon", "coordinates": [RING]}
RIGHT: list[tuple[str, dict[str, Any]]] = [
    ("detection", {"x": 900.0, "y": 950.0, "radius": 60.0, "drone": 0}),
    ("detection", {"lat": -24.0, "lon": -46.302, "radius": 60.0, "confidence": 0.7}),
    ("sighting", {"time": "2026-01-17T13:55Z", "lat": -24.001, "lon": -46.3, "radius": 200.0}),
    ("searched", {"pod": 0.5, "geometry": POLYGON}),
    ("searched", {"sweep_width": 200.0, "geometry": {"type": "LineString", "coordinates": RING}}),
    ("weather", {"wind": {"speed": 7, "from": 120, "error": 1}}),
    ("weather", {"current": {"speed": 0.4, "toward": 80}}),
    ("confirm", {"contact": "c3"}),
    ("dismiss", {"contact": "c1"}),
    ("withdraw", {"input": "f7"}),
]
"""Inputs by kind, without their identities."""


def deep(count: int) -> str:
    """Return an array in so many arrays."""
    return "[" * count + "]" * count


LONGEST_S = 600.0
"""Wall time after which there must be another step, also on a busy machine."""


ENDED_NODES: list[tuple[str, str]] = [
    ("searched", '{"id": "%s", "pod": 0.5, "geometry": {"type": "Polygon", "coordinates": '
     '[[[-46.31, -24.01], [-46.3, -24.01], [-46.17, -24.03, 1e999], [-46.31, -24.01]]]}}'),
    *(
        ("searched", '{"id": "%s", "pod": 0.5, "geometry": {"type": "Polygon", "coordinates": '
         f"[[[-46.31, -24.01, {deep(depth)}], [-46.3, -24.01], [-46.3, -23.99], "
         "[-46.31, -24.01]]]}}")
        for depth in (10, 63, 64, 65, 975, 980, 100_000)
    ),
    *(
        ("weather", '{"id": "%s", "wind": {"speed": 5, "from": 90, ' + stated + "}}")
        for stated in ('"select": {"time": 1e999}', '"axes": 1e999', '"variables": [1e999, 1]',
                       '"gap_cells": 1e999', '"gap_cells": -1e999', '"error": NaN',
                       '"select": {"time": ' + deep(980) + "}")
    ),
    ("detection", '{"id": "%s", "x": 1e999, "y": 0, "radius": 5}'),
    ("detection", '{"id": "%s", "x": 900, "y": 900, "radius": 1e-300, "drone": 1e999}'),
    ("detection", '{"id": "%s", "x": 900, "y": 900, "radius": 60, "time": 1e308}'),
    ("detection", '{"id": "%s", "id": "%s", "x": 900, "y": 900, "radius": 60}'),
    ("sighting", '{"id": "%s", "lat": -24, "lon": -46.3, "time": "9999-12-31T23:59Z"}'),
    ("withdraw", '{"id": "%s", "input": ' + deep(980) + "}"),
]  # fmt: skip
"""Texts that once ended a node or were acknowledged unread, and their neighbours; with an id."""


class Inputs:
    """Sends inputs to a search.

    Args:
        rig: The domain.
        seed: Of the choices.
    """

    def __init__(self, rig: Rig, seed: int) -> None:
        self.sent = 0
        self._draw = random.Random(seed)
        self._mutator = Mutator(self._draw, ["1e999", "2026-01-17T14:00Z", "c1", "f1"])
        self._rig = rig

    def send(self) -> None:
        """Send an input of any kind."""
        self.sent += 1
        name, turn = f"f{self.sent}", self._draw.random()
        if turn < 0.2:
            kind, text = self._draw.choice(ENDED_NODES)
            text = text.replace("%s", name)
        else:
            kind, values = self._draw.choice(RIGHT)
            text = json.dumps({"id": name, **values})
            if turn > 0.4:
                text = self._mutator.text(text)
            if turn > 0.95:
                kind = self._draw.choice(list(KINDS))
        publisher = self._rig.talk(String, f"/live/{kind}", EVERY)
        # What is no Unicode no topic can carry.
        publisher.publish(String(data=text.encode("utf-8", "replace").decode()))


class Fuzzed(NamedTuple):
    """What came of a search that was fuzzed.

    Attributes:
        inputs: Number of inputs.
        answers: Answers by code, "ok" for inputs that were accepted.
        missions: Number of missions, the last one not over.
        memory_mib: By node, its memory after each minute, see `memory_mib`.
    """

    inputs: int
    answers: Counter[str]
    missions: int
    memory_mib: dict[str, list[float]]


def memory_mib(process: Process) -> float:
    """Return the private memory of a process, without that which Fast DDS shares."""
    status = Path(f"/proc/{process.child.pid}/status").read_text(encoding="ascii")
    return int(status.partition("RssAnon:")[2].split()[0]) / 1024


def fuzz(rig: Rig, seed: int, seconds: float, rate: float = 20.0) -> Fuzzed:
    """Fuzz a search with a planner, and print memory each minute.

    Raises:
        AssertionError: If a node ended or met a defect, or the search does not go on.
    """
    received: Inbox = rig.listen(String, "/live/answers", EVERY)
    sim = rig.sim(FIELDS)
    planner = rig.start("planner_node", {"planner": "belief"})
    nodes = {"sim_node": sim.process, "planner_node": planner}
    rig.until(lambda: sim.step_number > 0, "the first step")
    inputs, answers = Inputs(rig, seed), Counter[str]()
    memory: dict[str, list[float]] = {name: [] for name in nodes}

    def answered() -> int:
        answers.update(json.loads(answer.data)["code"] or "ok" for answer in received)
        received.clear()
        return answers.total()

    begun_s, step, since_s = time.monotonic(), (0, 0), 0.0
    while (now_s := time.monotonic() - begun_s) < seconds:
        inputs.send()
        before = time.monotonic()
        while time.monotonic() - before < 1.0 / rate:
            rig.executor.spin_once(timeout_sec=0.01)
        answered()
        del sim.reports[:-1]
        for name, process in nodes.items():
            assert process.running, f"{name} ended with {process.wait()}: {process.output[-5000:]}"
        if step != (sim.search[1], sim.step_number):
            step, since_s = (sim.search[1], sim.step_number), now_s
        assert now_s < since_s + LONGEST_S, f"no step after {step}"
        if now_s >= 60.0 * len(memory["sim_node"]):
            for name, process in nodes.items():
                for word in ("Traceback", "defect", "FATAL"):
                    assert word not in process.output, process.output[-20000:]
                memory[name].append(memory_mib(process))
            shown = ", ".join(f"{name} {values[-1]:.0f} MiB" for name, values in memory.items())
            print(f"{now_s / 60:4.0f} min {inputs.sent:7} inputs, mission {step[0]}, {shown}, "
                  f"{dict(answers)}", flush=True)  # fmt: skip
    end_s = time.monotonic() + LONGEST_S
    while answered() < inputs.sent and time.monotonic() < end_s:
        rig.executor.spin_once(timeout_sec=0.1)
    return Fuzzed(inputs.sent, answers, step[0], memory)


def main() -> int:
    """Fuzz for a while."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(Path(folder))
        try:
            fuzzed = fuzz(rig, options.seed, 60.0 * options.minutes)
        finally:
            rig.close()
    print(f"{fuzzed.answers.total()} of {fuzzed.inputs} inputs answered")
    return int(fuzzed.answers.total() < fuzzed.inputs)


if __name__ == "__main__":
    sys.exit(main())
