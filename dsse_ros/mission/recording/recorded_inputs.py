# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The inputs of the live searches in a bag, from `live/history`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.live.history import FollowedHistory, Search
from dsse_ros.mission.live.live_search import Entry
from dsse_ros.mission.live.records import from_json
from dsse_ros.world.scenario.agents import AgentsInfo

HISTORY = "live/history"


class RecordedInputs:
    """The inputs of a live search by the step after which they came.

    Attributes:
        steps: Number of steps.

    Raises:
        ValueError: If a record is damaged.
    """

    def __init__(self, records: Sequence[Any]) -> None:
        self.steps = 0
        self._entries: defaultdict[int, list[Entry]] = defaultdict(list)
        for record in map(from_json, records):
            if isinstance(record, Entry):
                self._entries[self.steps].append(record)
            else:
                self.steps += 1

    def take(self, step: int) -> list[Entry]:
        """Return the inputs after a step, which are taken once."""
        return self._entries.pop(step, [])


def inputs_of(texts: Iterable[tuple[int, str]]) -> dict[Search, RecordedInputs]:
    """Return the inputs of each live search.

    Raises:
        FieldError: If they cannot be read.
    """
    follower, found = FollowedHistory(), {}
    try:
        for _, text in sorted(texts):
            follower.take(text)
            assert follower.search is not None
            found[follower.search] = follower.records
        return {search: RecordedInputs(records) for search, records in found.items()}
    except ValueError as error:
        raise FieldError(f"{HISTORY}: {error}") from None


def reason_not_to_compute(info: AgentsInfo | None, last: int, inputs: RecordedInputs | None) -> str:
    """Return why the belief of a mission up to this step is unknown, "" if it is not."""
    if info is None or info.definition is None or info.definition.scenario.has_persons:
        return ""
    known = 0 if inputs is None else inputs.steps
    return f"the bag has no {HISTORY} of step {known + 1}" if known < last else ""
