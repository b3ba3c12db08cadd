# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Trains one policy for all drones in any search of the rules `v2`, and exports it as ONNX.

    pip install '.[train]'
    python examples/train.py --out out/train

It runs on a GPU if PyTorch sees one. No person is drawn: the loss is the mean time to the find,
which the exact belief of each search gives. Ctrl-C saves a checkpoint, and the same command goes on
from it.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any


def parse() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description="Train a policy, or go on from a checkpoint.")
    parser.add_argument("--out", type=Path, default=Path("out/train"), help="folder of the results")
    parser.add_argument("--seconds", type=float, default=300, help="of training, in all")
    parser.add_argument("--check-every", type=float, default=20, help="seconds between checks")
    parser.add_argument("--worlds", type=int, help="searches in lockstep: 8192 on a GPU, else 128")
    parser.add_argument("--width", type=int, help="units of a layer: 512 on a GPU, else 128")
    parser.add_argument("--device", help="of PyTorch: cuda if there is one, else cpu")
    options = parser.parse_args()
    if options.worlds is not None and options.worlds < 8:
        parser.error(f"--worlds must be at least 8, got {options.worlds}")
    return options


if __name__ == "__main__":
    OPTIONS = parse()
    try:
        importlib.import_module("dsse_ros.training")
    except ImportError as error:
        sys.exit(f"train.py: {error}")

import torch

from dsse_ros.training.export import export
from dsse_ros.training.lockstep import (
    ACTIONS,
    LIMIT,
    Searches,
    joined,
    published_case,
    random_cases,
)
from dsse_ros.training.ppo import Learner, Rollouts, Settings, room_for

SEED, CHECK_SEED = 1, 10_000_000
"""Seeds of the training, and of the random searches that choose the best policy."""
DRIFTS = 16
"""Angles of the persons' own drift in the belief while training; checks have 64."""
CHECKED = 64
"""Random searches of a check."""
PUBLISHED, SMALL = 3 / 16, 1 / 8
"""Parts of the missions in the published search, and on the smaller default grid; the others are
random searches on 40 x 40 cells."""
SHARED_FROM = 0.15
"""Part of the training after which drones share every find; at first they share half."""


def fly(learner: Learner, generator: torch.Generator, rollouts: Rollouts) -> None:
    """Fly the missions of an update."""
    worlds = learner.settings.worlds
    published, small = (round(worlds * share) for share in (PUBLISHED, SMALL))
    others = random_cases(worlds - published - small, 40, generator)
    large = joined(published_case(published).to(learner.device), others)
    learner.fly(Searches(large, 40, DRIFTS), rollouts, slice(small, None))
    learner.fly(Searches(random_cases(small, 20, generator), 20, DRIFTS), rollouts, slice(small))


def check(learner: Learner) -> dict[str, float]:
    """Return the mean steps with the best actions, of the published and of random searches."""
    generator = torch.Generator().manual_seed(CHECK_SEED)
    cases = joined(published_case(), random_cases(CHECKED, 40, generator)).to(learner.device)
    published, *others = learner.mean_steps(Searches(cases, 40)).tolist()
    return {"published_case": round(published, 3), "random_cases": round(sum(others) / CHECKED, 3)}


