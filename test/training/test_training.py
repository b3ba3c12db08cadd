# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is trained is what flies: the same numbers in training and in the exported model."""

from __future__ import annotations

import copy
import csv
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.planners import planner_for
from dsse_ros.search import ACTION_VECTORS, parallel_env, vector_env
from dsse_ros.search.drone_slots import DroneSlots

torch = pytest.importorskip("torch")
MaskablePPO = pytest.importorskip("sb3_contrib").MaskablePPO
BaseCallback = pytest.importorskip("stable_baselines3.common.callbacks").BaseCallback

from dsse_ros.training.export import export  # noqa: E402
from dsse_ros.training.foveated import FEATURES, foveated  # noqa: E402
from dsse_ros.training.rollouts import ActingRolloutBuffer  # noqa: E402
from dsse_ros.training.vec_env import DroneVecEnv  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
SEARCH: dict[str, Any] = {
    "rules": "v2", "grid_size": 12, "num_drones": 3, "person_initial_position": (5, 6),
    "timestep_limit": 20, "drones_positions": [(0, 0), (11, 2), (4, 9)],
}  # fmt: skip
ACTIONS = parallel_env(**SEARCH).rules.actions
MOVES = [ACTION_VECTORS[name] for name in ACTIONS]


def make_env(worlds: int = 4) -> Any:
    batch = vector_env(worlds, observe="belief", **SEARCH)
    return DroneVecEnv(DroneSlots(batch, foveated(batch.rules.actions)))


def test_a_search_that_is_mirrored_looks_the_same_and_its_actions_are_mirrored() -> None:
    generator = np.random.default_rng(2)
    cells, belief = generator.integers(0, 12, (3, 2)), generator.random((12, 12), np.float32)
    seen, order = foveated(ACTIONS).encode(cells, belief)
    for mirrored, turned, of_move in (
        (np.stack([11 - cells[:, 0], cells[:, 1]], 1), belief[:, ::-1], lambda x, y: (-x, y)),
        (np.stack([cells[:, 0], 11 - cells[:, 1]], 1), belief[::-1], lambda x, y: (x, -y)),
        (cells[:, ::-1], belief.T, lambda x, y: (y, x)),
    ):
        also, other_order = foveated(ACTIONS).encode(mirrored, np.ascontiguousarray(turned))
        np.testing.assert_allclose(seen, also, atol=1e-5)
        for drone in range(3):
            there = [of_move(*MOVES[action]) for action in order[drone]]
            assert there == [MOVES[action] for action in other_order[drone]]


# PyTorch's exporter warns of the names of axes, and of what it calls itself.
@pytest.mark.filterwarnings("ignore::UserWarning:torch", "ignore::FutureWarning")
def test_the_exported_model_does_what_the_trained_policy_does(tmp_path: Path) -> None:
    env = make_env(1)
    model = MaskablePPO("MlpPolicy", env, n_steps=8, batch_size=12, seed=3, device="cpu")
    path = tmp_path / "policy.onnx"
    metadata = {"actions": ACTIONS, "rules": "v2", "observe": "belief"}
    export(model.policy, path, metadata, grid=9, drones=2)
    single = parallel_env(**SEARCH)
    planner = planner_for(single, "onnx", model=str(path))
    env.seed(8)
    observed = env.reset()
    observations, infos = single.reset(seed=8)
    steps = 0
    while single.agents:
        joint = planner(observations, infos)
        chosen, _ = model.predict(observed, action_masks=env.action_masks(), deterministic=True)
        actions = np.take_along_axis(env.slots.order, chosen[:, None], axis=1)
        # At the last call nobody acts: the time is out.
        assert env.slots.acting.all() == (steps < SEARCH["timestep_limit"])
        assert list(joint.values()) == actions.ravel().tolist() or not env.slots.acting.any()
        observations, _, _, _, infos = single.step(joint)
        observed, *_ = env.step(chosen)
        steps += 1
    assert steps > 10


def test_stable_baselines_learns_in_it_and_sees_the_ends_of_missions() -> None:
    env = make_env()
    model = MaskablePPO("MlpPolicy", env, n_steps=32, batch_size=96, seed=3, device="cpu")
    model.learn(3 * 4 * 32)
    assert env.observation_space.shape == (FEATURES,)
    assert model.ep_info_buffer and all(1 <= one["l"] <= 21 for one in model.ep_info_buffer)


