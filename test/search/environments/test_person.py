# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where persons go and how they are found, by distribution over many worlds at once."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from play import person_cells, put_person, started, step

from dsse_ros.search.environments.world import World
from dsse_ros.search.plain import Cell, Map, PlainSearch, move_chances
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

SEARCH = profile("paper").actions.index("search")
WORLDS = 20000
FEW = 4000


def worlds(count: int = WORLDS, **fields: Any) -> World:
    """Many worlds of one scenario, seeded and reset."""
    world = World(Scenario(**fields), profile("paper"), count, write_maps=False)
    world.seed(2026)
    world.reset()
    return world


def advance(world: World, action: int = NO_ACTION) -> None:
    world.step(np.full((world.num_worlds, world.num_drones), action, np.int8))


def places(world: World, person: int = 0) -> list[Cell]:
    persons = world.persons[:, person]
    return list(zip(persons["x"].tolist(), persons["y"].tolist(), strict=True))


def chi_square_bound(freedom: int) -> float:
    """Bound that chance passes once in some billion cases (Wilson and Hilferty 1931)."""
    spread = 2 / (9 * freedom)
    return float(freedom * (1 - spread + 6 * np.sqrt(spread)) ** 3)


def chi_square(seen: Counter[Any], chances: dict[Any, float]) -> tuple[float, int]:
    """Statistic and degrees of freedom; what is rarely expected is one class."""
    total = sum(seen.values())
    rare_seen = rare_expected = statistic = 0.0
    classes = 0
    for key in chances.keys() | seen.keys():
        expected = total * chances.get(key, 0.0)
        if expected < 5:
            rare_seen += seen[key]
            rare_expected += expected
        else:
            statistic += (seen[key] - expected) ** 2 / expected
            classes += 1
    if rare_expected >= 5:
        statistic += (rare_seen - rare_expected) ** 2 / rare_expected
        classes += 1
    return statistic, max(classes - 1, 0)


def transitions(fields: dict[str, Any], steps: int) -> list[tuple[Map, Counter[tuple[Cell, Cell]]]]:
    """Map of each step by the reference, and how often persons went from where to where."""
    world = worlds(**fields)
    size = fields["grid_size"]
    reference = PlainSearch(
        (size, size), [(0, 0)], fields["person_initial_position"], fields["vector"],
        (fields["sigma_x"], fields["sigma_y"]), 1,
    )  # fmt: skip
    seen = []
    before = places(world)
    for _ in range(steps):
        reference.drift()
        advance(world)
        after = places(world)
        seen.append((reference.probability, Counter(zip(before, after, strict=True))))
        before = after
    return seen


def chances_of(probability: Map, old: Cell, *, first_on_ties: bool) -> dict[Cell, float]:
    """Chances of the next cells; on the map turned by half a turn, the last of equal cells wins."""
    if first_on_ties:
        return move_chances(probability, old)
    last = len(probability) - 1
    turned = move_chances(probability[::-1, ::-1], (last - old[0], last - old[1]))
    return {(last - col, last - row): chance for (col, row), chance in turned.items()}


def misfit(
    seen: list[tuple[Map, Counter[tuple[Cell, Cell]]]], *, first_on_ties: bool = True
) -> tuple[float, int]:
    """Chi-square over all transitions, given where each began."""
    statistic, freedom = 0.0, 0
    for probability, moves in seen:
        for old in {old for old, _ in moves}:
            counts = Counter({new: n for (start, new), n in moves.items() if start == old})
            chances = chances_of(probability, old, first_on_ties=first_on_ties)
            assert counts.keys() <= chances.keys()
            part = chi_square(counts, chances)
            statistic += part[0]
            freedom += part[1]
    return statistic, freedom


@pytest.mark.slow
def test_persons_go_where_their_weighted_window_is_best_as_often_as_the_rules_say() -> None:
    fields = {
        "grid_size": 11,
        "person_initial_position": (6, 4),
        "vector": (0.3, -0.2),
        "sigma_x": 1.7,
        "sigma_y": 2.9,
    }
    statistic, freedom = misfit(transitions(fields, 12))
    assert freedom > 200
    assert statistic < chi_square_bound(freedom)


@pytest.mark.slow
def test_the_first_of_equal_cells_wins() -> None:
    # So wide a spread makes all cells of the circle exactly alike.
    fields = {
        "grid_size": 7,
        "person_initial_position": (3, 3),
        "vector": (0.0, 0.0),
        "sigma_x": 1e9,
        "sigma_y": 1e9,
    }
    seen = transitions(fields, 8)
    statistic, freedom = misfit(seen)
    assert statistic < chi_square_bound(freedom)
    statistic, freedom = misfit(seen, first_on_ties=False)
    assert statistic > chi_square_bound(freedom)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [49.8, 99.5, 100.5])
