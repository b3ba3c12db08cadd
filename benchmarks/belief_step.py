# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The step of many beliefs, and the same step in plain NumPy."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.processes import BenchmarkError
from benchmarks.workload import random_walks
from dsse_ros.search.belief import component_kernels, component_motion, motion_kernels
from dsse_ros.search.belief.belief import Forecast
from dsse_ros.search.environments.world import World
from dsse_ros.search.environments.world_beliefs import DRIFT_SAMPLES, WorldBeliefs
from dsse_ros.world.scenario.actions import ACTION_VECTORS
from dsse_ros.world.scenario.scenario import scenario_and_rules
from dsse_ros.world.targets.motion import STAND_STILL, STEPS

RULES = ("paper", "v2")
WAYS = ("two_cores", "numpy")
GRID_SIZE, NUM_DRONES, BATCH, LIMIT = 40, 5, 1024, 100
WALKS = 64
POD = 0.8
MEASURED = range(4, LIMIT, 10)
"""Measured steps of a mission."""
SHARES = 8
"""Parts of the batch for two threads, which take one after the other."""
TOLERANCE = 1e-12
"""Tolerance: the compiled step empties cells below 1e-13."""

Tables = Sequence[NDArray[np.float64] | None]


def measure(
    *, rounds: int, log: Callable[[str], None], batch: int = BATCH
) -> dict[str, dict[str, list[float]]]:
    """Return beliefs per second by rules, of a step with its failed searches, round by round.

    A round is a mission, of which some steps are measured: by two threads and by NumPy, both
    from the same beliefs.

    Args:
        rounds: Number of rounds.
        log: Gets a line for each of the rules.
        batch: B, number of beliefs that step at once.

    Raises:
        BenchmarkError: If NumPy's beliefs differ.
    """
    found = {}
    for rules in RULES:
        search = _Search(rules, batch)
        rates: dict[str, list[float]] = {name: [] for name in WAYS}
        # The first round compiles and computes what all rounds share.
        for turn in range(rounds + 1):
            seconds = search.mission()
            for name, taken in seconds.items():
                if turn:
                    rates[name].append(batch * len(MEASURED) / taken)
        best = {name: max(measured) for name, measured in rates.items()}
        log(f"{rules:8}{best['two_cores']:12.0f} two cores{best['numpy']:10.0f} NumPy   beliefs/s")
        found[rules] = rates
    return found


def numpy_step(
    belief: NDArray[np.float64],
    searched: tuple[NDArray[np.int64], NDArray[np.int64]],
    pod: float,
    tables: Tables,
) -> None:
    """Let beliefs learn from failed searches and move on, in plain NumPy.

    Args:
        belief: (B, K, S, S) float64, S = G + 2 margins; in and out.
        searched: Worlds and columns that were searched, each pair once.
        pod: Probability of detection.
        tables: Of each of the K drifts the probabilities (9, S, S) of the steps from each cell, see
            `motion_kernels`; None where its persons stand still.
    """
    worlds, columns = searched
    belief.reshape(*belief.shape[:2], -1)[worlds, :, columns] *= 1 - pod
    belief /= belief.sum(axis=(1, 2, 3), keepdims=True)
    after = np.empty((len(belief), *belief.shape[2:]))
    inner = after.shape[1] - 2
    product = np.empty((len(belief), inner, inner))
    for k, table in enumerate(tables):
        if table is None:
            continue
        after[:] = 0.0
        for step, chances in enumerate(table):
            row, col = divmod(step, 3)
            np.multiply(belief[:, k, 1:-1, 1:-1], chances[1:-1, 1:-1], out=product)
            after[:, row : row + inner, col : col + inner] += product
        belief[:, k] = after


def _seconds(do: Callable[[], object]) -> float:
    start = time.perf_counter()
    do()
    return time.perf_counter() - start


