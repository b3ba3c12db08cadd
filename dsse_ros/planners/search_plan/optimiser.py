# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The plan with the largest POS that an optimiser finds, by SciPy's differential evolution.

It first divides one rectangle among all units. Then it moves the area of one unit after the other,
wherever no other area is, and so may leave the rectangle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.search_plan.assignments import (
    Assignment,
    Choice,
    SearchUnit,
    assignment_of,
)
from dsse_ros.planners.search_plan.divisions import Cloud, bounds_of, divided
from dsse_ros.planners.search_plan.land import Land
from dsse_ros.planners.search_plan.rectangles import gap_m
from dsse_ros.planners.search_plan.success import Success
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.step.cell_tracks import Draw

Floats = NDArray[np.float64]


class NoPlanError(ValueError):
    """No plan was found in which each unit has time to search, and none afloat crosses land."""


Watch = Callable[[float], bool]
"""watch(pos) is called after each generation with the best POS; it returns whether to go on."""

PARTICLES = 2000
"""Particles by which plans are compared; POS is stated by others."""
STRAIGHT_S = 120.0
"""Time in which these drift straight."""
DIVISIONS, DIVISION_GENERATIONS = 10, 80
"""Plans of a generation for each unit, and generations, of the division among all units."""
MOVES, MOVE_GENERATIONS, ROUNDS = 20, 15, 1
"""The same of the move of one unit, and how often each is moved."""
_NO_TIME = 10.0
_OPTIONS: dict[str, Any] = {
    "strategy": "best1bin", "mutation": (0.4, 0.9), "recombination": 0.8, "tol": 0.0,
    "polish": False,
}  # fmt: skip


def generations(units: int) -> int:
    """Return how often `best_plan` calls its `watch`."""
    return DIVISION_GENERATIONS + ROUNDS * units * MOVE_GENERATIONS


def best_plan(
    units: Sequence[SearchUnit],
    forecast: EnsembleForecast,
    *,
    seed: int = 0,
    watch: Watch = lambda _: True,
    planned: EnsembleForecast | None = None,
) -> list[Assignment]:
    """Return an assignment for each unit; the same seed gives the same plan.

    Args:
        units: The units.
        forecast: The persons, of a search in metres.
        seed: Seed of the optimiser.
        watch: See `Watch`; if it returns False, the best plan so far is returned.
        planned: The particles by which plans are compared, if they are not to be drawn.

    Raises:
        NoPlanError: If no plan leaves each unit time to search.
    """
    success = success_for_planning(forecast) if planned is None else success_on(planned)
    search = _Optimiser(units, forecast, success, np.random.default_rng(seed), watch)
    search.divide()
    for _ in range(ROUNDS):
        for number in range(len(units)):
            search.move(number)
    if search.best is None:
        raise NoPlanError(
            "units must have time to reach the search area and to search it, those afloat at sea"
        )
    return search.best


