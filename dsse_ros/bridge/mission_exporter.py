# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Writes each finished search as mission files, and flies nothing; without ROS."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dsse_ros.bridge.flight_plan import layered
from dsse_ros.bridge.followed_search import FollowedSearch, News, SearchListener
from dsse_ros.bridge.settings import BridgeSettings
from dsse_ros.mission.vehicle_missions import search_missions, write_missions
from dsse_ros.scenario.fields import FieldError


class MissionExporter(SearchListener):
    """Writes the mission files of each search.

    Args:
        settings: Where and how to write the files.
        log: Takes log lines: a level and a line.

    Attributes:
        finished: Whether the files of the search are written.
    """

    def __init__(self, settings: BridgeSettings, log: Callable[[str, str], None]) -> None:
        self._settings = settings
        self._log = log
        self.search = FollowedSearch(None, whole=True)
        self.finished = False

    def set_publishers(self, count: int) -> bool:
        """Ignore the number of nodes that publish `step_report`; returns False."""
        return False

    def turn(self, now_s: float) -> None:
        """Write the files if a mission has finished."""
        self.handle_news(now_s)

    def handle_news(self, now_s: float) -> None:
        """Write the files of each finished mission."""
        while (news := self.search.next_news(now_s)) is not None:
            if news is News.BEGUN:
                self.finished = False
            elif news is News.TRACKS:
                self._write()

    def _write(self) -> None:
        info, settings = self.search.info, self._settings
        assert info is not None
        directory = Path(settings.export_directory)
        count = len(info.agents)
        try:
            frames = layered(info.frame, settings, count)
            tracks = [self.search.track(i) for i in range(count)]
            missions = search_missions(frames, tracks, settings, [None] * count)
            named = dict(zip(info.agents, missions, strict=True))
            written = write_missions(directory, named, settings.autopilot)
        except FieldError as error:
            self._fail(f"{error}: nothing is written")
        except OSError as error:
            self._fail(f"export_directory: {str(directory)!r}: {error.strerror}")
        else:
            self.finished = True
            self._log("info", f"{len(written)} files in {directory.resolve()}")

    def _fail(self, why: str) -> None:
        if self.search.fail(why):
            self._log("error", why)
