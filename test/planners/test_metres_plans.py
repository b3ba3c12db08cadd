# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the plans of drones in metres."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import kernel
from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.planners import metres_futures
from dsse_ros.planners.metres_futures import Seen, futures_of, value_of, write_survival
from dsse_ros.planners.metres_plans import MetresPlans, MetresSwarm, near
from dsse_ros.planners.options import BeamOptions
from dsse_ros.search.step.metres_detection import DEFINITE, DETECTORS, INVERSE_CUBE, missed
from dsse_ros.search.step.metres_paths import (
    AIRFRAMES,
    MOTION_STATES,
    Wind,
    largest_turn,
    pieces_of,
    write_path,
)

STEP_S, CRUISE, REACH, POD = 13.0, 10.0, 65.0, 0.8
SEARCHED = np.ones((20, 20), np.bool_)
QUICK = BeamOptions(samples=200, horizon=6, width=8)
EYE = {
    "definite": (DEFINITE, REACH, POD, 0.0),
    "inverse_cube": (INVERSE_CUBE, 824.0, 0.0, 4300.0),
}


@kernel
def fly(airframes, wind, flights, n, action, path):  # type: ignore[no-untyped-def]
    """Fly drone n by an action as the step does."""
    airframe = airframes[0]
    speed = airframe.slowest + 0.5 * (1.0 + action[1]) * (airframe.cruise - airframe.slowest)
    turn = action[0] * largest_turn(airframe.radius, speed, wind.step_s)
    write_path(airframe, wind, flights[n], turn, speed, path)


@kernel
def chance_missed(detectors, path, step_s, person):  # type: ignore[no-untyped-def]
    """Return what `missed` returns."""
    return missed(detectors[0], path, None, step_s, person, 1.0)


def swarm_of(
    drones: int = 3, *, radius: float = 0.0, acceleration: float = 0.0, slowest: float = 0.0,
    wind: tuple[float, float] = (0.0, 0.0), side: float = 4000.0, law: str = "definite",
) -> MetresSwarm:  # fmt: skip
    return MetresSwarm(
        np.array([(CRUISE, slowest, radius, acceleration)], AIRFRAMES),
        np.array([[EYE[law]]], DETECTORS),
        np.zeros(drones, np.int64),
        Wind(*wind, STEP_S),
        GridExtent(side, side),
        SEARCHED,
    )


def flights_of(swarm: MetresSwarm, seed: int) -> NDArray[np.void]:
    """Return drones anywhere on the grid, but for a margin in which all can turn."""
    rng = np.random.default_rng(seed)
    flights = np.zeros(len(swarm.kinds), MOTION_STATES)
    for name in ("east", "south"):
        flights[name] = rng.uniform(0.3, 0.7, len(flights)) * swarm.extent.width
    flights["heading"], flights["speed"] = rng.uniform(-4, 4, len(flights)), CRUISE
    return flights


def particles(seed: int, side: float = 4000.0, steps: int = 40) -> NDArray[np.float32]:
    """Return (T, M, 2) tracks of two groups, of which the second drifts off the grid."""
    rng = np.random.default_rng(seed)
    start = np.concatenate(
        [
            rng.normal(rng.uniform(0.2, 0.8, 2) * side, 400, (300, 2)),
            rng.normal((0.9 * side, 0.5 * side), 200, (100, 2)),
        ]
    )
    drift = np.concatenate([rng.normal(0, 3, (300, 2)), rng.normal((20, 0), 3, (100, 2))])
    return (start + np.arange(steps)[:, None, None] * drift).astype(np.float32)


swarms = st.builds(
    swarm_of,
    drones=st.integers(1, 4),
    radius=st.sampled_from([0.0, 25.0, 80.0, 150.0]),
    acceleration=st.sampled_from([0.0, 2.5]),
    slowest=st.sampled_from([0.0, 6.0]),
    wind=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    side=st.sampled_from([2500.0, 4000.0]),
    law=st.sampled_from(sorted(EYE)),
)


def flown(swarm: MetresSwarm, seed: int, steps: int) -> Any:
    """Yield the plans and the paths flown, (N, K + 1, 2), step by step."""
    positions = particles(seed, swarm.extent.width)
    plans = MetresPlans(swarm, positions, QUICK, seed=seed)
    flights = flights_of(swarm, seed)
    pieces = pieces_of(swarm.airframes, STEP_S)
    for step in range(steps):
        planned = plans(flights, np.full(400, 1 / 400), step, 40 - step)
        paths = np.empty((len(flights), pieces + 1, 2))
        before = flights.copy()
        for n, action in enumerate(planned.actions):
            fly(swarm.airframes, swarm.wind, flights, n, action, paths[n])
        yield before, planned, paths


