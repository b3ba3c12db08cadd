# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which search is followed, with messages in every order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsse_ros.vehicles.fleet.search_inbox import MISSION_REPORT_S, News, SearchInbox
from dsse_ros.vehicles.mission_items.track_missions import VehicleLeg
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.frames import GridFrame
from msg_adapters.mission_report import MISSION_REPORT_DTYPE
from msg_adapters.step_report import step_report_dtype
from msg_adapters.vehicle_tasks import VEHICLE_TASK

ACTIONS = ("left", "right", "up", "down", "search")
SEARCH = ACTIONS.index("search")
AHEAD = (1, 2)


def agents(run_id: int = 7, mission: int = 1, count: int = 2) -> AgentsInfo:
    return AgentsInfo(
        agents=tuple(f"drone{i}" for i in range(count)),
        actions=ACTIONS,
        rules="paper",
        seed=0,
        frame=GridFrame(8, 100.0, -24.0, -46.0, 0.0, 100.0),
        timestep_limit=10,
        step_duration_s=1.0,
        mission=mission,
        run_id=run_id,
    )


def report(
    step: int,
    cells: Sequence[tuple[int, int]] = (AHEAD, (5, 5)),
    *,
    run_id: int = 7,
    mission: int = 1,
    over: Sequence[bool] = (False, False),
    action: int = 0,
) -> NDArray[np.void]:
    made = np.zeros(len(cells), step_report_dtype(len(ACTIONS)))
    made["run_id"], made["mission"], made["step"] = run_id, mission, step
    made["col"], made["row"] = np.array(cells).T
    made["terminated"], made["action"] = over, action
    return made


def whole(steps: int, *, run_id: int = 7, mission: int = 1, count: int = 2) -> NDArray[np.void]:
    made = np.zeros((steps + 1, count), MISSION_REPORT_DTYPE)
    made["run_id"], made["mission"] = run_id, mission
    made["step"] = made["col"] = np.arange(steps + 1)[:, None]
    made["action"] = -1
    made["action"][-1] = SEARCH
    return made


def news(search: SearchInbox, now_s: float = 0.0) -> list[News]:
    return list(iter(lambda: search.next_news(now_s), None))


def followed(*, as_mission: bool = False) -> SearchInbox:
    search = SearchInbox(2, as_mission=as_mission)
    search.take_agents(agents())
    assert news(search) == [News.BEGUN]
    return search


def test_a_step_is_followed_once_it_is_known_whose_it_is() -> None:
    search = SearchInbox(2, as_mission=False)
    search.take_report(13, report(1), 0.0)
    assert news(search) == [] and search.legs == []
    search.take_agents(agents())
    assert news(search) == [News.BEGUN, News.STEP]
    assert [leg.cell for leg in search.legs] == [AHEAD, (5, 5)]
    assert {leg.number for leg in search.legs} == {13}


def tasks(*ends: tuple[int, int, int, int], run_id: int = 7, mission: int = 1) -> NDArray[np.void]:
    """Tasks of (number, column, row, action)."""
    made = np.zeros((1, len(ends)), VEHICLE_TASK)
    made["run_id"], made["mission"] = run_id, mission
    made["task"], made["col"], made["row"], made["action"] = np.array(ends).T
    return made


@pytest.mark.parametrize("first", ["tasks", "report"])
def test_vehicles_follow_their_tasks_and_end_with_their_drones(first: str) -> None:
    search, task = followed(), tasks((3, 2, 2, 1), (4, 5, 5, SEARCH))
    if first == "tasks":
        search.take_tasks(task)
        assert news(search) == []
    search.take_report(13, report(1, over=(False, True)), 0.0)
    search.take_tasks(task)
    assert News.STEP in news(search)
    assert search.legs == [VehicleLeg(3, (2, 2)), VehicleLeg(4, (5, 5), searched=True, over=True)]


@pytest.mark.parametrize(
    "other",
    [
        tasks((3, 0, 0, 1), (4, 0, 0, 1), run_id=8),
        tasks((3, 0, 0, 1)),
        np.zeros((1, 0), VEHICLE_TASK),
    ],
)
def test_tasks_of_another_search_or_number_of_drones_are_not_followed(
    other: NDArray[np.void],
) -> None:
    search = followed()
    search.take_report(13, report(1), 0.0)
    search.take_tasks(other)
    assert news(search) == [News.STEP]
    assert [leg.cell for leg in search.legs] == [AHEAD, (5, 5)]


def in_metres(search: SearchInbox) -> None:
    search.take_agents(replace(agents(), actions=()))
    made = np.zeros(2, step_report_dtype(0, path_points=3))
    made["run_id"], made["mission"], made["step"] = 7, 1, 1
    made["path"] = [[0.0, 0.0, 100.0, 0.0, 200.0, 50.0], [300.0, 800.0] * 3]
    search.take_report(13, made, 0.0)


