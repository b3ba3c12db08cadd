# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Slots are the agents of PettingZoo's environments, and missions follow one another in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.drone_slots import DroneSlots, Transition, searched_probability
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.vector_env import VectorEnv
from dsse_ros.search.environments.wrappers import ALL_POSITIONS, FLATTENED
from dsse_ros.world.scenario.scenario import scenario_and_rules

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


class Reported(VectorEnv):
    """A batch that keeps the infos of its last step."""

    infos: dict[str, Any]

    def step(self, actions: Any) -> Any:
        result = super().step(actions)
        self.infos = result[-1]
        return result


def reported(**fields: Any) -> Reported:
    return Reported(3, *scenario_and_rules(**fields), observe="belief")


CLOSE = {"drones_positions": [(3, 4), (3, 5), (2, 4)]}
"""Drones that meet, where the person is."""
BESIDE = [[-24.05, -46.18], [-24.05, -46.1649], [-24.02, -46.1649], [-24.02, -46.18]]
"""The four western columns of the grid: moves to the east are held up beside the person."""


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"rules": "paper", "leave_policy": "terminate", "circle": False},
        {"command_drop_rate": 0.4},
        {"command_delay": 2},
        {"stuck_rate": 0.2, "stuck_steps": 3},
        {"loss_rate": 0.05, "false_alarm_rate": 0.3},
        {"battery_move": 6.0, "relief_steps": 2},
        {"sensor": "flown_over"},
        {"sensor": "flown_over", "area": BESIDE},
        {"person_motion": "constant_drift", "area": BESIDE, "sensor": "flown_over"},
    ],
    ids=lambda fields: "-".join(fields) or "no faults",
)
def test_what_drones_have_searched_adds_up_to_the_probability_of_success(
    fields: dict[str, Any],
) -> None:
    search = {"rules": "v2", "probability_of_detection": 0.7, "dispersion_inc": 0.3}
    env = reported(**{**search, **MISSION, **CLOSE, **fields})
    # POS has particles of its own.
    tolerance = 0.02 if "person_motion" in fields else 1e-5
    compared = found = idle = 0
    before = np.zeros(3)

    def compare(step: Transition) -> Any:
        nonlocal compared, found, idle, before
        shares = searched_probability(step)
        # A search that finds somebody has not failed.
        failed = ~env.infos["Found"]
        expected = before + (1 - before) * shares.sum(axis=1)
        assert env.infos["pos"][failed] == pytest.approx(expected[failed], abs=tolerance)
        compared, found = compared + failed.sum(), found + (~failed).sum()
        idle += (step.actions == -1).sum()
        before = np.where(step.over, 0.0, env.infos["pos"])
        return shares

    slots = DroneSlots(env, reward=compare)
    slots.reset(seed=2)
    searches = env.rules.actions.index("search")
    generator = np.random.default_rng(4)
    for _ in range(60):
        often = generator.random(slots.num_slots) < 0.7
        moves = generator.integers(0, searches, slots.num_slots)
        slots.step(np.where(often, searches, moves))
    # In every kind of search some drones did nothing, if only as their time was out.
    assert compared > 60 and found > 0 and idle > 0


def test_what_drones_did_is_not_what_they_were_commanded() -> None:
    steps: list[Transition] = []

    def note(step: Transition) -> Any:
        steps.append(step)
        return np.zeros(step.actions.shape)

    fields = {**MISSION, **CLOSE, "rules": "v2", "command_delay": 1, "position_noise": 3.0}
    fields["person_pod_multipliers"] = [0.1]
    slots = DroneSlots(vector_env(2, observe="belief", **fields), reward=note)
    slots.reset(seed=0)
    starts = slots.env.world.starts
    for number in (8, 2, 8):
        slots.step(np.full(slots.num_slots, number))
    assert [step.actions[0].tolist() for step in steps] == [[-1] * 3, [8] * 3, [2] * 3]
    ends = [starts, starts, starts - (0, 1)]
    assert all(np.array_equal(step.cells, end) for step, end in zip(steps, ends, strict=True))
    assert any((step.before["positions"] != step.cells).any() for step in steps)
    # The first command, a search, was done in the second step: where the drones were.
    searched = steps[1]
    there = searched.before["probability"][np.arange(2)[:, None], starts[..., 1], starts[..., 0]]
    assert searched_probability(searched) == pytest.approx(0.1 * there, abs=1e-7) and there.any()


