# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""World steps per second of batches on a CUDA device, and of one core on the same machine.

    python -m benchmarks.device [--seconds 1]

It needs the extra `cuda` and a GPU. The bound is the memory's: the bytes that a step must read and
write, at the speed of a copy on the device.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import cuda

from dsse_ros.search.environments.device_vector_env import DeviceVectorEnv
from dsse_ros.search.environments.factories import vector_env
from dsse_ros.search.environments.vector_env import VectorEnv
from dsse_ros.world.targets.motion import STAND_STILL

WARM_UP, AT_ONCE = 5, 10
"""Steps before the measurement, and between looks at the clock."""
CPU_WORLDS = {"nothing": 1024, "map": 1024, "belief": 64}
COPIED_BYTES = 1 << 30


class Case(NamedTuple):
    """What is measured.

    Attributes:
        rules: The profile.
        grid_size: G.
        num_drones: N.
        observed: `nothing` but the positions, `map` or `belief`.
        num_worlds: B on the device.
    """

    rules: str
    grid_size: int
    num_drones: int
    observed: str
    num_worlds: int

    def env(self, device: str, num_worlds: int) -> VectorEnv:
        """Return a batch on this device."""
        kept: dict[str, dict[str, Any]] = {
            "nothing": {"lazy": True}, "map": {}, "belief": {"observe": "belief"}
        }  # fmt: skip
        return vector_env(
            num_worlds, rules=self.rules, grid_size=self.grid_size, num_drones=self.num_drones,
            device=device, copy=False, **kept[self.observed],
        )  # fmt: skip


CASES = (
    Case("v2", 40, 4, "nothing", 1 << 10),
    Case("v2", 40, 4, "nothing", 1 << 14),
    Case("v2", 40, 4, "nothing", 1 << 18),
    Case("v2", 40, 4, "map", 1 << 18),
    Case("v2", 40, 4, "belief", 1 << 12),
    Case("v2", 40, 50, "nothing", 1 << 16),
    Case("v2", 100, 4, "nothing", 1 << 17),
    Case("v2", 100, 4, "map", 1 << 17),
    Case("paper", 40, 4, "nothing", 1 << 18),
    Case("coverage", 40, 4, "nothing", 1 << 17),
    Case("sea", 40, 4, "nothing", 1 << 18),
)


def rate(env: VectorEnv, seconds: float) -> float:
    """Return the world steps per second of a batch with random actions."""
    env.reset(seed=np.random.SeedSequence(0))
    batch, drones = env.num_envs, env.world.num_drones
    generator = np.random.default_rng(0)
    actions: list[Any] = [
        generator.integers(0, len(env.rules.actions), (batch, drones)).astype(np.int8)
        for _ in range(AT_ONCE)
    ]
    wait: Callable[[], object] = time.perf_counter
    if isinstance(env, DeviceVectorEnv):
        actions, wait = [cuda.to_device(joint) for joint in actions], env.synchronize
    for _ in range(WARM_UP):
        env.step(actions[0])
    wait()
    start, steps, taken = time.perf_counter(), 0, 0.0
    while taken < seconds:
        for action in actions:
            env.step(action)
        wait()
        steps += AT_ONCE
        taken = time.perf_counter() - start
    return batch * steps / taken


def bytes_of(env: DeviceVectorEnv, observed: str) -> int:
    """Return the bytes that a step of one world must read or write.

    They are the records, read and written, the tables of a growing spread, the report and the map,
    and of a belief the layers that move.
    """
    world, batch = env.world, env.worlds.batch
    records = world.worlds.nbytes + world.drones.nbytes + world.persons.nbytes
    tables = 0
    if world.scenario.dispersion_inc:
        tables = sum(array.nbytes // len(array) for array in (batch.sea.gauss, batch.sea.tails))
    drones, actions = world.num_drones, len(env.rules.actions)
    # Actions, positions, rewards, two flags and masks of the drones; three infos.
    report = drones * (1 + 16 + 8 + 2 + actions) + 10
    shown = 0 if observed == "nothing" else 4 * world.grid_size.cells
    belief = 0
    if env.beliefs is not None:
        # The layers that move in a mean step, and their sum.
        of_belief = env.beliefs.tables
        moved = (np.asarray(of_belief.directions) != STAND_STILL).sum(axis=1).mean()
        belief = int((moved + 1) * 2 * 8 * of_belief.chances.shape[1])
    return 2 * records + tables + report + shown + belief


def copy_speed() -> float:
    """Return the bytes per second that a copy on the device reads and writes."""
    source, target = (cuda.device_array(COPIED_BYTES, np.int8) for _ in range(2))
    source.copy_to_device(target)
    cuda.synchronize()
    start = time.perf_counter()
    for _ in range(AT_ONCE):
        source.copy_to_device(target)
    cuda.synchronize()
    return 2 * COPIED_BYTES * AT_ONCE / (time.perf_counter() - start)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=1.0, help="of each measurement")
    options = parser.parse_args()
    speed = copy_speed()
    name = cuda.get_current_device().name
    print(f"{name.decode() if isinstance(name, bytes) else name}, copy {speed / 1e12:.2f} TB/s\n")
    print(
        "| Rules | G | N | Observed | Worlds | World steps/s | Of the bound | One core | Start, s |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for case in CASES:
        start = time.perf_counter()
        try:
            env = case.env("cuda", case.num_worlds)
            assert isinstance(env, DeviceVectorEnv)
            env.reset()
            env.synchronize()
            begun = time.perf_counter() - start
            there = rate(env, options.seconds)
            bound = speed / bytes_of(env, case.observed)
        except Exception as error:  # noqa: BLE001
            # One case must not cost the others.
            print(
                f"{case}: {type(error).__name__}: {' '.join(str(error).split())[:300]}", flush=True
            )
            continue
        del env
        core = rate(case.env("cpu", CPU_WORLDS[case.observed]), options.seconds)
        print(
            f"| {case.rules} | {case.grid_size} | {case.num_drones} | {case.observed} "
            f"| {case.num_worlds} | {there / 1e6:.3g} M | {there / bound:.0%} "
            f"| {core / 1e6:.3g} M | {begun:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
