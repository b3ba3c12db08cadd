# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where only a part of the grid is searched, no planner sends a drone out of it."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import pytest
from areas import geojson_of, random_mask, scenario_of
from effort import LITTLE_EFFORT
from grid_walker import DIAGONAL, STRAIGHT
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.registry import (
    COVERAGE_PLANNERS,
    PERSON_PLANNERS,
    PLANNER_NAMES,
    planner_for,
)
from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.actions import ActionSet, connected_components
from dsse_ros.world.scenario.rules import PROFILES

NAMES = [name for name in PLANNER_NAMES if name != "onnx"]
"""Planners that need no file."""
FITTING = [
    (name, rules)
    for name in NAMES
    for rules, of in PROFILES.items()
    if of.actions and name not in (COVERAGE_PLANNERS if not of.covers else PERSON_PLANNERS)
]
"""Planners, with the profiles on cells whose task is theirs."""
FINDING = [name for name, rules in PROFILES.items() if rules.actions and not rules.covers]
"""Profiles with persons, on cells."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "rules"), FITTING)
def test_no_planner_leaves_the_area_or_lets_drones_collide(name: str, rules: str) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        mask = random_mask(rng, 10)
        # Nobody is found, so that all of the time is flown.
        env = parallel_env(scenario_of(mask, rng, 4), rules=rules, probability_of_detection=0.0)
        if rules == "v1":
            env = parallel_env(scenario_of(mask, rng, 4), rules=rules)
        planner = planner_for(env, name, seed=seed, **LITTLE_EFFORT.get(name, {}))
        observations, infos = env.reset(seed=seed)
        while env.agents:
            actions = planner(observations, infos)
            for agent, action in actions.items():
                assert infos[agent]["action_mask"][action]
            observations, rewards, _, _, infos = env.step(actions)
            assert mask[env.positions[:, 1], env.positions[:, 0]].all()
            late = env.steps_done > env.scenario.timestep_limit
            assert late or min(rewards.values(), default=0) > -1000


@pytest.mark.parametrize(
    ("name", "rules"), [(n, r) for n, r in FITTING if r in ("paper", "coverage")]
)
def test_every_planner_decides_for_drones_that_are_observed_outside_the_area(
    name: str, rules: str
) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        given = scenario_of(random_mask(rng, 10), rng, 4)
        env = parallel_env(given, rules=rules, position_noise=0.8)
        planner = planner_for(env, name, seed=seed, **LITTLE_EFFORT.get(name, {}))
        observations, infos = env.reset(seed=seed)
        for _ in range(20):
            actions = planner(observations, infos)
            assert all(infos[agent]["action_mask"][actions[agent]] for agent in env.agents)
            observations, _, _, _, infos = env.step(actions)


def test_a_drone_outside_the_area_is_alone_in_an_empty_component() -> None:
    area = np.array([[1, 1, 0], [1, 0, 0], [0, 0, 1]], bool)
    cells = [(2, 0), (0, 1), (1, 1), (1, 0)]
    components = connected_components([ActionSet(STRAIGHT, area)] * 4, cells)
    assert [members for members, _ in components] == [[0], [1, 3], [2]]
    assert [cells.sum() for _, cells in components if cells is not None] == [0, 3, 0]


@pytest.mark.parametrize("names", [STRAIGHT, DIAGONAL])
def test_drones_go_by_shortest_ways_and_stay_where_none_leads(names: tuple[str, ...]) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        mask = random_mask(rng, 9)
        actions = ActionSet(names, mask)
        cells = [(int(x), int(y)) for y, x in np.argwhere(mask)]
        goal = cells[rng.integers(len(cells))]
        wanted = distances(mask, actions, goal)
        for cell in cells:
            assert actions.distance(cell, goal) == wanted.get(cell, -1)
            step = actions.towards(cell, goal)
            if cell == goal or cell not in wanted:
                assert step == cell
            else:
                assert wanted[step] == wanted[cell] - 1
                assert actions.towards(goal, cell) in actions.neighbours(goal, GridShape.square(9))


def distances(
    mask: NDArray[np.bool_], actions: ActionSet, goal: tuple[int, int]
) -> dict[tuple[int, int], int]:
    """Number of moves from each cell that leads to the goal, by a search of its own."""
    steps = {move for move in actions.moves if move != (0, 0)}
    found, queue = {goal: 0}, deque([goal])
    while queue:
        x, y = queue.popleft()
        for dx, dy in steps:
            cell = (x + dx, y + dy)
            inside = 0 <= cell[0] < len(mask) and 0 <= cell[1] < len(mask)
            if inside and mask[cell[1], cell[0]] and cell not in found:
                found[cell] = found[(x, y)] + 1
                queue.append(cell)
    return found


@pytest.mark.parametrize("drones", [1, 3])
@pytest.mark.parametrize("name", ["sweep", "expanding_square"])
def test_every_cell_that_a_drone_can_get_to_is_searched(name: str, drones: int) -> None:
    for seed in range(8):
        rng = np.random.default_rng(seed)
        mask = random_mask(rng, 8)
        given = scenario_of(mask, rng, drones) | {"timestep_limit": 600}
        env = parallel_env(given, probability_of_detection=0.0, collisions=False)
        actions = ActionSet(env.rules.actions, mask)
        starts = [(x, y) for x, y in given["drones_positions"]]
        components = connected_components([actions] * len(starts), starts)
        left = np.any([component for _, component in components], axis=0)
        planner = planner_for(env, name)
        observations, infos = env.reset(seed=seed)
        while env.agents and left.any():
            chosen = planner(observations, infos)
            for agent, action in chosen.items():
                if action == actions.search:
                    x, y = observations[agent][0]
                    left[y, x] = False
            observations, *_, infos = env.step(chosen)
        assert not left.any()


@pytest.mark.slow
@pytest.mark.parametrize("rules", [one for one in FINDING if one != "sea"])
def test_a_belief_has_nothing_outside_the_area_and_is_where_persons_are(rules: str) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        mask = random_mask(rng, 8)
        given: dict[str, Any] = scenario_of(mask, rng, 1) | {"person_amount": 1}
        env = parallel_env(given, rules=rules)
        belief = Belief(Forecast(env.scenario, env.rules, drift_samples=512))
        seen = np.zeros((30, *mask.shape))
        runs = 300
        for run in range(runs):
            env.reset(seed=run)
            for step in range(30):
                person = env.world.persons[0, 0]
                if 0 <= person["x"] < 8 and 0 <= person["y"] < 8:
                    seen[step, person["y"], person["x"]] += 1 / runs
                env.advance(np.array([-1], np.int8))
        for step in range(30):
            likely = belief.poc()
            assert not likely[~mask].any()
            # Twice the distance that as many draws of a cell have on average, and more.
            assert np.abs(likely - seen[step]).sum() < 2 * np.sqrt(mask.sum() / runs) + 0.05
            belief.advance()


@pytest.mark.slow
def test_an_area_that_is_the_whole_grid_plans_as_without_one() -> None:
    around = geojson_of(np.ones((8, 8), bool))
    for name in sorted({*NAMES} - {*COVERAGE_PLANNERS}):
        moves = []
        for area in (around, None):
            env = parallel_env(area=area, num_drones=3, cell_size=130.0)
            planner = planner_for(env, name, **LITTLE_EFFORT.get(name, {}))
            observations, infos = env.reset(seed=2)
            cells = []
            while env.agents:
                observations, *_, infos = env.step(planner(observations, infos))
                cells.append(env.positions.tolist())
            moves.append(cells)
        assert moves[0] == moves[1]
