# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The looks of a step of a live search, which found nobody, and what they do to a belief."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.mission.live.places import Places, from_piece
from dsse_ros.search.belief.belief import Belief
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief, EnsembleForecast, PathsFlown
from dsse_ros.search.step.looks import Looked, Looks
from dsse_ros.search.step.metres_detection import DEFINITE
from dsse_ros.world.scenario.frames import flip_y

AnyBelief = Belief | EnsembleBelief
Look = tuple[int, int]
"""Number of the step, and of the drone or `evidence.NOBODY`."""


class StepLooks(NamedTuple):
    """The looks of a step.

    Attributes:
        drones: (Q,) int64, the drone of each look at a cell.
        numbers: (Q,) int64, numbers of `looks.Looks`.
        cells: (Q, 2) int64, cells (col, row).
        paths: (N, K + 1, 2) float64, of `PathsFlown`; no rows unless drones fly in metres.
        looked: (N, K + 1) bool, of `PathsFlown`.
        flown: (N,) bool, of `PathsFlown`.
    """

    drones: NDArray[np.int64]
    numbers: NDArray[np.int64]
    cells: NDArray[np.int64]
    paths: NDArray[np.float64]
    looked: NDArray[np.bool_]
    flown: NDArray[np.bool_]

    def of_drones(self, drones: NDArray[np.bool_]) -> StepLooks:
        """Return the looks of these drones (N,) only."""
        kept = drones[self.drones] if len(self.drones) else np.zeros(0, bool)
        return self._replace(
            drones=self.drones[kept], numbers=self.numbers[kept], cells=self.cells[kept],
            flown=self.flown & drones if len(self.flown) else self.flown,
        )  # fmt: skip

    def has(self, drone: int) -> bool:
        """Return whether a drone looked."""
        return bool((self.drones == drone).any()) or bool(
            drone < len(self.flown) and self.flown[drone] and self.looked[drone].any()
        )


@dataclass(frozen=True)
class Sensors:
    """What the drones of a search see.

    Attributes:
        looks: Their looks at cells.
        detectors: (K, A) of `metres_detection.DETECTORS`, how each kind sees in passing; None over
            cells.
        cell_m: Side of a cell.
        step_s: Duration of a step.
        grid_size: Columns and rows of the grid.
    """

    looks: Looks
    detectors: NDArray[np.void] | None
    cell_m: float
    step_s: float
    grid_size: GridShape

    @property
    def count(self) -> int:
        """Number of drones, N."""
        return len(self.looks.kind)

    def apply(self, belief: AnyBelief, done: StepLooks) -> None:
        """Update a belief with looks that found nobody, before `advance`."""
        if self.detectors is not None and isinstance(belief, EnsembleBelief):
            belief.update_in_passing(self._paths_of(done))
        else:
            belief.update(
                [
                    Looked((col, row), self.looks.pods[number])
                    for number, (col, row) in zip(
                        done.numbers.tolist(), done.cells.tolist(), strict=True
                    )
                ]
            )

    def _paths_of(self, done: StepLooks) -> PathsFlown:
        assert self.detectors is not None
        nobody = np.zeros(len(done.flown), np.bool_)
        return PathsFlown(
            self.detectors, self.looks.kind, done.paths, done.flown, nobody, done.looked
        )

    def missed(self, places: Places, done: StepLooks, look: Look) -> NDArray[np.float64]:
        """Return the probability, 1 - POD, that a look misses somebody at each place, (M,).

        The persons of a live search have one POD.

        Args:
            places: The places.
            done: The looks of the step.
            look: The look.
        """
        step, drone = look
        if self.detectors is not None:
            assert isinstance(places.forecast, EnsembleForecast)
            return places.forecast.missed_in_passing(step, self._paths_of(done), drone)
        missed = np.ones(places.count)
        appearances = (
            places.forecast.appearances if isinstance(places.forecast, EnsembleForecast) else None
        )
        for k in np.flatnonzero(done.drones == drone).tolist():
            col, row = done.cells[k].tolist()
            here, pods = places.in_cell((col, row), step), self.looks.pods[done.numbers[k]]
            missed[here] *= 1.0 - (pods[0] if appearances is None else pods[appearances[here]])
        return missed

    def false_density(
        self, done: StepLooks, drone: int, place: tuple[float, float], spread_m: float
    ) -> float:
        """Return the density at a place of the reports of a false alarm in a step, 1/m^2.

        What raises it is anywhere in the cells that the drone looked at, or beside its path.

        Args:
            done: The looks of the step.
            drone: The drone.
            place: Metres to the east and north in the map frame.
            spread_m: Standard deviation of the reports along each axis.
        """
        if self.detectors is not None:
            length_m, width_m = self._strip(done, drone)
            return 1.0 / (width_m * (length_m + math.pi / 4 * width_m))
        return float(self._shares(done, drone, place, spread_m).mean()) / self.cell_m**2

    def share_seen(
        self, done: StepLooks, drone: int, place: tuple[float, float], spread_m: float
    ) -> float:
        """Return how much of a report lies where a drone looked in a step, from 0 to 1.

        Args:
            done: The looks of the step.
            drone: The drone.
            place: Metres to the east and north in the map frame.
            spread_m: Standard deviation of the report along each axis, above 0.
        """
        if self.detectors is None:
            return min(float(self._shares(done, drone, place, spread_m).sum()), 1.0)
        east, north = place
        at = np.array([[east, flip_y(self.grid_size.rows * self.cell_m, north)]])
        path = done.paths[drone]
        pieces = zip(path[:-1], path[1:], strict=True)
        away_m = min(float(from_piece(at, start, end)[0]) for start, end in pieces)
        _, width_m = self._strip(done, drone)
        low = np.array([(-away_m - width_m / 2) / spread_m])
        return float(normal_between(low, width_m / spread_m)[0])

    def _shares(
        self, done: StepLooks, drone: int, place: tuple[float, float], spread_m: float
    ) -> NDArray[np.float64]:
        """Return how much of a report lies in each cell that a drone looked at in a step."""
        col, row = done.cells[done.drones == drone].T
        along = [
            normal_between((low * self.cell_m - at) / spread_m, self.cell_m / spread_m)
            for low, at in zip((col, self.grid_size.rows - 1 - row), place, strict=True)
        ]
        return along[0] * along[1]

    def _strip(self, done: StepLooks, drone: int) -> tuple[float, float]:
        """Return length and width of the strip beside the path of a drone that it sweeps."""
        assert self.detectors is not None
        detector, path = self.detectors[self.looks.kind[drone], 0], done.paths[drone]
        length_m = max(float(np.hypot(*np.diff(path, axis=0).T).sum()), 1.0)
        width_m = 2.0 * float(detector["reach"])
        if detector["law"] != DEFINITE:
            # Its rate is W^2 v / (8 pi).
            width_m = math.sqrt(8.0 * math.pi * float(detector["rate"]) * self.step_s / length_m)
        return length_m, width_m


def normal_between(low: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """Return the probability of a standard normal value between low and low + width."""
    return np.array([(math.erf((at + width) / math.sqrt(2)) - math.erf(at / math.sqrt(2))) / 2
                     for at in low.tolist()])  # fmt: skip