class _Search:
    """A batch of beliefs whose drones walk at random and search, and never find anybody.

    The world makes no step: it has only what a belief reads, the positions of the drones.
    """

    def __init__(self, rules: str, batch: int) -> None:
        chosen, self.rules = scenario_and_rules(rules=rules)
        names = self.rules.actions
        starts, walks = random_walks(GRID_SIZE, NUM_DRONES, names, LIMIT, WALKS, seed=1)
        self.actions = np.tile(walks, (1, -(-batch // WALKS), 1))[:, :batch]
        vectors = np.array([ACTION_VECTORS[name] for name in names])
        self.cells = starts + np.cumsum(vectors[self.actions], axis=0)
        scenario = chosen.override(
            grid_size=GRID_SIZE, drones_positions=starts.tolist(), timestep_limit=LIMIT,
            person_initial_position=(GRID_SIZE // 2, GRID_SIZE // 2), probability_of_detection=POD,
        )  # fmt: skip
        self.batch = batch
        self.world = World(scenario, self.rules, batch, write_maps=False)
        self.world.reset()
        self.beliefs = WorldBeliefs(self.world)
        self.forecast = Forecast(scenario, self.rules, drift_samples=DRIFT_SAMPLES)
        self.table = cache(self._table)

    def mission(self) -> dict[str, float]:
        """Return the seconds that each implementation took for the measured steps of a mission."""
        taken = dict.fromkeys(WAYS, 0.0)
        self.beliefs.reset()
        with ThreadPoolExecutor(2) as pool:
            for step in range(LIMIT):
                self._place(step)
                if step not in MEASURED:
                    self._shared(pool)
                    continue
                mine = self._components().reshape(self.batch, -1, *self.forecast.padded.matrix)
                taken["two_cores"] += _seconds(partial(self._shared, pool))
                searched, tables = self._searched(step), self._tables(step)
                taken["numpy"] += _seconds(partial(numpy_step, mine, searched, POD, tables))
                self._compare(mine)
        return taken

    def _place(self, step: int) -> None:
        """Let the drones make a step, and inform the beliefs."""
        world = self.world
        self.beliefs.before_step(self.actions[step])
        world.drones["x"], world.drones["y"] = np.moveaxis(self.cells[step], -1, 0)
        world.worlds["t"] = step + 1

    def _shared(self, pool: ThreadPoolExecutor) -> None:
        """Do the work of `WorldBeliefs.after_step` in two threads."""
        size = self.batch // SHARES
        list(pool.map(lambda b: self.beliefs.after_step(b, b + size), range(0, self.batch, size)))

    def _searched(self, step: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return `searched` of `numpy_step`."""
        worlds, drones = np.nonzero(self.actions[step] == self.rules.action_set.search)
        col, row = (self.cells[step, worlds, drones] + motion_kernels.MARGIN).T
        return worlds, row * self.forecast.padded.columns + col

    def _tables(self, step: int) -> list[NDArray[np.float64] | None]:
        """Return `tables` of `numpy_step`."""
        slot = self.forecast.prepare(self.forecast.first_step + step)
        directions = self.forecast.moves.directions[slot].tolist()
        return [
            None if direction == STAND_STILL else self.table(slot, direction)
            for direction in directions
        ]

    def _table(self, slot: int, direction: int) -> NDArray[np.float64]:
        """Return the probabilities (9, S, S) of the steps from each cell."""
        forecast, padded = self.forecast, self.forecast.padded
        pitch = padded.columns
        # Each row is a person in one cell, and its distribution after the step.
        before, count = np.eye(padded.cells), padded.cells
        boxes = np.tile([0, pitch, 0, padded.rows, 0, 0, pitch], (count, 1))
        mass = component_kernels.Mass(before, boxes, np.eye(count), np.ones(count))
        scratch = component_motion.new_scratch(count)
        of_slot = forecast.moves.at(slot)._replace(directions=np.array([direction]))
        component_motion.predict(forecast.constants, forecast.sea, mass, of_slot, scratch)
        after = np.empty_like(before)
        component_kernels.unpack(mass, pitch, after)
        table = np.zeros((STEPS, count))
        for step in range(STEPS):
            offset = (step // 3 - 1) * pitch + step % 3 - 1
            table[step, max(-offset, 0) : count - max(offset, 0)] = after.diagonal(offset)
        return table.reshape(-1, *padded.matrix)

    def _components(self) -> NDArray[np.float64]:
        """Return the components cell by cell, (B, K, S S) float64; each belief sums to 1."""
        masses = self.beliefs.masses
        components = np.empty_like(masses.components)
        for b, out in enumerate(components):
            mass = component_kernels.Mass(*(array[b] for array in masses))
            component_kernels.unpack(mass, self.forecast.padded.columns, out)
        return components / masses.totals[:, :, None]

    def _compare(self, belief: NDArray[np.float64]) -> None:
        for mine, ours in zip(belief, self._components(), strict=True):
            if not np.allclose(mine, ours.reshape(mine.shape), rtol=1e-9, atol=TOLERANCE):
                raise BenchmarkError("NumPy's belief is another one")
