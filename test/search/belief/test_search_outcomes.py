# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What follows from searches for several persons: who is missing, where, and how many are found."""

from __future__ import annotations

import itertools
from collections import defaultdict
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from looking import find_in, search_in_vain
from numpy.typing import NDArray

from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.world import World
from dsse_ros.search.environments.world_beliefs import WorldBeliefs
from dsse_ros.world.scenario.scenario import scenario_and_rules

CENTRE, GRID = (4, 4), 9
MISSIONS = 1000
SIGMAS = 3.0


class Known(NamedTuple):
    """What is known of persons who stand still, after searches of cells that found or did not."""

    chance: float
    missing: NDArray[np.float64]
    cells: NDArray[np.float64]
    pos: float


def enumerated(
    pods: list[float], scatter: int, one_find: bool, searches: list[tuple[tuple[int, int], bool]]
) -> Known:
    """Return it by Bayes' rule, over all starts and all that each search can come to."""
    x0, y0 = CENTRE
    reach = range(-scatter, scatter + 1)
    around = [(x0 + dx, y0 + dy) for dx in reach for dy in reach if dx or dy]
    persons = range(len(pods))
    starts = list(itertools.permutations(around, len(pods) - 1)) if scatter else [(CENTRE,)]
    chance, found_in_all = 0.0, 0.0
    missing, cells = np.zeros(len(pods)), np.zeros((GRID, GRID))
    for others in starts:
        at = (CENTRE, *others) if scatter else (CENTRE,) * len(pods)
        # By who is missing: as the searches ended, and however they might have ended.
        seen, any_end = {frozenset(persons): 1.0}, {frozenset(persons): 1.0}
        for cell, found in searches:
            now: dict[Any, float] = defaultdict(float)
            for left, share in any_end.items():
                for end, probability in ends(left, at, cell, pods, one_find):
                    now[end] += share * probability
            any_end = dict(now)
            now = defaultdict(float)
            for left, share in seen.items():
                for end, probability in ends(left, at, cell, pods, one_find):
                    if end and (end != left) == found:
                        now[end] += share * probability
            seen = dict(now)
        chance += sum(seen.values()) / len(starts)
        for left, share in seen.items():
            for person in left:
                missing[person] += share / len(starts)
                cells[at[person][::-1]] += share / len(starts) / len(left)
        found_in_all += sum(
            share * (1 - len(left) / len(pods)) for left, share in any_end.items()
        ) / len(starts)
    total = max(chance, 1e-300)
    return Known(chance, missing / total, cells / total, found_in_all)


def ends(left: Any, at: Any, cell: Any, pods: list[float], one_find: bool) -> Any:
    """Yield who may be missing after a search of a cell, each with its probability."""
    here = [person for person in sorted(left) if at[person] == cell]
    for detected in itertools.product((False, True), repeat=len(here[:1] if one_find else here)):
        probability = 1.0
        for person, hit in zip(here, detected, strict=False):
            probability *= pods[person] if hit else 1 - pods[person]
        yield left - {p for p, hit in zip(here, detected, strict=False) if hit}, probability


def still(pods: list[float], scatter: int, one_find: bool) -> Belief:
    """Return the belief of persons before their first step."""
    scenario, rules = scenario_and_rules(
        rules="v2", grid_size=GRID, person_initial_position=CENTRE, vector=(0.0, 0.0),
        person_amount=len(pods), person_pod_multipliers=pods, person_scatter=scatter,
        one_find_per_search=one_find,
    )  # fmt: skip
    return Belief(Forecast(scenario, rules, drift_samples=2))


cells = st.sampled_from([CENTRE, (3, 4), (5, 3), (6, 6)])
chances = st.sampled_from([1.0, 0.8, 0.5, 0.1])
searches = st.lists(st.tuples(cells, st.booleans()), min_size=1, max_size=6)


def observed(belief: Belief, ended: list[tuple[tuple[int, int], bool]]) -> None:
    for cell, found in ended:
        if found:
            find_in(belief, cell)
        else:
            search_in_vain(belief, [cell])