@pytest.mark.parametrize(
    "fields",
    [
        {"rules": "paper", "grid_size": 5},
        {"rules": "v1", "drones_positions": [(0, 0), (6, 0), (0, 6)]},
        {"rules": "v2"},
        {"rules": "coverage", "grid_size": 3},
    ],
    ids=lambda fields: str(fields["rules"]),
)
def test_drones_whose_time_is_out_differ_from_those_whose_search_has_ended(
    fields: dict[str, Any],
) -> None:
    terminal: list[Any] = []

    def note(step: Transition) -> Any:
        terminal.append(step.terminal.ravel())
        return np.zeros(step.actions.shape)

    search = {**MISSION, "person_initial_position": (1, 2), **fields}
    slots = DroneSlots(vector_env(WORLDS, **search), reward=note)
    _, masks = slots.reset(seed=1)
    last = slots.env.rules.last_step(slots.env.scenario.timestep_limit)
    generator = np.random.default_rng(0)
    out = np.zeros(slots.num_slots, bool)
    counts = {"in time": 0, "out of time": 0, "found": 0}
    for _ in range(150):
        acting = slots.acting.copy()
        alive = slots.env.world.drones["alive"].ravel()
        # Some leave the grid, or meet.
        allowed = masks | (generator.random(masks.shape) < 0.02)
        step = slots.step((generator.random(masks.shape) * allowed).argmax(axis=1))
        masks = step.action_masks
        ended = (step.terminated | step.truncated) & ~out
        late = np.repeat(step.steps > last, DRONES)
        found = np.repeat(step.found, DRONES)
        assert np.array_equal(step.out_of_time, ended & late & ~found)
        assert np.array_equal(terminal[-1], ended & ~step.out_of_time)
        # Where the rules do nothing any more after the last step, no drone acts.
        acts_late = slots.env.rules.time_out_acts
        assert np.array_equal(acting, alive & ~out & (~late | acts_late))
        out = (step.terminated | step.truncated) & ~np.repeat(step.over, DRONES)
        counts["in time"] += (ended & ~late).sum()
        counts["out of time"] += step.out_of_time.sum()
        counts["found"] += (ended & found).sum()
    assert counts["out of time"] > 0 and counts["in time"] + counts["found"] > 0


def test_actions_that_are_none_are_refused_and_the_missions_stay() -> None:
    env = vector_env(2, rules="v2", **MISSION)
    slots = DroneSlots(env)
    slots.reset(seed=1)
    before = env.world.state_bytes()
    for number in (9, 260, -1, -250, 2**40):
        actions = np.zeros(slots.num_slots, np.int64)
        actions[3] = number
        with pytest.raises(FieldError, match=f"^actions must be from 0 to 8, got {number}$"):
            slots.step(actions)
    for wrong in (np.zeros(slots.num_slots), np.zeros(5, int), np.zeros((2, 3), int)):
        with pytest.raises(FieldError, match=r"^actions must be integers \(6\), got "):
            slots.step(wrong)
    assert env.world.state_bytes() == before
    slots.step(np.full(slots.num_slots, 8, np.uint8))


def test_a_reward_of_ones_own_takes_the_place_of_that_of_the_rules() -> None:
    env = vector_env(WORLDS, rules="v2", observe="belief", **MISSION)
    slots = DroneSlots(env, reward=searched_probability)
    slots.reset(seed=1)
    search = env.rules.actions.index("search")
    rewards = [slots.step(np.full(slots.num_slots, search)).rewards for _ in range(5)]
    assert (np.array(rewards) <= 1.0).all()


def test_slots_of_a_lazy_batch_are_refused() -> None:
    with pytest.raises(FieldError, match="lazy must be false with slots, got true"):
        DroneSlots(vector_env(2, lazy=True))


def test_slots_of_observations_that_are_no_arrays_are_refused() -> None:
    with pytest.raises(FieldError, match="a Box with slots, got those of a Tuple"):
        DroneSlots(vector_env(2), ALL_POSITIONS)


def test_drones_in_metres_are_refused_in_one_line() -> None:
    batch = vector_env(1, rules="flight", grid_size=6, num_drones=1)
    with pytest.raises(FieldError, match="space must be cells with slots, .* got 'metres'"):
        DroneSlots(batch)
