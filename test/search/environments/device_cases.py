# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Searches that step on a CUDA device and on the CPU, and a comparison of their missions.

As a program, with numba's CUDA simulator: the cases given by name.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from areas import scenario_of

from dsse_ros.search.environments import device_belief_kernels, device_worlds
from dsse_ros.search.environments.device_vector_env import DeviceMaps
from dsse_ros.search.environments.factories import vector_env
from dsse_ros.search.environments.vector_env import LazyMaps
from dsse_ros.search.environments.world import World
from dsse_ros.search.step import device_kernels

CELLS: dict[str, Any] = {
    "grid_size": 9, "num_drones": 3, "timestep_limit": 25, "vector": (0.3, -0.2)
}  # fmt: skip
# Without the cells of a corner.
CORNER = np.add.outer(np.arange(9), np.arange(9)) > 4
CASES: dict[str, dict[str, Any]] = {
    "paper": {"rules": "paper", "person_amount": 2, **CELLS},
    "v1": {"rules": "v1", "person_amount": 2, **CELLS},
    "v2": {"rules": "v2", "person_amount": 2, **CELLS},
    "coverage": {"rules": "coverage", **CELLS},
    "sea": {"rules": "sea", "particles": 500, **CELLS},
    "area": {"rules": "v2", **scenario_of(CORNER, np.random.default_rng(0), 3)},
    "faults": {
        "rules": "paper", "battery_move": 4.0, "battery_search": 1.0, "relief_steps": 3,
        "loss_rate": 0.01, "stuck_rate": 0.1, "command_delay": 1, "command_drop_rate": 0.1,
        "false_alarm_rate": 0.1, "position_noise": 0.5, **CELLS,
    },
}  # fmt: skip
"""Arguments of `vector_env`."""

BELIEFS: dict[str, dict[str, Any]] = {
    f"belief-{rules}": {
        "rules": rules, "observe": "belief", "probability_of_detection": 0.8, **CELLS
    }
    for rules in ("paper", "v1", "v2")
}  # fmt: skip
CASES |= BELIEFS

CLOSE: dict[str, float] = {"rtol": 1e-12, "atol": 1e-12}


def compare(name: str, num_envs: int, steps: int, *, exact: bool) -> None:
    """Play a case on both and compare observations, rewards, flags, infos and hidden states.

    Args:
        name: Of the case.
        num_envs: B.
        steps: Steps to play.
        exact: Whether floats must be equal bit for bit.
    """
    there = vector_env(num_envs, lazy=name not in BELIEFS, device="cuda", **CASES[name])
    here = vector_env(num_envs, **CASES[name])
    count = len(here.rules.actions)
    generator = np.random.default_rng(1)
    same(there.reset(seed=5), here.reset(seed=5), exact)
    for k in range(steps):
        actions = generator.integers(0, count, (num_envs, here.world.num_drones))
        # Hold a third of the drones, which search from where they are then.
        actions[generator.random(actions.shape) < 0.3] = here.rules.action_set.search
        same(there.step(actions), here.step(actions), exact)
        if k == steps // 2:
            mask = np.arange(num_envs) % 2 == 0
            given = {"seed": [k] * num_envs, "options": {"reset_mask": mask}}
            same(there.reset(**given), here.reset(**given), exact)
    if name not in BELIEFS:
        maps, lazy, cells = DeviceMaps(there.worlds), LazyMaps(here.world), here.world.starts
        alike(np.asarray(maps.windows(cells, 2)), lazy.windows(cells, 2), exact)
        alike(np.asarray(maps.cells(cells)), lazy.cells(cells), exact)
    restored = World(there.scenario, there.rules, num_envs, auto_reset=True)
    restored.restore(there.worlds.snapshot())
    for name, array in restored._state().items():
        alike(array, here.world._state()[name], exact)
    there.synchronize()


def same(there: Any, here: Any, exact: bool) -> None:
    """Raise unless two results of a step or a reset agree."""
    if isinstance(here, dict):
        assert there.keys() == here.keys()
        there, here = [there[name] for name in here], here.values()
    if not isinstance(here, np.ndarray):
        for one, other in zip(there, here, strict=True):
            same(one, other, exact)
        return
    if hasattr(there, "dense"):
        there = there.dense()
    alike(np.asarray(there), here, exact)


def alike(there: Any, here: Any, exact: bool) -> None:
    """Raise unless two arrays agree: integers and flags bit for bit."""
    assert there.dtype == here.dtype and there.shape == here.shape
    for field in here.dtype.names or (...,):
        one, other = there[field], here[field]
        if exact or one.dtype.kind != "f":
            np.testing.assert_array_equal(one, other)
        else:
            tolerance = CLOSE if one.dtype.itemsize == 8 else {"rtol": 1e-6, "atol": 1e-12}
            np.testing.assert_allclose(one, other, **tolerance)


def simulate() -> None:
    """Let the simulator's threads call the functions as they are compiled for the CPU."""
    device_worlds.ORDER = "C"
    device_kernels.THREADS = device_belief_kernels.THREADS = 4
    for kernel in (
        device_kernels.step, device_kernels.restart, device_kernels.write_maps,
        device_kernels.write_windows, device_belief_kernels.follow,
        device_belief_kernels.write_beliefs,
    ):  # fmt: skip
        kernel.extensions.append(_PlainArrays())


class _PlainArrays:
    """Passes the arrays of tuples as those of NumPy."""

    def prepare_args(self, kind: Any, value: Any, **_: Any) -> tuple[Any, Any]:
        """Return the kind and the value to pass."""
        return kind, _plain(value)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        parts = [_plain(part) for part in value]
        if isinstance(value, device_kernels.Exchange):
            # The type of argument for which the CPU has compiled the step.
            parts[value._fields.index("maps")] = np.zeros((len(value.steps), 0, 0), np.float32)
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return getattr(value, "_ary", value)


if __name__ == "__main__":
    simulate()
    for case in sys.argv[1:]:
        compare(case, 3, 6 if case in BELIEFS else 28, exact=case not in BELIEFS)
        print(case)
