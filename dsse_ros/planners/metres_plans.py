# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Plans of drones in metres: the receding horizon beam search of the planner `belief`.

The drones plan one after the other. Each plans for the persons that the other drones' plans leave
(sequential allocation). See `metres_futures` for the value of plans, and `metres_beam` for the
search.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.planners import metres_beam, metres_futures
from dsse_ros.planners.metres_futures import BinnedFutures, Seen
from dsse_ros.planners.options import OF_PARTICLES, BeamOptions
from dsse_ros.search.step.metres_detection import DEFINITE, INVERSE_CUBE
from dsse_ros.search.step.metres_paths import Wind, largest_turn, pieces_of, shares_of
from dsse_ros.search.step.metres_steering import steer

Floats = NDArray[np.float64]

HORIZON = 15
"""Steps planned."""
CLOSENESS = 0.8
"""Factor on the worth of a person left at the end of a plan for each leg to him."""
BLIND = 0.03
"""Exposure of a step below which a plan counts an inverse cube law as blind."""
TURNS = 7
"""Turns to each side of a drone that can turn around in a step."""
BEND = 1.35
"""Power of the spacing of the turns."""
MOST_PIECES = 3
"""Straight pieces of a step's path in a plan."""
MOST_SEEN = {DEFINITE: 64, INVERSE_CUBE: 16}
"""Greatest number of drawn persons seen on a leg where they are densest, by law: what a plan costs.
"""
FEWEST = 256
"""Fewest persons drawn."""


class MetresSwarm(NamedTuple):
    """The drones of a mission, and where they fly.

    Attributes:
        airframes: (K,) of `AIRFRAMES`, by kind of drone.
        detectors: (K, A) of `DETECTORS`, by kind and appearance.
        kinds: (N,) int64, the kind of each drone.
        wind: The wind, and the time of a step.
        extent: Of the grid.
        area: (R, C) bool [row, col], the cells in which persons are searched for. Drones may fly
            over the others.
    """

    airframes: NDArray[np.void]
    detectors: NDArray[np.void]
    kinds: NDArray[np.int64]
    wind: Wind
    extent: GridExtent
    area: NDArray[np.bool_]


class Planned(NamedTuple):
    """What the drones do next.

    Attributes:
        actions: (N, 2) float64, turn and speed as shares from -1 to 1, see `metres_paths`; zeros
            for a drone without a plan.
        paths: (N, H K + 1, 2) float64, planned positions at equal times, in metres to the east and
            to the south of the grid's north-west corner. A drone without a further plan stays.
    """

    actions: Floats
    paths: Floats


class DroneModel(NamedTuple):
    """What plans assume about a kind of drone.

    Attributes:
        airframes: (1,) of `AIRFRAMES`.
        detectors: (A,) of `DETECTORS`, see `near`.
        turns: (A,) float64, see `metres_beam.MetresProblem`.
    """

    airframes: NDArray[np.void]
    detectors: NDArray[np.void]
    turns: Floats


def turns_of(airframe: np.void, step_s: float) -> Floats:
    """Return the turns that a plan tries in a step, in radians.

    Args:
        airframe: One of `AIRFRAMES`.
        step_s: Time of a step.
    """
    largest = largest_turn(float(airframe["radius"]), float(airframe["cruise"]), step_s)
    count = max(math.ceil(TURNS * largest / math.pi), 2)
    right = largest * (np.arange(1, count + 1) / count) ** BEND
    # A drone without a radius turns around to the right only.
    left = right[:-1] if airframe["radius"] <= 0.0 else right
    return np.concatenate([[0.0], right, -left])


def near(detectors: NDArray[np.void], multiplier: float, step_s: float) -> NDArray[np.void]:
    """Return what a plan counts as seen: to the distance where it is `BLIND`."""
    detectors = detectors.copy()
    detectors["pod"] = np.minimum(detectors["pod"] * multiplier, 1.0)
    detectors["rate"] *= multiplier
    reach = (detectors["rate"] * step_s / BLIND) ** (1 / 3)
    detectors["reach"] = np.where(detectors["law"] == INVERSE_CUBE, reach, detectors["reach"])
    return detectors


