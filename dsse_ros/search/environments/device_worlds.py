# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arrays of B worlds on a CUDA device: reset and step."""

from __future__ import annotations

import weakref
from typing import Any, Literal

import numpy as np
from numba import cuda
from numpy.typing import DTypeLike, NDArray

from dsse_ros.base.compiled.draws import words_of_seed
from dsse_ros.search.environments.coverage_task import METRICS
from dsse_ros.search.environments.recycling import KEPT, Recycler
from dsse_ros.search.environments.snapshot import Snapshot
from dsse_ros.search.environments.world import World
from dsse_ros.search.step import device_kernels
from dsse_ros.search.step.device_kernels import Before, Exchange, Infos, Restart
from dsse_ros.search.step.world_state import Report, Scratch
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario

DeviceArray = Any
"""An array of `numba.cuda`, with `__cuda_array_interface__`."""

OF_WORLDS = (
    "worlds", "start_cells", "drones", "finds", "persons", "left", "records", "track", "conditions",
    "applied", "viewpoints",
)  # fmt: skip
"""Fields of the kernels' arguments with a first axis of B worlds; the worlds share the others."""

IN_SNAPSHOT = {"coverage": "records", "starts": "start_cells"}
"""Fields that have another name in a snapshot."""

ORDER: Literal["C", "F"] = "F"
"""Memory order of tables and scratch memory with an axis of B worlds: threads with neighbouring
worlds read and write neighbouring elements."""


