# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The belief about persons who follow an ensemble: weights of its particles.

A failed search removes the probability of detection from the particles in its cell, and the rest is
scaled up. With time the particles move along their tracks. The filter is exact for the particles;
its only error is that M particles approximate the model.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief import particle_kernels, search_outcomes
from dsse_ros.belief.belief_kernels import MARGIN
from dsse_ros.belief.protocol import Expected, Futures, LooksToCome
from dsse_ros.scenario.actions import Cell
from dsse_ros.scenario.probable_cells import most_probable
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.step.constants import area_of, constants_of
from dsse_ros.step.looks import Looked
from dsse_ros.step.sea_tracks import tracks_of


class EnsembleForecast:
    """The particles of a scenario, known in advance for a whole mission; a `TargetForecast`.

    After the last step of the tracks nothing moves.

    Args:
        scenario: The scenario; it is resolved with the rules.
        rules: The rules of the search; persons must follow an ensemble.
        horizon: Number of steps after the present one that are available.

    Attributes:
        constants: (1,) of `constants.CONSTANTS`.
        area: The searched cells, see `kernels`.
        first_step: Steps of the sea before a mission's first observation.
        side: S, columns and rows of the grid with its margins.
        cells: (T, M, 2) int16, cells (x, y) of the particles by step of the sea.
        weights: (M,) float64, weights of the particles.
        maps: (T, G, G) float32, see `SeaTracks`.

    Raises:
        FieldError: If the ensemble would take too much memory.
    """

    def __init__(self, scenario: Scenario, rules: Rules, *, horizon: int = 0) -> None:
        self.scenario = resolved = scenario.resolve(rules)
        self.rules = rules
        self.horizon = horizon
        self.constants = constants_of(resolved, rules)
        self.area, _ = area_of(resolved)
        self.first_step = resolved.pre_search_steps + rules.reset_sea_steps
        tracks = tracks_of(resolved, rules)
        if tracks is None:
            raise ValueError(f"person_motion: {rules.person_motion!r} is not an ensemble")
        self.cells, self.weights, self.maps = tracks.particles, tracks.weights, tracks.maps
        self.side = resolved.grid_size + 2 * MARGIN

    @cached_property
    def columns(self) -> NDArray[np.int32]:
        """(T, M) int32, `cells` as columns; a particle off the grid is in the nearest margin."""
        # The outermost cells stay empty.
        within = np.clip(self.cells, 1 - MARGIN, self.side - MARGIN - 2).astype(np.int32) + MARGIN
        columns: NDArray[np.int32] = within[..., 1] * self.side + within[..., 0]
        return columns

    def row(self, step: int) -> int:
        """Return the index of a step of the sea in the tracks."""
        return min(step, len(self.cells) - 1)

    def belief(self) -> EnsembleBelief:
        """Return a belief at the start of a mission."""
        return EnsembleBelief(self)

    def column(self, cell: Cell) -> int:
        """Return the column of a cell (col, row)."""
        return (cell[1] + MARGIN) * self.side + cell[0] + MARGIN

    def cell(self, column: int) -> Cell:
        """Return the cell (col, row) of a column."""
        row, col = divmod(column, self.side)
        return col - MARGIN, row - MARGIN

    def most_probable(self, steps: int) -> Cell:
        """Return the most probable cell of the map that drones observe after these steps."""
        return most_probable(self.maps[self.row(steps)], 1)[0]


