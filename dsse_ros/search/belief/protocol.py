# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The interface of a belief for planners, environments and reports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.step.looks import Looked
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario


class Futures(NamedTuple):
    """Sampled futures of the persons, sorted by cell in each of the next H steps.

    Attributes:
        cells: (H + 1, M) int64, columns of each of M futures, the present one first.
        persons: (M,) int64, number of a person with the POD of the person in each future.
        starts: (H, S + 1) int64, see `members`.
        members: (H, M) uint32: the futures in column i at step h are, in increasing order,
            members[h, starts[h, i] : starts[h, i + 1]].
    """

    cells: NDArray[np.int64]
    persons: NDArray[np.int64]
    starts: NDArray[np.int64]
    members: NDArray[np.uint32]

    @staticmethod
    def empty(count: int, horizon: int, columns: int) -> Futures:
        """Return memory for M futures of H steps."""
        return Futures(
            np.empty((horizon + 1, count), np.int64), np.empty(count, np.int64),
            np.empty((horizon, columns + 1), np.int64), np.empty((horizon, count), np.uint32),
        )  # fmt: skip


class LooksToCome(NamedTuple):
    """Looks of V plans, those of each plan in the order of their execution.

    Attributes:
        starts: (V + 1,) int64, the looks of plan v are starts[v] .. starts[v + 1] - 1.
        steps: (Q,) int64, number of steps from now, never decreasing in a plan.
        columns: (Q,) int64, columns of the cells to look at, see `TargetForecast`.
        pods: (Q, P) float64, POD of each person.
    """

    starts: NDArray[np.int64]
    steps: NDArray[np.int64]
    columns: NDArray[np.int64]
    pods: NDArray[np.float64]


class Expected(NamedTuple):
    """Expected result of V plans.

    Attributes:
        finds: (V,) float64, discounted numbers of finds, as shares of the missing persons.
        left: (V, S) float64, final distributions of the persons not found.
    """

    finds: NDArray[np.float64]
    left: NDArray[np.float64]


class Outlook(Protocol):
    """What plans are expected to find from the step in which this was made."""

    def __call__(self, looks: LooksToCome) -> Expected:
        """Return what plans find with these looks."""
        ...


class TargetForecast(Protocol):
    """Advance knowledge of the persons, the same in every mission of a scenario.

    Steps of the sea count from the start of its drift; the first `first_step` of them precede the
    mission. A column is a cell of the grid with its margins, of S cells.
    """

    scenario: ResolvedScenario
    rules: Rules
    area: NDArray[np.bool_] | None
    horizon: int
    first_step: int
    padded: GridShape

    @property
    def of_pos(self) -> TargetForecast:
        """The forecast whose beliefs state the POS, this one unless its beliefs are samples.

        A searcher that goes by samples finds more of them than of the persons.
        """
        ...

    def belief(self) -> TargetBelief:
        """Return a belief at the start of a mission."""
        ...

    def column(self, cell: Cell) -> int:
        """Return the column of a cell (col, row)."""
        ...

    def cell(self, column: int) -> Cell:
        """Return the cell (col, row) of a column."""
        ...

    def most_probable(self, steps: int) -> Cell:
        """Return the most probable cell of the map after these steps of the sea, at least 1."""
        ...


class TargetBelief(Protocol):
    """The probability of the positions of the persons who have not been found.

    Attributes:
        forecast: The advance knowledge of the persons.
        step: Steps done in the mission.
        pos: Cumulative probability of success: the prior probability, regardless of the outcomes,
            that the searches so far found the person; with several persons, the expected share
            found.
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
        """Return the probability of containment of every cell, (R, C) as [y, x]."""
        ...

    def advance(self) -> None:
        """Advance the sea by one step, after the update with this step's looks."""
        ...

    def update(self, looks: Sequence[Looked]) -> None:
        """Update with looks that found nobody."""
        ...

    def observe_find(self, look: Looked) -> None:
        """Update with a look that found a person while others are still missing."""
        ...

    def futures(self, count: int, horizon: int, rng: np.random.Generator) -> Futures:
        """Return `count` futures of the missing persons, `horizon` steps long, drawn with `rng`."""
        ...

    def outlook(self, horizon: int, gamma: float) -> Outlook:
        """Return a function of what plans are expected to find from now on.

        Args:
            horizon: H, at most that of the forecast.
            gamma: Discount of a find per step.
        """
        ...

    def copy(self) -> TargetBelief:
        """Return an independent copy; the forecast is shared."""
        ...

    def reset(self) -> None:
        """Start a new mission with the prior at its first observation."""
        ...
