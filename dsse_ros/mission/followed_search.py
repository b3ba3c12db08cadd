# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which search the vehicles follow, and what is known of it; without ROS and without a clock."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum, auto
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.agents import AgentsInfo
from msg_adapters.track_missions import Leg

MISSION_REPORT_S = 5.0
"""Time in which the report of a mission comes that is over."""


class News(Enum):
    """What has become known of the search."""

    BEGUN = auto()
    """Another mission is followed, or the same one from its start: `info` says which."""
    HEARD_AGAIN = auto()
    """After the agents of another simulation a step of this one has come."""
    STEP = auto()
    """There are new `legs`."""
    TRACKS = auto()
    """The mission is over, and there are its `tracks` and `final_legs`."""


class FollowedSearch:
    """The messages of searches, in any order, and the one mission of them that is followed.

    After each message the caller takes `next_news` until there is none: what comes of a message may
    depend on what the caller makes of the news before, see `fail`.

    Args:
        vehicles: Number of drones that the search must have; None for any.
        whole: Whether the tracks of the whole mission are wanted, once it is over.

    Attributes:
        info: The mission that is followed; None before the first.
        legs: What its last step asks of each vehicle; empty before the first.
        final_legs: What the end of the mission asks of them, with its `tracks`.
        tracks: (steps + 1, N) report of the whole mission; None if it is not wanted or not there.
        foreign: Why the latest agents are not followed; empty if they are.
    """

    def __init__(self, vehicles: int | None, *, whole: bool) -> None:
        self._vehicles = vehicles
        self._whole = whole
        self.info: AgentsInfo | None = None
        self.legs: list[Leg] = []
        self.final_legs: list[Leg] = []
        self.tracks: NDArray[Any] | None = None
        self.foreign = ""
        self._unflyable = ""
        self._followed_step: int | None = None
        self._over_since_s: float | None = None
        # Reports may come before the agents that they belong to.
        self._agents: AgentsInfo | None = None
        self._report: tuple[int, NDArray[Any]] | None = None
        self._mission_report: tuple[int, NDArray[Any]] | None = None
        self._look_at_step = self._look_at_tracks = False

    def take_agents(self, info: AgentsInfo) -> None:
        """Take who searches in which mission."""
        count = len(info.agents)
        if self._vehicles not in (None, count):
            # Those of another simulation; our own goes on if its next step comes.
            self.foreign = f"{self._vehicles} vehicles for {count} drones: nothing is flown"
            return
        self.foreign = ""
        self._agents = info
        self._look_at_step = self._look_at_tracks = True

    def take_report(self, stamp_ns: int, report: NDArray[Any]) -> None:
        """Take the report (N,) of a step, with its stamp."""
        if report.size:
            self._report = (stamp_ns, report)
            self._look_at_step = True

    def take_mission_report(self, stamp_ns: int, report: NDArray[Any]) -> None:
        """Take the report (steps + 1, N) of a mission that is over, with its stamp."""
        if report.size:
            self._mission_report = (stamp_ns, report)
            self._look_at_tracks = True

    def fail(self, why: str) -> bool:
        """Follow the mission no further, as it cannot be flown; returns whether that is new."""
        new = why != self._unflyable
        self._unflyable = why
        return new

    def trouble(self, now_s: float) -> str:
        """Return why the vehicles cannot do what they are for; empty if they can."""
        if self.foreign or self._unflyable:
            return self.foreign or self._unflyable
        missing = self._whole and self.tracks is None and self._over_since_s is not None
        if missing and now_s - (self._over_since_s or 0.0) > MISSION_REPORT_S:
            return "the search is over, and its mission_report has not come"
        return ""

    def next_news(self, now_s: float) -> News | None:
        """Return what is new, one after the other; None if nothing is.

        Args:
            now_s: Time on the clock of `trouble`.
        """
        if self._agents is not None:
            info, self._agents = self._agents, None
            if self.info is None or _identity(info) != _identity(self.info):
                return self._begin(info)
        if self.info is None:
            return None
        if self._look_at_step:
            news = self._news_of_step(self.info, now_s)
            # The others are about what comes before the step itself.
            self._look_at_step = news in (News.BEGUN, News.HEARD_AGAIN)
            if news is not None:
                return news
        if self._look_at_tracks:
            self._look_at_tracks = False
            return self._news_of_tracks(self.info)
        return None

    def _begin(self, info: AgentsInfo) -> News:
        self.info, self.legs, self.final_legs, self.tracks = info, [], [], None
        self._followed_step = self._over_since_s = None
        self._unflyable = ""
        return News.BEGUN

    def _news_of_step(self, info: AgentsInfo, now_s: float) -> News | None:
        if self._report is None or not _belongs(self._report[1], info):
            return None
        stamp_ns, report = self._report
        if self.foreign:
            self.foreign = ""
            return News.HEARD_AGAIN
        if self._unflyable or len(report) != len(info.agents):
            return None
        step = int(report["step"][0])
        if self._followed_step is not None and step < self._followed_step:
            # A simulation with a fixed run_id was started anew.
            self._mission_report = None
            return self._begin(info)
        self._followed_step = step
        self.legs = _legs(stamp_ns, report, _search_action(info))
        if self._over_since_s is None and all(leg.over for leg in self.legs):
            self._over_since_s = now_s
        return News.STEP

    def _news_of_tracks(self, info: AgentsInfo) -> News | None:
        if self._mission_report is None or not _belongs(self._mission_report[1], info):
            return None
        stamp_ns, report = self._mission_report
        if not self._whole or self.tracks is not None or self._unflyable:
            return None
        if report.shape[1] != len(info.agents):
            return None
        self.tracks = report
        self.final_legs = [replace(leg, over=True) for leg in _legs(stamp_ns, report[-1], -1)]
        return News.TRACKS

    def track(self, drone: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the cells (K, 2) of a drone, and flags (K,) of those it has searched."""
        assert self.tracks is not None and self.info is not None
        track = self.tracks[:, drone]
        cells = np.stack([track["col"], track["row"]], axis=1).astype(np.int64)
        return cells, track["action"] == _search_action(self.info)


def _identity(info: AgentsInfo) -> tuple[int, int]:
    return info.run_id, info.mission


def _belongs(report: NDArray[Any], info: AgentsInfo) -> bool:
    """Return whether a report, of a step or of a mission, is of this search."""
    first = report.flat[0]
    return (int(first["run_id"]), int(first["mission"])) == _identity(info)


def _search_action(info: AgentsInfo) -> int:
    return info.actions.index("search") if "search" in info.actions else -1


def _legs(stamp_ns: int, report: NDArray[Any], search: int) -> list[Leg]:
    """Return the legs of a step, one for each drone."""
    over = (report["terminated"] | report["truncated"]).astype(bool)
    cells = list(zip(report["col"].tolist(), report["row"].tolist(), strict=True))
    searched = report["action"] == search
    crashed = [bool(over[i]) and cells.count(cell) > 1 for i, cell in enumerate(cells)]
    return [
        Leg(stamp_ns, cell, bool(searched[i]), bool(over[i]), crashed[i])
        for i, cell in enumerate(cells)
    ]