@pytest.mark.slow
@settings(deadline=None)
@given(st.tuples(chances, chances), st.sampled_from([0, 2]), st.booleans(), searches)
def test_of_two_persons_it_is_known_exactly_who_is_missing_and_where(
    pods: tuple[float, float], scatter: int, one_find: bool, ended: Any
) -> None:
    known = enumerated(list(pods), scatter, one_find, ended)
    assume(known.chance > 1e-6)
    belief = still(list(pods), scatter, one_find)
    observed(belief, ended)
    assert belief.missing == pytest.approx(known.missing, abs=1e-9)
    assert belief.poc() == pytest.approx(known.cells, abs=1e-9)
    if not one_find or scatter:
        assert belief.pos == pytest.approx(known.pos, abs=1e-9)


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(st.tuples(chances, chances, chances), st.sampled_from([0, 2]), searches)
def test_of_three_persons_it_is_known_closely_where_a_search_looks_for_one(
    pods: tuple[float, float, float], scatter: int, ended: Any
) -> None:
    known = enumerated(list(pods), scatter, True, ended)
    assume(known.chance > 1e-6)
    belief = still(list(pods), scatter, True)
    observed(belief, ended)
    assert belief.missing == pytest.approx(known.missing, abs=0.01)
    assert belief.poc() == pytest.approx(known.cells, abs=0.01)


def batch(count: int, missions: int = MISSIONS, **fields: Any) -> World:
    """Return missions of a search whose drones start about the persons' start."""
    scenario, rules = scenario_and_rules(
        rules="v2", grid_size=11, person_initial_position=(5, 5), vector=(0.7, 0.4),
        timestep_limit=60, person_amount=count,
        **{"drones_positions": [(3, 3), (5, 6), (6, 5), (7, 7)], **fields},
    )  # fmt: skip
    world = World(scenario, rules, missions, write_maps=False)
    world.seed(30_000)
    world.reset()
    return world


def plan(world: World, steps: int) -> NDArray[np.int8]:
    """Return (steps, N) actions: in turn a search and a move about the start, the same in all."""
    names = world.rules.actions
    rounds = ["search", "left", "search", "up", "search", "right", "search", "down"]
    turns = [[rounds[(step + 2 * drone) % 8] for drone in range(4)] for step in range(steps)]
    return np.array([[names.index(name) for name in joint] for joint in turns], np.int8)