@settings(max_examples=25, deadline=None)
@given(swarms, st.integers(0, 99))
def test_drones_fly_the_paths_that_are_planned(swarm: MetresSwarm, seed: int) -> None:
    for before, planned, paths in flown(swarm, seed, 3):
        assert (np.abs(planned.actions) <= 1 + 1e-9).all()
        pieces = (planned.paths.shape[1] - 1) // 6
        assert planned.paths[:, 0, 0] == pytest.approx(before["east"])
        assert planned.paths[:, 0, 1] == pytest.approx(before["south"])
        assert planned.paths[:, pieces] == pytest.approx(paths[:, -1], abs=1e-6)


@settings(max_examples=25, deadline=None)
@given(swarms, st.integers(0, 99))
def test_nobody_leaves_the_grid(swarm: MetresSwarm, seed: int) -> None:
    for _, planned, paths in flown(swarm, seed, 30):
        for positions in (planned.paths, paths):
            assert positions.min() >= 0.0
            assert positions.max() <= swarm.extent.width


@settings(max_examples=20, deadline=None)
@given(st.sampled_from([25.0, 80.0, 150.0]), st.sampled_from(sorted(EYE)), st.integers(0, 99))
def test_no_planned_turn_is_tighter_than_the_turn_radius(
    radius: float, law: str, seed: int
) -> None:
    swarm = swarm_of(radius=radius, slowest=6.0, law=law)
    for _, planned, _ in flown(swarm, seed, 4):
        pieces = (planned.paths.shape[1] - 1) // 6
        legs = np.diff(planned.paths, axis=1)
        chords = np.hypot(legs[..., 0], legs[..., 1])
        headings = np.arctan2(legs[..., 0], -legs[..., 1])
        turns = np.abs((np.diff(headings, axis=1) + math.pi) % (2 * math.pi) - math.pi)
        # Between the middles of two pieces lies the way of one piece.
        way = CRUISE * STEP_S / pieces
        assert (turns <= way / radius + 1e-6).all()
        assert (chords <= way + 1e-6).all()


@pytest.mark.parametrize("law", sorted(EYE))
def test_the_same_seed_gives_the_same_plans_bit_for_bit(law: str) -> None:
    swarm = swarm_of(radius=80.0, law=law)
    positions, flights = particles(1), flights_of(swarm, 1)
    weights = np.full(400, 1 / 400)
    one, twin, other = (MetresPlans(swarm, positions, QUICK, seed=seed) for seed in (1, 1, 2))
    first = [plans(flights, weights, 0, 40).paths.tobytes() for plans in (one, twin, other)]
    assert first[0] == first[1] != first[2]
    later = [plans(flights, weights, 1, 40).paths.tobytes() for plans in (one.copy(), one, twin)]
    assert later[0] == later[1] == later[2]


@settings(max_examples=20, deadline=None)
@given(
    st.tuples(st.floats(0.1, 0.9), st.floats(0.1, 0.9)),
    st.sampled_from([0.0, 80.0]),
    st.sampled_from(sorted(EYE)),
    st.integers(0, 99),
)
def test_a_drone_flies_to_the_only_particle(
    place: tuple[float, float], radius: float, law: str, seed: int
) -> None:
    swarm = swarm_of(1, radius=radius, law=law)
    person = np.array(place) * swarm.extent.width
    positions = np.tile(person, (40, 1, 1)).astype(np.float32)
    plans = MetresPlans(swarm, positions, QUICK, seed=seed)
    flights, path = flights_of(swarm, seed), np.empty((pieces_of(swarm.airframes, STEP_S) + 1, 2))
    away = math.hypot(flights["east"][0] - person[0], flights["south"][0] - person[1])
    # A drone with a radius may have to turn around first.
    steps = math.ceil(away / (CRUISE * STEP_S)) + (4 if radius else 1)
    nearest = math.inf
    for step in range(steps):
        action = plans(flights, np.ones(1), step, 40 - step).actions[0]
        fly(swarm.airframes, swarm.wind, flights, 0, action, path)
        for a, b in zip(path, path[1:], strict=False):
            nearest = min(nearest, float(np.hypot(*(np.linspace(a, b, 50) - person).T).min()))
    assert nearest <= REACH


def survivals_of(
    swarm: MetresSwarm, positions: NDArray[np.float32], paths: NDArray[np.float64], horizon: int
) -> tuple[metres_futures.BinnedFutures, NDArray[np.float64]]:
    """Return futures of all particles, and how likely each drone misses them."""
    count = positions.shape[1]
    futures = futures_of(
        positions[: horizon + 1],
        np.full(count, 1 / count),
        np.zeros(count, np.int8),
        SEARCHED,
        swarm.extent,
        REACH,
    )
    survivals = np.empty((len(paths), horizon, count))
    detectors, seen = (
        near(swarm.detectors, 1.0, STEP_S)[0],
        Seen(np.empty(count + 1, int), np.empty(count + 1)),
    )
    for path, survival in zip(paths, survivals, strict=True):
        pieces = (len(path) - 1) // horizon
        legs = np.stack([path[h * pieces : (h + 1) * pieces + 1] for h in range(horizon)])
        write_survival(detectors, futures, swarm.wind, legs, horizon, seen, survival)
    return futures, survivals


