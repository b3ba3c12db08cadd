# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Steps per second of CPU in a training loop: the same one on this package and on DSSE 1.1.9.

    pip install '.[sb3]'
    pip install --no-deps DSSE==1.1.9 pygame
    python -m benchmarks.training

MaskablePPO learns with a small network. An environment is a drone of a world; both observe the
flattened map. A step counts once for a world with all drones.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from sb3_contrib import MaskablePPO
from stable_baselines3.common.callbacks import BaseCallback

from dsse_ros.search.environments.drone_slots import DroneSlots, SlotStep
from dsse_ros.search.environments.factories import vector_env
from dsse_ros.search.environments.wrappers import FLATTENED
from dsse_ros.training.vec_env import DroneVecEnv

GRID, DRONES, WORLDS, STEPS = 40, 4, 64, 32
POSITIONS = [(20, 0), (20, 39), (0, 20), (39, 20)]
ACTIONS = 9


class PublishedSlots:
    """The counterpart of `DroneSlots`: environments of DSSE 1.1.9, stepped one after the other."""

    num_slots, num_actions = WORLDS * DRONES, ACTIONS

    def __init__(self) -> None:
        from DSSE import DroneSwarmSearch

        self._envs = [
            DroneSwarmSearch(
                grid_size=GRID, drone_amount=DRONES, person_initial_position=(20, 20),
                dispersion_inc=0.05, timestep_limit=100,
            )
            for _ in range(WORLDS)
        ]  # fmt: skip
        self.single_observation_space = spaces.Box(
            0.0, 1.0, (2 * DRONES + GRID * GRID,), np.float32
        )
        # It has no masks: a drone that would leave the grid stays.
        self._masks = np.ones((self.num_slots, ACTIONS), np.int8)
        self._steps = np.zeros(WORLDS, np.int64)
        self.acting = np.ones(self.num_slots, np.bool_)

    def reset(self, seed: Any = None) -> tuple[NDArray[np.float32], NDArray[np.int8]]:
        """Start a new mission in every world."""
        return np.concatenate([self._restart(env) for env in self._envs]), self._masks

    def step(self, actions: NDArray[Any]) -> SlotStep:
        """Advance every world by one step."""
        seen, final, rewards, ended, cut, over, found = [], [], [], [], [], [], []
        for b, (env, chosen) in enumerate(
            zip(self._envs, actions.reshape(WORLDS, DRONES).tolist(), strict=True)
        ):
            names = list(env.agents)
            observations, paid, terminated, truncated, infos = env.step(
                dict(zip(names, chosen, strict=True))
            )
            last = self._flattened(observations)
            done = any(terminated.values()) or any(truncated.values())
            rewards += [paid[name] for name in names]
            ended += [terminated[name] for name in names]
            cut += [truncated[name] and not terminated[name] for name in names]
            over.append(done)
            found.append(any(info["Found"] for info in infos.values()))
            final.append(last)
            seen.append(self._restart(env) if done else last)
            self._steps[b] += 1
        steps = self._steps.copy()
        self._steps[over] = 0
        return SlotStep(
            np.concatenate(seen), np.array(rewards), np.array(ended), np.array(cut), np.array(cut),
            self._masks, np.concatenate(final), np.array(over), np.array(found), steps,
        )  # fmt: skip

    def close(self) -> None:
        """Do nothing."""

    def _restart(self, env: Any) -> NDArray[np.float32]:
        observations, _ = env.reset(options={"drones_positions": POSITIONS})
        return self._flattened(observations)

    def _flattened(self, observations: Mapping[str, Any]) -> NDArray[np.float32]:
        cells = np.array([position for position, _ in observations.values()])
        _, probability = next(iter(observations.values()))
        flat: NDArray[np.float32] = FLATTENED.encode(cells, probability).astype(np.float32)
        return flat


def our_slots() -> DroneSlots:
    """Return the same search of this package."""
    return DroneSlots(
        vector_env(
            WORLDS, rules="v2", grid_size=GRID, person_initial_position=(20, 20),
            dispersion_inc=0.05, drones_positions=POSITIONS,
        )
    )  # fmt: skip


class Rate(BaseCallback):
    """Records the number of steps of the worlds, and the time of the steps and of the learning."""

    def __init__(self) -> None:
        super().__init__()
        self.rollouts_s = 0.0

    def _on_rollout_start(self) -> None:
        self._began_s = time.process_time()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        self.rollouts_s += time.process_time() - self._began_s


def measure(slots: Any, updates: int) -> dict[str, float]:
    """Return the steps of worlds per second of CPU in the whole loop, and in the rollouts alone."""
    env = DroneVecEnv(slots)
    model = MaskablePPO(
        "MlpPolicy", env, n_steps=STEPS, batch_size=1024, n_epochs=4, seed=1, device="cpu",
        policy_kwargs={"net_arch": [128, 128]},
    )  # fmt: skip
    count = STEPS * slots.num_slots
    # The first run compiles.
    model.learn(count)
    rate, began_s = Rate(), time.process_time()
    model.learn(updates * count, callback=rate)
    worlds_steps = updates * STEPS * WORLDS
    return {
        "loop": worlds_steps / (time.process_time() - began_s),
        "rollouts": worlds_steps / rate.rollouts_s,
    }


def main() -> None:
    """Measure both, in turn, and print the medians."""
    parser = argparse.ArgumentParser(description="Steps per second inside a training loop.")
    parser.add_argument("--updates", type=int, default=5, help="of the policy, in each round")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    makers = {"ours": our_slots, "dsse_1_1_9": PublishedSlots}
    rounds = [
        {name: measure(make(), arguments.updates) for name, make in makers.items()}
        for _ in range(arguments.rounds)
    ]
    for name in makers:
        rates = {
            part: float(np.median([measured[name][part] for measured in rounds]))
            for part in ("loop", "rollouts")
        }
        print(json.dumps({"name": name, "steps_per_second": rates}))


if __name__ == "__main__":
    main()