def test_in_metres_a_leg_has_the_points_of_its_way_in_the_map_frame() -> None:
    search = SearchInbox(2, as_mission=False)
    in_metres(search)
    assert news(search) == [News.BEGUN, News.STEP]
    # From the north-west corner; a point that repeats the one before is left out.
    assert search.legs[0].way == ((0.0, 800.0), (100.0, 800.0), (200.0, 750.0))
    assert search.legs[1].way == ((300.0, 0.0),)
    points = np.repeat(tasks((3, 2, 2, -1), (4, 5, 5, -1)), 3, axis=0)
    points["x"][:, 0] = [10.0, 20.0, 20.0]
    search.take_tasks(points)
    assert news(search) == [News.STEP]
    assert [(leg.number, leg.way) for leg in search.legs] == [
        (3, ((10.0, 0.0), (20.0, 0.0))), (4, ((0.0, 0.0),))
    ]  # fmt: skip


def test_a_search_in_metres_is_not_flown_as_missions() -> None:
    search = SearchInbox(2, as_mission=True)
    in_metres(search)
    assert news(search) == [] and search.trouble(0.0) == (
        "the search is in metres, which mode mission does not fly: nothing is flown"
    )


@pytest.mark.parametrize("order", permutations(["agents", "report", "mission_report"]))
def test_the_order_in_which_messages_come_does_not_matter(order: Sequence[str]) -> None:
    search, seen = SearchInbox(2, as_mission=True), []
    for kind in order:
        if kind == "agents":
            search.take_agents(agents())
        elif kind == "report":
            search.take_report(40, report(3, over=(True, True)), 0.0)
        else:
            search.take_mission_report(40, whole(3))
        seen += news(search)
    assert seen.count(News.BEGUN) == seen.count(News.TRACKS) == 1
    assert News.STEP in seen and seen.index(News.BEGUN) == 0
    assert search.trouble(1e6) is None


@pytest.mark.parametrize("other", [{"run_id": 8}, {"mission": 2}])
def test_what_belongs_to_another_search_is_not_followed(other: dict[str, int]) -> None:
    search = followed(as_mission=True)
    search.take_report(13, report(1, **other), 0.0)  # type: ignore[arg-type]
    search.take_mission_report(13, whole(1, **other))
    assert news(search) == [] and search.legs == [] and search.tracks is None
    search.take_agents(agents(**other))
    assert news(search) == [News.BEGUN, News.STEP, News.TRACKS]


def test_agents_in_another_number_are_named_and_the_search_goes_on() -> None:
    search = followed()
    search.take_agents(agents(run_id=9, count=3))
    assert news(search) == [] and search.info == agents()
    assert search.trouble(0.0) == "2 vehicles for 3 drones: nothing is flown"
    search.take_report(13, report(1), 0.0)
    assert news(search) == [News.STEP]
    search.require_agents()
    assert search.trouble(0.0) is None


@pytest.mark.parametrize("other", [{"run_id": 8}, {"run_id": 8, "mission": 2}])
def test_another_simulation_is_followed_only_once_that_is_allowed(other: dict[str, int]) -> None:
    kept: list[str | None] = ["drone0 is in the air"]
    search = SearchInbox(2, as_mission=False, refuse=lambda info: kept[0])
    kept[0] = None
    search.take_agents(agents())
    assert news(search) == [News.BEGUN]
    kept[0] = "drone0 is in the air"
    search.take_agents(agents(**other))
    search.take_report(26, report(0, **other), 0.0)  # type: ignore[arg-type]
    search.take_report(13, report(1), 0.0)
    assert news(search) == [News.STEP]
    assert search.trouble(0.0) == "drone0 is in the air" and search.info == agents()
    kept[0] = None
    assert news(search) == [News.BEGUN, News.STEP]
    assert search.info == agents(**other) and search.legs[0].number == 26


def test_another_mission_of_the_same_simulation_is_followed_at_once() -> None:
    search = followed()
    search._refuse = lambda info: "drone0 is in the air"
    search.take_agents(agents(mission=2))
    assert news(search) == [News.BEGUN] and search.trouble(0.0) is None


def test_a_simulation_that_is_gone_is_not_followed_later() -> None:
    search = followed()
    search._refuse = lambda info: "2 nodes publish step_report"
    search.take_agents(agents(run_id=8))
    assert news(search) == []
    search.require_agents()
    search._refuse = lambda info: None
    assert news(search) == [] and search.info == agents()


