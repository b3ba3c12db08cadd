# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The messages of searches, and the mission that the vehicles follow; without ROS and a clock."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from enum import Enum, auto
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.vehicles.mission_items.track_missions import VehicleLeg, Way
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.agents_inbox import Latest
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.sensors.sensor import SEARCH
from msg_adapters.step_report import path_of, wind_of

MISSION_REPORT_S = 5.0
"""Time within which the report of a finished mission should come."""


Identity = tuple[int, int]
"""run_id and mission."""
_KEPT = 4
"""Number of searches whose reports are kept."""


_Reports = Latest[Identity, tuple[int, NDArray[Any]]]
"""The latest report of each search, with its stamp in nanoseconds."""
_Tasks = Latest[Identity, NDArray[Any]]
"""The latest tasks of each search."""


class News(Enum):
    """What is new about the search."""

    BEGUN = auto()
    """Another mission is followed, or the same one from its start: see `info`."""
    STEP = auto()
    """There are new `legs`."""
    TRACKS = auto()
    """The mission is over, and its `tracks` and `final_legs` are available."""


class SearchInbox:
    """Takes the messages of searches, in any order, and chooses the one mission to follow.

    After each message the caller calls `next_news` until it returns None. The effect of a message
    may depend on how the caller handles earlier news, see `fail`.

    Args:
        vehicles: Number of drones that the search must have.
        as_mission: Whether to wait for the tracks of the whole mission, once it is over.
        refuse: Returns why another search, or the followed one if it is described again, may not
            be followed now.

    Attributes:
        info: The followed mission; None before the first.
        legs: Leg of each vehicle; empty before the first step. Each is the vehicle's task or, where
            there are no `vehicle_tasks`, what its drone has done in the last step.
        final_legs: Leg of each vehicle at the end of the mission, set with `tracks`.
        tracks: (steps + 1, N) report of the whole mission; None if it has not come, or without
            `as_mission`.
        foreign: Why the search of the latest `agents` is not followed; None if it is.
        report_s: Time of the last step report, of any search.
        confirmed: Whether `agents` of this mission have come since simulations last came or went.
    """

    def __init__(
        self,
        vehicles: int,
        *,
        as_mission: bool,
        refuse: Callable[[AgentsInfo], str | None] = lambda info: None,
    ) -> None:
        self._vehicles = vehicles
        self._as_mission = as_mission
        self._refuse = refuse
        self.info: AgentsInfo | None = None
        self.legs: list[VehicleLeg] = []
        self.final_legs: list[VehicleLeg] = []
        self.tracks: NDArray[Any] | None = None
        self.foreign: str | None = None
        self.confirmed = False
        self.report_s = 0.0
        self._unflyable: str | None = None
        self._followed_step: int | None = None
        self._over_since_s: float | None = None
        # The latest agents that are not followed yet, and reports, which may come before agents.
        self._other: AgentsInfo | None = None
        self._reports = _Reports(_KEPT)
        self._mission_reports = _Reports(_KEPT)
        self._tasks = _Tasks(_KEPT)
        # Whether they may be, by the messages that have come since `next_news`.
        self._step_is_new = self._tracks_are_new = False

    def take_agents(self, info: AgentsInfo) -> None:
        """Take an `agents` message: the mission and its drones."""
        self._step_is_new = self._tracks_are_new = True
        if self.info is not None and _is_same(info, self.info):
            self.info, self._other, self.foreign = info, None, None
            self.confirmed = True
        else:
            self._other = info

    def take_report(self, stamp_ns: int, report: NDArray[Any], now_s: float) -> None:
        """Take the report (N,) of a step, with its stamp, at a time on the clock of `trouble`."""
        self.report_s = now_s
        self._step_is_new |= _keep(self._reports, stamp_ns, report)

    def take_tasks(self, tasks: NDArray[Any]) -> None:
        """Take the tasks (P, N) of the vehicles."""
        if tasks.size:
            self._tasks.put((int(tasks["run_id"][0, 0]), int(tasks["mission"][0, 0])), tasks)
            self._step_is_new = True

    def take_mission_report(self, stamp_ns: int, report: NDArray[Any]) -> None:
        """Take the report (steps + 1, N) of a finished mission, with its stamp."""
        self._tracks_are_new |= _keep(self._mission_reports, stamp_ns, report)

    def require_agents(self) -> None:
        """Require new `agents`, because a simulation has come or gone."""
        self._other, self.foreign, self.confirmed = None, None, False

    def fail(self, why: str) -> None:
        """Stop following the mission, which cannot be flown."""
        self._unflyable = why

    @property
    def wind_mps(self) -> tuple[float, float] | None:
        """The wind in which it is planned, to the east and to the north, m/s.

        None if the search has none that vehicles report, or is over.
        """
        known = None if self.info is None else self._reports.get(_identity(self.info))
        if known is None or not self.legs or all(leg.over for leg in self.legs):
            return None
        return wind_of(known[1])

    @property
    def commanded(self) -> bool:
        """Whether the drones of the search have been commanded, so that a planner is running."""
        return self.info is not None and (self.info.commanded or (self._followed_step or 0) > 0)

    def trouble(self, now_s: float) -> str | None:
        """Return why the vehicles cannot fly the search."""
        if self.foreign or self._unflyable:
            return self.foreign or self._unflyable
        missing = self._as_mission and self.tracks is None and self._over_since_s is not None
        if missing and now_s - (self._over_since_s or 0.0) > MISSION_REPORT_S:
            return "the search is over, and its mission_report has not arrived"
        return None

    def next_news(self, now_s: float) -> News | None:
        """Return the next news, None if there is none.

        Args:
            now_s: Time on the clock of `trouble`.
        """
        if self._other is not None:
            self.foreign = self._why_not(self._other)
            if not self.foreign:
                info, self._other = self._other, None
                return self._begin(info)
        if self.info is None:
            return None
        if self._step_is_new:
            news = self._news_of_step(self.info, now_s)
            # A mission that restarts is reported before its step, so its step is new again.
            self._step_is_new = news is News.BEGUN
            if news is not None:
                return news
        if self._tracks_are_new:
            self._tracks_are_new = False
            return self._news_of_tracks(self.info)
        return None

    def _why_not(self, info: AgentsInfo) -> str | None:
        """Return why a search may not be followed."""
        count = len(info.agents)
        if self._vehicles != count:
            return f"{self._vehicles} vehicles for {count} drones: nothing is flown"
        if not info.actions and self._as_mission:
            return "the search is in metres, which mode mission does not fly: nothing is flown"
        known = self.info
        if known is not None and info.run_id == known.run_id and info.mission != known.mission:
            return None
        return self._refuse(info)

    def _begin(self, info: AgentsInfo) -> News:
        self.info, self.legs, self.final_legs, self.tracks = info, [], [], None
        self.confirmed = True
        self._followed_step = self._over_since_s = None
        self._unflyable = None
        self._step_is_new = self._tracks_are_new = True
        return News.BEGUN

    def _news_of_step(self, info: AgentsInfo, now_s: float) -> News | None:
        if _identity(info) not in self._reports:
            return None
        stamp_ns, report = self._reports[_identity(info)]
        if self._unflyable or len(report) != len(info.agents):
            return None
        step = int(report["step"][0])
        if self._followed_step is not None and step < self._followed_step:
            # A simulation with a fixed run_id has restarted.
            self._mission_reports.pop(_identity(info), None)
            return self._begin(info)
        self._followed_step = step
        search = _search_action(info)
        self.legs = _legs(stamp_ns, report, search, info.frame)
        if _identity(info) in self._tasks:
            tasks = self._tasks[_identity(info)]
            if tasks.shape[1] == len(self.legs):
                self.legs = _legs_of_tasks(self.legs, tasks, search)
        if self._over_since_s is None and all(leg.over for leg in self.legs):
            self._over_since_s = now_s
        return News.STEP

    def _news_of_tracks(self, info: AgentsInfo) -> News | None:
        if _identity(info) not in self._mission_reports:
            return None
        stamp_ns, report = self._mission_reports[_identity(info)]
        if not self._as_mission or self.tracks is not None or self._unflyable:
            return None
        if report.shape[1] != len(info.agents):
            return None
        self.tracks = report
        self.final_legs = [
            replace(leg, over=True) for leg in _legs(stamp_ns, report[-1], -1, info.frame)
        ]
        return News.TRACKS

    def track(self, drone: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the cells (K, 2) of a drone, and flags (K,) of those that it has searched."""
        assert self.tracks is not None and self.info is not None
        track = self.tracks[:, drone]
        cells = np.stack([track["col"], track["row"]], axis=1).astype(np.int64)
        return cells, track["action"] == _search_action(self.info)


def _identity(info: AgentsInfo) -> Identity:
    return info.run_id, info.mission


def _is_same(info: AgentsInfo, known: AgentsInfo) -> bool:
    """Return whether a mission is described as before, except for what changes in it."""
    return replace(info, commanded=known.commanded) == known


def _keep(reports: _Reports, stamp_ns: int, report: NDArray[Any]) -> bool:
    """Keep a report as the latest of its search; returns False if it is empty."""
    if not report.size:
        return False
    first = report.flat[0]
    reports.put((int(first["run_id"]), int(first["mission"])), (stamp_ns, report))
    return True


def _search_action(info: AgentsInfo) -> int:
    return info.actions.index(SEARCH) if SEARCH in info.actions else -1


def _legs(stamp_ns: int, report: NDArray[Any], search: int, frame: GridFrame) -> list[VehicleLeg]:
    """Return the legs of a step, one for each drone."""
    over = (report["terminated"] | report["truncated"]).astype(bool)
    cells = list(zip(report["col"].tolist(), report["row"].tolist(), strict=True))
    searched = report["action"] == search
    collided = [bool(over[i]) and cells.count(cell) > 1 for i, cell in enumerate(cells)]
    ways: list[Way] = [()] * len(cells)
    if "path" in (report.dtype.names or ()):
        collided = [False] * len(cells)
        # Paths begin at the north-west corner, the map frame at the south-west one.
        ways = [_way_of((0.0, frame.extent.height) + path * (1, -1)) for path in path_of(report)]
    return [
        VehicleLeg(stamp_ns, cell, bool(searched[i]), bool(over[i]), collided[i], ways[i])
        for i, cell in enumerate(cells)
    ]


def _way_of(points: NDArray[np.floating[Any]]) -> Way:
    """Return points (P, 2) of the map frame without those that repeat the one before."""
    places = [(float(x), float(y)) for x, y in points.tolist()]
    return tuple(place for place, _ in itertools.groupby(places))


def _legs_of_tasks(legs: list[VehicleLeg], tasks: NDArray[Any], search: int) -> list[VehicleLeg]:
    """Return the legs of the tasks (P, N), which end as those of the last step."""
    ends = tasks[-1]
    cells = zip(ends["col"].tolist(), ends["row"].tolist(), strict=True)
    searches = (ends["action"] == search).tolist()
    points = np.stack([tasks["x"], tasks["y"]], axis=-1)
    ways = [_way_of(points[:, i]) if leg.way else () for i, leg in enumerate(legs)]
    return [
        replace(leg, number=number, cell=cell, searched=searched, way=way)
        for leg, number, cell, searched, way in zip(
            legs, ends["task"].tolist(), cells, searches, ways, strict=True
        )
    ]
