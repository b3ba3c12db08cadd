# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arrays of B worlds that share one scenario and one set of rules: reset and step."""

from __future__ import annotations

import dataclasses
import os
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.draws import words_of_seed
from dsse_ros.base.compiled.overloads import Specialized, overload_of
from dsse_ros.search.environments.coverage_task import Coverage
from dsse_ros.search.environments.faults import Faults
from dsse_ros.search.environments.metres_drones import MetresDrones, reported_wind, wind_of
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.environments.viewpoints import Viewpoints
from dsse_ros.search.environments.world_ensemble import WorldEnsemble
from dsse_ros.search.step import kernels
from dsse_ros.search.step.constants import area_of, constants_of
from dsse_ros.search.step.entities import DRONES, WORLDS, Entities
from dsse_ros.search.step.looks import looks_of
from dsse_ros.search.step.masks import mask_table, write_masks
from dsse_ros.search.step.world_state import Batch, Extensions, Scratch
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario, Scenario
from dsse_ros.world.scenario.scenario_identity import identity_of
from dsse_ros.world.targets import sea_map
from dsse_ros.world.targets.motion import PERSONS
from dsse_ros.world.targets.person_kernels import motion_data

_ACTION = np.dtype(np.int8)

SHARES = 4
"""Shares of the worlds per thread: a thread that finishes early takes another one."""
SHARE_BYTES = 1 << 18
"""Bytes of drones in a share with `on_stepped`, so that they stay in the core's own cache."""


class Rebound:
    """An object whose copies create what `_bind` creates, instead of copying it.

    A plain copy or pickle would detach its views from its own arrays.
    """

    _bound: set[str]

    def _bind(self) -> None:
        """Create the attributes that must not be copied."""
        raise NotImplementedError

    def _rebind(self) -> None:
        """Call `_bind`, and record which attributes are new."""
        before = set(vars(self))
        self._bind()
        self._bound = vars(self).keys() - before

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in vars(self).items() if k != "_bound" and k not in self._bound}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._rebind()


