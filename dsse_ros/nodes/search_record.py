# SPDX-License-Identifier: Apache-2.0
"""The steps of a search as a listener has heard them, without ROS."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class SearchRecord:
    """Collects the step reports of one search.

    Args:
        search_action: Number of the action search.

    Attributes:
        missed: Numbers of the steps that were not heard.
    """

    def __init__(self, search_action: int) -> None:
        self._search = search_action
        self._cells: list[NDArray[np.int64]] = []
        self._searched: list[NDArray[np.bool_]] = []
        self._step = -1
        self.missed: list[int] = []

    def add(self, report: NDArray[Any]) -> None:
        """Take a report: see `msg_adapters.step_report`; one that is told again is left out."""
        step = int(report["step"][0])
        if step <= self._step:
            return
        self.missed += range(self._step + 1, step)
        self._step = step
        self._cells.append(np.stack([report["col"], report["row"]], axis=1).astype(np.int64))
        self._searched.append(report["action"] == self._search)

    def track(self, drone: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the cells (K, 2) of a drone and flags (K,) of those it has searched."""
        return (
            np.array([cells[drone] for cells in self._cells]),
            np.array([flags[drone] for flags in self._searched]),
        )
