# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Persons who follow tracks of an ensemble, and the map of its particles, compiled.

`ensemble` is the `SeaEnsemble` of one world. Other arguments are as in `sea_map`. The functions are
inlined, because a call would pass every array of the ensemble.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.draws import draw_unit
from dsse_ros.base.compiled.jit import inlined, part
from dsse_ros.search.step.constants import Constants
from dsse_ros.search.step.entities import Area, Map, Records, WorldRecord
from dsse_ros.world.targets.sea_map import drift, grid_of, is_inside

FAR = 30000
"""Limit for the distance of cells from the grid's corner, so that they fit into 16 bits. It is off
any grid."""


class SeaEnsemble(NamedTuple):
    """The ensemble of a scenario, for B worlds or for one: then `track` has no first axis B.

    Attributes:
        truth: (M, T, 2) int16, cells (x, y) of the tracks that persons follow, by step of the sea;
            nobody is found off the grid or outside the area. The steps of a track are neighbours
            in memory, because a world reads one track.
        cumulative: (M,) float64, cumulative probabilities of these tracks.
        maps: (T, R, C) float32 as [y, x], the probability of each cell by another draw from the
            same model; probability outside the grid and the area is in no cell.
        track: (B, P) int64, number of the track that each person follows.
        appearances: (M,) int8, number of the appearance of the object on each track.
    """

    truth: NDArray[np.int16]
    cumulative: NDArray[np.float64]
    maps: NDArray[np.float32]
    track: NDArray[np.int64]
    appearances: NDArray[np.int8]


@part
def ensemble_of(ensemble: SeaEnsemble | None, b: int) -> SeaEnsemble | None:
    """Return the ensemble of world b; None if persons move step by step."""
    if ensemble is None:
        return None
    return SeaEnsemble(
        truth=ensemble.truth,
        cumulative=ensemble.cumulative,
        maps=ensemble.maps,
        track=ensemble.track[b],
        appearances=ensemble.appearances,
    )


@inlined
def step_of(world: WorldRecord, ensemble: SeaEnsemble) -> int:
    """Return the step of the sea; after the last one of the tracks nothing moves."""
    return min(world.map_steps, len(ensemble.maps) - 1)


@inlined
def put_on_tracks(world: WorldRecord, persons: Records, ensemble: SeaEnsemble) -> None:
    """Put each person at the start of a track, drawn by the weights."""
    cumulative = ensemble.cumulative
    for p in range(len(persons)):
        drawn = draw_unit(world) * cumulative[-1]
        low, high = 0, len(cumulative) - 1
        while low < high:
            middle = (low + high) // 2
            if cumulative[middle] > drawn:
                high = middle
            else:
                low = middle + 1
        ensemble.track[p] = low
        persons[p].x = np.int64(ensemble.truth[low, 0, 0])
        persons[p].y = np.int64(ensemble.truth[low, 0, 1])


@inlined
def ensemble_step(
    constants: Constants, world: WorldRecord, persons: Records, area: Area, ensemble: SeaEnsemble
) -> None:
    """Advance datum and persons by one step; found persons stay where they are."""
    drift(constants, world, area)
    world.circle_x, world.circle_y = world.datum_x, world.datum_y
    world.map_steps += 1
    step = step_of(world, ensemble)
    for p in range(len(persons)):
        if persons[p].found and not constants.found_persons_stay:
            continue
        track = ensemble.track[p]
        persons[p].x = np.int64(ensemble.truth[track, step, 0])
        persons[p].y = np.int64(ensemble.truth[track, step, 1])


@inlined
def pod_column(ensemble: SeaEnsemble | None, num_persons: int, p: int) -> int:
    """Return the column of `Looks.pods` for person p, by what it looks like."""
    if ensemble is None:
        return p
    return int(ensemble.appearances[ensemble.track[p]]) * num_persons + p


@inlined
def probability_in(
    constants: Constants, world: WorldRecord, ensemble: SeaEnsemble, x: int, y: int
) -> float:
    """Return the probability of the cell (x, y), 0 outside the grid and the area."""
    if not is_inside(grid_of(constants), x, y):
        return 0.0
    return np.float64(ensemble.maps[step_of(world, ensemble), y, x])


@inlined
def write_present(world: WorldRecord, ensemble: SeaEnsemble, out: Map) -> None:
    """Write the map (R, C) float32, out[y, x]."""
    step = step_of(world, ensemble)
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            out[j, i] = ensemble.maps[step, j, i]
