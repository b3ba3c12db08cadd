# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The latest `agents` of several searches, whose messages may come in any order."""

from __future__ import annotations

from typing import Any, TypeVar

from numpy.typing import NDArray

from dsse_ros.world.scenario.agents import AgentsInfo, agents_from_json

K = TypeVar("K")
V = TypeVar("V")

_RUNS = 10
"""Runs whose `agents` are kept: more than there are simulations in a namespace by mistake."""


class Latest(dict[K, V]):
    """Values by key, the latest one last; the oldest goes when there are too many.

    Args:
        most: Largest number of values.
    """

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def put(self, key: K, value: V) -> None:
        """Add a value as the latest one, in place of another with the same key."""
        self.pop(key, None)
        self[key] = value
        if len(self) > self._most:
            del self[next(iter(self))]

    @property
    def last(self) -> V | None:
        """The latest value; None if there is none."""
        return next(reversed(self.values()), None)


class AgentsInbox(Latest[int, AgentsInfo]):
    """The last `agents` of each run, by run_id.

    Args:
        with_definition: Whether to read the definitions, which may name files.
    """

    def __init__(self, *, with_definition: bool = True) -> None:
        super().__init__(_RUNS)
        self._with_definition = with_definition

    def take(self, text: str) -> AgentsInfo:
        """Take the text of an `agents` and return what it states.

        Raises:
            ValueError: If it is malformed; the last one stays.
        """
        info = agents_from_json(text, with_definition=self._with_definition)
        self.put(info.run_id, info)
        return info

    def info_of(self, report: NDArray[Any]) -> AgentsInfo | None:
        """Return the `agents` of the run of a report; None if it has not come."""
        return self.get(int(report["run_id"][0]))
