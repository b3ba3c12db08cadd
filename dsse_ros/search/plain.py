# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search in plain NumPy: what a step does, and what a search that finds nobody teaches.

This file is the specification, to be read from top to bottom, and it is slow. It shares no code
with the compiled step and beliefs; tests hold them to it on random small searches.

In cells it has the rules `paper`. A step of a `PlainSearch`:

1. The drones act in order. A move earns 1. A drone that would leave the grid stays, is out of the
   search and pays 100000. A search detects each person in the drone's cell with the POD.
2. The map drifts by the vector, cell by cell, and its circle grows: see `probability_map`.
3. Drones that share a cell are out of the search and pay 100000. If all persons are found, the
   search is over.
4. The persons go to the best cell of the 3 x 3 around them: the largest p times U{1..100} / 100.
   `move_persons` does this, for whoever draws their factors; `step` does the rest.

In metres, see `PlainMetresSearch`.

A `PlainBelief` is the probability of containment p(c) of one person, given all searches so far:

    failed search    p'(c) = p(c) (1 - POD(c)) / (1 - F),    F = sum of p(c) POD(c)
    motion           p'(c) = sum over b of p(b) P(person goes from b to c)

POS, the probability that the searches so far find the person, becomes POS + (1 - POS) F. In each
step a belief takes the searches, also those of drones that then collide, and then the motion. A
find ends the search for the person: beliefs are about those who are missing.

In metres the person is one of many weighted particles w_k, which move along tracks of their own,
and the same equation holds with 1 - POD to the power of the passes in place of 1 - POD(c): see
`PlainParticles`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Cell = tuple[int, int]
"""Column and row, from the north-west corner."""
Map = NDArray[np.float64]
"""(R, C) float64 [row, col], the probability of each cell."""
Points = NDArray[np.float64]
"""(..., 2) float64, metres to the east and to the south."""

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
MOVES = {LEFT: (-1, 0), RIGHT: (1, 0), UP: (0, -1), DOWN: (0, 1)}


def on_grid(cell: Cell, size: Cell) -> bool:
    """Return whether a cell is on a grid of this size, columns and rows."""
    return 0 <= cell[0] < size[0] and 0 <= cell[1] < size[1]


def moved(cell: Cell, action: int) -> Cell:
    """Return the cell to which an action leads, on the grid or not; a search leads nowhere."""
    dx, dy = MOVES.get(action, (0, 0))
    return cell[0] + dx, cell[1] + dy


def in_circle(dx: ArrayLike, dy: ArrayLike, radius: float) -> NDArray[np.bool_]:
    """Return whether cells at these offsets are in a circle: the middles of their outer edges."""
    x, y = np.abs(dx), np.abs(dy)
    return np.asarray(((x + 0.5) ** 2 + y**2 <= radius**2) & (x**2 + (y + 0.5) ** 2 <= radius**2))


def probability_map(size: Cell, datum: Cell, map_steps: int, sigma: tuple[float, float]) -> Map:
    """Return the map: a Gaussian about the datum, cut by a circle, divided by its sum.

    The radius is 1, 1, 1.5, 2, ... cells in the maps 1, 2, 3, 4, ...; map 0 is the datum alone.
    """
    dx, dy = np.arange(size[0]) - datum[0], (np.arange(size[1]) - datum[1])[:, None]
    if map_steps == 0:
        return ((dx == 0) & (dy == 0)).astype(float)
    inside = in_circle(dx, dy, 1.0 + max(map_steps - 2, 0) / 2)
    values = np.exp(-(dx**2 / (2 * sigma[0] ** 2) + dy**2 / (2 * sigma[1] ** 2))) * inside
    return np.asarray(values / values.sum())


