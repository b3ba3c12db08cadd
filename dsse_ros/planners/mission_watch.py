# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recognizes that a planner is used for another mission, so that it starts again."""

from __future__ import annotations

import copy

from dsse_ros.planners.planner import Cell, Infos, Observations, Search, cells_of


class MissionWatch:
    """Watches the observations of a planner for the first one of a mission.

    With the number of steps, that is one with fewer steps than the last one, or with none.
    Otherwise it is one in which a drone has come back or has moved by more than a cell.

    Args:
        search: Has the steps done; None where only the infos may have them.
    """

    def __init__(self, search: Search | None = None) -> None:
        self._search = search
        self._step: int | None = None
        self._cells: dict[str, Cell] = {}

    def copy(self) -> MissionWatch:
        """Return an independent copy in the same state."""
        return copy.copy(self)

    def is_new(self, observations: Observations, infos: Infos) -> bool:
        """Return whether an observation, of at least one drone, is the first one of a mission."""
        cells = dict(zip(observations, cells_of(observations), strict=True))
        done = None if self._search is None else self._search.steps_done
        step = infos.get(next(iter(observations)), {}).get("step", done)
        if step is not None and self._step is not None:
            new = step < self._step or (step == 0 and cells.keys() >= self._cells.keys())
        else:
            new = self._has_jumped(cells)
        self._cells, self._step = cells, None if step is None else int(step)
        return new

    def _has_jumped(self, cells: dict[str, Cell]) -> bool:
        return any(
            agent not in self._cells
            or max(abs(col - self._cells[agent][0]), abs(row - self._cells[agent][1])) > 1
            for agent, (col, row) in cells.items()
        )
