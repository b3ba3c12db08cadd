# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""On cells what vehicles have flown is what was searched."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from cell_search import CELL_M, At, CellSearch

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.mission.vehicles.vehicle_looks import MOST_WAITING, PassedCells

LEGS = ["right", "right", "down", "left", "search", "search", "up"]


@pytest.mark.parametrize("sensor", ["flown_over", "own_cell", "camera", "sweep_width"])
def test_a_vehicle_on_its_track_searches_what_its_drone_would(sensor: str) -> None:
    both = [CellSearch(looks=looks, sensor=sensor) for looks in (True, False)]
    looked, own = (search.fly(LEGS) for search in both)
    assert looked == own and len(own) >= 2
    pos = [search.mission.pos for search in both]
    assert pos[0] == pos[1] and pos[0] > 0.005  # type: ignore[operator]
    assert both[0].mission.belief().tobytes() == both[1].mission.belief().tobytes()


def test_a_vehicle_within_half_a_cell_of_its_track_searches_the_same() -> None:
    looked = CellSearch(belief=False).fly(LEGS, lambda share: At(10.0 * share, 10.0))
    assert looked == CellSearch(looks=False, belief=False).fly(LEGS)


@pytest.mark.parametrize("south_m", [CELL_M / 2 + 30.0, CELL_M])
def test_a_vehicle_beside_its_cells_has_searched_where_it_was(south_m: float) -> None:
    beside = CellSearch(start=At(south=south_m))
    assert beside.fly(["right"] * 3, lambda _: At(south=south_m)) == [[7, 7], [8, 7], [9, 7]]
    there = CellSearch(looks=False, drones_positions=[(6, 7)])
    there.fly(["right"] * 3)
    assert beside.mission.pos == there.mission.pos
    assert beside.mission.belief().tobytes() == there.mission.belief().tobytes()


def test_a_vehicle_searches_what_it_passes_before_it_is_where_its_drone_goes() -> None:
    search = CellSearch(belief=False)
    assert search.step("down_right", takes=3, until=2)[["action", "look_action"]].tolist() == [
        (-1, 7)
    ]


def test_a_search_counts_in_the_cell_in_which_the_vehicle_was() -> None:
    away = At(east=-CELL_M)
    assert CellSearch(belief=False, start=away).fly(["search"], lambda _: away) == [[5, 6]]


@pytest.mark.parametrize("name", ["right", "search"])
@pytest.mark.parametrize(
    "at",
    [At(silent=True), At(up=21.0), At(tilt_deg=61.0)],
    ids=["gap", "altitude", "tilt"],
)
def test_what_a_vehicle_cannot_see_is_not_searched(at: At, name: str) -> None:
    search = CellSearch()
    report = search.step(name, lambda _: at)
    assert report["look_action"].tolist() == [-1] and report["action"].tolist() != [-1]
    assert search.mission.pos == 0.0
    assert (0 in search.steps.blind) != at.silent
    # It looks again once it can.
    assert len(search.fly([name])) == 1 and not search.steps.blind and search.mission.pos > 0.0  # type: ignore[operator]


def test_a_vehicle_may_come_down_to_search() -> None:
    search = CellSearch(belief=False)
    assert search.fly(["search"], lambda _: At(up=-90.0)) == [[6, 6]]
    assert search.fly(["right"], lambda _: At(up=-90.0)) == []


def test_persons_are_found_where_the_vehicle_is_and_not_where_its_drone_is() -> None:
    still: dict[str, Any] = {
        "person_motion": "random_walk", "person_steps": [0.0] * 4 + [1.0] + [0.0] * 4,
        "belief": False, "person_pod_multipliers": [1.0], "probability_of_detection": 1.0,
    }  # fmt: skip
    for row, found in ((6, 0), (7, 1)):
        search = CellSearch(person_initial_position=(7, row), start=At(south=CELL_M), **still)
        report = search.step("right", lambda _: At(south=CELL_M))
        assert report["found"].tolist() == [found]
        assert report[["look_col", "look_row"]].tolist() == [(7, 7)]


@pytest.mark.parametrize("course_deg", [0.0, 20.0, 45.0, 70.0])
def test_a_straight_path_passes_as_many_cells_as_it_is_long(course_deg: float) -> None:
    turn, count = math.radians(course_deg), 0
    way = np.array([math.cos(turn), math.sin(turn)])
    offsets = np.linspace(0.0, 1.0, 60, endpoint=False)
    for offset in offsets:
        begin = np.array([30.0, 30.013]) + offset * np.array([-way[1], way[0]]) * 10.0
        path = (begin + np.linspace(0.0, 10.0, 17)[:, None] * way) * CELL_M
        count += len(PassedCells(CELL_M, GridShape.square(100)).take(path, np.ones(17, bool)))
    assert count / len(offsets) == pytest.approx(10.0, abs=0.4)


def test_looks_that_come_too_fast_wait_for_the_next_steps() -> None:
    search = CellSearch(belief=False)
    jump = At(east=3 * CELL_M)
    assert search.fly(["right"], lambda share: jump._replace(east=jump.east * share)) == [[7, 6]]
    looked = search.fly(["search"] * 3, lambda _: At(east=3 * CELL_M))
    assert looked == [[8, 6], [9, 6], [10, 6]] and MOST_WAITING == 4


def test_a_vehicle_that_stays_anywhere_passes_no_cell_again() -> None:
    draw, passed = np.random.default_rng(2), PassedCells(CELL_M, GridShape.square(12))
    for place in draw.uniform(3.0, 9.0, (50, 2)):
        path = place * CELL_M + draw.uniform(-8.0, 8.0, (100, 2))
        passes = [over.cell for over in passed.take(path, draw.random(100) < 0.5)]
        assert len(passes) == len({*passes})


def test_a_pass_counts_once_although_positions_were_missing_during_it() -> None:
    path = np.stack([np.linspace(3.5, 6.5, 31), np.full(31, 4.5)], axis=1) * CELL_M
    looked = np.ones(31, bool)
    for first in (3, 8, 13, 18, 23):
        looked[first : first + 4] = False
    passes = PassedCells(CELL_M, GridShape.square(12)).take(path, looked)
    assert [over.cell for over in passes] == [(4, 4), (5, 4), (6, 4)]
    looked[5:16] = False
    passes = PassedCells(CELL_M, GridShape.square(12)).take(path, looked)
    assert [over.cell for over in passes] == [(5, 4), (6, 4)]


@pytest.mark.parametrize(("sensor", "sees"), [("flown_over", False), ("camera", True)])
def test_a_vehicle_off_the_grid_looks_from_there(sensor: str, sees: bool) -> None:
    fields: dict[str, Any] = {"sensor": sensor, "drones_positions": [(6, 11)], "sigma_y": 6.0}
    if sees:
        fields |= {"altitude": 2 * CELL_M, "field_of_view": 70.0}
    beside, far = (CellSearch(start=At(south=m), **fields) for m in (CELL_M, 9 * CELL_M))
    looked = beside.fly(["right"] * 3, lambda _: At(south=CELL_M))
    on_grid = [cell for cell in looked if cell[1] <= 11]
    assert (len(on_grid) > 0) == sees and all(cell[1] >= 11 for cell in on_grid)
    assert (beside.mission.pos > 0.0) == sees  # type: ignore[operator]
    far.fly(["right"] * 3, lambda _: At(south=9 * CELL_M))
    assert far.mission.pos == 0.0
