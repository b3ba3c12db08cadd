# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Kills a live search at random moments, and takes it up from its journal.

`python -m benchmarks.live_kills --kills 200` prints how many inputs were acknowledged, how many of
them were lost, and whether belief and world at the end equal those of a search without a kill, bit
for bit.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dsse_ros.mission.files.mission_journal import MissionJournal
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.live_search import Entry
from dsse_ros.mission.run.live_intake import LiveIntake
from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.factories import parallel_env

STEPS = 26
INCIDENT: dict[str, Any] = {
    "object": "PIW-1", "search_start": "2026-01-17T14:00Z",
    "wind": {"speed": 4, "from": 90, "error": 1},
    "seen": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:50Z", "radius": 150},
}  # fmt: skip
AREA = [[-46.31, -24.01], [-46.3, -24.01], [-46.3, -23.99], [-46.31, -23.99], [-46.31, -24.01]]
INPUTS: dict[int, list[tuple[str, dict[str, Any]]]] = {
    step: [("detection", {"id": f"d{step}-{n}", "x": 300.0 + 40 * n, "y": 400.0, "radius": 60.0,
                          "drone": n}) for n in (0, 1)]
    for step in range(2, STEPS, 3)
}  # fmt: skip
INPUTS |= {
    7: [("searched", {"id": "heli", "time": 30.0, "pod": 0.5,
                      "geometry": {"type": "Polygon", "coordinates": [AREA]}})],
    13: [("sighting", {"id": "seen", "time": "2026-01-17T14:01Z", "lat": -24.001, "lon": -46.3})],
    19: [("weather", {"id": "wind", "wind": {"speed": 7, "from": 120, "error": 1}})],
    22: [("dismiss", {"id": "no", "contact": "c1"})],
    25: [("withdraw", {"id": "sorry", "input": "heli"})],
}  # fmt: skip
"""Inputs by the step after which they come."""


def new_mission(rules: str) -> Mission:
    """Return the mission at its start."""
    fields = {
        "incident": INCIDENT, "particles": 200, "num_drones": 2, "timestep_limit": STEPS,
        "false_alarm_rate": 0.05, "probability_of_detection": 0.8, "grid_size": 15,
        "drones_positions": [[7, 7], [7, 8]],
    }  # fmt: skip
    return Mission(parallel_env(fields, rules=rules, truth="none", collisions=False), 3)


def keep(mission: Mission, journal: Path, acknowledge: Callable[[str], None]) -> None:
    """Keep a search to its end, from where its journal ends.

    Args:
        mission: A new mission.
        journal: Path of the journal.
        acknowledge: Called with the id of each input that was answered.
    """
    kept = MissionJournal(journal, mission, lambda _: None)
    intake = LiveIntake(mission, lambda *_: None, Counter(), kept)
    while True:
        step = mission.result.step
        kept.record()
        intake.clock.set(step, mission.result.stamp_ns / 1e9)
        for kind, values in INPUTS.get(step, ()):
            intake.take(kind, json.dumps(values))
        for answer in intake.decide(mission.result.stamp_ns / 1e9):
            assert answer.ok, answer
            acknowledge(answer.id)
        if mission.done:
            kept.close()
            return
        rng = np.random.default_rng(step)
        if mission.env.rules.in_metres:
            mission.command_all(rng.uniform(-1.0, 1.0, (2, 2)).tolist())
        else:
            allowed = mission.env.action_masks()
            mission.command_all([int(rng.choice(np.flatnonzero(mask))) for mask in allowed])
        mission.advance("hold")


def digest_of(mission: Mission) -> str:
    """Return a digest of the belief and the world of a mission."""
    assert isinstance(mission.beliefs, LiveBeliefs)
    live_search = mission.beliefs.live_search
    parts = (live_search.belief.density.tobytes(), np.float64(live_search.pos).tobytes(),
             mission.env.world.state_bytes(), mission.history.tobytes())  # fmt: skip
    return hashlib.sha256(b"".join(parts)).hexdigest()


class Killed(NamedTuple):
    """What came of searches that were killed.

    Attributes:
        kills: Number of kills.
        acknowledged: Number of acknowledged inputs.
        lost: Those that the live search did not have at the end.
        different: Number of searches whose end differs from that without a kill.
    """

    kills: int
    acknowledged: int
    lost: int
    different: int


def kill(rules: str, kills: int, seed: int, folder: Path) -> Killed:
    """Kill searches this often at random moments, and take each up from its journal.

    Args:
        rules: Name of the profile.
        kills: Number of kills.
        seed: Seed of the moments.
        folder: Where the journals are.
    """
    moments = random.Random(seed)
    # The first search compiles and draws what the later ones share, as those that are killed do.
    for name in ("first", "whole"):
        begun_s = time.monotonic()
        unbroken = new_mission(rules)
        keep(unbroken, folder / f"{name}.mcap", lambda _: None)
        lasts_s, wanted = time.monotonic() - begun_s, digest_of(unbroken)
    done = acknowledged = lost = different = number = 0
    while done < kills:
        journal, ids = folder / f"{number}.mcap", set[str]()
        number += 1
        while done < kills and moments.random() < 0.9:
            was_killed, heard = _killed_after(rules, journal, moments.uniform(0.0, lasts_s))
            ids |= heard
            done += was_killed
            if not was_killed:
                break
        mission = new_mission(rules)
        keep(mission, journal, lambda _: None)
        assert isinstance(mission.beliefs, LiveBeliefs)
        known = {
            entry.id for entry in mission.beliefs.live_search.history if isinstance(entry, Entry)
        }
        acknowledged, lost = acknowledged + len(ids), lost + len(ids - known)
        different += digest_of(mission) != wanted
    return Killed(done, acknowledged, lost, different)


def _killed_after(rules: str, journal: Path, delay_s: float) -> tuple[bool, set[str]]:
    """Keep a search in a process that is killed; return whether it was, and its answers."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        try:
            keep(new_mission(rules), journal, lambda input_id: _write(write, input_id))
        finally:
            os._exit(0)
    os.close(write)
    time.sleep(delay_s)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    with os.fdopen(read) as file:
        # The last line may be cut off: then it was not acknowledged.
        heard = {line[:-1] for line in file if line.endswith("\n")}
    return os.WIFSIGNALED(status), heard


def _write(file: int, text: str) -> None:
    os.write(file, f"{text}\n".encode())


def main(argv: Sequence[str] | None = None) -> int:
    """Print what came of the kills; the exit code is 1 if something was lost or differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    arguments = parser.parse_args(argv)
    failed = False
    for rules in ("sea", "flight"):
        with tempfile.TemporaryDirectory() as folder:
            outcome = kill(rules, arguments.kills // 2, 7, Path(folder))
        print(f"{rules}: {outcome.kills} kills, {outcome.acknowledged} inputs acknowledged, "
              f"{outcome.lost} lost, {outcome.different} searches differ")  # fmt: skip
        failed |= bool(outcome.lost or outcome.different)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
