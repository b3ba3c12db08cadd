# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a picture of a mission shows, and the mission as text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHADES = " .:-=+*#%@"


@dataclass(frozen=True)
class MissionView:
    """What a picture of a mission shows; cells are (col, row), row 0 in the north.

    Attributes:
        probability: (G, G) float32, [row, col].
        tracks: (N, K, 2) cells of each drone, from its start to where it is now.
        alive: (N,) bool, whether the drone is still in flight.
        persons: (P, 2) cells; no rows where the persons are not to be shown.
        found: (P,) bool.
        datum: Supposed cell of the person, or None where it is not known.
        step: Steps done.
        timestep_limit: Steps the drones can do.
        cell_size_m: Side of a cell in metres.
        title: Name of the place.
        pos: Cumulative probability of success of the searches, None where it is not known.
        coverage_rate: Share of the cells to cover that are covered; None for another task.
        belief: Whether the probability is a belief, which has learned from the searches.
        area: (G, G) bool [row, col], the cells that are searched; None for all.
        searches: (G, G) int [row, col], how often each cell was searched; None where not known.
        circle: (col, row, radius) of the circle of the map in cells, None for none.
        origin: WGS84 latitude and longitude in degrees of the grid's south-west corner and its
            height in metres; None where the place is not known.
        step_s: Time of one step in seconds, None where it is not known.
        flown: Of each drone the places (M, 2) of the vehicle that flew its track, in metres east
            and north of the grid's south-west corner; empty where there are no vehicles.
    """

    probability: NDArray[np.float32]
    tracks: NDArray[np.integer[Any]]
    alive: NDArray[np.bool_]
    persons: NDArray[np.integer[Any]]
    found: NDArray[np.bool_]
    datum: tuple[int, int] | None
    step: int
    timestep_limit: int
    cell_size_m: float
    title: str = ""
    pos: float | None = None
    coverage_rate: float | None = None
    belief: bool = False
    area: NDArray[np.bool_] | None = None
    searches: NDArray[np.integer[Any]] | None = None
    circle: tuple[float, float, float] | None = None
    origin: tuple[float, float, float] | None = None
    step_s: float | None = None
    flown: tuple[NDArray[np.floating[Any]], ...] = ()

    @property
    def status(self) -> str:
        """One line: step, persons found or cells covered, drones in flight, POS."""
        time = "" if self.step_s is None else f" ({self.step * self.step_s / 60:.0f} min)"
        parts = [f"step {self.step} of {self.timestep_limit}{time}"]
        if len(self.persons):
            parts.append(f"{int(self.found.sum())} of {len(self.persons)} found")
        if self.coverage_rate is not None:
            parts.append(f"{self.coverage_rate:.1%} covered")
        parts.append(f"{int(self.alive.sum())} of {len(self.alive)} drones in flight")
        if self.pos is not None:
            parts.append(f"POS {self.pos:.1%}")
        return ", ".join(parts)

    @property
    def headline(self) -> str:
        """One line: place and status."""
        return ": ".join(filter(None, [self.title, self.status]))


def to_ansi(view: MissionView) -> str:
    """Return the mission as text: shades of probability, drones 0-9, x down, P person, F found.

    A cell outside the area is a slash.
    """
    top = float(view.probability.max()) or 1.0
    level = np.ceil(np.sqrt(view.probability / top) * (len(SHADES) - 1)).astype(int)
    rows = [[SHADES[i] for i in line] for line in level.tolist()]
    if view.area is not None:
        for row, col in np.argwhere(~view.area).tolist():
            rows[row][col] = "/"

    def put(cell: NDArray[np.integer[Any]], mark: str) -> None:
        col, row = int(cell[0]), int(cell[1])
        if 0 <= row < len(rows) and 0 <= col < len(rows):
            rows[row][col] = mark

    for cell in view.persons[~view.found]:
        put(cell, "P")
    for i, track in enumerate(view.tracks):
        put(track[-1], str(i % 10) if view.alive[i] else "x")
    # Its finder is in its cell.
    for cell in view.persons[view.found]:
        put(cell, "F")
    edge = "+" + "-" * len(rows) + "+"
    body = ["|" + "".join(row) + "|" for row in rows]
    return "\n".join([view.headline, edge, *body, edge]) + "\n"
