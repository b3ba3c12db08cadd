# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of search patterns that planners fly over the grid."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from grid_walker import DIAGONAL
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.expanding_square import square_spiral
from dsse_ros.planners.pattern_routes import PatternRoutes
from dsse_ros.planners.patterns import SearchPattern
from dsse_ros.planners.planner import Cell
from dsse_ros.planners.registry import planner_for, planner_with
from dsse_ros.planners.sweep import boustrophedon, sweep_routes
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.actions import ActionSet

CELL_M = 130.0
ACTIONS = ActionSet(DIAGONAL)


def routes(
    size: int, drones: int = 1, datum: Cell | None = None, **pattern: Any
) -> list[list[Cell]]:
    starts = [(k % size, k // size) for k in range(drones)]
    probability = np.zeros((size, size), np.float32)
    return PatternRoutes(SearchPattern(**pattern), CELL_M, datum)(
        starts, probability, [ACTIONS] * len(starts)
    )


@given(st.integers(1, 9))
def test_with_a_spacing_of_one_cell_the_square_is_that_of_the_whole_grid(half: int) -> None:
    side = 2 * half + 1
    (route,) = routes(
        side, datum=(half, half), pattern="SS", track_spacing=CELL_M, length=side * CELL_M
    )
    assert route == list(square_spiral((half, half), GridShape.square(side)))


@pytest.mark.parametrize(("pattern", "creeping"), [("PS", False), ("CS", True)])
@given(half=st.integers(1, 9))
def test_with_a_spacing_of_one_cell_the_lanes_are_those_of_the_whole_grid(
    pattern: str, creeping: bool, half: int
) -> None:
    side = 2 * half + 1
    (route,) = routes(
        side, datum=(half, half), pattern=pattern, track_spacing=CELL_M, length=side * CELL_M,
        width=side * CELL_M, heading=90.0 if creeping else 180.0,
        first_turn="starboard" if creeping else "port",
    )  # fmt: skip
    (of_grid,) = sweep_routes([(0, 0)], np.zeros((side, side)), [ACTIONS], creeping=creeping)
    assert route == of_grid


def test_a_creeping_line_flies_each_share_row_by_row() -> None:
    (first, second) = sweep_routes([(0, 0), (3, 0)], np.zeros((4, 4)), [ACTIONS] * 2, creeping=True)
    assert first[:4] == [(0, 0), (1, 0), (1, 1), (0, 1)]
    assert sorted(first + second) == sorted(boustrophedon(range(4), range(4)))


@given(st.sampled_from(["PS", "CS", "SS", "VS"]), st.floats(0, 360), st.integers(1, 5), st.data())
def test_drones_share_the_track_in_contiguous_stretches_on_the_grid(
    kind: str, heading: float, drones: int, data: st.DataObject
) -> None:
    size = data.draw(st.integers(12, 25))
    datum = data.draw(st.tuples(*[st.integers(0, size - 1)] * 2))
    values: dict[str, Any] = {"pattern": kind, "heading": heading, "length": 8 * CELL_M}
    values |= {} if kind == "VS" else {"track_spacing": 2 * CELL_M}
    values |= {"width": 5 * CELL_M} if kind in ("PS", "CS") else {}
    (alone,) = routes(size, datum=datum, **values)
    shared = routes(size, drones, datum, **values)
    assert [cell for route in shared for cell in route] == alone
    assert max(map(len, shared)) - min(map(len, shared)) <= 1
    assert all(0 <= col < size and 0 <= row < size for col, row in alone)
    if datum[0] in range(8, size - 8) and datum[1] in range(8, size - 8):
        assert all(max(abs(a[0] - b[0]), abs(a[1] - b[1])) == 1 for a, b in pairwise(alone))


def test_a_planner_searches_the_lanes_of_its_options_from_the_commence_search_point() -> None:
    env = parallel_env("config/santos.yaml", num_drones=1)
    observations, infos = env.reset(seed=1)
    planner = planner_for(
        env, "sweep", datum=(10, 9), heading=90, track_spacing=260, length=1300, width=1040
    )
    searched = []
    while env.agents and len(searched) < 4 * 9 + 3:
        actions = planner(observations, infos)
        if actions["drone0"] == env.rules.action_set.search:
            searched.append(tuple(env.positions[0].tolist()))
        observations, _, _, _, infos = env.step(actions)
    lanes = [row for col, row in searched if col == 10]
    assert searched[0] == (6, 6)
    assert lanes == [6, 8, 10, 12]


@pytest.mark.parametrize(
    ("planner", "options", "line"),
    [
        (
            "greedy",
            {"heading": 3.0},
            "'heading' is not an option of planner greedy",
        ),
        ("sector", {"heading": 3.0}, "a pattern of planner sector must have length, got no length"),
        (
            "sweep",
            {"length": 500},
            "must have .*, got no track_spacing, width",
        ),
        ("sector", {"length": 500, "datum": (20, 3)}, "datum must have col and row from 0 to 19"),
        ("sector", {"length": 500, "datum": 3}, "datum must be a cell"),
    ],
)
def test_an_option_that_is_not_allowed_gets_one_line(
    planner: str, options: dict[str, Any], line: str
) -> None:
    with pytest.raises(FieldError, match=line):
        planner_for(parallel_env("config/santos.yaml"), planner, **options)


def test_options_as_text_are_those_of_the_same_values() -> None:
    env = parallel_env("config/santos.yaml", num_drones=1)
    observations, infos = env.reset(seed=1)
    texts = ["heading=90", "track_spacing=260.0", "length=1300", "width=1040", "datum=[10, 9]"]
    values = {"heading": 90, "track_spacing": 260, "length": 1300, "width": 1040, "datum": (10, 9)}
    with_texts = planner_with(env, "sweep", texts)
    with_values = planner_for(env, "sweep", **values)
    assert with_texts(observations, infos) == with_values(observations, infos)
    assert with_texts._layout == with_values._layout


@pytest.mark.parametrize(
    ("option", "line"),
    [
        ("heading", "planner_options must be name=value each, got 'heading'"),
        ("heading=[", "planner_options: heading: not YAML: "),
        ("heading=010", "planner_options: heading: line 1: a whole number must not begin with 0"),
        ("depth=3", "'depth' is not an option of planner sweep; did you mean width?"),
    ],
)
def test_text_that_is_no_option_gets_one_line(option: str, line: str) -> None:
    with pytest.raises(FieldError, match=line):
        planner_with(parallel_env("config/santos.yaml"), "sweep", [option])
