# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where a belief has its probability at a time: particles of an ensemble, or centres of cells.

Positions are metres to the east and to the north in the map frame. Times are seconds since the
search began.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.belief.belief import Forecast
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.belief.motion_kernels import MARGIN
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.frames import cell_centre

NEAREST = 64
"""Particles that show where the sea takes what floats among them."""
NEAREST_M = 1e-3
"""Least distance from a line."""
COVERED = 8
"""Particles that a report covers, however exact it is: fewer would be chance."""
Points = NDArray[np.float64]


class Places:
    """The places of a forecast.

    Args:
        forecast: The forecast.

    Attributes:
        forecast: As given.
    """

    def __init__(self, forecast: Forecast | EnsembleForecast) -> None:
        self.forecast = forecast
        self._scenario = scenario = forecast.scenario
        self._step_s = scenario.step_duration_s
        self._cells: Points | None = None
        if isinstance(forecast, Forecast):
            rows, cols = np.divmod(np.arange(forecast.padded.cells), forecast.padded.columns)
            self._cells = np.stack(
                cell_centre(scenario.grid_size, scenario.cell_size, cols - MARGIN, rows - MARGIN),
                axis=1,
            ).astype(np.float64)
        # The floats of the last time: several reports are of one time.
        self._last: tuple[float, Points] | None = None

    @property
    def count(self) -> int:
        """Number of places, M."""
        forecast = self.forecast
        return forecast.padded.cells if isinstance(forecast, Forecast) else len(forecast.weights)

    @property
    def are_particles(self) -> bool:
        """Whether places are particles, which keep their numbers as they move."""
        return self._cells is None

    def at(self, time_s: float) -> Points:
        """Return the places at a time, (M, 2); before the sea begins and after its end, as then."""
        if self._cells is not None:
            return self._cells
        if self._last is None or self._last[0] != time_s:
            assert isinstance(self.forecast, EnsembleForecast)
            tracks = self.forecast.positions
            row = min(max(self.forecast.first_step + time_s / self._step_s, 0.0), len(tracks) - 1)
            before = min(int(row), len(tracks) - 2)
            share = row - before
            between = (1.0 - share) * tracks[before] + share * tracks[before + 1]
            self._last = time_s, between.astype(np.float64)
        return self._last[1]

    def in_cell(self, cell: Cell, step: int) -> NDArray[np.int64]:
        """Return the numbers of the places in a cell (col, row) after `step` steps of the mission.

        Nobody is detected off the grid, so no place is there.
        """
        forecast = self.forecast
        if not self._scenario.grid_size.holds(*cell):
            return np.zeros(0, np.int64)
        column = forecast.column(cell)
        if isinstance(forecast, Forecast):
            return np.array([column])
        cells = forecast.cells[forecast.row(forecast.first_step + step)]
        return np.flatnonzero(forecast.columns(cells) == column)

    def moved(self, x_m: float, y_m: float, from_s: float, to_s: float) -> tuple[float, float]:
        """Return where the sea takes what floats at a place, forward or back in time."""
        if abs(to_s - from_s) < 1e-9:
            return x_m, y_m
        if self._cells is not None:
            east, south = self._scenario.drift
            steps = (to_s - from_s) / self._step_s * self._scenario.cell_size
            return x_m + steps * east, y_m - steps * south
        before = self.at(from_s)
        away = np.hypot(before[:, 0] - x_m, before[:, 1] - y_m)
        count = min(NEAREST, len(away))
        near = np.argpartition(away, count - 1)[:count]
        dx, dy = (self.at(to_s)[near] - before[near]).mean(axis=0).tolist()
        return x_m + dx, y_m + dy

    def density(self, time_s: float, x_m: float, y_m: float, radius_m: float) -> Points:
        """Return the density of a report of a position, by where its object really is.

        Args:
            time_s: Time of the report.
            x_m: Metres to the east.
            y_m: Metres to the north.
            radius_m: Standard deviation along each axis, see `spread_m`.

        Returns:
            (M,) 1/m^2.
        """
        variance = self.spread_m(time_s, x_m, y_m, radius_m) ** 2
        squared = self._squared(time_s, x_m, y_m)
        return np.asarray(np.exp(-squared / (2.0 * variance)) / (2.0 * math.pi * variance))

    def spread_m(self, time_s: float, x_m: float, y_m: float, radius_m: float) -> float:
        """Return the standard deviation with which a report counts along each axis.

        That of a position in its cell is added; among particles it is at least the distance to the
        eighth. Arguments are those of `density`.
        """
        if not self.are_particles:
            return math.sqrt(radius_m**2 + self._scenario.cell_size**2 / 12.0)
        squared = self._squared(time_s, x_m, y_m)
        last = min(COVERED, len(squared)) - 1
        return max(radius_m, math.sqrt(np.partition(squared, last)[last]))

    def _squared(self, time_s: float, x_m: float, y_m: float) -> NDArray[np.float64]:
        dx, dy = (self.at(time_s) - (x_m, y_m)).T
        return np.asarray(dx**2 + dy**2)


def inside(points: Points, rings: list[Points]) -> NDArray[np.bool_]:
    """Return which points (M, 2) are in a polygon; its second and further rings are holes."""
    x, y = points.T
    within = np.zeros(len(points), np.bool_)
    for ring in rings:
        for (x0, y0), (x1, y1) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            if y0 == y1:
                continue
            crosses = (y0 <= y) != (y1 <= y)
            within ^= crosses & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    return within


def from_piece(points: Points, start: Points, end: Points) -> NDArray[np.float64]:
    """Return the distances (M,) of points from a straight piece of a line."""
    along = end - start
    squared = float(along @ along)
    share = np.zeros(len(points))
    if squared > 0.0:
        share = np.clip((points - start) @ along / squared, 0.0, 1.0)
    return np.asarray(np.hypot(*(points - start - share[:, None] * along).T))


def inverse_cubes(points: Points, start: Points, end: Points) -> NDArray[np.float64]:
    """Return the integrals (M,) of the inverse cube of the distance from points along a piece.

    That of the inverse cube law of detection is W^2 / (8 pi) times it, W the sweep width.
    """
    length = math.hypot(*(end - start))
    if length == 0.0:
        return np.zeros(len(points))
    ahead, aside = (end - start) / length, np.array([start[1] - end[1], end[0] - start[0]]) / length
    beside = np.maximum(np.abs((points - start) @ aside), NEAREST_M)
    before = (points - start) @ ahead

    def until(way: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(way / (beside**2 * np.hypot(way, beside)))

    return until(length - before) - until(-before)
