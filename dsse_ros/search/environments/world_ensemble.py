# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ensemble of B worlds: the shared tracks, and the track that each person follows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.step.cell_tracks import CellTracks, tracks_of
from dsse_ros.search.step.ensemble_kernels import SeaEnsemble
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario

DECIDES_TRACKS = ("vector", "person_initial_position")
"""Fields of the scenario that a reset may replace and that change the tracks."""


class WorldEnsemble:
    """The ensemble that the persons of B worlds follow.

    Args:
        scenario: The scenario.
        rules: The rules of the search.
        tracks: Tracks of the scenario.
        shape: (B, P).

    Attributes:
        tracks: The tracks, shared and therefore read-only.
        track: (B, P) int64, number of the track that each person follows.
    """

    def __init__(
        self, scenario: ResolvedScenario, rules: Rules, tracks: CellTracks, shape: tuple[int, ...]
    ) -> None:
        self._scenario = self._placed = scenario
        self._rules = rules
        self._values: dict[str, Any] = {}
        self.tracks = tracks
        self.track = np.zeros(shape, np.int64)

    @classmethod
    def of_scenario(
        cls, scenario: ResolvedScenario, rules: Rules, num_worlds: int
    ) -> WorldEnsemble | None:
        """Return the ensemble of worlds, or None if their persons do not follow one.

        Raises:
            FieldError: As `tracks_of`.
        """
        tracks = None if rules.covers else tracks_of(scenario, rules)
        if tracks is None:
            return None
        return cls(scenario, rules, tracks, (num_worlds, scenario.person_amount))

    def _tracks(self) -> CellTracks:
        tracks = tracks_of(self._placed, self._rules)
        assert tracks is not None
        return tracks

    def __getstate__(self) -> dict[str, Any]:
        # Tracks are large and follow from the scenario, so copies share them.
        return {name: value for name, value in vars(self).items() if name != "tracks"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.tracks = self._tracks()

    @property
    def arrays(self) -> SeaEnsemble:
        """The ensemble for the kernels."""
        tracks = self.tracks
        truth = tracks.truth.transpose(1, 0, 2)
        return SeaEnsemble(
            truth=truth, cumulative=tracks.cumulative, maps=tracks.maps, track=self.track,
            appearances=tracks.truth_appearances,
        )  # fmt: skip

    def place(self, replaced: dict[str, Any]) -> bool:
        """Switch to the tracks of the scenario with these fields; return whether they changed.

        Args:
            replaced: Replaced fields, as `World.placed` returns them.
        """
        values = {name: replaced[name] for name in DECIDES_TRACKS if name in replaced}
        if values == self._values:
            return False
        self._values = values
        self._placed = self._scenario.override(**values).resolve(self._rules)
        before, self.tracks = self.tracks, self._tracks()
        return self.tracks is not before

    def cells(
        self, worlds: NDArray[np.void], x: NDArray[np.int64], y: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """Return the probabilities of cells, see `World.cells`.

        Args:
            worlds: (B,) of `entities.WORLDS`.
            x: (B, K) columns.
            y: (B, K) rows.
        """
        maps = self.tracks.maps
        return cells_of_maps(maps, np.minimum(worlds["map_steps"], len(maps) - 1), x, y)


def cells_of_maps(
    maps: NDArray[Any], index: NDArray[np.int64], x: NDArray[np.int64], y: NDArray[np.int64]
) -> NDArray[Any]:
    """Return the values of cells, (B, K), 0 off the grid.

    Args:
        maps: (M, R, C) as [y, x].
        index: (B,), the map of each row of cells.
        x: (B, K) columns.
        y: (B, K) rows.
    """
    _, rows, columns = maps.shape
    inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    found = maps[index[:, np.newaxis], np.where(inside, y, 0), np.where(inside, x, 0)]
    return np.where(inside, found, maps.dtype.type(0))