class _Optimiser:
    """The best plan so far, and what improves it."""

    def __init__(
        self, units: Sequence[SearchUnit], forecast: EnsembleForecast, success: Success,
        rng: np.random.Generator, watch: Watch,
    ) -> None:  # fmt: skip
        self._units, self._rng, self._watch = units, rng, watch
        self._success, self._land = success, Land(forecast.scenario)
        self._cloud = cloud_of(forecast, max(unit.until_s for unit in units))
        self._reach_m = 3 * math.sqrt(float(np.linalg.eigvalsh(self._cloud.covariance)[1]))
        self.best: list[Assignment] | None = None
        self.pos = 0.0
        self._goes_on = True

    def _note(self, plan: list[Assignment], pos: float) -> float:
        """Remember a plan if it is the best one; return its value, the lower, the better."""
        if self.best is None or pos > self.pos:
            self.best, self.pos = plan, pos
        return -pos

    def _ashore(self, assignment: Assignment) -> float:
        """Return which share of a track is on land where its unit cannot go."""
        return self._land.share_of(assignment.track) if assignment.unit.afloat else 0.0

    def divide(self) -> None:
        """Divide a rectangle among all units."""

        def value(numbers: Floats) -> float:
            plan = divided(self._units, numbers)
            if plan is None:
                return _NO_TIME
            ashore = sum(map(self._ashore, plan))
            if ashore > 0.0:
                return 1.0 + ashore
            return self._note(
                plan, self._success.pos(self._success.missed(each.search) for each in plan)
            )

        bounds = bounds_of(self._units, self._cloud)
        count = DIVISIONS * (len(self._units) + 1)
        first = self._rng.uniform(bounds[:, 0], bounds[:, 1], size=(count, len(bounds)))
        self._evolve(value, bounds, first, DIVISION_GENERATIONS)

    def move(self, number: int) -> None:
        """Move the area of a unit to where it adds most to those of the others."""
        if self.best is None or not self._goes_on:
            return
        unit, plan = self._units[number], self.best
        others = [each for n, each in enumerate(plan) if n != number]
        left = [self._success.missed(each.search) for each in others]

        def value(numbers: Floats) -> float:
            laid = assignment_of(unit, choice_of(numbers))
            if laid is None:
                return _NO_TIME
            overlap = sum(max(-gap_m(laid.area, each.area), 0.0) for each in others)
            wrong = overlap / self._reach_m + self._ashore(laid)
            if wrong > 0.0:
                return 1.0 + wrong
            moved = [*plan[:number], laid, *plan[number + 1 :]]
            return self._note(moved, self._success.pos([*left, self._success.missed(laid.search)]))

        bounds = self._move_bounds(unit)
        first = self._rng.uniform(bounds[:, 0], bounds[:, 1], size=(MOVES, len(bounds)))
        # Half of them are near the present one.
        near = numbers_of(plan[number])
        spread = 0.05 * np.ptp(bounds, axis=1)
        first[: MOVES // 2] = near + spread * self._rng.standard_normal((MOVES // 2, len(bounds)))
        first[0] = near
        self._evolve(value, bounds, np.clip(first, *bounds.T), MOVE_GENERATIONS)

    def _move_bounds(self, unit: SearchUnit) -> Floats:
        east, south = self._cloud.mean.tolist()
        reach, width = self._reach_m, unit.sweep_width_m
        return np.array(
            [
                (east - reach, east + reach),
                (south - reach, south + reach),
                (0.0, 720.0),
                (0.0, math.log(4 * math.sqrt(unit.longest_m / width) + 1)),
                (math.log(width / 8), math.log(width * 8)),
            ]
        )

    def _evolve(
        self, value: Callable[[Floats], float], bounds: Floats, first: Floats, count: int
    ) -> None:
        """Let plans evolve, and watch."""
        # It comes with an extra.
        from scipy.optimize import differential_evolution

        if not self._goes_on:
            return

        def callback(intermediate_result: Any) -> bool:
            self._goes_on = self._goes_on and self._watch(self.pos)
            return not self._goes_on

        differential_evolution(
            value, bounds, init=first, maxiter=count, seed=self._rng, callback=callback, **_OPTIONS
        )


def success_for_planning(forecast: EnsembleForecast) -> Success:
    """Return how likely searches find persons, by which plans are compared."""
    scenario = forecast.scenario
    if scenario.particles > PARTICLES:
        scenario = replace(scenario, particles=PARTICLES)
    return success_on(EnsembleForecast(scenario, forecast.rules, draw=Draw.PLANNING))


def success_on(planned: EnsembleForecast) -> Success:
    """Return the same on given particles."""
    return Success(planned, every=max(int(STRAIGHT_S / planned.scenario.step_duration_s), 1))


def cloud_of(forecast: EnsembleForecast, until_s: float) -> Cloud:
    """Return where the persons are in the middle of a search."""
    positions, weights = forecast.tracks.particles_m, forecast.weights
    assert positions is not None
    steps = int(until_s / forecast.scenario.step_duration_s / 2)
    there = positions[forecast.row(forecast.first_step + steps)].astype(np.float64)
    known = np.isfinite(there).all(axis=1) & (np.abs(there) < 1e6).all(axis=1)
    share = (weights[known] / weights[known].sum())[:, None]
    # In whole metres: libraries of linear algebra need not give the same last bits in each process.
    mean = np.round((share * there[known]).sum(axis=0))
    east, south = (there[known] - mean).T
    products = np.stack([east * east, east * south, south * south], axis=1)
    xx, xy, yy = np.round((share * products).sum(axis=0)).tolist()
    return Cloud(mean, np.array([[xx, xy], [xy, yy]]))


def choice_of(numbers: Floats) -> Choice:
    """Return what numbers choose: centre, heading and side of the turn, lanes and spacing."""
    east, south, heading, lanes, spacing = numbers.tolist()
    return Choice(
        east, south, heading % 360, heading >= 360, max(round(math.exp(lanes)), 1),
        math.exp(spacing),
    )  # fmt: skip


def numbers_of(assignment: Assignment) -> Floats:
    """Return the numbers of an assignment; the inverse of `choice_of`."""
    choice = assignment.choice
    return np.array(
        [
            choice.east, choice.south, choice.heading_deg % 360 + 360 * choice.port,
            math.log(choice.lanes), math.log(choice.spacing_m),
        ]
    )  # fmt: skip
