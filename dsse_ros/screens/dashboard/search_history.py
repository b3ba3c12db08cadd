# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The history of one search from its messages: the page can show any step again."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterator
from enum import IntEnum
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.fault_kernels import LOST
from dsse_ros.search.step.looks import Looks
from dsse_ros.world.scenario.frames import GridFrame, map_to_places
from msg_adapters.step_report import looked_of, path_of

LAYERS = {"probability_grid": "Map", "belief_grid": "Belief"}
"""Topics of the maps that the page can show, and their names."""
EXACT_LAYERS = {"probability": "probability_grid", "belief": "belief_grid"}
"""Topics of the exact maps, and the layers that they are of."""
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


class MapImage(NamedTuple):
    """A map.

    Attributes:
        stamp_ns: Stamp of its step.
        png: See `map_png`.
        top: Probability of its most probable cell; None if unknown.
    """

    stamp_ns: int
    png: bytes
    top: float | None = None


class MapImages:
    """The images of one layer, by the stamps of their steps.

    Args:
        max_bytes: Largest total size.
    """

    def __init__(self, max_bytes: int = MAX_MAP_BYTES) -> None:
        self._max_bytes = max_bytes
        self._stamps: list[int] = []
        self._images: dict[int, MapImage] = {}
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def nbytes(self) -> int:
        """Total size."""
        return self._bytes

    def add(self, image: MapImage) -> None:
        """Keep an image; it replaces one with the same stamp, unless only that one has a top."""
        known = self._images.get(image.stamp_ns)
        if known is None:
            insort(self._stamps, image.stamp_ns)
        elif image.top is None and known.top is not None:
            return
        self._bytes += len(image.png) - (0 if known is None else len(known.png))
        self._images[image.stamp_ns] = image
        while self._bytes > self._max_bytes and self.thin():
            pass

    def thin(self) -> bool:
        """Drop every second image except the first and the last one; returns whether it could."""
        dropped = self._stamps[1:-1:2]
        for stamp in dropped:
            self._bytes -= len(self._images.pop(stamp).png)
        self._stamps = sorted(self._images)
        return bool(dropped)

    def clear(self) -> None:
        """Drop all images."""
        self._stamps, self._images, self._bytes = [], {}, 0

    def at(self, stamp_ns: int) -> MapImage | None:
        """Return the last map up to a stamp, inclusive."""
        i = bisect_right(self._stamps, stamp_ns) - 1
        return None if i < 0 else self._images[self._stamps[i]]


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
        maps: Maps of its steps, by layer.
        pos: (step, cumulative probability of success), in order of the steps.
        revision: Grows with every change except appending a step.
    """

    def __init__(self, run_id: int, mission: int, num_drones: int) -> None:
        self.key = (run_id, mission)
        self.num_drones = num_drones
        self.steps: list[int] = []
        self.maps = {layer: MapImages() for layer in LAYERS}
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
        """Approximate size of all steps and maps."""
        of_step = self.reports[-1].nbytes + _STEP_BYTES if self.reports else 0
        return of_step * len(self.reports) + sum(maps.nbytes for maps in self.maps.values())

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
            for maps in self.maps.values():
                maps.clear()
        del self.states[i:], self.rewards[i:]
        self._follow()

    def add_all(self, reports: NDArray[Any]) -> None:
        """Add the reports (K, N) of the whole search, including those that were not received."""
        self.revision += 1
        stamps = dict(zip(self.steps, self.stamps_ns, strict=True))
        received = dict(zip(self.steps, self.reports, strict=True))
        self.steps = reports["step"][:, 0].tolist()
        # Reports of a step have more fields.
        self.reports = [
            received.get(step, report) for step, report in zip(self.steps, reports, strict=True)
        ]
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

    def collided_with(self, i: int, drone: int) -> list[int]:
        """Return the drones with which a drone that is lost in known step `i` has collided.

        They were lost in the same step and cell, and not by a fault.
        """
        states = self.states
        k = bisect_left(states, True, hi=i, key=lambda state: bool(state[drone] == DroneState.LOST))
        row = self.reports[k]
        together = (states[k] == DroneState.LOST) & (row["col"] == row["col"][drone])
        together &= row["row"] == row["row"][drone]
        if k:
            together &= states[k - 1] != DroneState.LOST
        if has_field(row, "status"):
            together &= row["status"] != LOST
        others = np.flatnonzero(together).tolist()
        return [neighbour for neighbour in others if neighbour != drone] if together[drone] else []

    def add_map(self, layer: str, image: MapImage) -> None:
        """Add the map of a known step; a map of no known step is ignored."""
        if image.stamp_ns in self.stamps_ns[bisect_left(self.stamps_ns, image.stamp_ns) :][:1]:
            self.maps[layer].add(image)

    def step_at(self, stamp_ns: int) -> int | None:
        """Return the first known step with a stamp or a later one, None if there is none."""
        i = bisect_left(self.stamps_ns, stamp_ns)
        return self.steps[i] if i < len(self.steps) else None

    def map_at(self, layer: str, i: int) -> MapImage | None:
        """Return the map in known step `i`, or the last one before it."""
        return self.maps[layer].at(self.stamps_ns[i])

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
            cells = np.stack([row["col"], row["row"]], axis=1).astype(np.int64)
            drones = np.column_stack([cells, self._flags(i)])
            if looks is None:
                looked = cells[row["action"] != NO_ACTION]
            elif has_field(row, "look_action"):
                at = np.stack([row["look_col"], row["look_row"]], axis=1).astype(np.int64)
                _, _, looked = looks.at(row["look_action"], at)
            else:
                _, _, looked = looks.at(row["action"], cells)
            yield [self.steps[i], *drones.ravel().tolist(), *looked.ravel().tolist()]

    def flights(self, frame: GridFrame, since: int = 0) -> Iterator[list[Any]]:
        """Yield what the map draws of each known step in metres.

        These are the step, col, row and flags of each drone as in `paths`, with fractions between
        cells, and a list of its heading, radians clockwise from north, whether it looked, 0 or 1,
        on each leg of its path (None if on all), and col and row of each place on it since the step
        before; only two None if the report does not state these.

        Args:
            frame: The grid.
            since: Index of the first step.
        """
        for i in range(since, len(self.steps)):
            row, entry = self.reports[i], [self.steps[i]]
            x_m, y_m = row["x"].astype(np.float64), row["y"].astype(np.float64)
            places = np.stack(map_to_places(frame, x_m, y_m), axis=1).round(3).tolist()
            for (col, line), flags in zip(places, self._flags(i).tolist(), strict=True):
                entry += [col, line, flags]
            yield [*entry, *_flown(row, frame)]

    def _flags(self, i: int) -> NDArray[np.int64]:
        """Return the flags (N,) of the drones in known step `i`, see `paths`."""
        return self.states[i].astype(np.int64) | (self.reports[i]["found"] != 0) << 4


def _flown(report: NDArray[Any], frame: GridFrame) -> list[list[Any]]:
    """Return heading, looks and path of each drone, see `SearchHistory.flights`."""
    if not has_field(report, "heading"):
        return [[None, None] for _ in report]
    between = (path_of(report)[:, 1:-1] / frame.cell_size_m - 0.5).round(3)
    looked = looked_of(report)
    return [
        [
            round(heading, 3),
            None if looked is None else looked[n, 1:].astype(int).tolist(),
            *between[n].ravel().tolist(),
        ]
        for n, heading in enumerate(report["heading"].tolist())
    ]


def has_field(report: Any, name: str) -> bool:
    """Return whether a report has a field, which those of a whole mission may lack."""
    return name in (report.dtype.names or ())


def _states(before: NDArray[np.uint8], report: NDArray[Any], completed: bool) -> NDArray[np.uint8]:
    """Return the `DroneState` (N,) after a report, from that before."""
    found, truncated = report["found"] != 0, report["truncated"] != 0
    ended = report["terminated"] != 0
    over = completed or found.any()
    how = np.where(found, DroneState.FINDER, DroneState.OVER if over else DroneState.LOST)
    now = np.where(ended, how, np.where(truncated, DroneState.OUT_OF_TIME, DroneState.FLYING))
    return np.where(before != DroneState.FLYING, before, now).astype(np.uint8)