class EnsembleBelief:
    """The weights of the particles of one mission; a `TargetBelief`.

    Persons with the same POD are one detection class: all start alike and move independently. Finds
    do not identify the person found; see `search_outcomes` for searches for several persons.

    Args:
        forecast: The particles. Beliefs may share one.

    Attributes:
        step: Steps done in the mission.
        pos: Cumulative probability of success, see `TargetBelief`.
        class_of: (n,) int64, the detection class of each person.
        examples: (C,) int64, number of a person of each class.
        missing: (n,) float64, probability that a person is missing; 1 for a single person.
        unfound: (n,) float64, the same, regardless of the outcomes of the searches.
        weights: (C, M) float64, see `particle_kernels`; they sum to 1.
    """

    def __init__(self, forecast: EnsembleForecast) -> None:
        self.forecast = forecast
        scenario = forecast.scenario
        _, self.examples, self.class_of = np.unique(
            scenario.person_pod_multipliers, return_index=True, return_inverse=True
        )
        self.class_of = self.class_of.ravel()
        self.missing, self.unfound = np.ones((2, scenario.person_amount))
        self._numbers = np.zeros((search_outcomes.OF_CLASS, len(self.examples)))
        self._scale = np.zeros(len(self.examples))
        self.weights = np.zeros((len(self.examples), len(forecast.weights)))
        self.reset()

    def reset(self) -> None:
        """Start a new mission with the weights of the ensemble."""
        self.step = 0
        self.pos = 0.0
        self.missing[:] = self.unfound[:] = 1.0
        shares = np.bincount(self.class_of) / len(self.class_of)
        self.weights[:] = shares[:, None] * self.forecast.weights

    def copy(self) -> EnsembleBelief:
        """Return an independent copy; the forecast is shared."""
        twin = copy.copy(self)
        twin.weights = self.weights.copy()
        twin.missing, twin.unfound = self.missing.copy(), self.unfound.copy()
        return twin

    def mean_pod(self, pods: NDArray[np.float64]) -> float:
        """Return the mean of these PODs, (n,) by person, over the persons who are missing."""
        return float(self.missing @ pods / self.missing.sum())

    def of_missing(self) -> NDArray[np.float64]:
        """Return the weights of the persons who are missing, (C, M); they sum to 1."""
        if len(self.examples) == 1:
            return self.weights
        search_outcomes.weigh_classes(self.class_of, self.missing, self._scale)
        return self.weights * self._scale[:, None]

    def _cells(self) -> NDArray[np.int16]:
        """Return the present cells of the particles, (M, 2)."""
        return self.forecast.cells[self.forecast.row(self.forecast.first_step + self.step)]

    def advance(self) -> None:
        """Advance the sea by one step, after the update with this step's looks."""
        self.step += 1

    def update(self, looks: Sequence[Looked]) -> None:
        """Update with looks that found nobody.

        If no weight is left, because no particle is possible any more, the weights restart from
        those of the ensemble.
        """
        self._learn(looks, failed=len(looks))

    def observe_find(self, look: Looked) -> None:
        """Update with a look that found a person while others are still missing."""
        self._learn([look], failed=0)

    def _learn(self, looks: Sequence[Looked], *, failed: int) -> None:
        """Update with looks, of which the first `failed` found nobody."""
        if not looks:
            return
        self.pos = particle_kernels.learn_looks(
            self.forecast.constants, self._cells(), self.weights, self.forecast.weights,
            self.class_of, self.missing, self.unfound, self.pos, self._numbers,
            np.empty_like(self.missing), np.array([look.cell for look in looks], np.int64),
            np.arange(len(looks)), np.array([look.pods[self.examples] for look in looks]),
            failed, len(looks),
        )  # fmt: skip

    def poc(self) -> NDArray[np.float64]:
        """Return the probability of containment of every cell, (G, G) as [y, x].

        Probability outside the grid or the area is in no cell.
        """
        g = self.forecast.scenario.grid_size
        out = np.empty((g, g))
        particle_kernels.write_poc(
            self.forecast.constants, self.forecast.area, self._cells(), self.weights,
            self.class_of, self.missing, self._scale, out,
        )  # fmt: skip
        return out

    @property
    def outside(self) -> float:
        """The probability of containment outside the grid and the area."""
        x, y = self._cells().astype(np.int64).T
        g, area = self.forecast.scenario.grid_size, self.forecast.area
        inside = (x >= 0) & (x < g) & (y >= 0) & (y < g)
        if area is not None:
            inside[inside] = area[y[inside], x[inside]]
        return float(self.of_missing()[:, ~inside].sum())

    def futures(self, count: int, horizon: int, rng: np.random.Generator) -> Futures:
        """Draw futures of the missing persons: tracks of particles, by their weights.

        Sampling is systematic: each particle gets its share of the futures, rounded up or down.

        Args:
            count: M.
            horizon: H; after the last step of the tracks nothing moves.
            rng: Generator of the draws.
        """
        sums = np.cumsum(self.of_missing())
        wanted = (np.arange(count) + rng.random()) * (sums[-1] / count)
        # Rounding may put the last draw beyond the end, or on a particle of weight 0.
        last = int(np.searchsorted(sums, sums[-1]))
        drawn = np.minimum(np.searchsorted(sums, wanted, side="right"), last)
        of_class, particle = np.divmod(drawn, len(self.forecast.weights))
        cells = self._columns(horizon)[:, particle].astype(np.int64)
        return Futures(np.ascontiguousarray(cells), self.examples[of_class])

    def expect(self, looks: LooksToCome, horizon: int, gamma: float) -> Expected:
        """Return the expected finds of future looks, exactly for the particles.

        Args:
            looks: Looks in the next `horizon` steps.
            horizon: H.
            gamma: Discount of a find per step.
        """
        left = np.empty(self.forecast.side**2)
        finds = particle_kernels.expect_particles(
            self._columns(horizon), self.of_missing(), looks.steps, looks.columns,
            np.ascontiguousarray(looks.pods[:, self.examples]), gamma,
            self.forecast.scenario.grid_size, left,
        )  # fmt: skip
        return Expected(float(finds), left)

    def _columns(self, horizon: int) -> NDArray[np.int32]:
        """Return the columns of the particles now and in the next H steps, (H + 1, M)."""
        forecast = self.forecast
        first = forecast.first_step + self.step
        rows = np.minimum(np.arange(first, first + horizon + 1), len(forecast.columns) - 1)
        return forecast.columns[rows]