def test_draws_reach_from_one_to_a_hundred(ratio: float) -> None:
    # Two cells are possible, one `ratio` times less: it wins if its draw is so much the larger.
    world = worlds(
        grid_size=2,
        person_initial_position=(0, 0),
        vector=(0, 0),
        sigma_x=1 / np.sqrt(2 * np.log(ratio)),
        sigma_y=1e-3,
    )
    tries = wins = 0
    for _ in range(40):
        before = world.persons["x"].copy()
        advance(world)
        if world.worlds["map_steps"][0] > 2:
            tries += int((before == 0).sum())
            wins += int((world.persons["x"] > before).sum())
    draws = np.arange(1, 101)
    expected = tries * (draws > ratio * draws[:, None]).mean()
    assert abs(wins - expected) <= 6 * np.sqrt(expected)
    assert (wins > 0) == (ratio < 100)


def test_persons_in_one_cell_go_their_own_ways() -> None:
    world = worlds(
        person_amount=2, grid_size=7, person_initial_position=(3, 3), vector=(0, 0), sigma=2
    )
    for _ in range(3):
        advance(world)
    first, second = places(world, 0), places(world, 1)
    alone = Counter(first) + Counter(second)
    shares = {cell: n / alone.total() for cell, n in alone.items()}
    together = {(a, b): shares[a] * shares[b] for a in shares for b in shares}
    statistic, freedom = chi_square(Counter(zip(first, second, strict=True)), together)
    assert freedom > 10
    assert statistic < chi_square_bound(freedom)


def test_worlds_of_one_batch_differ() -> None:
    world = worlds(64, person_initial_position=(4, 4), vector=(0, 0), sigma=3)
    for _ in range(8):
        advance(world)
    assert len(set(places(world))) > 8


def test_who_sees_nothing_but_impossible_cells_stays() -> None:
    env = started(grid_size=12, person_initial_position=(1, 5), vector=(3, 0))
    for _ in range(2):
        step(env, SEARCH)
        assert person_cells(env) == [(1, 5)]
    assert env.probability[5, 7] == 1


@pytest.mark.parametrize("corner", [(0, 0), (5, 0), (0, 5), (5, 5)])
def test_a_person_in_a_corner_stays_on_the_grid(corner: Cell) -> None:
    world = worlds(500, grid_size=6, person_initial_position=corner, vector=(0, 0), sigma=1e9)
    seen: set[Cell] = set()
    for _ in range(20):
        advance(world)
        seen |= set(places(world))
    assert corner in seen
    assert all(0 <= col < 6 and 0 <= row < 6 for col, row in seen)
    assert len(seen) > 20


def test_a_person_found_stays_where_it_was_found() -> None:
    env = started(drones_positions=[(3, 3)], person_amount=2, sigma=3)
    put_person(env, (3, 3), 0)
    put_person(env, (7, 7), 1)
    step(env, SEARCH)
    for _ in range(5):
        step(env, 0 if env.positions[0][0] else 1)
        assert person_cells(env)[0] == (3, 3)


def searched(chance: float, multipliers: NDArray[np.float64] | None = None, **fields: Any) -> World:
    """Many worlds in which the drone searched the persons' cell once."""
    world = worlds(
        FEW,
        probability_of_detection=chance,
        drones_positions=[(3, 3)],
        person_initial_position=(3, 3),
        person_pod_multipliers=multipliers,
        **fields,
    )
    advance(world, SEARCH)
    return world


def test_a_search_finds_for_certain_by_default() -> None:
    world = worlds(50, drones_positions=[(3, 3)], person_initial_position=(3, 3))
    advance(world, SEARCH)
    assert world.persons["found"].all()


@pytest.mark.parametrize("chance", [0.0, 0.25, 0.8, 1.0])
def test_a_search_finds_as_often_as_the_probability_of_detection_says(chance: float) -> None:
    world = searched(chance)
    found = world.persons["found"][:, 0]
    deviation = np.sqrt(chance * (1 - chance) / FEW)
    assert abs(found.mean() - chance) <= 6 * deviation
    rewards = world.rewards[:, 0]
    assert (rewards[found] == 20000).all()
    # All the probability was in this cell.
    assert (rewards[~found] == 10000).all()
    np.testing.assert_array_equal(world.found[:, 0], found)


def test_each_person_has_its_own_factor_on_the_probability_of_detection() -> None:
    factors = np.array([0.0, 0.5, 1.0, 3.0])
    world = searched(0.5, factors, person_amount=4)
    shares = world.persons["found"].mean(axis=0)
    expected = np.minimum(0.5 * factors, 1)
    np.testing.assert_allclose(shares, expected, rtol=0, atol=6 * 0.5 / np.sqrt(FEW))
    assert shares[0] == 0 and shares[3] == 1
    finds = world.persons["found"].sum(axis=1)
    np.testing.assert_array_equal(
        world.rewards[:, 0], np.where(finds > 0, 20000.0 * finds, 10000.0)
    )