class Training:
    """A training that can be interrupted.

    Args:
        options: Of the command line.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self.out: Path = options.out
        self.total_s: float = options.seconds
        self.check_every_s: float = options.check_every
        device = torch.device(options.device or ("cuda" if torch.cuda.is_available() else "cpu"))
        gpu = device.type == "cuda"
        worlds, width = (8192, 512) if gpu else (128, 128)
        worlds, width = options.worlds or worlds, options.width or width
        settings = Settings(worlds=worlds, batches=50 if gpu else 12)
        self.generator = torch.Generator(device)
        self.learner = Learner(width, settings, device)
        self.rollouts = room_for(worlds, 4, device)
        self.seconds, self.drone_steps = 0.0, 0
        self.curve: list[dict[str, Any]] = []
        self.stopped = False
        self.out.mkdir(parents=True, exist_ok=True)

    def run(self) -> None:
        """Train until the time is over or Ctrl-C, and export the best policy."""
        self.resume()
        signal.signal(signal.SIGINT, self.stop)
        checked_s = self.seconds
        while self.seconds < self.total_s and not self.stopped:
            figures = self.update()
            last = self.stopped or self.seconds >= self.total_s
            if last or self.seconds - checked_s >= self.check_every_s:
                self.keep(figures)
                checked_s = self.seconds
        signal.signal(signal.SIGINT, signal.default_int_handler)
        self.export()

    def stop(self, *_: Any) -> None:
        """End the training after the current update; a second Ctrl-C ends it at once."""
        self.stopped = True
        signal.signal(signal.SIGINT, signal.default_int_handler)

    def update(self) -> dict[str, float]:
        """Fly missions and learn from them."""
        began_s = time.monotonic()
        done = self.seconds / self.total_s
        fly(self.learner, self.generator, self.rollouts)
        shared = min(0.5 + 0.5 * done / SHARED_FROM, 1.0)
        figures = self.learner.learn(self.rollouts, 1 - done, shared)
        mean = float(self.rollouts.missing.sum(0).mean())
        self.seconds += time.monotonic() - began_s
        self.drone_steps += LIMIT * self.rollouts.there[0].numel()
        return {"mean_steps": mean, **figures}

    def keep(self, figures: dict[str, float]) -> None:
        """Check the policy, save it, and keep the best one."""
        row = {
            "seconds": round(self.seconds),
            "drone_steps": self.drone_steps,
            **check(self.learner),
            **{name: round(value, 4) for name, value in figures.items()},
        }
        self.curve.append(row)
        with (self.out / "curve.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, row, lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.curve)
        self.save()
        if min(self.curve, key=badness) is row:
            write(self.learner.actor.state_dict(), self.out / "best.pt")
        print(", ".join(f"{name} {value}" for name, value in row.items()), flush=True)

    def save(self) -> None:
        """Save a checkpoint."""
        state = {
            "networks": self.learner.networks.state_dict(),
            "optimizer": self.learner.optimizer.state_dict()["state"],
            "seconds": self.seconds,
            "drone_steps": self.drone_steps,
            "curve": self.curve,
        }
        write(state, self.out / "checkpoint.pt")

    def export(self) -> None:
        """Write the best policy for the planner `onnx`."""
        self.learner.actor.load_state_dict(torch.load(self.out / "best.pt"))
        # The searches have a POD of 1; down to .5, 2000 paired missions showed no difference to
        # the planner belief.
        metadata = {"actions": ACTIONS, "rules": "v2", "observe": "belief", "pod": [0.5, 1.0]}
        export(self.learner.actor, self.out / "best.onnx", metadata)

    def resume(self) -> None:
        """Go on from the checkpoint, if there is one."""
        path = self.out / "checkpoint.pt"
        if path.is_file():
            state = torch.load(path, map_location=self.learner.device)
            self.learner.networks.load_state_dict(state["networks"])
            # Its settings are those of this machine.
            settings = self.learner.optimizer.state_dict()
            self.learner.optimizer.load_state_dict({**settings, "state": state["optimizer"]})
            self.seconds, self.drone_steps = state["seconds"], state["drone_steps"]
            self.curve = state["curve"]
            print(f"going on from {path}: {self.drone_steps} steps of drones")
        # Missions that were not flown before.
        self.generator.manual_seed(SEED + self.drone_steps)
        torch.manual_seed(SEED + self.drone_steps)


def badness(row: dict[str, Any]) -> float:
    """Return what the best policy has least of."""
    return float(row["published_case"] + row["random_cases"])


def write(state: dict[str, Any], path: Path) -> None:
    """Write a file of PyTorch; the previous one stays until it is complete."""
    torch.save(state, path.with_suffix(".next"))
    os.replace(path.with_suffix(".next"), path)


if __name__ == "__main__":
    Training(OPTIONS).run()
