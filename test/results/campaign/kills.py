# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Kill a campaign at random moments, workers and the campaign itself, and look at what is left.

    python test/results/campaign/kills.py config.yaml folder [--kills 10]

The file's campaign is played once undisturbed and once killed by turns; every file of both must be
the same, byte for byte, and no chunk that was there after a kill may be written again.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path


def campaign(config: Path, out: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "dsse_ros.cli.campaign", str(config), "--out", str(out)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def workers(process: subprocess.Popen[bytes], address: bool) -> list[int]:
    """Return the workers of a campaign; on Ray those that play for any campaign here."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            line = (folder / "cmdline").read_bytes()
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        ray = address and line.startswith(b"ray::play")
        if ray or (parent == process.pid and b"spawn_main" in line):
            found.append(int(folder.name))
    return found


def chunks(out: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in out.glob("chunks/*.parquet")}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--apart", type=int, default=20, help="chunks between kills, at most")
    arguments = parser.parse_args()
    unbroken, killed = arguments.folder / "whole", arguments.folder / "killed"
    assert campaign(arguments.config, unbroken).wait() == 0
    on_ray = "engine: ray" in arguments.config.read_text()
    draw, kept = random.Random(1), dict[str, int]()
    process = campaign(arguments.config, killed)
    done = {"worker": 0, "campaign": 0}
    while sum(done.values()) < arguments.kills and process.poll() is None:
        what = "worker" if done["worker"] <= done["campaign"] else "campaign"
        # At a random moment after some of it is done.
        goal = len(chunks(killed)) + draw.randrange(arguments.apart)
        while len(chunks(killed)) < goal and process.poll() is None:
            time.sleep(0.01)
        time.sleep(draw.uniform(0.0, 1.0))
        there = workers(process, on_ray)
        if process.poll() is not None or (what == "worker" and not there):
            continue
        os.kill(draw.choice(there) if what == "worker" else process.pid, signal.SIGKILL)
        done[what] += 1
        if what == "campaign":
            process.wait()
            kept = chunks(killed) | kept
            process = campaign(arguments.config, killed)
        print(f"killed {what}, {len(chunks(killed))} chunks", flush=True)
    assert process.wait() == 0
    after = chunks(killed)
    assert {name: after[name] for name in kept} == kept, "a chunk was written again"
    for path in unbroken.rglob("*"):
        if path.is_file():
            beside = killed / path.relative_to(unbroken)
            assert beside.read_bytes() == path.read_bytes(), beside
    print(f"{done}: nothing lost, nothing repeated")
    return 0


if __name__ == "__main__":
    sys.exit(main())