def test_somebody_plans_the_search_once_its_drones_were_commanded() -> None:
    search = SearchInbox(2, as_mission=False)
    search.take_agents(replace(agents(), commanded=False))
    search.take_report(0, report(0), 0.0)
    assert news(search) == [News.BEGUN, News.STEP] and not search.commanded
    search.take_agents(agents())
    assert news(search) == [News.STEP] and search.commanded
    other = SearchInbox(2, as_mission=False)
    other.take_agents(replace(agents(), commanded=False))
    other.take_report(13, report(1), 0.0)
    assert news(other) == [News.BEGUN, News.STEP] and other.commanded


@pytest.mark.parametrize("refused", ["", "a vehicle is in the air"])
def test_a_mission_that_is_described_anew_is_another_one(refused: str) -> None:
    # A vehicle takes off between the two.
    reasons = iter([None, *[refused] * 9])
    search = SearchInbox(2, as_mission=False, refuse=lambda info: next(reasons))
    search.take_agents(agents())
    search.take_report(13, report(1), 0.0)
    assert news(search) == [News.BEGUN, News.STEP]
    moved = replace(agents(), frame=replace(agents().frame, origin_lat_deg=10.0))
    search.take_agents(moved)
    assert (news(search), search.foreign) == (
        ([News.STEP], refused) if refused else ([News.BEGUN, News.STEP], "")
    )
    assert (search.info == moved) == (not refused)


@pytest.mark.parametrize("counts", [(2, 1, 3), (2, 3, 2), (2, 1)])
def test_a_mission_whose_drones_change_in_number_leaves_those_that_are_followed(
    counts: tuple[int, ...],
) -> None:
    search = SearchInbox(2, as_mission=False)
    for count in counts:
        search.take_agents(agents(count=count))
        search.take_report(13, report(1), 0.0)
        news(search)
        assert search.info is not None and len(search.info.agents) == 2 == len(search.legs)


def test_the_same_mission_from_its_start_is_another_one() -> None:
    search = followed(as_mission=True)
    search.take_report(40, report(5), 0.0)
    search.take_mission_report(40, whole(5))
    assert news(search) == [News.STEP, News.TRACKS]
    search.take_report(1, report(0), 0.0)
    assert news(search) == [News.BEGUN, News.STEP]
    assert search.tracks is None


def test_a_search_that_cannot_be_flown_is_followed_no_further() -> None:
    search = SearchInbox(2, as_mission=True)
    search.take_report(13, report(1), 0.0)
    search.take_agents(agents())
    assert search.next_news(0.0) is News.BEGUN
    search.fail("no room")
    assert news(search) == [] and search.legs == []
    assert search.trouble(0.0) == "no room"
    search.take_agents(agents(mission=2))
    assert news(search) == [News.BEGUN]
    assert search.trouble(0.0) is None


def test_a_mission_report_that_does_not_come_is_missed_after_a_while() -> None:
    search = followed(as_mission=True)
    search.take_report(13, report(4, over=(True, True)), 0.0)
    assert news(search, 10.0) == [News.STEP]
    # A step that is published again does not put it off.
    search.take_report(13, report(4, over=(True, True)), 0.0)
    assert news(search, 14.0) == [News.STEP]
    assert search.trouble(10.0 + MISSION_REPORT_S) is None
    assert "mission_report" in search.trouble(10.1 + MISSION_REPORT_S)
    search.take_mission_report(13, whole(4))
    assert news(search) == [News.TRACKS]
    assert search.trouble(1e6) is None


def test_who_follows_steps_wants_no_tracks() -> None:
    search = followed()
    search.take_report(13, report(1, over=(True, True)), 0.0)
    search.take_mission_report(13, whole(1))
    assert news(search) == [News.STEP]
    assert search.tracks is None and search.trouble(1e6) is None


def test_tracks_have_the_cells_and_where_they_were_searched() -> None:
    search = followed(as_mission=True)
    search.take_mission_report(40, whole(3))
    assert news(search) == [News.TRACKS]
    cells, searched = search.track(1)
    assert cells.tolist() == [[0, 0], [1, 0], [2, 0], [3, 0]]
    assert searched.tolist() == [False, False, False, True]
    assert all(leg.over and leg.cell == (3, 0) for leg in search.final_legs)


def test_reports_of_another_number_of_drones_and_empty_ones_are_left_alone() -> None:
    search = followed(as_mission=True)
    search.take_report(13, report(1, cells=[(0, 0)], over=(False,)), 0.0)
    search.take_mission_report(13, whole(1, count=3))
    search.take_report(13, report(1)[:0], 0.0)
    search.take_mission_report(13, whole(1)[:0])
    assert news(search) == [] and search.legs == [] and search.tracks is None


def test_drones_that_end_in_one_cell_have_collided() -> None:
    search = followed()
    search.take_report(13, report(2, cells=[(4, 4), (4, 4)], over=(True, True), action=SEARCH), 0.0)
    assert news(search) == [News.STEP]
    assert all(leg.collided and leg.over and leg.searched for leg in search.legs)