@settings(max_examples=15, deadline=None)
@given(swarms, st.integers(0, 99))
def test_the_value_of_plans_is_that_of_brute_force(swarm: MetresSwarm, seed: int) -> None:
    horizon, positions, gamma = 6, particles(seed, swarm.extent.width), 0.9
    paths = next(flown(swarm, seed, 1))[1].paths
    futures, survivals = survivals_of(swarm, positions, paths, horizon)
    detectors, pieces = near(swarm.detectors, 1.0, STEP_S)[0], (paths.shape[1] - 1) // horizon
    value = 0.0
    for s in range(positions.shape[1]):
        left = 1.0
        for h in range(horizon):
            person = (*positions[h, s].tolist(), *positions[h + 1, s].tolist())
            for path in paths:
                leg = path[h * pieces : (h + 1) * pieces + 1]
                chance = 1.0
                if min(person[:2]) >= 0 and max(person[:2]) < swarm.extent.width:
                    chance = float(chance_missed(detectors, leg, STEP_S, person))
                value += gamma**h * left * (1 - chance) / positions.shape[1]
                left *= chance
    planned = value_of(futures, survivals, gamma)
    if swarm.detectors["law"][0, 0] == DEFINITE:
        assert planned == pytest.approx(value, rel=1e-6, abs=1e-9)
    else:
        # Plans ignore distant persons, who are hardly seen.
        assert 0.95 * value <= planned <= value * (1 + 1e-6)


@settings(max_examples=15, deadline=None)
@given(swarms, st.integers(0, 99))
def test_a_plan_is_worth_what_it_adds_to_the_value_of_the_others(
    swarm: MetresSwarm, seed: int
) -> None:
    horizon, positions, gamma = 6, particles(seed, swarm.extent.width), 0.9
    paths = next(flown(swarm, seed, 1))[1].paths
    futures, survivals = survivals_of(swarm, positions, paths, horizon)
    count = positions.shape[1]
    worth, left = np.empty((horizon, count)), np.empty(count)
    metres_futures.write_worth(futures, survivals, 0, gamma, worth, left)
    alone = survivals.copy()
    alone[0] = 1.0
    added, before = 0.0, np.ones(count)
    for h in range(horizon):
        seen = futures.starts[h, -1]
        lost = (before - survivals[0, h])[futures.members[h, :seen]]
        added += float(lost @ worth[h, :seen])
        before = survivals[0, h]
    expected = value_of(futures, survivals, gamma) - value_of(futures, alone, gamma)
    assert added == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_drones_share_out_what_there_is() -> None:
    # Two groups of persons, and two drones between them.
    swarm = swarm_of(2)
    rng = np.random.default_rng(0)
    groups = [rng.normal((x, 2000), 60, (200, 2)) for x in (1200, 2800)]
    positions = np.tile(np.concatenate(groups), (40, 1, 1)).astype(np.float32)
    flights = np.zeros(2, MOTION_STATES)
    flights["east"], flights["south"], flights["speed"] = (1990, 2010), 2000, CRUISE
    planned = MetresPlans(swarm, positions, BeamOptions(), seed=0)(
        flights, np.full(400, 1 / 400), 0, 40
    )
    last = planned.paths[:, 7, 0]
    assert last.min() < 1500 < 2500 < last.max()


def test_a_drone_that_is_not_live_has_no_plan() -> None:
    swarm = swarm_of(2)
    flights = flights_of(swarm, 3)
    live = np.array([True, False])
    planned = MetresPlans(swarm, particles(0), QUICK)(
        flights, np.full(400, 1 / 400), 0, 40, live=live
    )
    assert planned.actions[1].tolist() == [0.0, 0.0]
    assert (planned.paths[1] == planned.paths[1, 0]).all()
    assert planned.actions[0, 1] == 1.0


def test_plans_end_with_the_mission() -> None:
    swarm = swarm_of(1)
    planned = MetresPlans(swarm, particles(0), QUICK)(
        flights_of(swarm, 3), np.full(400, 1 / 400), 38, 2
    )
    assert planned.paths.shape == (1, 3, 2)


def test_particles_that_are_nowhere_or_far_away_are_ignored() -> None:
    swarm = swarm_of(1)
    positions = particles(0)
    positions[:, ::2], positions[:, 1::4] = np.nan, 1e6
    plans = MetresPlans(swarm, positions, QUICK)
    planned = plans(flights_of(swarm, 3), np.full(400, 1 / 400), 0, 40)
    assert np.isfinite(planned.paths).all()
    nowhere = MetresPlans(swarm, np.full_like(positions, np.nan), QUICK)
    assert np.isfinite(nowhere(flights_of(swarm, 3), np.full(400, 1 / 400), 0, 40).paths).all()
