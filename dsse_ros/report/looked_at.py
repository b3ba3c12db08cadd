# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The cells that the drones of a record looked at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsse_ros.report.drone_places import flown_over
from dsse_ros.report.of_vehicles import numbers_of
from dsse_ros.step.looks import looks_of
from dsse_ros.step.viewpoints import NO_LOOK, viewpoints_at

if TYPE_CHECKING:
    from dsse_ros.report.record import RecordedMission


def viewpoints_in(record: RecordedMission) -> NDArray[np.void]:
    """Return from where drones on cells looked, (K, N) of `viewpoints.VIEWPOINTS`.

    That is where their vehicles were, if vehicles flew the mission.
    """
    if record.looks is not None:
        return record.looks
    done = np.where(record.acted, numbers_of(record.actions, record.rules.actions), NO_LOOK)
    return viewpoints_at(done, record.cells[..., 0], record.cells[..., 1])


def looks_in(record: RecordedMission) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return `looked_at` and `pods_of_looks` of a record."""
    if record.covers:
        step, drone = np.nonzero(record.searched)
        pod = record.scenario.probability_of_detection
        looked = np.column_stack([step, drone, record.cells[step, drone]])
        return looked, np.full((len(step), 1), pod)
    if record.rules.in_metres:
        cells = flown_over(record.places, record.acted, record.grid_size)
        return cells, np.zeros((len(cells), record.scenario.person_amount))
    looks, parts = looks_of(record.scenario, record.rules), [np.empty((0, 4), np.int64)]
    pods, views = [np.empty((0, looks.pods.shape[1]))], viewpoints_in(record)
    for n in range(views.shape[1]):
        for action in range(len(record.rules.actions)):
            done = np.flatnonzero(views["action"][:, n] == action)
            at = np.stack([views["x"][done, n], views["y"][done, n]], axis=1)
            for look in looks.numbers(n, action):
                cells = at + looks.offsets[look]
                parts.append(np.column_stack([done, np.full_like(done, n), cells]))
                pods.append(np.repeat(looks.pods[look : look + 1], len(done), axis=0))
    looked = np.concatenate(parts)
    off_grid = ((looked[:, 2:] < 0) | (looked[:, 2:] >= record.grid_size)).any(axis=1)
    order = np.lexsort((looked[:, 1], looked[:, 0]))
    order = np.setdiff1d(order, np.flatnonzero(off_grid), assume_unique=True)
    return looked[order], np.concatenate(pods)[order]