class MetresPlans:
    """Plans for the drones of one mission.

    Args:
        swarm: The drones.
        positions: (T, M, 2) float32, positions of the persons' particles before the first step of
            the sea and after each one; after the last nothing moves. A particle with a position
            that is not finite is nowhere.
        options: Options of the search.
        multiplier: Mean multiplier of the POD over the persons.
        appearances: (M,) int8, the particles' appearances; None if all are alike.
        seed: Seed of the draws from the particles.
    """

    def __init__(
        self,
        swarm: MetresSwarm,
        positions: NDArray[np.float32],
        options: BeamOptions,
        *,
        multiplier: float = 1.0,
        appearances: NDArray[np.int8] | None = None,
        seed: int = 0,
    ) -> None:
        step_s = swarm.wind.step_s
        self._swarm, self._positions, self._options = swarm, positions, options
        alike = np.zeros(positions.shape[1], np.int8)
        self._appearances = alike if appearances is None else appearances
        detectors = near(swarm.detectors, multiplier, step_s)
        self._models = [
            DroneModel(swarm.airframes[k : k + 1], detectors[k], turns_of(airframe, step_s))
            for k, airframe in enumerate(swarm.airframes)
        ]
        self._leg = float(swarm.airframes["cruise"].max()) * step_s
        self._order = by_place(positions[len(positions) // 2], swarm.extent)
        self._rng = np.random.default_rng(seed)
        self._plans = [np.empty((0, 2)) for _ in swarm.kinds]

    def copy(self) -> MetresPlans:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._rng, twin._plans = copy.deepcopy(self._rng), list(self._plans)
        return twin

    def with_seed(self, seed: int) -> MetresPlans:
        """Return a copy that draws with this seed."""
        twin = self.copy()
        twin._rng = np.random.default_rng(seed)
        return twin

    def __call__(
        self,
        flights: NDArray[np.void],
        weights: Floats,
        step: int,
        left: int,
        *,
        wind: Wind | None = None,
        live: NDArray[np.bool_] | None = None,
        deadline_s: float = math.inf,
    ) -> Planned:
        """Plan for the drones, which are where the last plans have led them.

        Args:
            flights: (N,) of `MOTION_STATES`.
            weights: (M,) float64, probability of each particle.
            step: Step of the sea, index of the positions.
            left: Steps of the mission that are left.
            wind: The wind from now on, and the time of a step; None for the last one.
            live: (N,) bool, the drones that fly; None for all.
            deadline_s: When no further drone plans, on the clock of `time.monotonic`.
        """
        if wind is not None:
            self._swarm = self._swarm._replace(wind=wind)
        if self._options.budget_ms is not None:
            deadline_s = min(deadline_s, time.monotonic() + self._options.budget_ms / 1000)
        flying = np.ones(len(flights), np.bool_) if live is None else live
        horizon = max(1, min(self._options.horizon or HORIZON, left))
        joint = JointPlans(self._swarm, self._models, self._options, flights)
        joint.start(self._futures(weights, step, horizon))
        for n in np.flatnonzero(flying).tolist():
            joint.follow(n, self._plans[n][1:])
        for count, n in enumerate(joint.order(flying)):
            if count and time.monotonic() > deadline_s:
                break
            joint.plan(n)
        self._plans = joint.plans
        return Planned(self._actions(), joint.paths())

    def _futures(self, weights: Floats, step: int, horizon: int) -> BinnedFutures:
        """Draw persons systematically from the particles on the grid, now or at the end."""
        swarm = self._swarm
        rows = np.minimum(step + np.arange(horizon + 1), len(self._positions) - 1)
        ends = self._positions[rows[[0, -1]]]
        there = ((ends >= 0.0) & (ends < swarm.extent)).all(axis=2).any(axis=0)
        known = np.where(there, weights, 0.0)
        sums = np.cumsum(known[self._order])
        count = self._count(known, ends[0])
        wanted = (np.arange(count) + self._rng.random()) * (sums[-1] / count)
        drawn, times = np.unique(np.searchsorted(sums, wanted, "right"), return_counts=True)
        drawn, times = drawn[drawn < len(sums)], times[drawn < len(sums)]
        positions = self._positions[rows[:, None], self._order[drawn]]
        finite = np.isfinite(positions).all(axis=(0, 2))
        return metres_futures.futures_of(
            np.ascontiguousarray(positions[:, finite]), times[finite] * (sums[-1] / count),
            self._appearances[self._order[drawn[finite]]], swarm.area, swarm.extent,
            self._leg / 2,
        )  # fmt: skip

    def _count(self, weights: Floats, positions: NDArray[np.float32]) -> int:
        """Return how many persons to draw: fewer where they are so dense that fewer are enough."""
        known = (weights > 0.0) & np.isfinite(positions).all(axis=1)
        if not known.any():
            return 1
        spread = np.cov(positions[known].T.astype(np.float64), aweights=weights[known], ddof=0)
        # Of normally distributed persons a leg sees at most its area over this one.
        area = 2 * math.pi * math.sqrt(max(float(np.linalg.det(spread)), 0.0))
        wanted = min(
            MOST_SEEN[int(model.detectors["law"][0])]
            * area
            / (self._leg * 2 * model.detectors["reach"].max())
            for model in self._models
        )
        return min(max(math.ceil(wanted), FEWEST), self._options.samples or OF_PARTICLES)

    def _actions(self) -> Floats:
        """Return the first actions of the plans."""
        swarm, actions = self._swarm, np.zeros((len(self._plans), 2))
        for action, kind, plan in zip(actions, swarm.kinds, self._plans, strict=True):
            if len(plan):
                turn, speed = plan[0].tolist()
                action[:] = shares_of(swarm.airframes[kind], turn, speed, swarm.wind.step_s)
        return actions


def by_place(positions: NDArray[np.float32], extent: GridExtent) -> NDArray[np.int64]:
    """Return the particles in an order in which neighbours are close to each other.

    A systematic sample of this order has its share of each place.

    Args:
        positions: (M, 2).
        extent: Of the grid.
    """
    cells = (
        np.nan_to_num(np.clip(positions / np.array(extent, np.float32), 0.0, 1.0)) * 255
    ).astype(np.int64)
    code = np.zeros(len(cells), np.int64)
    for bit in range(8):
        code |= (cells[:, 0] >> bit & 1) << 2 * bit | (cells[:, 1] >> bit & 1) << 2 * bit + 1
    return np.argsort(code, kind="stable")


class JointPlans:
    """The plans of all drones in one decision.

    Args:
        swarm: The drones.
        models: By kind of drone.
        options: Options of the search.
        flights: (N,) of `MOTION_STATES`.

    Attributes:
        plans: (H', 2) float64 of each drone, turns in radians and airspeeds of H' <= H steps.
    """

    def __init__(
        self,
        swarm: MetresSwarm,
        models: Sequence[DroneModel],
        options: BeamOptions,
        flights: NDArray[np.void],
    ) -> None:
        self._swarm, self._options, self._flights = swarm, options, flights
        self._models = [models[kind] for kind in swarm.kinds]
        self._leg = float(swarm.airframes["cruise"].max()) * swarm.wind.step_s
        self._pieces = min(pieces_of(swarm.airframes, swarm.wind.step_s), MOST_PIECES)
        self.plans = [np.empty((0, 2)) for _ in flights]

    def start(self, futures: BinnedFutures) -> None:
        """Begin to plan for persons."""
        self._futures = futures
        self._horizon, count = futures.members.shape
        drones, (width, height) = len(self._flights), self._swarm.extent
        squares = math.ceil(height / (self._leg / 2)), math.ceil(width / (self._leg / 2))
        self._seen = Seen(np.empty(count + 1, np.int64), np.empty(count + 1))
        self._scratch = metres_beam.PathScratch(
            np.empty((self._pieces + 1, 2)), self._seen, np.zeros(squares, np.int64)
        )
        self._survivals = np.ones((drones, self._horizon, count))
        self._worth, self._left = np.empty((self._horizon, count)), np.empty(count)
        present = np.stack([self._flights["east"], self._flights["south"]], axis=1)
        self._legs = np.empty((drones, self._horizon, self._pieces + 1, 2))
        self._legs[:] = present[:, None, None]

    def paths(self) -> Floats:
        """Return the paths of the plans, (N, H K + 1, 2)."""
        later = self._legs[:, :, 1:].reshape(len(self._legs), -1, 2)
        return np.concatenate([self._legs[:, :1, 0], later], axis=1)

    def order(self, flying: NDArray[np.bool_]) -> list[int]:
        """Return the flying drones in order of their distance to the persons' mean."""
        count = int(self._futures.starts[0, -1])
        weights = self._futures.weights[self._futures.members[0, :count]]
        mean = weights @ self._futures.ways[0, :count, :2] / max(float(weights.sum()), 1e-300)
        away = np.hypot(self._flights["east"] - mean[0], self._flights["south"] - mean[1])
        return [n for n in np.argsort(away, kind="stable").tolist() if flying[n]]

    def follow(self, n: int, plan: Floats) -> None:
        """Let a drone follow a plan."""
        model, wind = self._models[n], self._swarm.wind
        self.plans[n] = plan = plan[: self._horizon]
        metres_beam.write_legs(model.airframes, wind, self._flights[n : n + 1], plan, self._legs[n])
        if len(plan):
            self._legs[n, len(plan) :] = self._legs[n, len(plan) - 1, -1]
        metres_futures.write_survival(
            model.detectors, self._futures, wind, self._legs[n], len(plan), self._seen,
            self._survivals[n],
        )  # fmt: skip

    def plan(self, n: int) -> None:
        """Plan for a drone, given the plans of the others, or keep to its last plan."""
        problem, last = self._problem(n), self.plans[n]
        plan, rank = self._best(problem, n, self._options.width)
        if len(last):
            longer, again = self._best(problem._replace(fixed=last), n, 1)
            if len(longer) >= len(plan) and again > rank:
                plan = longer
        self.follow(n, plan)

    def _best(self, problem: metres_beam.MetresProblem, n: int, width: int) -> tuple[Floats, float]:
        """Return the best plan of a drone, (H', 2), and its rank.

        One near the edge that finds no plan flies to the middle for a step.
        """
        plan = np.empty((self._horizon, 2))
        depth, rank = metres_beam.plan_flight(
            problem, self._flights[n : n + 1], width, self._scratch, plan
        )
        if not depth:
            model, middle = self._models[n], np.array([self._swarm.extent]) / 2
            plan = steer(
                model.airframes, self._swarm.wind, self._swarm.extent, self._flights[n : n + 1],
                middle, False, self._scratch.path,
            )  # fmt: skip
        return plan[: max(depth, 1)], rank

    def _problem(self, n: int) -> metres_beam.MetresProblem:
        """Return what a drone plans for."""
        model, swarm = self._models[n], self._swarm
        metres_futures.write_worth(
            self._futures, self._survivals, n, self._options.gamma, self._worth, self._left
        )
        field = metres_beam.field_of(self._futures, self._left, swarm.extent, self._leg, CLOSENESS)
        return metres_beam.MetresProblem(
            airframes=model.airframes, detectors=model.detectors, wind=swarm.wind,
            extent=swarm.extent, turns=model.turns, futures=self._futures, worth=self._worth,
            left=self._left, field=field, kappa=self._options.kappa, fixed=np.empty((0, 2)),
        )  # fmt: skip
