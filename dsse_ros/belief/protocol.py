# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of a belief: what a planner, an environment and a report ask it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.actions import Cell
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.step.looks import Looked


class Futures(NamedTuple):
    """Where persons may be from now on.

    Attributes:
        cells: (H + 1, M) int64 columns of each of M futures, the present one first.
        persons: (M,) int64, number of a person whose POD is that of the one in the future.
    """

    cells: NDArray[np.int64]
    persons: NDArray[np.int64]


class LooksToCome(NamedTuple):
    """Looks that may be done, in the order in which they are.

    Attributes:
        steps: (Q,) int64, how many steps from now, not falling.
        columns: (Q,) int64, what they look at, see `TargetForecast`.
        pods: (Q, P) float64, POD of each person.
    """

    steps: NDArray[np.int64]
    columns: NDArray[np.int64]
    pods: NDArray[np.float64]


class Expected(NamedTuple):
    """What looks to come may find.

    Attributes:
        finds: The discounted number of finds, as a share of the persons who are missing.
        left: (S S,) float64, where those are in the end who were not found.
    """

    finds: float
    left: NDArray[np.float64]


class TargetForecast(Protocol):
    """What is known of the persons in advance, the same for every mission of a scenario.

    Steps of the sea are counted from the start of its drift: the first `first_step` of them are
    done when a mission begins. A column is a cell of the grid with its margins, S along a side.
    """

    scenario: ResolvedScenario
    rules: Rules
    area: NDArray[np.bool_] | None
    horizon: int
    first_step: int
    side: int

    def belief(self) -> TargetBelief:
        """Return a belief at the start of a mission."""
        ...

    def column(self, cell: Cell) -> int:
        """Return the column that stands for a cell (col, row)."""
        ...

    def cell(self, column: int) -> Cell:
        """Return the cell (col, row) that a column stands for."""
        ...

    def most_probable(self, steps: int) -> Cell:
        """Return the most probable cell of the map after these steps of the sea, at least 1."""
        ...


class TargetBelief(Protocol):
    """The probability of where the persons are who have not been found.

    Attributes:
        forecast: What is known in advance.
        step: Steps of the mission done.
        pos: Cumulative probability of success: that searches so far found the person, before
            anything was known of how they ended; of several persons the expected share of finds.
    """

    step: int
    pos: float

    @property
    def forecast(self) -> TargetForecast: ...  # noqa: D102

    def mean_pod(self, pods: NDArray[np.float64]) -> float:
        """Return the mean of these PODs, (P,), over the persons who are missing."""
        ...

    @property
    def outside(self) -> float:
        """The probability of containment outside the grid and the area."""
        ...

    def poc(self) -> NDArray[np.float64]:
        """Return the probability of containment of every cell, (G, G) as [y, x]."""
        ...

    def advance(self) -> None:
        """Let the sea do one step, after the looks of this one."""
        ...

    def update(self, looks: Sequence[Looked]) -> None:
        """Learn that these looks have not found anyone."""
        ...

    def observe_find(self, look: Looked) -> None:
        """Learn that this look has found a person, and that others are left."""
        ...

    def futures(self, count: int, horizon: int, rng: np.random.Generator) -> Futures:
        """Return M futures of the persons who are missing, H steps long, drawn with `rng`."""
        ...

    def expect(self, looks: LooksToCome, horizon: int, gamma: float) -> Expected:
        """Return what looks to come may find.

        Args:
            looks: Those of the next `horizon` steps.
            horizon: H, at most that of the forecast.
            gamma: Discount of a find per step.
        """
        ...

    def copy(self) -> TargetBelief:
        """Return a belief of its own with the same content; the forecast is shared."""
        ...

    def reset(self) -> None:
        """Start anew: what is known at a mission's first observation."""
        ...
