# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many searches of the rules `v2` at once, as tensors: the drones and the exact belief.

No person is drawn. A step has the probability p of finding the person, given no find before, and
M[t] is the probability that t steps have found nothing. The sum of M[t] over the steps of a mission
is its mean time, exactly, where a mission without a find counts as its time limit.

The searches start together and their persons' drifts are known, so in each step it is known which
layers of the belief move (`SeaForecast`); the others only lose what is searched. The belief is that
of `dsse_ros.search.belief.belief`, in float32.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from dsse_ros.world.scenario.actions import ACTION_VECTORS
from dsse_ros.world.scenario.rules import PROFILES
from dsse_ros.world.targets.drawn_cell import DRIFT_WEIGHT

RULES = PROFILES["v2"]
ACTIONS = RULES.actions
MOVES = [ACTION_VECTORS[name] for name in ACTIONS]
SEARCH = ACTIONS.index("search")
LIMIT = 100
"""Steps of a mission."""
CELL_M, STEP_S = 130.0, 13.0
"""The default size of a cell and duration of a step."""
AWAY = -1000
"""Coordinate of drones that are not in the search."""
ANGLES_DEG = ((0.0, 45.0), (20.0, 55.0), (300.0, 360.0), (315.0, 360.0))
"""Ranges of the angle of a person's own drift, see `person_kernels.own_drift`."""


@dataclass(frozen=True)
class Cases:
    """B searches for one person each.

    Attributes:
        persons: (B, 2) int64, last known cells (x, y).
        vectors: (B, 2) float64, `vector` of the scenario.
        sigma: (B, 2) float64, spread at first along x and y, in cells.
        growth: (B, 1) float64, `dispersion_inc`.
        starts: (B, N, 2) int64, cells of the drones; `AWAY` of those not in the search.
    """

    persons: Tensor
    vectors: Tensor
    sigma: Tensor
    growth: Tensor
    starts: Tensor

    def __len__(self) -> int:
        return len(self.persons)

    def at(self, rows: slice) -> Cases:
        """Return some of the searches."""
        return Cases(*(part[rows] for part in vars(self).values()))

    def to(self, device: torch.device) -> Cases:
        """Return the searches on a device."""
        return Cases(*(part.to(device) for part in vars(self).values()))


def joined(*parts: Cases) -> Cases:
    """Return the searches of several `Cases` in one."""
    return Cases(
        *(
            torch.cat(tensors)
            for tensors in zip(*(vars(part).values() for part in parts), strict=True)
        )
    )


def published_case(count: int = 1) -> Cases:
    """Return the published search, 40 x 40 cells with four drones, so many times."""
    rows = [(20, 20)], [(1.1, 1.0)], [(0.5, 0.5)], [(0.05,)]
    persons, vectors, sigma, growth = (torch.tensor(row, dtype=torch.float64) for row in rows)
    starts = torch.tensor([[(20, 0), (20, 39), (0, 20), (39, 20)]])
    case = Cases(persons.long(), vectors, sigma, growth, starts)
    return Cases(*(part.repeat_interleave(count, 0) for part in vars(case).values()))


