# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Trains one policy for all drones with MaskablePPO, and exports it for the planner `onnx`.

    pip install '.[train]'
    python examples/train.py --out out/train

Each drone of each world is a separate environment for the library; all share the policy. A drone
observes the belief, where the person can still be after the searches so far, and is rewarded for
the probability that is searched. Ctrl-C saves a checkpoint, and the same command resumes from it.
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
    parser.add_argument("--steps", type=float, default=1.2e6, help="of drones, in all")
    parser.add_argument("--check-every", type=float, default=1e5, help="steps between checkpoints")
    return parser.parse_args()


if __name__ == "__main__":
    OPTIONS = parse()
    try:
        importlib.import_module("dsse_ros.training")
    except ImportError as error:
        sys.exit(f"train.py: {error}")

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib import MaskablePPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from tqdm import tqdm

from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.mission_batches import PlayedMissions
from dsse_ros.search import vector_env
from dsse_ros.search.drone_slots import DroneSlots, Transition, searched_probability
from dsse_ros.training.export import export
from dsse_ros.training.foveated import foveated
from dsse_ros.training.rollouts import ActingRolloutBuffer
from dsse_ros.training.vec_env import DroneVecEnv

SEARCH: dict[str, Any] = {
    "rules": "v2",
    "grid_size": 40,
    "drones_positions": [(20, 0), (20, 39), (0, 20), (39, 20)],
    "person_initial_position": (20, 20),
    "dispersion_inc": 0.05,
}
"""The published case: four drones that start in the middle of the edges, 100 steps."""
SEED = 1
"""Seed of the weights and of the draws; the worlds have the seeds from 1000 on."""
WORLD_SEED, CHECK_SEED = 1_000, 10_000_000
"""First seeds of the missions for training and for choosing checkpoints."""
WORLDS, STEPS = 64, 32
"""Steps of the worlds between two updates."""
GAMMA = 0.96
ENTROPY = 0.005
"""Weight of the entropy at first; it falls to 0."""
TEAM = 0.5
"""Fraction of the reward that all drones share."""


def reward(step: Transition) -> NDArray[np.float64]:
    """Return the searched probability, (B, N), of the drone and of the team, and the approach.

    It is divided by the root of the highest one: late in a mission, with little left, a drone
    would otherwise hardly learn.
    The reward for the approach is a potential, taken back at the end except at the time limit,
    where the learner continues: it changes no optimum (Ng, Harada and Russell, "Policy
    invariance under reward transformations", 1999).
    """
    highest = step.before["probability"].max(axis=(1, 2))
    own = searched_probability(step) / np.sqrt(highest)[:, None]
    nearer = GAMMA * potential(step.after) * ~step.terminal - potential(step.before)
    return (1 - TEAM) * own + TEAM * own.sum(axis=1, keepdims=True) + nearer


def potential(observations: dict[str, Any]) -> NDArray[np.float64]:
    """Return (B, N), the greater the nearer a drone is to the middle of the belief; 0 within 5."""
    positions, probability = observations["positions"], observations["probability"]
    line = np.arange(probability.shape[-1])
    middle = np.stack([probability.sum(axis=1) @ line, probability.sum(axis=2) @ line], axis=-1)
    away = np.abs(positions - middle[:, None]).max(axis=-1)
    return -0.04 * np.maximum(away - 5.0, 0.0)


def make_env() -> DroneVecEnv:
    """Return the environments to train in."""
    batch = vector_env(WORLDS, observe="belief", **SEARCH)
    return DroneVecEnv(DroneSlots(batch, foveated(batch.rules.actions), reward))


def make_model(env: DroneVecEnv) -> MaskablePPO:
    """Return an untrained policy."""
    return MaskablePPO(
        "MlpPolicy",
        env,
        learning_rate=lambda left: 6e-4 * max(left, 0.03),
        n_steps=STEPS,
        batch_size=1024,
        n_epochs=4,
        gamma=GAMMA,
        gae_lambda=0.92,
        clip_range=0.2,
        ent_coef=ENTROPY,
        max_grad_norm=0.5,
        rollout_buffer_class=ActingRolloutBuffer,
        policy_kwargs={
            "net_arch": {"pi": [128, 128], "vf": [128, 128]},
            "activation_fn": torch.nn.ReLU,
        },
        seed=SEED,
        device="cpu",
    )


def check(model: Path) -> PlayedMissions:
    """Return the results of an exported policy on missions that it was not trained on."""
    return play_missions(2000, "onnx", seed=CHECK_SEED, options={"model": str(model)}, **SEARCH)


