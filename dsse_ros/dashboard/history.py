# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The history of one search from its messages: the page can show any step again."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterator
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search import HOLD
from dsse_ros.step.looks import Looks

_STEP_BYTES = 600
"""Of a step beside its report: states, rewards, numbers, objects."""
MAX_MAP_BYTES = 48 * 2**20
"""Size of the images of one layer; above it, every second image is dropped."""


class DroneState(IntEnum):
    """Where a drone is in its search."""

    FLYING = 0
    FINDER = 1
    """It has found the last person."""
    OVER = 2
    """Another one has, or all is covered."""
    LOST = 3
    OUT_OF_TIME = 4


class MapImages:
    """The images of a map by the stamps of their steps.

    Args:
        max_bytes: Size of all at most.
    """

    def __init__(self, max_bytes: int = MAX_MAP_BYTES) -> None:
        self._max_bytes = max_bytes
        self._stamps: list[int] = []
        self._images: dict[int, bytes] = {}
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def nbytes(self) -> int:
        """Size of all."""
        return self._bytes

    def add(self, stamp_ns: int, image: bytes) -> None:
        """Keep an image, in place of one of the same stamp."""
        if stamp_ns not in self._images:
            insort(self._stamps, stamp_ns)
        self._bytes += len(image) - len(self._images.get(stamp_ns, b""))
        self._images[stamp_ns] = image
        while self._bytes > self._max_bytes and self.thin():
            pass

    def thin(self) -> bool:
        """Drop every second image except the first and the last one; returns whether it could."""
        given_up = self._stamps[1:-1:2]
        for stamp in given_up:
            self._bytes -= len(self._images.pop(stamp))
        self._stamps = sorted(self._images)
        return bool(given_up)

    def keep_only(self, stamp_ns: int) -> None:
        """Give up all images but that of a stamp."""
        self._images = {k: image for k, image in self._images.items() if k == stamp_ns}
        self._stamps = list(self._images)
        self._bytes = sum(map(len, self._images.values()))

    def at(self, stamp_ns: int, first_ns: int) -> tuple[int, bytes] | None:
        """Return stamp and image of the last map between two stamps, both inclusive."""
        i = bisect_right(self._stamps, stamp_ns) - 1
        if i < 0 or self._stamps[i] < first_ns:
            return None
        return self._stamps[i], self._images[self._stamps[i]]


