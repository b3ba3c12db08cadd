# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many searches at once as arrays, for training, with the same worlds and compiled step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from dsse_ros.base.compiled.overloads import Specialized
from dsse_ros.base.fields import FieldError, Spec, shown
from dsse_ros.search.environments.agents import RESET_FIRST
from dsse_ros.search.environments.recycling import Recycler
from dsse_ros.search.environments.space import check_integers, space_of
from dsse_ros.search.environments.world import World
from dsse_ros.search.environments.world_beliefs import WorldBeliefs, observed_beliefs
from dsse_ros.search.step import kernels
from dsse_ros.search.step.world_state import Report
from dsse_ros.world.scenario.env_options import OBSERVED, check_mapping, check_options, check_seed
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario

Observations = dict[str, Any]

RESET_MASK = "reset_mask"
"""Option of a reset, as in Gymnasium: the worlds to reset."""

DEVICES = Spec("str", "Where a batch steps.", choices=("cpu", "cuda"))

MAX_REACH = 10_000
"""Cells on each side of the centre of the largest window."""


class LazyMaps:
    """The maps of B worlds, computed cell by cell from their parameters.

    Values come from the present state of the worlds, not from the state at the time it was
    returned.
    """

    def __init__(self, world: World) -> None:
        self._world = world

    def cells(self, cells: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return probabilities (B, K) float32 of cells (B, K, 2) as (x, y); 0 off the grid.

        Raises:
            FieldError: If the cells are not (B, K, 2) integers.
        """
        cells = check_integers("cells", cells, (self._world.num_worlds, None, 2))
        return self._world.cells(cells[..., 0], cells[..., 1])

    def windows(self, centres: NDArray[np.int64], reach: int) -> NDArray[np.float32]:
        """Return the squares of 2 reach + 1 cells around centres.

        Args:
            centres: (B, K, 2) as (x, y).
            reach: Cells on each side of the centre.

        Returns:
            (B, K, 2 reach + 1, 2 reach + 1) float32 as [y, x]; 0 outside the grid.

        Raises:
            FieldError: If the centres are not (B, K, 2) integers, or the reach is not from 0 to
                `MAX_REACH`.
        """
        centres = check_integers("centres", centres, (self._world.num_worlds, None, 2))
        centres = centres.astype(np.int64)
        reach = Spec("int", "", low=0, high=MAX_REACH).check("reach", reach)
        offsets = np.arange(-reach, reach + 1)
        batch, count = centres.shape[:2]
        shape = (batch, count, len(offsets), len(offsets))
        x = np.broadcast_to(centres[..., 0, None, None] + offsets, shape)
        y = np.broadcast_to(centres[..., 1, None, None] + offsets[:, None], shape)
        flat = self._world.cells(x.reshape(batch, -1), y.reshape(batch, -1))
        return flat.reshape(shape)

    def dense(self) -> NDArray[np.float32]:
        """Return the whole maps (B, R, C) float32 as [y, x]."""
        grid, batch = self._world.grid_size, self._world.num_worlds
        y, x = (np.broadcast_to(a.ravel(), (batch, grid.cells)) for a in np.indices(grid.matrix))
        return self._world.cells(x, y).reshape(batch, *grid.matrix)


class VectorEnv:
    """B searches, stepped together.

    The step after the end of a world's mission resets that world, whatever its actions, with reward
    0 and no flag (Gymnasium's `AutoresetMode.NEXT_STEP`); its generator continues.

    Observations are `{"positions": (B, N, 2) int64 as (x, y), "probability": (B, R, C) float32 as
    [y, x]}`; in the lazy mode `probability` is a `LazyMaps`. Infos are `{"Found": (B,) bool every
    person found, "step": (B,) int64 steps done, "over": (B,) bool the search has ended,
    "action_mask": (B, N, A) int8, 0 where a move would leave the grid or the area}`. As in
    Gymnasium, each has a mask of the worlds it is valid for, (B,) bool, here all true, under its
    name after an underscore.

    In metres actions are (B, N, 2) from -1 to 1, turns and speeds, see `step.metres_paths`;
    observations have `states` (B, N, 5) float32, see `space.STATE`, in place of `positions`, and
    infos have `path` (B, N, K + 1, 2) float64, see `SearchEnv`, in place of `action_mask`.

    With faults, or drones of different kinds, infos also have `status` (B, N) int8, a number in
    `fault_kernels.STATUSES`, `action` (B, N) int8, the action that the drone did, -1 for nothing,
    and, if batteries run down, `battery` (B, N) float64, in percent.

    With `observe="belief"`, `probability` is each world's posterior after its searches
    (`belief.Belief`), in the cells that the drones observed, and infos have `pos` (B,) float64, the
    cumulative probability of success of the mission's searches there. Beliefs take
    8 B C K S bytes, with S cells of the grid and six more rows and columns, C different
    `person_pod_multipliers` and K = 1, or 64 if each
    person has its own drift (`v2`). Beliefs of an ensemble take 8 B C M bytes, with M `particles`.

    In the coverage task `probability` is the probability left to cover, `Found` is whether all is
    covered, and infos have the metrics of `coverage_task.Coverage`, (B,) float64 each.

    The caller owns the returned arrays and may keep and change them. Memory is reused once nothing
    refers to it: a loop that holds the last one or two observations allocates no new arrays; one
    that holds more pays for new memory as for copies.

    Args:
        num_envs: B.
        scenario: The scenario of all worlds.
        rules: The rules of all worlds.
        lazy: Whether to keep only the maps' parameters.
        copy: Whether every step returns new arrays, or overwrites those it returned before.
        threads: Number of threads that share the worlds.
        observe: `map`, drawn by the rules, or `belief`, which cannot be lazy.

    Raises:
        FieldError: If the scenario does not fit the rules, or a value is not allowed.
    """

    device = "cpu"

    def __init__(
        self,
        num_envs: int,
        scenario: Scenario,
        rules: Rules,
        *,
        lazy: bool = False,
        copy: bool = True,
        threads: int = 1,
        observe: str = "map",
    ) -> None:
        of_belief, lazy, copy = check_shown(observe, lazy, copy)
        self.num_envs = Spec("int", "", low=1).check("num_envs", num_envs)
        threads = Spec("int", "", low=1, high=1024).check("threads", threads)
        self.rules = rules
        self.world = World(
            scenario, rules, self.num_envs, write_maps=not (lazy or of_belief), auto_reset=True,
            threads=threads,
        )  # fmt: skip
        self.scenario = self.world.scenario
        self._space = space_of(self.world)
        self._beliefs = observed_beliefs(self.world) if of_belief else None
        self.lazy = lazy
        self._lazy = LazyMaps(self.world) if lazy else None
        self._was_reset = False
        self._report_worlds = Specialized(kernels.report_worlds)
        shape = (self.num_envs, self.world.num_drones)
        self._maps, *self._report = (
            Recycler(size, dtype, overwrite=not copy)
            for size, dtype in (
                (
                    (self.num_envs, *self.world.grid_size.matrix)
                    if of_belief
                    else self.world.maps.shape,
                    np.float32,
                ),
                ((*shape, 2), np.int64),
                (shape, np.float64),
                (shape, np.bool_),
                (shape, np.bool_),
                ((*shape, len(rules.actions)), np.int8),
            )
        )

    def reset(
        self,
        seed: int | Sequence[int | None] | np.random.SeedSequence | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, NDArray[Any]]]:
        """Start a new mission in every world.

        Args:
            seed: With a number s, world b equals the single environment seeded with s + b, bit for
                bit; batches seeded s and s + 1 therefore share all worlds but one. A list has B
                numbers, one per world; the generator of a world with None continues. A
                `numpy.random.SeedSequence` gives each world one of its words; batches with spawned
                sequences are independent. Without a seed all generators continue.
            options: As in `SearchEnv.reset`, for all worlds, valid until the next call, also in
                automatic resets. Alternatively `reset_mask`, (B,) bool: only these worlds are
                seeded and restart, as in an automatic reset; the others stay as they are.

        Raises:
            FieldError: If an option or the seed is not allowed; the current missions stay as they
                are.
        """
        start, which = self._check_options(options)
        if seed is not None:
            seeds, going_on = check_seeds(seed, self.num_envs), self.world.worlds["rng"][~which]
            self.world.seed(seeds)
            self.world.worlds["rng"][~which] = going_on
        if start is not None:
            self.world.place(**start)
        self._was_reset = True
        maps = self._maps.take()
        if self._beliefs is None:
            self.world.reset(which, maps)
        else:
            self._beliefs.reset(which)
            self.world.reset(which)
            self._beliefs.write(maps)
        positions, *_, masks = outputs = [recycler.take() for recycler in self._report]
        self._write(outputs, 0, self.num_envs)
        return self._observations(positions, maps), self._infos(masks)

    def step(
        self, actions: NDArray[np.int8]
    ) -> tuple[
        Observations,
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, NDArray[Any]],
    ]:
        """Advance every world by one step.

        Args:
            actions: (B, N) integers, numbers of actions or `world.NO_ACTION` for a drone that does
                nothing. Those of drones that are out have no effect.

        Returns:
            Observations, rewards (B, N) float64, terminated (B, N), truncated (B, N), infos.

        Raises:
            FieldError: If the actions are not (B, N) integers, or the rules do not allow one; the
                missions stay as they are.
            gymnasium.error.ResetNeeded: Before the first reset.
        """
        self._check_reset()
        actions = self._space.joint_of(actions)
        outputs = [recycler.take() for recycler in self._report]
        positions, rewards, terminated, truncated, masks = outputs
        maps = self._maps.take()
        if self._beliefs is None:
            self.world.step(actions, maps, partial(self._write, outputs))
        else:
            self._beliefs.before_step(actions)
            self.world.step(
                actions, on_stepped=partial(self._write_with_beliefs, self._beliefs, outputs, maps)
            )
        observations = self._observations(positions, maps)
        return observations, rewards, terminated, truncated, self._infos(masks)

    def _check_reset(self) -> None:
        """Raise before the first reset, unless the worlds were restored from a snapshot.

        Raises:
            gymnasium.error.ResetNeeded: If they were not.
        """
        worlds = self.world.worlds
        if not self._was_reset and (worlds["done"] & (worlds["t"] == 0)).all():
            raise ResetNeeded(RESET_FIRST)
        self._was_reset = True

    def out_of_time(self, infos: Mapping[str, NDArray[Any]]) -> NDArray[np.bool_]:
        """Return which worlds (B,) ended at the time limit, from the infos of a step."""
        # The flags do not show it: if the rules set both at once, a crash has both too.
        over: NDArray[np.bool_] = infos["over"] & ~infos["Found"]
        return over & (infos["step"] > self.rules.last_step(self.scenario.timestep_limit))

    def single_spaces(self) -> tuple[spaces.Dict, spaces.Space[Any]]:
        """Return the spaces of the observations and of the joint action of one world."""
        return self._space.of_one_world()

    def close(self) -> None:
        """End the threads; a later step starts them again."""
        self.world.close()

    def _check_options(
        self, options: Mapping[str, Any] | None
    ) -> tuple[dict[str, Any] | None, NDArray[np.bool_]]:
        """Return the values to place, None to keep the present ones, and the worlds to reset."""
        others = {k: v for k, v in check_mapping(options).items() if k != RESET_MASK}
        mask = None if options is None else options.get(RESET_MASK)
        if mask is None:
            start = check_options(others, self.scenario, self.rules)
            return start, np.ones(self.num_envs, np.bool_)
        if others:
            raise FieldError(
                f"{RESET_MASK} must be the only option, got {shown(next(iter(others)))} too"
            )
        shape = (self.num_envs,)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != shape:
            raise FieldError(f"{RESET_MASK} must be bool {shape}, got {shown(mask)}")
        return None, mask

    def _write(self, outputs: list[NDArray[Any]], first: int, last: int) -> None:
        """Write the report of some worlds, see `kernels.report_worlds`."""
        world = self.world
        report = Report(*outputs)
        self._report_worlds(world.constants, world.area, world.drones, report, first, last)
        if world.faults is not None:
            positions, *_, masks = outputs
            world.faults.restrict(world.batch, masks, first, last)
            positions[first:last] = world.faults.positions()[first:last]

    def _write_with_beliefs(
        self,
        beliefs: WorldBeliefs,
        outputs: list[NDArray[Any]],
        maps: NDArray[np.float32],
        first: int,
        last: int,
    ) -> None:
        """Update the beliefs of some worlds with their step, and write them and the report."""
        beliefs.after_step(first, last)
        beliefs.write(maps, first, last)
        self._write(outputs, first, last)

    def _observations(
        self, positions: NDArray[np.int64], maps: NDArray[np.float32]
    ) -> Observations:
        return {**self._space.observed(positions), "probability": self._lazy or maps}

    def _infos(self, masks: NDArray[np.int8]) -> dict[str, NDArray[Any]]:
        worlds = self.world.worlds
        infos = {
            "Found": worlds["num_missing"] == 0,
            "step": worlds["t"].copy(),
            "over": worlds["done"].copy(),
            **self._space.infos(masks),
        }
        if self._beliefs is not None:
            infos["pos"] = self._beliefs.pos.copy()
        infos |= self.world.coverage_metrics()
        if self.world.faults is not None:
            infos |= self.world.faults.batch_infos()
        return infos | {f"_{name}": np.ones(self.num_envs, np.bool_) for name in infos}


def check_shown(observe: str, lazy: bool, copy: bool) -> tuple[bool, bool, bool]:
    """Return whether a belief is observed, and the two flags, see `VectorEnv`.

    Raises:
        FieldError: If a value is not allowed.
    """
    of_belief = OBSERVED.check("observe", observe) == "belief"
    lazy, copy = (
        Spec("bool", "").check(name, value) for name, value in (("lazy", lazy), ("copy", copy))
    )
    if of_belief and lazy:
        raise FieldError("lazy must be false with observe belief, got true")
    return of_belief, lazy, copy


def check_seeds(seed: Any, count: int) -> Any:
    """Return a seed for this number of worlds in its canonical form.

    Raises:
        FieldError: If the seed is not allowed.
    """
    if isinstance(seed, np.random.SeedSequence):
        return seed
    if not isinstance(seed, Sequence | np.ndarray) or isinstance(seed, str | bytes):
        return check_seed(seed)
    if len(seed) != count:
        raise FieldError(f"seed must be one number for each of {count} worlds, got {len(seed)}")
    return [None if number is None else check_seed(number) for number in seed]