def collect(slots: DroneSlots, steps: int) -> tuple[Any, Any, dict[str, Any]]:
    """Return a learner, what it collected in so many steps, and what it was handed at each."""
    seen: dict[str, Any] = {"acting": [], "rewards": [], "infos": [], "out": []}
    collected = []

    class Noted(DroneVecEnv):
        def step_wait(self) -> Any:
            seen["acting"].append(self.slots.acting.copy())
            seen["out"].append(self._out.copy())
            observations, rewards, dones, infos = super().step_wait()
            seen["rewards"].append(rewards.copy())
            seen["infos"].append(infos)
            return observations, rewards, dones, infos

    class Collected(BaseCallback):
        def _on_step(self) -> bool:
            return True

        def _on_rollout_end(self) -> None:
            collected.append(copy.deepcopy(self.model.rollout_buffer))

    model = MaskablePPO(
        "MlpPolicy", Noted(slots), n_steps=steps, seed=3, device="cpu", gamma=0.9,
        rollout_buffer_class=ActingRolloutBuffer, learning_rate=0.0,
    )  # fmt: skip
    model.learn(1, callback=Collected())
    return model, collected[0], {name: np.array(of_steps) for name, of_steps in seen.items()}


CRASHES: dict[str, Any] = {
    "rules": "paper", "grid_size": 5, "timestep_limit": 9, "circle": False,
    "drones_positions": [(0, 0), (4, 2), (2, 4)],
}  # fmt: skip
"""Drones that meet, and then are out while the others go on."""


def test_a_learner_takes_the_value_of_what_was_to_come_where_the_time_is_out() -> None:
    near = {"drones_positions": [(5, 6), (4, 6), (5, 5)], "probability_of_detection": 0.5}
    slots = DroneSlots(vector_env(4, **SEARCH | near))
    model, buffer, seen = collect(slots, 64)
    late = ended = 0
    expected = seen["rewards"].copy()
    for (step, slot), info in np.ndenumerate(seen["infos"]):
        if info.get("TimeLimit.truncated"):
            last, _ = model.policy.obs_to_tensor(info["terminal_observation"])
            with torch.no_grad():
                expected[step, slot] += 0.9 * model.policy.predict_values(last).item()
            assert info["episode"]["l"] == 21 and not info["is_success"]
            late += 1
        elif info:
            assert info["is_success"]
            ended += 1
    np.testing.assert_allclose(buffer.rewards, expected, atol=1e-5)
    assert late > 0 and ended > 0


def test_a_learner_sees_the_drones_that_act_and_no_others() -> None:
    _, buffer, seen = collect(DroneSlots(vector_env(6, **CRASHES)), 40)
    acting, out = seen["acting"], seen["out"]
    assert out.any() and not (acting & out).any() and (~acting & ~out).any()
    batches = list(buffer.get(16))
    sizes = [len(batch.advantages) for batch in batches]
    assert sum(sizes) == acting.sum() and max(sizes) <= 16 and min(sizes) >= 15
    assert all(batch.action_masks.any(dim=1).all() for batch in batches)
    assert len(next(buffer.get()).advantages) == acting.sum()


def test_what_is_thought_of_drones_that_are_out_changes_nothing_for_the_others() -> None:
    slots = DroneSlots(vector_env(6, **CRASHES))
    _, buffer, seen = collect(slots, 40)
    none = np.zeros(slots.num_slots)
    buffer.values[seen["out"]] = 1e6
    buffer.compute_returns_and_advantage(torch.zeros(slots.num_slots), none)
    changed = buffer.advantages.copy()
    buffer.values[seen["out"]] = 0.0
    buffer.compute_returns_and_advantage(torch.zeros(slots.num_slots), none)
    np.testing.assert_array_equal(changed[seen["acting"]], buffer.advantages[seen["acting"]])
    assert (changed[seen["out"]] != buffer.advantages[seen["out"]]).all()


def test_the_example_goes_on_from_its_checkpoint_after_an_interrupt(tmp_path: Path) -> None:
    command = [sys.executable, ROOT / "examples/train.py", "--out", tmp_path, "--check-every=1e9"]
    with subprocess.Popen([*command, "--steps=1e9"]) as first:
        try:
            # TensorBoard's file has more than its first event when the policy was improved.
            while not any(file.stat().st_size > 500 for file in tmp_path.glob("log/events*")):
                assert first.poll() is None
                time.sleep(0.5)
            first.send_signal(signal.SIGINT)
            assert first.wait(300) == 0
        finally:
            first.kill()
    done = read(tmp_path / "curve.csv")
    assert len(done) == 1 and (tmp_path / "best.onnx").is_file()
    more = int(done[0]["drone_steps"]) + 1
    again = subprocess.run(
        [*command, f"--steps={more}"], capture_output=True, text=True, timeout=600
    )
    assert again.returncode == 0
    assert f"going on from {tmp_path / 'checkpoint.zip'}" in again.stdout
    assert int(read(tmp_path / "curve.csv")[1]["drone_steps"]) >= more


def read(curve: Path) -> list[dict[str, str]]:
    with curve.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))
