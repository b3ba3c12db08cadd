# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The looks and inputs of a live search as texts, from which others compute its belief.

Each text has the records since the last one. Now and then one has all of them, so that the last
texts are enough for those who come late.
"""

from __future__ import annotations

import json
from typing import Any

from dsse_ros.base.json_reader import read_json
from dsse_ros.mission.live.live_search import Forecasts, LiveSearch
from dsse_ros.mission.live.records import STEP, from_json, to_json
from dsse_ros.world.scenario.json_keys import Keys
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario

WHOLE_EVERY = 500
"""Texts from one that has all records to the next; late joiners get twice as many."""
Search = tuple[int, int]
"""run_id and number of a mission."""


class HistoryTexts:
    """Makes the texts of one search after the other."""

    def __init__(self) -> None:
        self._of: tuple[Search, LiveSearch] | None = None
        self._sent = self._count = 0

    def next(self, search: Search, live_search: LiveSearch) -> str:
        """Return the text of what is new in a search.

        Args:
            search: The search.
            live_search: Its beliefs and inputs.
        """
        if self._of != (search, live_search) or self._count % WHOLE_EVERY == 0:
            self._of, self._sent, self._count = (search, live_search), 0, 0
        self._count += 1
        begin, self._sent = self._sent, len(live_search.history)
        run_id, mission = search
        records = [to_json(record) for record in live_search.history[begin:]]
        values = {"run_id": run_id, "mission": mission, "begin": begin, "records": records}
        return json.dumps(values, allow_nan=False)


class FollowedHistory:
    """The last search of which texts came.

    Attributes:
        search: The search; None before the first text.
        steps: Number of its steps as far as they are known; -1 if none is.
        records: Its looks and inputs as far as they are known, as in `records.to_json`.
    """

    def __init__(self) -> None:
        self.search: Search | None = None
        self.steps = -1
        self.records: list[Any] = []
        self._live_search: LiveSearch | None = None
        self._forecasts: Forecasts | None = None

    def __bool__(self) -> bool:
        return self.search is not None

    def take(self, text: str) -> None:
        """Take a text of `HistoryTexts`.

        Raises:
            ValueError: If it is not a text of `HistoryTexts`.
        """
        keys = Keys(read_json(text, "history"), "history")
        search = keys.integer("run_id", 0), keys.integer("mission", 0)
        begin, records = keys.integer("begin", 0), keys.entries("records")
        known = self.records[begin:]
        if search != self.search or known != records[: len(known)]:
            self.search, self.steps, self.records, self._live_search = search, -1, [], None
        if begin <= len(self.records):
            new = records[len(self.records) - begin :]
            steps = sum(Keys(record, "history.records").value("kind") == STEP for record in new)
            self.records += new
            self.steps = max(self.steps, 0) + steps

    def live_search(
        self, scenario: ResolvedScenario, rules: Rules, forecasts: Forecasts
    ) -> LiveSearch:
        """Return the live search of all records so far.

        Args:
            scenario: The scenario of the search, as for `LiveSearch`.
            rules: Its rules.
            forecasts: As there; with others than in the last call, all is computed again.

        Raises:
            ValueError: If a record is damaged.
        """
        live_search, self._live_search = self._live_search, None
        if live_search is None or self._forecasts != forecasts:
            live_search, self._forecasts = LiveSearch(scenario, rules, forecasts), forecasts
        live_search.repeat(map(from_json, self.records[len(live_search.history) :]))
        self._live_search = live_search
        return live_search