def random_cases(count: int, grid: int, generator: torch.Generator, *, drones: int = 4) -> Cases:
    """Return searches with random places, drifts and spreads, for 1 to `drones` drones.

    Drifts have up to .3 cells per step. Half of the spreads are the default .5 cells at first.
    Drones start on the edges, anywhere, or side by side; 40 % of the searches lack some.
    The drift points between right and down; other searches are these, turned (`foveated.turned`).
    """

    def uniform(*shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
        draws = torch.rand(count, *shape, generator=generator, device=device, dtype=torch.float64)
        return low + (high - low) * draws

    def cells(*shape: int, margin: int = 0) -> Tensor:
        return (margin + uniform(*shape) * (grid - 2 * margin)).long()

    device = generator.device
    persons = torch.where(uniform(1) < 0.2, cells(2), cells(2, margin=grid // 8))
    angle, speed = uniform(high=math.pi / 2), uniform(high=3.0).sqrt()
    vectors = speed[:, None] * torch.stack([angle.cos(), angle.sin()], dim=1)
    sigma = torch.where(uniform(1) < 0.5, 0.5, uniform(2, low=0.3, high=3.0))
    growth = uniform(1, low=0.02, high=0.12)
    starts, edge = cells(drones, 2), cells(drones) * 5 // grid
    for number in range(4):
        axis, last = number % 2, number // 2 * (grid - 1)
        starts[..., axis] = torch.where(edge == number, last, starts[..., axis])
    beside = torch.tensor([(k % 2, k // 2) for k in range(drones)], device=device)
    together = starts[:, :1].clamp(max=grid - 1 - int(beside.max())) + beside
    starts = torch.where(uniform(1, 1) < 0.25, together, starts)
    number = torch.where(uniform() < 0.4, 1 + (uniform() * (drones - 1)).long(), drones)
    there = torch.arange(drones, device=device) < number[:, None]
    return Cases(persons, vectors, sigma, growth, torch.where(there[..., None], starts, AWAY))


class SeaForecast(NamedTuple):
    """What is known in advance of B searches, by step s of the sea, the first at the reset.

    Attributes:
        along_x: (S, B, G) float32; the map is the product of the two.
        along_y: (S, B, G) float32.
        drift: (B, 2) float32, of the map, cells per step.
        spread: (S, B, 2) float32, standard deviation of the map, cells.
        moving: By step, (R,) int64, the rows of the belief (B K) that move.
        steps: By step, (R, 2) int64, where their drifts lead, (x, y) from -1 to 1.
    """

    along_x: Tensor
    along_y: Tensor
    drift: Tensor
    spread: Tensor
    moving: tuple[Tensor, ...]
    steps: tuple[Tensor, ...]


def sea_of(cases: Cases, grid: int, drifts: int) -> SeaForecast:
    """Return the sea of searches with K angles of the persons' own drift."""
    drift, own = _per_step(cases.vectors), _own_drifts(cases.vectors, drifts)
    remainder, of_own = torch.zeros_like(drift), torch.zeros_like(own)
    datum, data, moving, steps = cases.persons.double(), [], [], []
    for _ in range(LIMIT + 1):
        data.append(datum)
        moves = (of_own.abs() >= 1).any(-1)
        of_own = of_own + own
        moving.append(moves)
        steps.append(of_own.round().sign())
        of_own = torch.where(moves[..., None], _less_one(of_own), of_own)
        remainder = remainder + drift
        to = datum + remainder.trunc()
        remainder = _less_one(remainder)
        inside = ((to >= 0) & (to < grid)).all(-1, keepdim=True)
        datum = torch.where(inside, to, datum)
    grown = (torch.arange(LIMIT + 1, device=drift.device) - 1).clamp(min=0)[:, None, None]
    spread = cases.sigma + grown * cases.growth
    line = torch.arange(grid, device=drift.device)
    away = line - torch.stack(data)[..., None]
    gauss = torch.exp(-(away**2) / (2 * spread**2)[..., None])
    # The first map has all the probability in one cell.
    gauss[0] = (away[0] == 0).double()
    along_x, along_y = (gauss / gauss.sum(-1, keepdim=True)).float().unbind(2)
    moved = torch.stack(moving).flatten(1)
    # One transfer has the numbers of all steps.
    rows = moved.nonzero()[:, 1].split(moved.sum(1).tolist())
    led = [step.flatten(0, 1)[row].long() for step, row in zip(steps, rows, strict=True)]
    return SeaForecast(along_x, along_y, drift.float(), spread.float(), rows, tuple(led))


def _per_step(vectors: Tensor) -> Tensor:
    """Return drifts (..., 2) in cells per step, see `sea_map.drift_per_step`."""
    norm = vectors.square().sum(-1, keepdim=True).sqrt().clamp(min=1e-12)
    return vectors / (CELL_M / norm / STEP_S)


def _own_drifts(vectors: Tensor, drifts: int) -> Tensor:
    """Return drifts (B, K, 2) of persons in cells per step, see `motion_kernels.start_sea`."""
    place = 4 * (torch.arange(drifts, dtype=torch.float64, device=vectors.device) + 0.5) / drifts
    low, high = torch.tensor(ANGLES_DEG, dtype=torch.float64, device=vectors.device)[place.long()].T
    angle = torch.deg2rad(low + place.frac() * (high - low))
    scale = 0.5 + torch.exp(-(angle - math.pi / 2).abs() / math.pi)
    x, y = vectors[:, None].unbind(-1)
    cos, sin = angle.cos(), angle.sin()
    turned = torch.stack([scale * (cos * x - sin * y), scale * (sin * x + cos * y)], dim=-1)
    return _per_step((vectors[:, None] + turned) / 2)


def _less_one(remainder: Tensor) -> Tensor:
    return torch.where(remainder.abs() >= 1, remainder - remainder.sign(), remainder)


class Searches:
    """B searches in the same step, with their beliefs.

    Args:
        cases: The searches.
        grid: G.
        drifts: K, angles of the persons' own drift in the belief.

    Attributes:
        cells: (B, N, 2) int64, cells (x, y) of the drones.
        there: (B, N) bool, the drones in the search.
        t: Steps done.
        missing: (B,) float32, M[t].
        belief: (B, G, G) float32, as [y, x], probability of the missing person's cell.
    """

    def __init__(self, cases: Cases, grid: int, drifts: int = 64) -> None:
        self.cases, self.grid, self.t = cases, grid, 0
        self._sea = sea_of(cases, grid, drifts)
        self.cells, self.there = cases.starts, cases.starts[..., 0] >= 0
        device = self.cells.device
        self._moves = torch.tensor(MOVES, device=device)
        row = torch.arange(len(cases), device=device)
        # Not normalised: it sums to M[t].
        self._layers = torch.zeros(len(cases), drifts, grid, grid, device=device)
        x, y = cases.persons.unbind(1)
        self._layers[row, :, y, x] = 1.0 / drifts
        line = torch.arange(grid, device=device)
        # Where steps of -1, 0, 1 along an axis lead; those that would leave the grid stay.
        self._leads = torch.stack(
            [((line + step).clamp(0, grid - 1)[:, None] == line).float() for step in (-1, 0, 1)]
        )
        self._near = ((line[:, None] - line).abs() <= 1).float()
        self._add_up()

    def _add_up(self) -> None:
        total = self._layers.sum(1)
        self.missing = total.sum((1, 2))
        self.belief = total / self.missing.clamp(min=1e-30)[:, None, None]

    def case(self) -> Tensor:
        """Return what the drones know of each search, (B, 6): see `foveated.Foveated`."""
        sea, growth = self._sea, self.cases.growth.float()
        # The drones observe the map that the persons look at in the next step.
        spread, time = sea.spread[self.t + 1], torch.full_like(growth, self.t / LIMIT)
        return torch.cat([sea.drift, time, spread, growth], dim=1)

    def masks(self) -> Tensor:
        """Return the actions that do not leave the grid, (B, N, A) bool."""
        to = self.cells[..., None, :] + self._moves
        allowed: Tensor = ((to >= 0) & (to < self.grid)).all(-1)
        allowed[..., SEARCH] = True
        return allowed

    def step(self, actions: Tensor) -> Tensor:
        """Advance every search by a step without a find.

        Args:
            actions: (B, N) int64, allowed ones.

        Returns:
            Probability that each drone's search would have found, (B, N) float32. Drones that
            search the same cell share it; the sum is p.
        """
        self.cells = torch.where(self.there[..., None], self.cells + self._moves[actions], AWAY)
        searches = (actions == SEARCH) & self.there
        together = (self.cells[:, :, None] == self.cells[:, None]).all(-1) & searches[:, None]
        place = (self.cells[..., 1] * self.grid + self.cells[..., 0]).clamp(min=0)
        shares = self.belief.flatten(1).gather(1, place) * searches
        shares = shares / together.sum(2).clamp(min=1)
        found = place[:, None].expand(-1, self._layers.shape[1], -1)
        left = (~searches).float()[:, None].expand_as(found)
        self._layers.flatten(2).scatter_reduce_(2, found, left, "prod")
        self.t += 1
        self._move()
        self._add_up()
        return shares

    def _move(self) -> None:
        """Advance the persons of the layers that move."""
        sea, rows, steps = self._sea, self._sea.moving[self.t], self._sea.steps[self.t]
        layers, world = self._layers.flatten(0, 1), rows // self._layers.shape[1]
        likely = sea.along_y[self.t][:, :, None] * sea.along_x[self.t][:, None]
        near = self._near
        per_weight = layers[rows] / (DRIFT_WEIGHT + near @ likely @ near)[world]
        along_x, along_y = self._leads[steps + 1].unbind(1)
        drifted = along_y.mT @ per_weight @ along_x
        layers[rows] = likely[world] * (near @ per_weight @ near) + DRIFT_WEIGHT * drifted
