# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""POS of a search in metres is the share of persons that missions find."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsse_ros.search.belief.ensemble_belief import EnsembleBelief, PathsFlown
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.metres_drones import MetresDrones
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.cell_tracks import Draw
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

FLIGHT = profile("flight")
SENSORS: dict[str, dict[str, Any]] = {
    "definite range": {"sensor": "flown_over", "probability_of_detection": 0.8},
    "inverse cube": {"sensor": "sweep_width"},
    "camera": {"sensor": "camera", "object_size": 0.2},
    "several objects": {"sensor": "sweep_width"},
}
SEVERAL = [
    {"class": "PIW-1", "weight": 2},
    {"class": "LIFE-RAFT-DB-12", "search_object": "raft_4_person"},
]
MISSIONS, PLANS, STEPS, DRONES, PARTICLES = 56, 8, 150, 3, 2000
UNTIL = np.linspace(0.1, 0.9, PLANS)
"""POS at which each plan ends."""


def scenario_of(sensor: str, persons: int, seed: int) -> Scenario:
    return Scenario(
        incident={
            "object": SEVERAL if sensor == "several objects" else "PIW-1",
            "search_start": "2026-01-17T14:00Z",
            "wind": {"from": 270, "speed": 5.0},
            "seen": [{"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 300}],
        },
        particles=PARTICLES, num_drones=DRONES, person_amount=persons, timestep_limit=STEPS,
        ensemble_seed=seed, **SENSORS[sensor],
    )  # fmt: skip


def headed(flights: MetresDrones, belief: EnsembleBelief) -> NDArray[np.float64]:
    """Return actions of the drones towards likely cells, a different one for each."""
    worth, actions = belief.poc(), np.ones((DRONES, 2))
    side = np.arange(len(worth)) * 130.0 + 65.0
    for n, state in enumerate(flights.states[0]):
        away = np.hypot(side[None, :] - state["east"], side[:, None] - state["south"])
        row, col = np.unravel_index(np.argmax(worth * 0.9 ** (away / 130.0)), worth.shape)
        worth[row, col] = 0.0
        bearing = math.atan2(side[col] - state["east"], state["south"] - side[row])
        turn = math.remainder(bearing - state["heading"], 2 * math.pi)
        actions[n, 0] = turn / math.pi
    return actions


def plan(sensor: str, number: int) -> tuple[float, list[NDArray[np.float64]]]:
    """Return the POS of a plan, and its actions (N, 2) by step."""
    scenario = scenario_of(sensor, 1, number)
    # Nobody is found.
    blind = World(scenario.override(person_pod_multipliers=(0.0,)), FLIGHT, 1, write_maps=False)
    blind.reset()
    assert blind.metres is not None
    planned, belief = (
        forecast_for(scenario, FLIGHT, draw=draw).belief() for draw in (Draw.PLANNING, Draw.POS)
    )
    assert isinstance(planned, EnsembleBelief) and isinstance(belief, EnsembleBelief)
    plan = []
    while belief.pos < UNTIL[number] and belief.step < STEPS:
        plan.append(headed(blind.metres, planned))
        blind.metres.actions[:] = plan[-1]
        blind.step(np.full((1, DRONES), NO_ACTION, np.int8))
        flown = PathsFlown(
            blind.metres.detectors, blind.looks.kind, blind.metres.paths[0], np.ones(DRONES, bool),
            np.zeros(DRONES, bool),
        )  # fmt: skip
        for each in (planned, belief):
            each.update_in_passing(flown)
            each.advance()
    return belief.pos, plan


def found(sensor: str, persons: int, number: int, plan: list[NDArray[np.float64]]) -> int:
    """Return the persons found by missions with a plan."""
    world = World(scenario_of(sensor, persons, number), FLIGHT, MISSIONS, write_maps=False)
    world.seed(number * MISSIONS)
    world.reset()
    assert world.metres is not None
    for actions in plan:
        world.metres.actions[:] = actions
        world.step(np.full((MISSIONS, DRONES), NO_ACTION, np.int8))
    return int(world.persons["found"].sum())


@pytest.mark.slow
@pytest.mark.parametrize("sensor", SENSORS)
def test_pos_is_the_share_of_persons_found(sensor: str) -> None:
    plans = [plan(sensor, number) for number in range(PLANS)]
    pos = np.array([of_plan for of_plan, _ in plans])
    bins = np.minimum(pos * 10, 9).astype(int)
    assert len(set(bins.tolist())) >= 7
    for persons in (1, 4):
        finds = [found(sensor, persons, n, actions) for n, (_, actions) in enumerate(plans)]
        count = MISSIONS * persons
        # The persons' tracks and the particles are two draws from one model.
        of_draws = count**2 * 2 * pos * (1 - pos) / PARTICLES
        errors = count * pos * (1 - pos) + of_draws
        for each in set(bins.tolist()):
            off = (np.array(finds) - count * pos)[bins == each].sum()
            assert abs(off) < 3.3 * math.sqrt(errors[bins == each].sum()), (persons, each)