class World(Rebound):
    """B worlds, stepped together.

    Args:
        scenario: The scenario; it is resolved with the rules.
        rules: The rules of the search.
        num_worlds: B.
        write_maps: Whether to write `maps`; `cells` works without them.
        auto_reset: Whether a step resets a world that is done, instead of advancing it.
        threads: Number of threads that share the worlds.

    Attributes:
        grid_size: The shape of the grid.
        worlds, drones, persons: The state, structured arrays (B,), (B, N), (B, P) of
            `entities.WORLDS`, `entities.DRONES` and `motion.PERSONS`; without a truth (B, 0).
        starts: (B, N, 2) int64, cells of the drones at reset as (x, y).
        looks: The looks of the drones' sensors.
        faults: The drones' faults, None if they have none.
        area, runs: The searched cells, see `sea_map.Sea`.
        batch: All of these for the kernels.
        coverage: State of the coverage task, which has no persons; None in a search for persons.
        ensemble: The persons' ensemble; None if they move step by step.
        metres: The drones in metres; None if drones move from cell to cell.
        viewpoints: From where vehicles looked on cells; None if drones look in their own cells.
        maps: (B, R, C) float32, the probability of cell [row, col].
        rewards: (B, N) float64, rewards of the last step, a view on `drones`.
        terminated, truncated: (B, N) bool, flags since the last reset, views on `drones`; when
            drones end together, each has one of them at the end.
        finds: (B, N) uint64, see `entities.Entities`.
        found: (B, N) bool, whether the drone found a person in the last step, a view on `drones`.

    Raises:
        FieldError: If the scenario does not fit the rules.
    """

    def __init__(
        self,
        scenario: Scenario,
        rules: Rules,
        num_worlds: int = 1,
        *,
        write_maps: bool = True,
        auto_reset: bool = False,
        threads: int = 1,
    ) -> None:
        self.scenario = resolved = scenario.resolve(rules)
        resolved.check_truth(rules)
        self.rules = rules
        self.grid_size = resolved.grid_size
        self.num_worlds = num_worlds
        self.num_drones = resolved.num_drones
        self.looks = looks_of(resolved, rules)
        self.constants = constants_of(resolved, rules, looks=self.looks, auto_reset=auto_reset)
        self.worlds = np.zeros(num_worlds, WORLDS)
        self.drones = np.zeros((num_worlds, self.num_drones), DRONES)
        self.finds = np.zeros(self.drones.shape, np.uint64)
        self.coverage = Coverage(resolved, rules, num_worlds) if rules.covers else None
        persons = resolved.person_amount if resolved.has_persons and not rules.covers else 0
        self.persons = np.zeros((num_worlds, persons), PERSONS)
        self.starts = np.zeros((num_worlds, self.num_drones, 2), np.int64)
        self._map_shape = (num_worlds, *(self.grid_size.matrix if write_maps else (0, 0)))
        self.maps = np.zeros(self._map_shape, np.float32)
        # With a constant spread, all worlds share one table.
        tables = num_worlds if resolved.dispersion_inc else 1
        self.gauss = np.zeros((tables, 2, 2 * self.grid_size.longer + 1))
        self.tails = np.zeros((tables, 2, self.grid_size.longer + 2))
        self.area, self.runs = area_of(resolved)
        self._pod_multipliers = resolved.person_pod_multipliers
        self.ensemble = WorldEnsemble.of_scenario(resolved, rules, num_worlds)
        self.metres = MetresDrones(resolved, rules, num_worlds) if rules.in_metres else None
        self.viewpoints = Viewpoints.of_rules(rules, self.drones.shape)
        self.faults = Faults.of_scenario(resolved, rules, num_worlds, self.looks)
        self._write_masks = Specialized(write_masks)
        self._threads = threads
        self._rebind()
        self.seed()
        self.place()
        # Mark the worlds as done, so that the first step of an auto-reset batch resets them.
        self.worlds["done"] = True
        # Write the table of a constant spread once.
        self._refresh(self.maps[:, :0, :0])

    def _bind(self) -> None:
        """Create the views on the arrays, and the threads."""
        self.rewards = self.drones["reward"]
        self.terminated = self.drones["terminated"]
        self.truncated = self.drones["truncated"]
        self.found = self.drones["found"]
        sea = sea_map.Sea(
            gauss=self.gauss,
            tails=self.tails,
            area=self.area,
            runs=self.runs,
            data=motion_data(self.scenario, self.rules),
        )
        entities = Entities(
            start_cells=self.starts,
            drones=self.drones,
            finds=self.finds,
            persons=self.persons,
            kinds=self.looks.kind,
            look_starts=self.looks.starts,
            look_offsets=self.looks.offsets,
            look_pods=self.looks.pods,
        )
        extensions = Extensions(
            coverage=None if self.coverage is None else self.coverage.arrays,
            ensemble=None if self.ensemble is None else self.ensemble.arrays,
            metres=None if self.metres is None else self.metres.arrays(self.ensemble),
            viewpoints=None if self.viewpoints is None else self.viewpoints.array,
        )
        self.batch = Batch(
            constants=self.constants,
            worlds=self.worlds,
            sea=sea,
            entities=entities,
            extensions=extensions,
        )
        self._scratch = [self._make_scratch() for _ in range(self._threads)]
        self._kernels: list[Callable[..., None]] = []
        # Made when needed: that of a large area takes a second.
        self._mask_table: list[list[NDArray[np.int8]]] | None = None
        self._pool = ThreadPoolExecutor(self._threads - 1) if self._threads > 1 else None
        self._process = os.getpid()

    def seed(self, seed: int | Sequence[int | None] | np.random.SeedSequence | None = None) -> None:
        """Seed the worlds' generators, see `draws.words_of_seed`."""
        words, seeded = words_of_seed(seed, self.num_worlds)
        self.worlds["rng"][seeded] = words[seeded]

    def place(
        self,
        *,
        drones_positions: Sequence[tuple[int, int]] | None = None,
        vector: tuple[float, float] | None = None,
        person_initial_position: tuple[int, int] | None = None,
        person_pod_multipliers: Sequence[float] | None = None,
    ) -> None:
        """Set the values for the next resets; None restores the scenario's own value."""
        s = self.scenario
        starts = np.asarray(s.drones_positions if drones_positions is None else drones_positions)
        self.starts[...] = starts
        self.worlds["vector_x"], self.worlds["vector_y"] = s.vector if vector is None else vector
        person = person_initial_position or s.person_initial_position
        self.worlds["start_x"], self.worlds["start_y"] = person
        if self.coverage is None:
            pods = person_pod_multipliers
            pods = s.person_pod_multipliers if pods is None else tuple(pods)
            self.persons["pod_multiplier"] = pods if self.persons.size else 1.0
            self._update_pods(pods)
        self._update_tracks()

    def _update_pods(self, multipliers: tuple[float, ...]) -> None:
        """Compute the PODs of the looks for the persons, who are the same in all worlds."""
        if multipliers != self._pod_multipliers:
            scenario = dataclasses.replace(self.scenario, person_pod_multipliers=multipliers)
            self.looks.pods[...] = looks_of(scenario, self.rules).pods
            self._pod_multipliers = multipliers

    def _update_tracks(self) -> None:
        """Update the tracks for the placed values, if persons follow an ensemble."""
        if self.ensemble is not None and self.ensemble.place(self.placed()):
            self.close()

    def placed(self) -> dict[str, Any]:
        """Return the fields of the scenario that `place` replaced, with their new values."""
        world, scenario = self.worlds[0], self.scenario
        starts = {"drones_positions": tuple((x, y) for x, y in self.starts[0].tolist())}
        values: dict[str, Any] = (
            starts
            if self.coverage is not None
            else {
                **starts,
                "vector": (float(world["vector_x"]), float(world["vector_y"])),
                "person_initial_position": (int(world["start_x"]), int(world["start_y"])),
                "person_pod_multipliers": self._pod_multipliers,
            }
        )
        return {name: value for name, value in values.items() if value != getattr(scenario, name)}

    def placed_scenario(self) -> ResolvedScenario:
        """Return the scenario with the values for persons that `place` replaced."""
        # What is made for persons is slow to make and does not depend on the drones.
        replaced = {n: value for n, value in self.placed().items() if n != "drones_positions"}
        return self.scenario.override(**replaced).resolve(self.rules) if replaced else self.scenario

    def set_wind(self, wind_mps: tuple[float, float] | None) -> None:
        """Change the wind of drones in metres from the next step on; beliefs stay as they are.

        Args:
            wind_mps: Its velocity to the east and to the north, m/s; None for the scenario's.

        Raises:
            FieldError: If it is not slower than the drones.
        """
        metres, wind = self.metres, wind_of(self.scenario)
        assert metres is not None
        if wind_mps is not None:
            wind = reported_wind(wind_mps, metres.airframes, wind.step_s)
        if wind != metres.wind:
            metres.wind = wind
            self._bind()

    def reset(
        self,
        which: NDArray[np.bool_] | None = None,
        maps: NDArray[np.float32] | None = None,
    ) -> None:
        """Reset all worlds, or those with which[b]; their generators continue.

        Args:
            which: (B,) bool, by default all.
            maps: Memory for `maps`, by default new memory.
        """
        if which is None:
            which = np.ones(self.num_worlds, bool)
        if maps is None:
            maps = np.empty(self._map_shape, np.float32)
        if not which.all():
            self._refresh(maps)
        self.maps = maps
        kernels.reset_worlds(self.batch, self._scratch[0], self.maps, which, 0, self.num_worlds)
        if self.faults is not None:
            self.faults.reset(self.batch, which)

    def step(
        self,
        actions: NDArray[np.int8],
        maps: NDArray[np.float32] | None = None,
        on_stepped: Callable[[int, int], None] | None = None,
    ) -> None:
        """Advance every world by one step.

        Args:
            actions: (B, N) int8, action numbers of the rules or `NO_ACTION`; those of terminated or
                truncated drones have no effect. With faults drones may do something else, see
                `Faults.applied`. In metres drones do those of `metres` instead.
            maps: Memory for `maps`, C-contiguous, by default new memory.
            on_stepped: Called as on_stepped(first, last) after the step of worlds first..last - 1,
                in the thread that stepped them.

        Raises:
            ValueError: If `maps` has another shape, data type or memory layout.
        """
        actions = np.ascontiguousarray(actions, _ACTION)
        if maps is None:
            maps = np.empty(self._map_shape, np.float32)
        elif maps.shape != self._map_shape or maps.dtype != np.float32 or not maps.flags.carray:
            raise ValueError(f"maps must be C-contiguous float32 {self._map_shape}")
        self.maps = maps
        if self._pool is not None and self._process != os.getpid():
            # Threads do not survive a fork.
            self._bind()
        if not self._kernels:
            self._kernels = self._make_kernels()
        if self._pool is None and on_stepped is None:
            self._kernels[0](actions, self.maps, 0, self.num_worlds)
            return
        count = self.num_worlds
        size = count if self._pool is None else -(-count // (SHARES * self._threads))
        if on_stepped is not None:
            size = min(size, max(1, SHARE_BYTES // self.drones[0].nbytes))
        shares = deque((first, min(first + size, count)) for first in range(0, count, size))
        others = [
            self._pool.submit(self._do, shares, kernel, actions, on_stepped)
            for kernel in self._kernels[1:]
            if self._pool is not None
        ]
        self._do(shares, self._kernels[0], actions, on_stepped)
        for other in others:
            other.result()

    def _make_kernels(self) -> list[Callable[..., None]]:
        """Return one kernel per thread, each with its own scratch memory."""
        others = (np.empty(self.drones.shape, _ACTION), self.maps, 0, self.num_worlds)
        step = overload_of(kernels.step_worlds, self.batch, self._scratch[0], *others)
        steps: list[Callable[..., None]] = [
            partial(step, self.batch, scratch) for scratch in self._scratch
        ]
        faults = self.faults
        return steps if faults is None else [faults.wrap(self.batch, step) for step in steps]

    def _do(
        self,
        shares: deque[tuple[int, int]],
        kernel: Callable[..., None],
        actions: NDArray[np.int8],
        on_stepped: Callable[[int, int], None] | None,
    ) -> None:
        """Step shares of the worlds until none are left."""
        while True:
            try:
                first, last = shares.popleft()
            except IndexError:
                return
            kernel(actions, self.maps, first, last)
            if on_stepped is not None:
                on_stepped(first, last)

    def _make_scratch(self) -> Scratch:
        grid, around = self.grid_size, 2 * self.rules.person_scatter + 1
        scattered = min(around, grid.columns) * min(around, grid.rows)
        return Scratch(
            occupied=np.zeros(grid.cells + 1, np.uint16),
            circle=np.zeros(grid.longer + 1, np.int64),
            cells=np.zeros(scattered, np.int64),
            span=np.zeros(grid.columns),
        )

    def _refresh(self, maps: NDArray[np.float32]) -> None:
        """Write the tables that the state requires, and these maps."""
        kernels.refresh_worlds(self.batch, self._scratch[0], maps)

    def close(self) -> None:
        """End the threads; a later step starts them again."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._bind()

    def cells(self, x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the probabilities (B, K) float32 of cells, 0 outside the grid and the area.

        Args:
            x: (B, K) int64 columns.
            y: (B, K) int64 rows.
        """
        # Numba would compile the function again for each kind of array.
        x, y = (np.require(array, np.int64, ["C", "W"]) for array in (x, y))
        if self.coverage is not None:
            return self.coverage.cells(x, y)
        if self.ensemble is not None:
            return self.ensemble.cells(self.worlds, x, y)
        out = np.empty(x.shape, np.float32)
        sea_map.read_cells(self.constants, self.worlds, self.gauss, self.area, x, y, out)
        return out

    def map_of(self, world: int) -> NDArray[np.float32]:
        """Return the map (R, C) of one world, even if `maps` is not written."""
        if self.coverage is not None:
            return self.coverage.left[world].astype(np.float32)
        sea = self.batch.sea._replace(
            gauss=np.empty((1, *self.gauss.shape[1:])), tails=np.empty((1, *self.tails.shape[1:]))
        )
        batch = self.batch._replace(worlds=self.worlds[[world]], sea=sea)
        maps = np.empty((1, *self.grid_size.matrix), np.float32)
        kernels.refresh_worlds(batch, self._make_scratch(), maps)
        return maps[0]

    @property
    def mask_table(self) -> list[list[NDArray[np.int8]]]:
        """The action mask of a drone in each cell, see `masks.mask_table`."""
        if self._mask_table is None:
            self._mask_table = mask_table(self.constants, self.area)
        return self._mask_table

    def action_masks(self) -> NDArray[np.int8]:
        """Return the action masks (B, N, A) of all drones."""
        x, y = self.drones["x"].ravel(), self.drones["y"].ravel()
        masks = np.empty((*self.drones.shape, len(self.rules.actions)), np.int8)
        self._write_masks(self.constants, self.area, x, y, masks.reshape(x.size, -1))
        return masks if self.faults is None else self.faults.restrict(self.batch, masks)

    def acting(self) -> NDArray[np.bool_]:
        """Return which drones (N,) of the first world act in the next step."""
        now = self.worlds[0]
        last = self.rules.last_acting_step(self.scenario.timestep_limit)
        return self.drones["alive"][0] & np.bool_(not now["done"] and now["t"] < last)

    def looks_done(
        self, actions: NDArray[Any]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return the looks of the last step of the first world, see `Looks.at`.

        Args:
            actions: (N,) the actions of its drones, `NO_ACTION` for none.
        """
        places = self.drones[0]
        if self.viewpoints is not None:
            places = self.viewpoints.array[0]
            actions = places["action"]
        return self.looks.at(actions, np.stack([places["x"], places["y"]], axis=1))

    def withdraw(self, drone: int) -> NDArray[np.bool_]:
        """Take a drone out of the missions that go on, see `SearchEnv.withdraw`.

        Args:
            drone: Its number.

        Returns:
            (B,), whether it was still in the search.
        """
        taken: NDArray[np.bool_] = self.drones["alive"][:, drone] & ~self.worlds["done"]
        self.drones["alive"][taken, drone] = False
        self.worlds["num_active"] -= taken
        return taken

    def snapshot(self) -> Snapshot:
        """Return the complete state, including the random state."""
        arrays = {name: array.copy() for name, array in self._state().items()}
        return Snapshot(self._identity, arrays)

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot, bit for bit.

        Raises:
            SnapshotError: If it is of another scenario, other rules or another number of worlds,
                or its state is impossible; the present state stays as it is.
        """
        state = self._state()
        snapshot.check(self._identity, state)
        self._check_possible(snapshot.arrays)
        if self.faults is not None:
            self.faults.check(snapshot, self.grid_size)
        for name, array in state.items():
            array[...] = snapshot.arrays[name]
        if self.persons.size:
            self._update_pods(tuple(self.persons["pod_multiplier"][0].tolist()))
        if self.faults is not None:
            self.faults.restore(self.batch)
        self._update_tracks()
        self.maps = np.empty(self._map_shape, np.float32)
        self._refresh(self.maps)

    def _check_possible(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Raise if a state would make the kernels read beyond their arrays.

        The checksum alone does not prevent that: it is not a signature.
        """
        worlds = arrays["worlds"]
        things = self.grid_size.cells if self.coverage is not None else self.scenario.person_amount
        if self.metres is not None:
            self.metres.check(arrays["motion_states"], self.grid_size)
        if self.viewpoints is not None:
            self.viewpoints.check(arrays["viewpoints"])
        highest = dict.fromkeys(("datum_x", "circle_x", "start_x"), self.grid_size.columns - 1)
        highest |= dict.fromkeys(("datum_y", "circle_y", "start_y"), self.grid_size.rows - 1)
        highest |= {"num_active": self.num_drones, "num_missing": things}
        highest |= {"t": 2**40, "map_steps": 2**30}
        for name, high in highest.items():
            if not ((worlds[name] >= 0) & (worlds[name] <= high)).all():
                raise SnapshotError(f"the snapshot is damaged: {name} is not from 0 to {high}")
        multipliers = arrays["persons"]["pod_multiplier"]
        if not ((multipliers >= 0.0) & (multipliers < np.inf)).all():
            raise SnapshotError("the snapshot is damaged: a pod_multiplier is not 0 or more")
        if self.ensemble is not None:
            high = self.ensemble.tracks.truth.shape[1] - 1
            if not ((arrays["track"] >= 0) & (arrays["track"] <= high)).all():
                raise SnapshotError(f"the snapshot is damaged: track is not from 0 to {high}")

    def state_bytes(self) -> bytes:
        """Return the complete state as bytes, for comparison."""
        # Field by field, because the padding between fields has arbitrary content.
        return b"".join(
            array[field].tobytes()
            for array in self._state().values()
            for field in array.dtype.names or (...,)
        )

    def info_columns(self, world: int, drones: Sequence[int]) -> dict[str, Iterable[Any]]:
        """Return the infos of drones of a world by key, besides `Found` and `action_mask`.

        In a search for several persons, `found_person` is whether the drone's last look found one.
        If an action looks at several cells, `finds` has a bit for each look that found one. See
        `Faults.infos` for the keys that faults add, and `Coverage.metrics` for those of coverage.
        """
        columns: dict[str, Iterable[Any]] = {}
        if self.coverage is None and self.scenario.person_amount > 1:
            found = self.found[world, drones]
            columns["found_person"] = found.tolist()
            if self.looks.several:
                columns["finds"] = np.where(found, self.finds[world, drones], 0).tolist()
        if self.faults is not None:
            columns |= self.faults.infos(world, drones)
        if self.viewpoints is not None:
            columns["look"] = self.viewpoints.infos(world, drones)
        if self.coverage is not None:
            metrics = self.coverage.metrics(self.worlds["num_missing"], world)
            columns |= {name: [float(value)] * len(drones) for name, value in metrics.items()}
        return columns

    def coverage_metrics(self) -> dict[str, NDArray[np.float64]]:
        """Return `Coverage.metrics`, or an empty dictionary in a search for persons."""
        if self.coverage is None:
            return {}
        return self.coverage.metrics(self.worlds["num_missing"])

    def _state(self) -> dict[str, NDArray[Any]]:
        covered = self.coverage
        return {
            "worlds": self.worlds,
            "starts": self.starts,
            "drones": self.drones,
            **({"finds": self.finds} if self.looks.several else {}),
            "persons": self.persons,
            **({} if covered is None else {"left": covered.left, "coverage": covered.records}),
            **({} if self.ensemble is None else {"track": self.ensemble.track}),
            **({} if self.faults is None else {"conditions": self.faults.conditions}),
            **({} if self.metres is None else self.metres.state()),
            **({} if self.viewpoints is None else {"viewpoints": self.viewpoints.array}),
        }

    @cached_property
    def _identity(self) -> dict[str, Any]:
        return identity_of(self.scenario, self.rules)
