# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Persons follow a given Markov chain, and every belief, planner and snapshot knows it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from chains import chain_of_walk, matrix_of, uneven_chain
from numpy.typing import NDArray

from dsse_ros.conformance.target_model import SCENARIO, target_model_test
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.looks import Looked
from dsse_ros.world.scenario.scenario import scenario_and_rules
from dsse_ros.world.targets.markov_chain import MARKOV_CHAIN

WALK = (0.05, 0.1, 0.0, 0.2, 0.3, 0.1, 0.05, 0.2, 0.0)
SQUARE = [[-24.036, -46.168], [-24.036, -46.161], [-24.031, -46.161], [-24.031, -46.168]]


def search(side: int, chain: NDArray[np.float64] | None, **fields: Any) -> dict[str, Any]:
    """The arguments of a search for a person who follows this chain, or the walk without one."""
    given = {"rules": "paper", "grid_size": side, "num_drones": 2, "timestep_limit": 30}
    motion: dict[str, Any] = {"person_motion": "random_walk", "person_steps": WALK}
    if chain is not None:
        motion = {"person_motion": "markov_chain", "transition_probabilities": chain}
    return {**given, **motion, **fields}


@pytest.mark.slow
@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_a_given_chain_keeps_the_promises_of_a_target_model(rules: str) -> None:
    scenario = SCENARIO.override(transition_probabilities=uneven_chain(15))
    target_model_test(MARKOV_CHAIN, rules=rules, scenario=scenario)


def test_a_walk_as_a_chain_gives_the_same_missions_bit_for_bit() -> None:
    states = []
    for chain in (None, chain_of_walk(7, WALK)):
        env = vector_env(50, **search(7, chain, person_amount=3))
        env.reset(seed=3)
        rng = np.random.default_rng(0)
        states.append([env.world.state_bytes()])
        for _ in range(30):
            env.step(rng.integers(0, 5, (50, 2)).astype(np.int8))
            states[-1].append(env.world.state_bytes())
    assert states[0] == states[1]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["belief", "belief_greedy"])
def test_a_walk_as_a_chain_gives_the_same_plans(name: str) -> None:
    missions = []
    for chain in (None, chain_of_walk(7, WALK)):
        env = parallel_env(**search(7, chain, collisions=False, drones_positions=[[0, 0], [6, 6]]))
        observations, infos = env.reset(seed=4)
        planner, actions = planner_for(env, name), []
        while env.agents:
            actions.append(planner(observations, infos))
            observations, _, _, _, infos = env.step(actions[-1])
        missions.append(actions)
    assert missions[0] == missions[1] and len(missions[0]) > 3


@pytest.mark.parametrize("area", [None, SQUARE])
def test_the_belief_is_the_exact_filter_of_the_chain(area: Any) -> None:
    chain = uneven_chain(6, seed=1)
    scenario, rules = scenario_and_rules(
        **search(
            6,
            chain,
            area=area,
            cell_size=130.0,
            probability_of_detection=0.7,
            person_initial_position=(3, 1),
        )  # fmt: skip
    )
    resolved = scenario.resolve(rules)
    mask = resolved.area_mask
    assert (mask is None) == (area is None) and (mask is None or 4 < mask.sum() < 36)
    belief, matrix = forecast_for(scenario, rules).belief(), matrix_of(chain, mask)
    col, row = resolved.person_initial_position
    expected = np.zeros(36)
    expected[6 * row + col] = 1.0
    failed = 1.0
    for step in range(20):
        cell = int(np.argmax(expected))
        look = Looked((cell % 6, cell // 6), np.array([0.7]))
        if step % 2:
            belief.update([look])
            expected[cell] *= 0.3
            failed *= expected.sum()
            expected /= expected.sum()
        belief.advance()
        expected = expected @ matrix
        np.testing.assert_allclose(belief.poc().ravel(), expected, rtol=0, atol=1e-12)
    assert belief.pos == pytest.approx(1.0 - failed, abs=1e-12)


def test_persons_stay_instead_of_leaving_the_grid() -> None:
    east = (0.0, 0.0, 0.0, 0.0, 0.25, 0.75, 0.0, 0.0, 0.0)
    scenario, rules = scenario_and_rules(
        rules="paper", person_motion="markov_chain", grid_size=4, person_initial_position=(2, 1),
        transition_probabilities=np.tile(east, (4, 4, 1)),
    )  # fmt: skip
    belief = forecast_for(scenario, rules).belief()
    for _ in range(2):
        belief.advance()
    np.testing.assert_allclose(belief.poc()[1], [0.0, 0.0, 0.0625, 0.9375], atol=1e-15)


@pytest.mark.parametrize("area", [None, SQUARE])
def test_person_steps_have_one_meaning_for_every_motion(area: Any) -> None:
    given = {
        "rules": "paper", "person_steps": WALK, "grid_size": 6, "cell_size": 130.0, "area": area,
        "person_initial_position": (3, 1),
    }  # fmt: skip
    beliefs = []
    for motion in ("random_walk", "markov_chain"):
        scenario, rules = scenario_and_rules(person_motion=motion, **given)
        beliefs.append(forecast_for(scenario, rules).belief())
    for _ in range(12):
        for belief in beliefs:
            belief.advance()
        np.testing.assert_array_equal(beliefs[0].poc(), beliefs[1].poc())


def test_worlds_of_a_batch_equal_single_worlds() -> None:
    scenario, rules = scenario_and_rules(**search(9, uneven_chain(9)))
    batch = World(scenario, rules, 3, threads=2)
    batch.seed(11)
    batch.reset()
    hold = np.full((3, 2), -1, np.int8)
    for _ in range(10):
        batch.step(hold)
    for b in range(3):
        single = World(scenario, rules)
        single.seed(11 + b)
        single.reset()
        for _ in range(10):
            single.step(hold[:1])
        assert single.persons.tobytes() == batch.persons[b : b + 1].tobytes()
    batch.close()


def test_a_mission_continues_from_its_snapshot_with_the_same_chain_only() -> None:
    chain = uneven_chain(7)
    env, twin = (parallel_env(**search(7, chain)) for _ in range(2))
    env.reset(seed=5)
    stored = Snapshot.from_bytes(env.snapshot().to_bytes())
    twin.restore(stored)
    for _ in range(10):
        for each in (env, twin):
            each.step(dict.fromkeys(each.agents, 4))
        assert env.world.state_bytes() == twin.world.state_bytes()
    with pytest.raises(SnapshotError, match="transition_probabilities"):
        parallel_env(**search(7, uneven_chain(7, seed=1))).restore(stored)


def test_a_person_of_a_damaged_snapshot_stays_off_the_grid() -> None:
    scenario, rules = scenario_and_rules(**search(7, uneven_chain(7)))
    world = World(scenario, rules)
    world.seed(0)
    world.reset()
    world.persons["x"], world.persons["y"] = 10**9, -(10**9)
    world.step(np.zeros((1, 2), np.int8))
    assert (world.persons["x"], world.persons["y"]) == (10**9, -(10**9))