def around(cell: Cell) -> list[Cell]:
    """Return the 3 x 3 cells around a cell, row by row."""
    return [(cell[0] + dx, cell[1] + dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]


def window(probability: Map, cell: Cell) -> NDArray[np.float64]:
    """Return the probabilities of the cells around a cell, (9,); 0 off the grid."""
    return np.pad(probability, 1)[cell[1] : cell[1] + 3, cell[0] : cell[0] + 3].ravel()


def person_factors(draw: Callable[[], float]) -> list[int]:
    """Draw the factors of a person's step: one of 1 to 100 for each cell around."""
    return [1 + int(100 * draw()) for _ in range(9)]


def best_cell(probability: Map, cell: Cell, factors: Sequence[int]) -> Cell:
    """Return the cell to which a person goes: the largest p times factor / 100, the first if equal.

    A person without a possible cell stays.
    """
    products = window(probability, cell) * (np.array(factors) / 100)
    return around(cell)[int(products.argmax())] if products.max() > 0.0 else cell


def move_chances(probability: Map, cell: Cell) -> dict[Cell, float]:
    """Return the probability of each cell to which `best_cell` leads with factors U{1..100}."""
    products = np.outer(window(probability, cell), np.arange(1, 101) / 100)
    if products.max() == 0.0:
        return {cell: 1.0}
    chances = {}
    for i, own in enumerate(products):
        beats = [(own[:, None] > other).mean(axis=1) for other in products[:i]]
        holds = [(own[:, None] >= other).mean(axis=1) for other in products[i + 1 :]]
        if own.max() > 0.0:
            chances[around(cell)[i]] = float(np.prod(beats + holds, axis=0).mean())
    return chances


@dataclass
class PlainOutcome:
    """What a step gave, by number of the drones that were in the search before it."""

    rewards: dict[int, float] = field(default_factory=dict)
    searched: dict[int, float] = field(default_factory=dict)
    """Probability of the cell, where the reward is that of a search that has failed."""
    terminated: set[int] = field(default_factory=set)
    truncated: set[int] = field(default_factory=set)
    finders: set[int] = field(default_factory=set)


@dataclass
class PlainSearch:
    """One mission in cells, by the rules `paper`.

    Attributes:
        size: Columns and rows of the grid.
        starts: First cell of each drone.
        lkp: Cell of the persons at the start, the last known position.
        vector: Drift, cells per step.
        sigma: Spread along x and y, cells.
        limit: Steps that the drones can do.
        person_amount: Number of persons.
        pod: Probability of detection of a search in a person's cell.
    """

    size: Cell
    starts: Sequence[Cell]
    lkp: Cell
    vector: tuple[float, float]
    sigma: tuple[float, float]
    limit: int
    person_amount: int = 1
    pod: float = 1.0

    def __post_init__(self) -> None:
        self.drones, self.active = list(self.starts), set(range(len(self.starts)))
        self.persons, self.found = [self.lkp] * self.person_amount, set[int]()
        self.steps = self.map_steps = 0
        self.datum, self.remainder = self.lkp, [0.0, 0.0]
        self.probability = probability_map(self.size, self.lkp, 0, self.sigma)

    @property
    def all_found(self) -> bool:
        """Whether no person is left to find."""
        return len(self.found) == self.person_amount

    def step(self, actions: Mapping[int, int], draw: Callable[[], float]) -> PlainOutcome:
        """Do one step, except that the persons move; `draw` returns floats in [0, 1)."""
        outcome = PlainOutcome()
        out_of_time = self.steps >= self.limit
        for drone in sorted(self.active):
            if out_of_time:
                outcome.rewards[drone] = -100000.0
                outcome.truncated.add(drone)
            elif actions[drone] == SEARCH:
                self._search(drone, outcome, draw)
            elif on_grid(cell := moved(self.drones[drone], actions[drone]), self.size):
                self.drones[drone], outcome.rewards[drone] = cell, 1.0
            else:
                outcome.rewards[drone] = -100000.0
                outcome.terminated.add(drone)
        self.steps += 1
        self.drift()
        self._collide(outcome)
        if self.all_found:
            outcome.terminated |= self.active
        self.active -= outcome.terminated | outcome.truncated
        return outcome

    def _search(self, drone: int, outcome: PlainOutcome, draw: Callable[[], float]) -> None:
        cell = self.drones[drone]
        left = [p for p in range(self.person_amount) if p not in self.found]
        finds = {
            p for p in left if self.persons[p] == cell and (self.pod >= 1 or draw() < self.pod)
        }
        if finds:
            self.found |= finds
            outcome.finders.add(drone)
            bonus = 10000 * (1 - self.steps / self.limit)
            outcome.rewards[drone] = len(finds) * (10000 + bonus)
        else:
            p = outcome.searched[drone] = float(self.probability[cell[1], cell[0]])
            outcome.rewards[drone] = p * 10000 if p >= 0.01 else -100.0

    def _collide(self, outcome: PlainOutcome) -> None:
        flying = self.active - outcome.terminated
        drones_in = Counter(self.drones[drone] for drone in flying)
        for drone in flying:
            if drones_in[self.drones[drone]] > 1:
                outcome.rewards[drone] = -100000.0
                outcome.searched.pop(drone, None)
                outcome.terminated.add(drone)

    def drift(self) -> None:
        """Move the map by one step; along an axis on which it would leave, the datum stays."""
        datum = list(self.datum)
        for axis in (0, 1):
            self.remainder[axis] += self.vector[axis]
            cells = math.trunc(self.remainder[axis])
            self.remainder[axis] -= cells
            if 0 <= datum[axis] + cells < self.size[axis]:
                datum[axis] += cells
        self.datum = (datum[0], datum[1])
        self.map_steps += 1
        self.probability = probability_map(self.size, self.datum, self.map_steps, self.sigma)

    def move_persons(self, draw: Callable[[], float]) -> None:
        """Move the persons who are not found."""
        for p in range(self.person_amount):
            if p not in self.found:
                factors = person_factors(draw)
                self.persons[p] = best_cell(self.probability, self.persons[p], factors)


class PlainBelief:
    """Where one person is, given all searches so far; it knows the map and no person.

    Args:
        search: The search, at its start.
    """

    def __init__(self, search: PlainSearch) -> None:
        self.poc, self.pos = search.probability.copy(), 0.0

    def update(self, cell: Cell, pod: float) -> None:
        """Take a search of a cell that has failed."""
        found = self.poc[cell[1], cell[0]] * pod
        self.pos += (1.0 - self.pos) * found
        self.poc[cell[1], cell[0]] *= 1.0 - pod
        self.poc /= 1.0 - found

    def move(self, probability: Map) -> None:
        """Move like a person who looks at this map."""
        after = np.zeros_like(self.poc)
        for row, col in zip(*np.nonzero(self.poc), strict=True):
            for (x, y), chance in move_chances(probability, (int(col), int(row))).items():
                after[y, x] += self.poc[row, col] * chance
        self.poc = after


def direction(heading: float) -> Points:
    """Return the unit vector of a heading, radians clockwise from north."""
    return np.array([math.sin(heading), -math.cos(heading)])


def ramp(first: Points, last: Points, acceleration: float, t: float) -> Points:
    """Return the way in the time t of what changes its velocity at an acceleration; 0: at once."""
    change = last - first
    ramp_s = float(np.linalg.norm(change)) / acceleration if acceleration > 0 else 0.0
    early = min(t, ramp_s)
    bend = early**2 / (2 * ramp_s) if ramp_s > 0 else 0.0
    return np.asarray(first * early + last * (t - early) + change * bend)


@dataclass
class PlainDrone:
    """A drone in metres. Heading and speeds are through the air; m/s, m/s^2, m, radians.

    Attributes:
        place: (2,), where it is.
        heading: Clockwise from north.
        speed: Airspeed.
        cruise: Its largest airspeed.
        slowest: Its lowest airspeed.
        radius: Of its tightest turn; 0 if it turns on the spot.
        acceleration: At which it changes its velocity; 0: at once.
    """

    place: Points
    heading: float
    speed: float
    cruise: float
    slowest: float = 0.0
    radius: float = 0.0
    acceleration: float = 0.0

    def fly(
        self, action: tuple[float, float], wind: tuple[float, float], step_s: float, pieces: int
    ) -> Points:
        """Fly a step; return the places at equal times, (pieces + 1, 2).

        With a turn radius it flies an arc and then straight on, as it changes its speed. Without
        one it changes its velocity straight to the new one.

        Args:
            action: A turn and a speed, from -1 to 1: shares of the largest turn of a step, and from
                the lowest airspeed to that of cruise.
            wind: Its velocity to the east and to the south.
            step_s: Time of the step.
            pieces: Straight pieces that stand for the path.
        """
        speed = self.slowest + (1 + action[1]) / 2 * (self.cruise - self.slowest)
        most = min(speed * step_s / self.radius, math.pi) if self.radius > 0 else math.pi
        turn, start, heading = action[0] * most, self.place, self.heading
        side = math.copysign(1.0, turn)
        first, last = self.speed * direction(heading), speed * direction(heading + turn)

        def at(t: float) -> tuple[Points, float]:
            if self.radius == 0:
                return ramp(first, last, self.acceleration, t), heading + turn
            airspeeds = np.array([self.speed]), np.array([speed])
            way = float(ramp(*airspeeds, self.acceleration, t)[0])
            arc = min(self.radius * abs(turn), way)
            ends = heading + side * arc / self.radius
            chord = direction(heading + math.pi / 2) - direction(ends + math.pi / 2)
            return side * self.radius * chord + (way - arc) * direction(ends), ends

        times = [step_s * k / pieces for k in range(pieces + 1)]
        path = np.array([start + at(t)[0] + np.array(wind) * t for t in times])
        self.place, self.heading = path[-1], at(step_s)[1]
        change = np.linalg.norm(last - first) if self.radius == 0 else abs(speed - self.speed)
        share = 1.0
        if change > self.acceleration * step_s > 0:
            share = float(self.acceleration * step_s / change)
        self.speed += share * (speed - self.speed)
        if self.radius == 0 and share < 1:
            velocity = first + share * (last - first)
            self.heading, self.speed = math.atan2(velocity[0], -velocity[1]), math.hypot(*velocity)
        return path


def passes(drone: Points, persons: Points, reach: float, *, looked_before: bool) -> Points:
    """Return how often a drone passes each of K persons in a straight piece of its path.

    A person within reach at the start counts only if the drone did not look there before.

    Args:
        drone: (2, 2), its place before and after.
        persons: (2, K, 2), their places before and after.
        reach: Greatest distance of a detection, m.
        looked_before: Whether it looked until then.
    """
    before, after = persons[0] - drone[0], persons[1] - drone[1]
    change = after - before
    length = np.maximum((change**2).sum(axis=-1), 1e-300)
    share = np.clip(-(before * change).sum(axis=-1) / length, 0.0, 1.0)
    nearest = before + share[:, None] * change
    in_view, comes = ((at**2).sum(axis=-1) <= reach**2 for at in (before, nearest))
    return np.where(in_view, 0 if looked_before else 1, comes).astype(float)


def passes_of(path: Points, persons: Points, reach: float, *, looked_before: bool) -> Points:
    """Return how often a drone passes each of K persons on its path, see `passes`."""
    pieces, count = len(path) - 1, np.zeros(persons.shape[1])
    for k in range(pieces):
        at = [persons[0] + (persons[1] - persons[0]) * ((k + j) / pieces) for j in (0, 1)]
        looked = looked_before or k > 0
        count += passes(path[k : k + 2], np.array(at), reach, looked_before=looked)
    return count


@dataclass
class PlainMetresSearch:
    """One mission in metres. In a step each drone, in order, flies its action and then detects.

    A drone that would leave the grid flies along its edge. Each person who is not found goes along
    a track of his or her own; one whom the drone passes is detected with the POD, once a pass.
    The events, and so the rewards, the time limit and the end, are those of cells; this class has
    the flight and the detections only.

    Attributes:
        drones: The drones.
        tracks: (P, T + 1, 2), where each person is before each step and after the last one.
        wind: Its velocity to the east and to the south, m/s.
        step_s: Time of a step.
        pieces: Straight pieces of a path.
        extent: Width and height of the grid, m.
        reach: Greatest distance of a detection, m.
        pod: Probability of detection of a pass.
    """

    drones: Sequence[PlainDrone]
    tracks: Points
    wind: tuple[float, float]
    step_s: float
    pieces: int
    extent: tuple[float, float]
    reach: float
    pod: float

    def __post_init__(self) -> None:
        self.steps, self.found = 0, set[int]()

    def step(
        self, actions: Sequence[tuple[float, float]], draw: Callable[[], float]
    ) -> list[Points]:
        """Do one step; return the paths of the drones."""
        persons = self.tracks[:, self.steps : self.steps + 2].transpose(1, 0, 2)
        paths = []
        for drone, action in zip(self.drones, actions, strict=True):
            path = drone.fly(action, self.wind, self.step_s, self.pieces).clip(0.0, self.extent)
            drone.place = path[-1]
            paths.append(path)
            count = passes_of(path, persons, self.reach, looked_before=self.steps > 0)
            for p in range(len(self.tracks)):
                missed = (1.0 - self.pod) ** count[p]
                if p not in self.found and missed < 1.0 and draw() >= missed:
                    self.found.add(p)
        self.steps += 1
        return paths


class PlainParticles:
    """Where one person is, as weights of K particles in metres."""

    def __init__(self, count: int) -> None:
        self.weights, self.pos = np.full(count, 1.0 / count), 0.0

    def update(self, missed: Points) -> None:
        """Take a path that has failed and missed each particle with these probabilities, (K,)."""
        found = float((self.weights * (1.0 - missed)).sum())
        self.pos += (1.0 - self.pos) * found
        self.weights = self.weights * missed / (1.0 - found)