@pytest.mark.slow
@pytest.mark.parametrize("one_find", [True, False])
@pytest.mark.parametrize("scatter", [2, 0])
@pytest.mark.parametrize("multipliers", [[0.8], [0.9, 0.2], [0.2, 0.9, 0.5, 0.5]], ids=str)
def test_missions_with_the_same_searches_find_as_many_as_the_pos_says(
    multipliers: list[float], scatter: int, one_find: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dsse_ros.search.environments.world_beliefs.DRIFT_SAMPLES", 16)
    world = batch(
        len(multipliers), person_pod_multipliers=multipliers, person_scatter=scatter,
        one_find_per_search=one_find,
    )  # fmt: skip
    beliefs = WorldBeliefs(world)
    found = np.zeros(world.persons.shape, bool)
    for joint in plan(world, 24):
        beliefs.step(np.tile(joint, (MISSIONS, 1)))
        found |= world.persons["found"]
        share = found.mean(axis=1)
        reach = SIGMAS * share.std() / MISSIONS**0.5 + SIGMAS**2 / MISSIONS
        assert abs(beliefs.pos.mean() - share.mean()) < reach, world.worlds["t"][0]
        if world.worlds["done"].any():
            # It is not searched any more.
            break
    assert beliefs.pos.mean() > 0.03


@pytest.mark.slow
def test_one_person_is_found_as_often_as_its_hazards_say_to_the_end() -> None:
    world = batch(1, probability_of_detection=0.4)
    beliefs = WorldBeliefs(world)
    expected, finds = 0.0, 0
    for joint in plan(world, 60):
        going, before = ~world.worlds["done"], beliefs.pos.copy()
        beliefs.step(np.tile(joint, (MISSIONS, 1)))
        hazards = (beliefs.pos - before)[going] / (1 - before[going])
        expected += hazards.sum()
        finds += int((going & (world.worlds["num_missing"] == 0)).sum())
        assert abs(finds - expected) < SIGMAS * max(expected, 1.0) ** 0.5
    assert finds > 0.3 * MISSIONS


@pytest.mark.slow
@pytest.mark.parametrize("one_find", [True, False])
def test_the_missing_are_where_the_belief_is_after_finds(
    one_find: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dsse_ros.search.environments.world_beliefs.DRIFT_SAMPLES", 16)
    world = batch(3, person_pod_multipliers=[0.9, 0.3, 0.9], one_find_per_search=one_find)
    beliefs = WorldBeliefs(world)
    for joint in plan(world, 12):
        beliefs.step(np.tile(joint, (MISSIONS, 1)))
    maps, missing = beliefs.write().astype(float), ~world.persons["found"]
    for count in (1, 2):
        chosen = missing.sum(axis=1) == count
        assert chosen.sum() > 50
        expected = count * maps[chosen].sum(axis=0)
        there = np.zeros(expected.shape)
        persons = world.persons[chosen][missing[chosen]]
        np.add.at(there, (persons["y"], persons["x"]), 1)
        likely = expected >= 5
        chi_square = ((there - expected)[likely] ** 2 / expected[likely]).sum()
        freedom = likely.sum()
        assert chi_square < freedom + 3.9 * np.sqrt(2 * freedom)


@pytest.mark.slow
def test_after_failed_searches_persons_are_found_as_often_as_expected() -> None:
    missions = 20_000
    world = batch(
        2, missions, person_pod_multipliers=[1.0, 0.1], person_scatter=0, one_find_per_search=False,
        drones_positions=[(6, 5), (6, 6), (7, 6), (6, 7)],
    )  # fmt: skip
    belief = Belief(Forecast(world.scenario, world.rules, drift_samples=64))
    at, search = world.scenario.drones_positions, world.rules.action_set.search
    found_none = np.ones(missions, bool)
    for _ in range(20):
        search_in_vain(belief, at)
        belief.advance()
        world.step(np.full((missions, 4), search, np.int8))
        found_none &= ~world.persons["found"].any(axis=1)
    assert found_none.sum() > 500
    of_classes = belief.of_missing().reshape(2, -1, belief.forecast.padded.cells).sum(axis=1)
    assert of_classes.sum(axis=1) == pytest.approx([0.5, 0.5])
    columns = [belief.forecast.column(cell) for cell in at]
    expected = 2 * float((world.looks.pods[0, belief.examples] @ of_classes)[columns].sum())
    world.step(np.full((missions, 4), search, np.int8))
    finds = world.persons["found"][found_none].sum(axis=1)
    assert finds.mean() == pytest.approx(expected, abs=SIGMAS * finds.std() / len(finds) ** 0.5)
    assert expected > 0.01 and belief.mean_pod(world.looks.pods[0]) == pytest.approx(0.55)


def test_a_search_for_one_leaves_the_others_in_its_cell() -> None:
    """Four start in one cell: each certain search finds one, and the others are there."""
    belief = still([1.0] * 4, 0, True)
    for left in (3, 2, 1):
        find_in(belief, CENTRE)
        assert belief.poc()[CENTRE] == pytest.approx(1)
        assert belief.missing.sum() == pytest.approx(left)
        assert belief.pos == pytest.approx(1 - left / 4)


def test_persons_in_cells_of_their_own_leave_none_behind_when_one_is_found() -> None:
    belief = still([1.0] * 4, 2, True)
    find_in(belief, (3, 4))
    assert belief.poc()[4, 3] == 0.0
    assert belief.poc()[CENTRE] == pytest.approx(1 / 3)
    find_in(belief, CENTRE)
    assert belief.poc()[CENTRE] == 0.0