class DeviceRecycler(Recycler):
    """A `Recycler` of the device, whose memory is reused once the array that was returned is gone.

    A part of an array does not keep the memory; a tensor made of the array does.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: DTypeLike, *, overwrite: bool = False
    ) -> None:
        super().__init__(shape, dtype, overwrite=overwrite)
        self._lent: list[tuple[DeviceArray, weakref.ref[DeviceArray]]] = []

    def take(self) -> DeviceArray:
        """Return an array with arbitrary content."""
        free = [k for k, (_, lent) in enumerate(self._lent) if self._overwrite or lent() is None]
        if free:
            memory, _ = self._lent.pop(free[0])
        else:
            memory = cuda.device_array(self._shape, self._dtype)
        array = memory.bind()
        self._lent = [*self._lent, (memory, weakref.ref(array))][-KEPT:]
        return array


class DeviceWorlds:
    """B worlds of one search on the current CUDA device; they start again after their end.

    Args:
        scenario: The scenario; it is resolved with the rules.
        rules: The rules of the search, on cells.
        num_worlds: B.
        copy: Whether every report has new arrays, or overwrites those of the last one.

    Attributes:
        template: One world of the search on the CPU. It has what the worlds share, and the values
            for their next missions.
        batch: The `world_state.Batch` on the device.
        faults: The `fault_kernels.FaultArrays` on the device; None without faults.
        actions: (B, N) int8 of the last step.
        before: The state before it.
        every: (B,) bool, all true.

    Raises:
        FieldError: If the scenario does not fit the rules.
    """

    def __init__(
        self, scenario: Scenario, rules: Rules, num_worlds: int, *, copy: bool = True
    ) -> None:
        self.template = World(scenario, rules, write_maps=False, auto_reset=True)
        self.num_worlds = num_worlds
        worlds = np.repeat(self.template.worlds, num_worlds)
        worlds["rng"], _ = words_of_seed(None, num_worlds)
        self._state: dict[str, DeviceArray] = {"worlds": cuda.to_device(worlds)}
        self._scratch = self._make_scratch()
        self._tables = self._make_tables()
        self._share()
        self.every = cuda.to_device(np.ones(num_worlds, np.bool_))
        self.actions = cuda.device_array(self.shape, np.int8)
        self.before = Before(
            cuda.device_array(self.shape, np.bool_), cuda.device_array(num_worlds, np.bool_)
        )
        self._wrong = cuda.mapped_array(2, np.int64)
        self._wrong[0] = 0
        self._report, self._infos = (
            {name: DeviceRecycler(*kind, overwrite=not copy) for name, kind in kinds.items()}
            for kinds in self._reported()
        )
        # Compiled with the first step.
        self._step: Any = None

    @property
    def shape(self) -> tuple[int, int]:
        """(B, N)."""
        return self.num_worlds, self.template.num_drones

    @property
    def num_blocks(self) -> int:
        """Blocks of a kernel with a thread for each world."""
        return -(-self.num_worlds // device_kernels.THREADS)

    def place(self, **values: Any) -> None:
        """Set the values for the next missions, see `World.place`."""
        self.template.place(**values)
        self._share()

    def restart(
        self, which: NDArray[np.bool_], words: NDArray[np.uint64], seeded: NDArray[np.bool_]
    ) -> tuple[Report, Infos, DeviceArray]:
        """Begin new missions.

        Args:
            which: (B,), the worlds.
            words: (B,), states of their generators, see `words_of_seed`.
            seeded: (B,), the worlds whose generators get these states.

        Returns:
            The report on all worlds; and `which` on the device.
        """
        world = self.template
        new = Restart(which, seeded & which, words, world.worlds, world.starts, world.persons)
        new = Restart(*map(cuda.to_device, new))
        device_kernels.restart[self.num_blocks, device_kernels.THREADS](self.batch, new)
        return *self._advance(new.which), new.which

    def step(self, actions: DeviceArray) -> tuple[Report, Infos]:
        """Advance every world by one step; return the report on all worlds.

        Args:
            actions: (B, N) integers on the device, numbers of actions or `world.NO_ACTION`. Other
                numbers do nothing, see `wrong_action`.
        """
        count, noop = len(self.template.rules.actions), self.template.rules.noop_actions
        device_kernels.take_actions[self.num_blocks, device_kernels.THREADS](
            actions, count, noop, self._state["worlds"], self._state["drones"], self.actions,
            self._wrong,
        )  # fmt: skip
        return self._advance(self.every)

    def wrong_action(self) -> int | None:
        """Return a number that the rules do not allow as an action, and forget it.

        It is of a drone in the search in a step that the device has completed.
        """
        if not self._wrong[0]:
            return None
        self._wrong[0] = 0
        return int(self._wrong[1])

    def _advance(self, steps: DeviceArray) -> tuple[Report, Infos]:
        report = Report(**{name: kind.take() for name, kind in self._report.items()})
        infos = Infos(**{name: self._infos[name].take() for name in self._infos})
        exchange = Exchange(self.actions, steps, None, self.before, report, infos)
        arguments = self.batch, self.faults, self._scratch, exchange
        if self._step is None:
            self._step = device_kernels.step.specialize(*arguments)
        self._step[self.num_blocks, device_kernels.THREADS](*arguments)
        return report, infos

    def write_maps(self, out: DeviceArray) -> None:
        """Write the maps of all worlds to (B, R, C) float32, as [y, x]."""
        block = device_kernels.map_block(self.template.grid_size)
        device_kernels.write_maps[self.num_worlds, block](self.batch, (out,))

    def write_windows(self, centres: DeviceArray, out: DeviceArray) -> None:
        """Write windows around centres (B, K, 2) to (B, K, W, W) float32, as [y, x]; W is odd."""
        windows = centres, out
        threads = device_kernels.MAP_THREADS
        device_kernels.write_windows[self.num_worlds, threads](self.batch, windows)

    def snapshot(self) -> Snapshot:
        """Return the complete state, including the random state, for `World.restore`."""
        template = self.template.snapshot()
        arrays = {
            name: self._state[IN_SNAPSHOT.get(name, name)].copy_to_host()
            for name in template.arrays
        }
        return Snapshot(template.identity, arrays)

    def _reported(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the shapes and types of the fields of `Report` and of those in use of `Infos`."""
        worlds, shape = (self.num_worlds,), self.shape
        faults, coverage = self.template.faults, self.template.coverage
        report = {
            "positions": ((*shape, 2), np.int64),
            "rewards": (shape, np.float64),
            "terminated": (shape, np.bool_),
            "truncated": (shape, np.bool_),
            "action_masks": ((*shape, len(self.template.rules.actions)), np.int8),
        }
        infos: dict[str, Any] = {
            "found": (worlds, np.bool_),
            "step": (worlds, np.int64),
            "over": (worlds, np.bool_),
        }
        if faults is not None:
            infos |= {"status": (shape, np.int8), "action": (shape, np.int8)}
            infos |= {"battery": (shape, np.float64)} if faults.has_battery else {}
        if coverage is not None:
            infos |= dict.fromkeys(METRICS, (worlds, np.float64))
        return report, infos

    def _share(self) -> None:
        """Copy to the device what the worlds share, and their state if it is not there yet."""
        template, faults = self.template, self.template.faults
        if faults is not None:
            faults.place(template.batch)
        self.batch = self._on_device(template.batch)
        self.faults = None if faults is None else self._on_device(faults.arrays)

    def _on_device(self, part: Any) -> Any:
        """Return a tuple of arrays, of tuples and of None with its arrays on the device."""
        return type(part)(*map(self._put, part._fields, part))

    def _put(self, name: str, value: Any) -> Any:
        if value is None:
            return None
        if isinstance(value, tuple):
            return self._on_device(value)
        if name in self._tables:
            return self._tables[name]
        if name not in OF_WORLDS:
            return cuda.to_device(value)
        if name not in self._state:
            self._state[name] = cuda.to_device(np.repeat(value, self.num_worlds, axis=0))
        return self._state[name]

    def _make_tables(self) -> dict[str, DeviceArray]:
        """Return the tables of the sea: of each world if the spread grows, else one."""
        world = self.template
        tables = {"gauss": world.gauss, "tails": world.tails}
        if not world.scenario.dispersion_inc:
            return {n: cuda.to_device(np.array(t, order=ORDER)) for n, t in tables.items()}
        return {
            name: cuda.device_array((self.num_worlds, *table.shape[1:]), order=ORDER)
            for name, table in tables.items()
        }

    def _make_scratch(self) -> Scratch:
        """Return the scratch memory of B threads: only what the rules need."""
        world, rules = self.template, self.template.rules
        grid, cells = world.grid_size, (2 * rules.person_scatter + 1) ** 2

        def zeros(count: int, kind: DTypeLike) -> DeviceArray:
            return cuda.to_device(np.zeros((self.num_worlds, count), kind, ORDER))

        return Scratch(
            zeros(grid.cells + 1 if rules.collisions else 1, np.uint16),
            zeros(grid.longer + 1 if rules.circle else 1, np.int64),
            zeros(cells, np.int64),
            cuda.to_device(np.zeros(0)),
        )