class SearchHistory:
    """The steps of one search that have been received, in order.

    A report that comes again, as when a drone is lost between two steps, replaces the earlier one.

    Args:
        run_id: Identity of the simulation.
        mission: Number of its mission.
        num_drones: Number of drones, N.

    Attributes:
        steps: Numbers of the steps known.
        pos: (step, cumulative probability of success), in order of the steps.
        revision: Grows with every change except appending a step.
    """

    def __init__(self, run_id: int, mission: int, num_drones: int) -> None:
        self.key = (run_id, mission)
        self.num_drones = num_drones
        self.steps: list[int] = []
        self.pos: list[tuple[int, float]] = []
        self.revision = 0
        self._rows: list[NDArray[Any]] = []
        self._stamps: list[int] = []
        self._states: list[NDArray[np.uint8]] = []
        self._rewards: list[NDArray[np.float64]] = []
        # Steps with which all was found or covered: the report of a whole mission does not say it.
        self._completed: set[int] = set()

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def nbytes(self) -> int:
        """Approximate size of all steps."""
        return len(self._rows) * (self._rows[-1].nbytes + _STEP_BYTES) if self._rows else 0

    def add(self, report: NDArray[Any], stamp_ns: int) -> None:
        """Take the report (N,) of a step, with the fields of `step_report.POINT`."""
        step = int(report["step"][0])
        if report["all_found"].any():
            self._completed.add(step)
        i = bisect_left(self.steps, step)
        if i < len(self.steps) and self.steps[i] == step:
            self._rows[i], self._stamps[i] = report, stamp_ns
            self.revision += 1
        else:
            self.revision += i < len(self.steps)
            self.steps.insert(i, step)
            self._rows.insert(i, report)
            self._stamps.insert(i, stamp_ns)
        if i and stamp_ns < self._stamps[i - 1]:
            # Mission time has restarted during the search.
            self._stamps[:i] = [stamp_ns] * i
        del self._states[i:], self._rewards[i:]
        self._follow()

    def add_all(self, reports: NDArray[Any]) -> None:
        """Take the reports (K, N) of the whole search, of which some may not have been received."""
        self.revision += 1
        stamps = dict(zip(self.steps, self._stamps, strict=True))
        self.steps = reports["step"][:, 0].tolist()
        self._rows = list(reports)
        self._stamps = [stamps.get(step, -1) for step in self.steps]
        last = -1
        for i, stamp in enumerate(self._stamps):
            # A step that was not received gets the stamp of the one before: it has its map.
            self._stamps[i] = last = max(stamp, last)
        self._states.clear()
        self._rewards.clear()
        self._follow()

    def add_pos(self, step: int, pos: float) -> None:
        """Take the cumulative probability of success after a step."""
        i = bisect_left(self.pos, (step, -1.0))
        if i < len(self.pos) and self.pos[i][0] == step:
            self.pos[i] = (step, pos)
        else:
            self.pos.insert(i, (step, pos))

    def _follow(self) -> None:
        """Compute what depends on earlier steps, for the steps that lack it."""
        for i in range(len(self._states), len(self._rows)):
            row = self._rows[i]
            before = self._states[i - 1] if i else np.zeros(self.num_drones, np.uint8)
            self._states.append(_states(before, row, self.steps[i] in self._completed))
            self._rewards.append(row["reward"] + (self._rewards[i - 1] if i else 0.0))

    # What was in a step

    def index(self, step: int | None) -> int:
        """Return the place of a step, or of the last one before that is known; None is the last.

        Raises:
            IndexError: If no step is known.
        """
        if not self.steps:
            raise IndexError("no step is known")
        if step is None:
            return len(self.steps) - 1
        return max(bisect_right(self.steps, step) - 1, 0)

    def report(self, i: int) -> NDArray[Any]:
        """Return the report (N,) at a place."""
        return self._rows[i]

    def states(self, i: int) -> NDArray[np.uint8]:
        """Return the `DroneState` (N,) of each drone at a place."""
        return self._states[i]

    def rewards(self, i: int) -> NDArray[np.float64]:
        """Return the sum (N,) of each drone's rewards up to a place."""
        return self._rewards[i]

    def stamp_ns(self, i: int) -> int:
        """Return the stamp of the step at a place."""
        return self._stamps[i]

    def map_at(self, maps: MapImages, i: int) -> tuple[int, bytes] | None:
        """Return stamp and image of the map at a place, or of the last one before."""
        return maps.at(self._stamps[i], self._stamps[0])

    def pos_at(self, i: int) -> float | None:
        """Return the last known probability of success at a place."""
        j = bisect_right(self.pos, (self.steps[i], 2.0)) - 1
        return self.pos[j][1] if j >= 0 else None

    @property
    def done(self) -> bool:
        """Whether no drone is left in flight."""
        return bool(self._states) and bool((self._states[-1] != DroneState.FLYING).all())

    def paths(self, looks: Looks | None, since: int = 0) -> Iterator[list[int]]:
        """Return for each place from `since` on what the map draws of the step.

        These are the step, col, row and flags of each drone, and col and row of each cell that was
        looked at. The flags are the `DroneState`, and 16 if the drone has found a person in this
        step.

        Args:
            looks: What the drones look at; None where each cell that is entered counts.
            since: First place.
        """
        for i in range(since, len(self.steps)):
            row = self._rows[i]
            flags = self._states[i] | (row["found"] != 0) << 4
            drones = np.stack([row["col"], row["row"], flags.astype(np.int16)], axis=1)
            cells = drones[:, :2].astype(np.int64)
            if looks is None:
                looked = cells[row["action"] != HOLD]
            else:
                _, _, looked = looks.at(row["action"], cells)
            yield [self.steps[i], *drones.ravel().tolist(), *looked.ravel().tolist()]


def _states(before: NDArray[np.uint8], report: NDArray[Any], completed: bool) -> NDArray[np.uint8]:
    """Return the `DroneState` (N,) after a report, from that before."""
    found, truncated = report["found"] != 0, report["truncated"] != 0
    ended = report["terminated"] != 0
    over = completed or found.any()
    how = np.where(found, DroneState.FINDER, DroneState.OVER if over else DroneState.LOST)
    now = np.where(ended, how, np.where(truncated, DroneState.OUT_OF_TIME, DroneState.FLYING))
    return np.where(before != DroneState.FLYING, before, now).astype(np.uint8)