class Progress(BaseCallback):
    """Shows the time left, keeps checkpoints and the best policy, and stops at Ctrl-C.

    Args:
        out: Folder of the results.
        total: Steps of drones to train for, including those before a checkpoint.
        check_every: Steps of drones between two checkpoints.
    """

    def __init__(self, out: Path, total: int, check_every: int) -> None:
        super().__init__()
        self.out, self.total, self.check_every = out, total, check_every
        self.curve = read_curve(out / "curve.csv")
        self.before_s = float(self.curve[-1]["seconds"]) if self.curve else 0.0
        self.best = min((float(row["mean_steps"]) for row in self.curve), default=np.inf)
        self.stopped = False
        self.checks_s = 0.0

    def stop(self, *_: Any) -> None:
        """End the training after the current step; a second Ctrl-C ends it at once."""
        self.stopped = True
        signal.signal(signal.SIGINT, signal.default_int_handler)

    def _on_training_start(self) -> None:
        self.began_s = time.monotonic()
        self.checked = self.num_timesteps
        self.bar = tqdm(
            total=self.total, initial=self.checked, unit="step", unit_scale=True, dynamic_ncols=True
        )
        signal.signal(signal.SIGINT, self.stop)

    def _on_step(self) -> bool:
        return not self.stopped

    def _on_rollout_start(self) -> None:
        self.model.ent_coef = ENTROPY * self.model._current_progress_remaining
        # The policy of the last update.
        self.bar.update(self.num_timesteps - self.bar.n)
        if self.num_timesteps - self.checked >= self.check_every:
            self.keep()

    def _on_training_end(self) -> None:
        self.keep()
        self.bar.close()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    def keep(self) -> None:
        """Save a checkpoint, export the policy and play missions with it."""
        check_began_s = time.monotonic()
        seconds = self.before_s + check_began_s - self.began_s - self.checks_s
        save(self.model, self.out)
        path = self.out / "policy.onnx"
        export_policy(self.model, path)
        missions = check(path)
        row = {
            "drone_steps": self.num_timesteps,
            "seconds": round(seconds),
            "found_percent": round(100 * missions.found.mean(), 2),
            "mean_steps": round(missions.steps.mean(), 3),
            "median_steps": float(np.median(missions.steps)),
        }
        self.curve.append(row)
        write_curve(self.out / "curve.csv", self.curve)
        if row["mean_steps"] < self.best:
            self.best = row["mean_steps"]
            (self.out / "best.onnx").write_bytes(path.read_bytes())
        for name in ("found_percent", "mean_steps"):
            self.logger.record(f"check/{name}", row[name])
        tqdm.write(", ".join(f"{name} {value}" for name, value in row.items()))
        self.checks_s += time.monotonic() - check_began_s
        self.checked = self.num_timesteps


def save(model: MaskablePPO, out: Path) -> None:
    """Save a checkpoint; the previous one stays until it is complete."""
    model.save(out / "next.zip")
    os.replace(out / "next.zip", out / "checkpoint.zip")


def export_policy(model: MaskablePPO, path: Path) -> None:
    """Write the policy for the planner `onnx`."""
    env = model.get_env()
    assert isinstance(env, DroneVecEnv)
    batch = env.slots.env
    export(
        model.policy,
        path,
        {
            "actions": batch.rules.actions,
            "rules": batch.rules.profile,
            "observe": "belief",
            "avoid_collisions": True,
        },
        grid=batch.world.grid_size,
        drones=batch.world.num_drones,
    )


def read_curve(path: Path) -> list[dict[str, Any]]:
    """Return the rows of the curve so far."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_curve(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write the curve."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def train(out: Path, total: int, check_every: int) -> None:
    """Train, or resume from the checkpoint in the folder of the results."""
    out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    env = make_env()
    checkpoint = out / "checkpoint.zip"
    if checkpoint.is_file():
        model = MaskablePPO.load(checkpoint, env=env, device="cpu")
        tqdm.write(f"going on from {checkpoint}: {model.num_timesteps} steps of drones")
    else:
        model = make_model(env)
    # Missions that were not played before.
    env.seed(WORLD_SEED + model.num_timesteps)
    model.set_logger(configure(str(out / "log"), ["tensorboard"]))
    left = total - model.num_timesteps
    if left > 0:
        model.learn(left, callback=Progress(out, total, check_every), reset_num_timesteps=False)


if __name__ == "__main__":
    train(OPTIONS.out, round(OPTIONS.steps), round(OPTIONS.check_every))
