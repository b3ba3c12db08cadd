# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The history of one search from its messages: the page can show any step again."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterator
from enum import IntEnum
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search import HOLD
from dsse_ros.step.looks import Looks

_STEP_BYTES = 600
"""Size of a step apart from its report: states, rewards, numbers, objects."""
MAX_MAP_BYTES = 48 * 2**20
"""Size of the images of one layer; above it, every second image is dropped."""


class DroneState(IntEnum):
    """State of a drone in its search."""

    FLYING = 0
    FINDER = 1
    """The drone has found the last person."""
    OVER = 2
    """Another drone has found the last person, or all cells are covered."""
    LOST = 3
    OUT_OF_TIME = 4


class MapImages:
    """The images of one layer, by the stamps of their steps.

    Args:
        max_bytes: Largest total size.
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
        """Total size."""
        return self._bytes

    def add(self, stamp_ns: int, image: bytes) -> None:
        """Keep an image; it replaces one with the same stamp."""
        if stamp_ns not in self._images:
            insort(self._stamps, stamp_ns)
        self._bytes += len(image) - len(self._images.get(stamp_ns, b""))
        self._images[stamp_ns] = image
        while self._bytes > self._max_bytes and self.thin():
            pass

    def thin(self) -> bool:
        """Drop every second image except the first and the last one; returns whether it could."""
        dropped = self._stamps[1:-1:2]
        for stamp in dropped:
            self._bytes -= len(self._images.pop(stamp))
        self._stamps = sorted(self._images)
        return bool(dropped)

    def keep_only(self, stamp_ns: int) -> None:
        """Drop all images except that of a stamp."""
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

    A second report of a step replaces the first: one comes if a drone is lost between two steps.

    Args:
        run_id: Identity of the simulation.
        mission: Number of its mission.
        num_drones: Number of drones, N.

    Attributes:
        steps: Numbers of the known steps.
        reports: Report (N,) of each known step, with the fields of `step_report.POINT`.
        stamps_ns: Stamp of each known step.
        states: `DroneState` (N,) of the drones after each known step.
        rewards: Sum (N,) of each drone's rewards up to each known step.
        pos: (step, cumulative probability of success), in order of the steps.
        revision: Grows with every change except appending a step.
    """

    def __init__(self, run_id: int, mission: int, num_drones: int) -> None:
        self.key = (run_id, mission)
        self.num_drones = num_drones
        self.steps: list[int] = []
        self.pos: list[tuple[int, float]] = []
        self.revision = 0
        self.reports: list[NDArray[Any]] = []
        self.stamps_ns: list[int] = []
        self.states: list[NDArray[np.uint8]] = []
        self.rewards: list[NDArray[np.float64]] = []
        # Steps that completed the search, which the report of a whole mission does not contain.
        self._completed: set[int] = set()

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def nbytes(self) -> int:
        """Approximate size of all steps."""
        return len(self.reports) * (self.reports[-1].nbytes + _STEP_BYTES) if self.reports else 0

    def add(self, report: NDArray[Any], stamp_ns: int) -> None:
        """Add the report (N,) of a step."""
        step = int(report["step"][0])
        if report["all_found"].any():
            self._completed.add(step)
        i = bisect_left(self.steps, step)
        self.revision += i < len(self.steps)
        replaced = slice(i, i + (self.steps[i : i + 1] == [step]))
        self.steps[replaced], self.reports[replaced] = [step], [report]
        self.stamps_ns[replaced] = [stamp_ns]
        if i and stamp_ns < self.stamps_ns[i - 1]:
            # Mission time has restarted during the search.
            self.stamps_ns[:i] = [stamp_ns] * i
        del self.states[i:], self.rewards[i:]
        self._follow()

    def add_all(self, reports: NDArray[Any]) -> None:
        """Add the reports (K, N) of the whole search, including those that were not received."""
        self.revision += 1
        stamps = dict(zip(self.steps, self.stamps_ns, strict=True))
        self.steps = reports["step"][:, 0].tolist()
        self.reports = list(reports)
        # A step that was not received shows the map of the step before.
        known = [stamps.get(step, -1) for step in self.steps]
        self.stamps_ns = list(accumulate(known, max))
        self.states.clear()
        self.rewards.clear()
        self._follow()

    def add_pos(self, step: int, pos: float) -> None:
        """Add the cumulative probability of success after a step."""
        i = bisect_left(self.pos, (step, -1.0))
        known = i < len(self.pos) and self.pos[i][0] == step
        self.pos[i : i + known] = [(step, pos)]

    def _follow(self) -> None:
        """Compute missing states and rewards, which depend on earlier steps."""
        for i in range(len(self.states), len(self.reports)):
            row = self.reports[i]
            before = self.states[i - 1] if i else np.zeros(self.num_drones, np.uint8)
            self.states.append(_states(before, row, self.steps[i] in self._completed))
            self.rewards.append(row["reward"] + (self.rewards[i - 1] if i else 0.0))

    def index(self, step: int | None) -> int:
        """Return the index of a step, or of the last known step before it; None is the last step.

        Raises:
            IndexError: If no step is known.
        """
        if not self.steps:
            raise IndexError("no step is known")
        if step is None:
            return len(self.steps) - 1
        return max(bisect_right(self.steps, step) - 1, 0)

    def map_at(self, maps: MapImages, i: int) -> tuple[int, bytes] | None:
        """Return stamp and image of the map in known step `i`, or of the last map before it."""
        return maps.at(self.stamps_ns[i], self.stamps_ns[0])

    def pos_at(self, i: int) -> float | None:
        """Return the last probability of success up to known step `i`."""
        j = bisect_right(self.pos, (self.steps[i], 2.0)) - 1
        return self.pos[j][1] if j >= 0 else None

    @property
    def done(self) -> bool:
        """Whether no drone is in flight."""
        return bool(self.states) and bool((self.states[-1] != DroneState.FLYING).all())

    def paths(self, looks: Looks | None, since: int = 0) -> Iterator[list[int]]:
        """Yield what the map draws of each known step.

        These are the step, col, row and flags of each drone, and col and row of each cell that was
        looked at. The flags are the `DroneState`, plus 16 if the drone found a person in this step.

        Args:
            looks: The looks of the drones; None if each entered cell counts as searched.
            since: Index of the first step.
        """
        for i in range(since, len(self.steps)):
            row = self.reports[i]
            flags = self.states[i] | (row["found"] != 0) << 4
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
