# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many searches at once on a CUDA device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from numba import cuda
from numpy.typing import NDArray

from dsse_ros.base.compiled.draws import words_of_seed
from dsse_ros.base.fields import FieldError, Spec
from dsse_ros.search.environments.agents import RESET_FIRST
from dsse_ros.search.environments.device_beliefs import DeviceBeliefs
from dsse_ros.search.environments.device_worlds import DeviceArray, DeviceRecycler, DeviceWorlds
from dsse_ros.search.environments.space import check_integers, space_of
from dsse_ros.search.environments.vector_env import (
    MAX_REACH,
    Observations,
    VectorEnv,
    check_seeds,
    check_shown,
)
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.device_kernels import Infos
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario

NAMES = {"found": "Found"}
"""Infos with another name than the field of `Infos`."""


class DeviceMaps:
    """The maps of B worlds on the device, computed from their parameters, as `LazyMaps`.

    Values come from the present state of the worlds, not from the state at the time it was
    returned. Cells and centres are arrays of NumPy or on the device; those on the device must be
    int64. Results are on the device.
    """

    def __init__(self, worlds: DeviceWorlds) -> None:
        self._worlds = worlds

    def cells(self, cells: Any) -> DeviceArray:
        """Return probabilities (B, K) float32 of cells (B, K, 2) as (x, y); 0 off the grid.

        Raises:
            FieldError: If the cells are not (B, K, 2) integers.
        """
        windows = self._windows("cells", cells, 0)
        return windows.reshape(windows.shape[:2])

    def windows(self, centres: Any, reach: int) -> DeviceArray:
        """Return the squares of 2 reach + 1 cells around centres, see `LazyMaps.windows`."""
        reach = Spec("int", "", low=0, high=MAX_REACH).check("reach", reach)
        return self._windows("centres", centres, reach)

    def _windows(self, name: str, centres: Any, reach: int) -> DeviceArray:
        centres = on_device(name, centres, (self._worlds.num_worlds, None, 2), np.int64)
        side = 2 * reach + 1
        out = cuda.device_array((*centres.shape[:2], side, side), np.float32)
        self._worlds.write_windows(centres, out)
        return out

    def dense(self) -> DeviceArray:
        """Return the whole maps (B, R, C) float32 as [y, x]."""
        shape = self._worlds.num_worlds, *self._worlds.template.grid_size.matrix
        out = cuda.device_array(shape, np.float32)
        self._worlds.write_maps(out)
        return out


