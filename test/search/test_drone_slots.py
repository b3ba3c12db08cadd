# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Slots are the agents of PettingZoo's environments, and missions follow one another in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.search import FieldError, parallel_env, vector_env
from dsse_ros.search.drone_slots import DroneSlots, Transition, searched_probability
from dsse_ros.search.wrappers import FLATTENED

WORLDS, DRONES, GRID = 4, 3, 7
MISSION: dict[str, Any] = {
    "grid_size": GRID,
    "num_drones": DRONES,
    "person_initial_position": (3, 4),
    "timestep_limit": 15,
}


@pytest.mark.parametrize("observe", ["map", "belief"])
@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_a_slot_is_an_agent_of_the_single_environment_mission_after_mission(
    rules: str, observe: str
) -> None:
    slots = DroneSlots(vector_env(WORLDS, rules=rules, observe=observe, **MISSION))
    singles = [parallel_env(rules=rules, observe=observe, **MISSION) for _ in range(WORLDS)]
    observations, masks = slots.reset(seed=5)
    infos = [single.reset(seed=5 + b)[1] for b, single in enumerate(singles)]
    generator = np.random.default_rng(3)
    ends = 0
    for _ in range(60):
        for b, single in enumerate(singles):
            encoded = FLATTENED.encode(single.positions, single.probability)
            for agent in single.agents:
                slot = b * DRONES + int(agent[5:])
                assert np.array_equal(observations[slot], encoded[slot % DRONES].astype("f4"))
                assert np.array_equal(masks[slot], infos[b][agent]["action_mask"])
        actions = generator.integers(0, slots.num_actions, slots.num_slots)
        step = slots.step(actions)
        for b, single in enumerate(singles):
            acting = list(single.agents)
            chosen = {agent: int(actions[b * DRONES + int(agent[5:])]) for agent in acting}
            _, rewards, terminated, truncated, infos[b] = single.step(chosen)
            assert step.over[b] == (not single.agents)
            encoded = FLATTENED.encode(single.positions, single.probability)
            for n, agent in enumerate(single.possible_agents):
                slot = b * DRONES + n
                assert np.array_equal(step.final_observations[slot], encoded[n].astype("f4"))
                if agent in acting:
                    assert step.rewards[slot] == rewards[agent]
                    assert step.terminated[slot] == terminated[agent]
                    assert step.truncated[slot] == truncated[agent]
                else:
                    assert step.rewards[slot] == 0.0
                    assert step.terminated[slot] or step.truncated[slot]
                if agent not in single.agents and not step.over[b]:
                    assert step.action_masks[slot].tolist() == [1, *[0] * (slots.num_actions - 1)]
            if step.over[b]:
                assert step.found[b] == (single.world.worlds["num_missing"][0] == 0)
                assert step.steps[b] == single.world.worlds["t"][0]
                infos[b] = single.reset()[1]
                ends += 1
        observations, masks = step.observations, step.action_masks
    assert ends > WORLDS


def test_what_drones_search_adds_up_to_the_probability_of_success() -> None:
    env = vector_env(
        3, rules="v2", observe="belief", probability_of_detection=0.7, dispersion_inc=0.3,
        **{**MISSION, "drones_positions": [(3, 4), (3, 5), (2, 4)]},
    )  # fmt: skip
    observations, infos = env.reset(seed=2)
    search = env.rules.actions.index("search")
    generator = np.random.default_rng(4)
    compared = 0
    for _ in range(40):
        actions = np.where(
            generator.random((3, DRONES)) < 0.7, search, generator.integers(0, 8, (3, DRONES))
        ).astype(np.int8)
        before, was_over, observed = infos["pos"], infos["over"], observations
        observations, _, _, truncated, infos = env.step(actions)
        step = Transition(env, observed, actions, observations, infos["over"])
        shares = searched_probability(step)
        assert ((shares == 0) | (actions == search)).all()
        # A search that has found somebody is no failed one, one after the time is none at all.
        failed = ~was_over & ~infos["Found"] & ~truncated.any(axis=1)
        expected = before + (1 - before) * shares.sum(axis=1)
        assert infos["pos"][failed] == pytest.approx(expected[failed], abs=1e-5)
        compared += failed.sum()
    assert compared > 40


def test_a_reward_of_ones_own_takes_the_place_of_that_of_the_rules() -> None:
    env = vector_env(WORLDS, rules="v2", observe="belief", **MISSION)
    slots = DroneSlots(env, reward=searched_probability)
    slots.reset(seed=1)
    search = env.rules.actions.index("search")
    rewards = [slots.step(np.full(slots.num_slots, search)).rewards for _ in range(5)]
    assert (np.array(rewards) <= 1.0).all()


def test_slots_of_a_lazy_batch_are_refused() -> None:
    with pytest.raises(FieldError, match="lazy: true is not allowed with slots"):
        DroneSlots(vector_env(2, lazy=True))
