# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rules of profile `paper`, written down plainly and slowly, cell by cell.

Nothing here is shared with the package. The person's own draw is not repeated: a test that compares
says where the persons are, and `may_move` and `move_chances` say where they may go.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]
Map = NDArray[np.float64]

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
MOVES = {LEFT: (-1, 0), RIGHT: (1, 0), UP: (0, -1), DOWN: (0, 1)}
AMPLITUDE = 40.0


def on_grid(cell: Cell, size: int) -> bool:
    """Whether the cell (col, row) is one of the grid."""
    return 0 <= cell[0] < size and 0 <= cell[1] < size


def moved(cell: Cell, action: int) -> Cell:
    """Cell that a move leads to, on the grid or not; a search leads nowhere."""
    dx, dy = MOVES.get(action, (0, 0))
    return cell[0] + dx, cell[1] + dy


def radius_of(map_step: int) -> float:
    """Radius of the circle in the n-th map, n = 1, 2, 3, ...: 1, 1, 1.5, 2, ..."""
    return 1.0 if map_step <= 2 else 1.0 + (map_step - 2) / 2


def in_circle(dx: int, dy: int, radius: float) -> bool:
    """Whether the cell at this offset lies in the circle with the middles of its outer edges."""
    dx, dy = abs(dx), abs(dy)
    return (dx + 0.5) ** 2 + dy**2 <= radius**2 and dx**2 + (dy + 0.5) ** 2 <= radius**2


def dense_map(
    size: int,
    datum: Cell,
    radius: float,
    sigma_x: float,
    sigma_y: float,
    centre: Cell | None = None,
) -> Map:
    """Probability (G, G) as [row, col]: the Gaussian inside the circle, divided by its sum."""
    x0, y0 = datum
    cx, cy = datum if centre is None else centre
    values = np.zeros((size, size))
    for y in range(size):
        for x in range(size):
            if in_circle(x - cx, y - cy, radius):
                exponent = (x - x0) ** 2 / (2 * sigma_x**2) + (y - y0) ** 2 / (2 * sigma_y**2)
                values[y, x] = AMPLITUDE * math.exp(-exponent)
    return values / values.sum()


def window(probability: Map, cell: Cell) -> list[tuple[Cell, float]]:
    """The 3 x 3 cells around a cell, row by row, with their probabilities; 0 off the grid."""
    size = len(probability)
    cells = [(cell[0] + dx, cell[1] + dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    return [(c, float(probability[c[1], c[0]]) if on_grid(c, size) else 0.0) for c in cells]


def may_move(probability: Map, old: Cell, new: Cell) -> bool:
    """Whether a person may go from one cell to another: to a possible one, or stay if none is."""
    around = dict(window(probability, old))
    if new not in around:
        return False
    # A number too small for a product with 1 / 100 may count as nothing.
    if max(around.values()) < 1e-300:
        return new == old or around[new] > 0
    return around[new] > 0


def move_chances(probability: Map, old: Cell, *, first_on_ties: bool = True) -> dict[Cell, float]:
    """Chance of each next cell of a person: the argmax of p * U{1..100}, the first on ties."""
    cells, values = zip(*window(probability, old), strict=True)
    if max(values) == 0:
        return {old: 1.0}
    draws = np.arange(1, 101)
    chances = {}
    for i, p in enumerate(values):
        if p == 0:
            continue
        wins = np.ones(100)
        for j, q in enumerate(values):
            if j == i:
                continue
            better = p * draws[:, None] > q * draws
            equal = p * draws[:, None] == q * draws
            wins *= (better | (equal & ((i < j) == first_on_ties))).mean(axis=1)
        chances[cells[i]] = float(wins.mean())
    return chances


@dataclass
class Outcome:
    """What one step gave: by drone number, of the drones that were in flight before it."""

    rewards: dict[int, float] = field(default_factory=dict)
    searched: dict[int, float] = field(default_factory=dict)
    """Probability of the cells searched in vain, whose reward hangs on it."""
    terminated: set[int] = field(default_factory=set)
    truncated: set[int] = field(default_factory=set)
    finders: set[int] = field(default_factory=set)


@dataclass
class PaperWorld:
    """One mission by the rules of profile `paper`.

    Attributes:
        size: Cells along a side.
        starts: First cell of each drone.
        lkp: Cell in which the persons are at the start.
        vector: Drift in cells per step.
        sigma_x, sigma_y: Spread in cells.
        limit: Steps that the drones can do.
        persons: Cell of each person; the caller moves those who are not found.
    """

    size: int
    starts: Sequence[Cell]
    lkp: Cell
    vector: tuple[float, float]
    sigma_x: float
    sigma_y: float
    limit: int
    person_amount: int = 1

    def __post_init__(self) -> None:
        self.drones = list(self.starts)
        self.active = set(range(len(self.starts)))
        self.persons = [self.lkp] * self.person_amount
        self.found: set[int] = set()
        self.steps = 0
        self.map_steps = 0
        self.datum = self.lkp
        self.remainder = [0.0, 0.0]
        self.probability = np.zeros((self.size, self.size))
        self.probability[self.lkp[1], self.lkp[0]] = 1.0

    @property
    def all_found(self) -> bool:
        """Whether no person is left to find."""
        return len(self.found) == self.person_amount

    def step(self, actions: Mapping[int, int]) -> Outcome:
        """Do one step of the drones in flight; the persons are still to be moved after it."""
        result = Outcome()
        late = self.steps >= self.limit
        for drone in sorted(self.active):
            if late:
                result.rewards[drone] = -100000.0
                result.truncated.add(drone)
            elif actions[drone] == SEARCH:
                self._search(drone, result)
            else:
                self._move(drone, actions[drone], result)
        self.steps += 1
        self.drift()
        self._collide(result)
        if self.all_found:
            result.terminated |= self.active
        self.active -= result.terminated | result.truncated
        return result

    def _search(self, drone: int, result: Outcome) -> None:
        cell = self.drones[drone]
        here = {i for i, p in enumerate(self.persons) if p == cell and i not in self.found}
        if here:
            self.found |= here
            result.finders.add(drone)
            result.rewards[drone] = len(here) * (10000 + 10000 * (1 - self.steps / self.limit))
            return
        p = float(self.probability[cell[1], cell[0]])
        result.searched[drone] = p
        result.rewards[drone] = p * 10000 if p >= 0.01 else -100.0

    def _move(self, drone: int, action: int, result: Outcome) -> None:
        target = moved(self.drones[drone], action)
        if on_grid(target, self.size):
            self.drones[drone] = target
            result.rewards[drone] = 1.0
        else:
            result.rewards[drone] = -100000.0
            result.terminated.add(drone)

    def _collide(self, result: Outcome) -> None:
        active = self.active - result.terminated
        drones_in_cell = Counter(self.drones[drone] for drone in active)
        for drone in active:
            if drones_in_cell[self.drones[drone]] > 1:
                result.rewards[drone] = -100000.0
                result.searched.pop(drone, None)
                result.terminated.add(drone)

    def drift(self) -> None:
        """Do one step of the map."""
        datum = list(self.datum)
        for axis in (0, 1):
            self.remainder[axis] += self.vector[axis]
            whole = math.trunc(self.remainder[axis])
            self.remainder[axis] -= whole
            if 0 <= datum[axis] + whole < self.size:
                datum[axis] += whole
        self.datum = (datum[0], datum[1])
        self.map_steps += 1
        self.probability = dense_map(
            self.size, self.datum, radius_of(self.map_steps), self.sigma_x, self.sigma_y
        )