class DeviceVectorEnv(VectorEnv):
    """A `VectorEnv` whose state, observations, rewards, flags and infos are on a CUDA device.

    They are arrays of `numba.cuda` with `__cuda_array_interface__`: `torch.as_tensor`,
    `jax.numpy.asarray` and `cupy.asarray` take them without a copy, `numpy.asarray` with one. The
    caller owns them; the memory of one is used again once neither it nor a tensor made of it is
    left. Work is done in the order of the device's default stream, as that of PyTorch; call
    `synchronize` before other streams read them.

    World b of a seed is that of a `VectorEnv`: the same integers bit for bit, floats within
    rounding. In the lazy mode `probability` is a `DeviceMaps`.

    Args:
        num_envs: B.
        scenario: The scenario of all worlds.
        rules: The rules of all worlds.
        lazy: As in `VectorEnv`.
        copy: As in `VectorEnv`.
        observe: As in `VectorEnv`; a belief is about a single person, in a search for it on cells
            step by step.

    Attributes:
        worlds: The worlds on the device.
        beliefs: What drones observe with `observe="belief"`, else None.

    Raises:
        FieldError: If the scenario does not fit the rules, a value is not allowed, or drones fly in
            metres.
    """

    device = "cuda"

    def __init__(
        self,
        num_envs: int,
        scenario: Scenario,
        rules: Rules,
        *,
        lazy: bool = False,
        copy: bool = True,
        observe: str = "map",
    ) -> None:
        of_belief, self.lazy, copy = check_shown(observe, lazy, copy)
        self.num_envs = Spec("int", "", low=1).check("num_envs", num_envs)
        self.rules = rules
        if rules.in_metres:
            raise FieldError("device must be cpu where drones fly in metres, got 'cuda'")
        self.worlds = DeviceWorlds(scenario, rules, self.num_envs, copy=copy)
        self.world = self.worlds.template
        self.scenario = self.world.scenario
        self.beliefs = DeviceBeliefs(self.worlds) if of_belief else None
        self._space = space_of(self.world)
        self._lazy_maps = DeviceMaps(self.worlds)
        shape = self.num_envs, *self.world.grid_size.matrix
        self._dense = DeviceRecycler(shape, np.float32, overwrite=not copy)
        self._valid = cuda.to_device(np.ones(self.num_envs, np.bool_))
        self._was_reset = False

    def reset(
        self,
        seed: int | Sequence[int | None] | np.random.SeedSequence | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, DeviceArray]]:
        """Start a new mission in every world, see `VectorEnv.reset`; a `reset_mask` is of NumPy.

        Raises:
            FieldError: As there, and as `step`.
        """
        self._check_actions()
        start, which = self._check_options(options)
        # Without a seed all generators continue.
        none: list[int | None] = [None] * self.num_envs
        seeds = none if seed is None else check_seeds(seed, self.num_envs)
        words, seeded = words_of_seed(seeds, self.num_envs)
        if start is not None:
            self.worlds.place(**start)
            if self.beliefs is not None:
                self.beliefs.place()
        report, infos, restarted = self.worlds.restart(which, words, seeded)
        if self.beliefs is not None:
            self.beliefs.follow(restarted)
        self._was_reset = True
        return self._observed(report.positions), self._named(infos, report.action_masks)

    def step(
        self, actions: Any
    ) -> tuple[Observations, DeviceArray, DeviceArray, DeviceArray, dict[str, DeviceArray]]:
        """Advance every world by one step, see `VectorEnv.step`.

        Args:
            actions: (B, N) integers, of NumPy or any array on the device.

        Raises:
            FieldError: If the actions are not (B, N) integers; or the rules did not allow one in
                an earlier step, in which that drone did nothing: the device works on while Python
                does.
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        if not self._was_reset:
            raise ResetNeeded(RESET_FIRST)
        self._check_actions()
        report, infos = self.worlds.step(on_device("actions", actions, self.worlds.shape))
        if self.beliefs is not None:
            self.beliefs.follow(self.worlds.every)
        return (
            self._observed(report.positions), report.rewards, report.terminated, report.truncated,
            self._named(infos, report.action_masks),
        )  # fmt: skip

    def synchronize(self) -> None:
        """Wait until the device has done all steps.

        Raises:
            FieldError: If the rules did not allow an action of one, see `step`.
        """
        cuda.synchronize()
        self._check_actions()

    def close(self) -> None:
        """Do nothing: the memory is freed with the arrays."""

    def _check_actions(self) -> None:
        wrong = self.worlds.wrong_action()
        if wrong is not None:
            raise FieldError(
                f"actions must be from 0 to {len(self.rules.actions) - 1}, or {NO_ACTION} for "
                f"nothing, got {wrong} in an earlier step, in which that drone did nothing"
            )

    def _observed(self, positions: DeviceArray) -> Observations:
        if self.lazy:
            return {"positions": positions, "probability": self._lazy_maps}
        maps = self._dense.take()
        (self.worlds.write_maps if self.beliefs is None else self.beliefs.write)(maps)
        return {"positions": positions, "probability": maps}

    def _named(self, infos: Infos, masks: DeviceArray) -> dict[str, DeviceArray]:
        """Return infos by the names of `VectorEnv`."""
        present = {name: array for name, array in infos._asdict().items() if array is not None}
        named = {NAMES.get(name, name): array for name, array in present.items()}
        named["action_mask"] = masks
        if self.beliefs is not None:
            named["pos"] = self.beliefs.pos()
        return named | {f"_{name}": self._valid for name in named}


def on_device(
    name: str, value: Any, shape: tuple[int | None, ...], dtype: Any = None
) -> DeviceArray:
    """Return integers on the device, without a copy if they are there.

    Args:
        name: For the error.
        value: An array with `__cuda_array_interface__`, or one of NumPy or what becomes one.
        shape: Wanted shape, where None is any length.
        dtype: Wanted type; None for any integers.

    Raises:
        FieldError: If it is not such an array.
    """
    if not hasattr(value, "__cuda_array_interface__"):
        array: NDArray[Any] = np.ascontiguousarray(check_integers(name, value, shape), dtype)
        return cuda.to_device(array)
    array = cuda.as_cuda_array(value)
    fits = len(array.shape) == len(shape) and all(
        n in (None, length) for n, length in zip(shape, array.shape, strict=True)
    )
    kinds = "iu" if dtype is None else np.dtype(dtype).kind
    if not fits or array.dtype.kind not in kinds or dtype not in (None, array.dtype):
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise FieldError(
            f"{name} must be {'integers' if dtype is None else np.dtype(dtype)} ({wanted}), got "
            f"{array.dtype} {array.shape}"
        )
    return array
