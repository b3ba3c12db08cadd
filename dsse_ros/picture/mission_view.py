# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contents of a picture of a mission, and the mission as text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.scenario.sea_state import SeaState

SHADES = " .:-=+*#%@"


@dataclass(frozen=True)
class MissionView:
    """The contents of a picture of a mission; cells are (col, row), row 0 in the north.

    Attributes:
        probability: (R, C) float32, [row, col].
        tracks: (N, K, 2) cells of each drone, from its start to its present cell; in metres
            float64 places on its path, with fractions between cells.
        alive: (N,) bool, whether the drone is still in flight.
        persons: (P, 2) cells; no rows if persons are hidden.
        found: (P,) bool.
        datum: Supposed cell of the person, None if unknown.
        step: Steps done.
        timestep_limit: Steps the drones can do.
        cell_size_m: Side of a cell in metres.
        title: Name of the place.
        pos: Cumulative probability of success of the searches, None if unknown.
        coverage_rate: Share of the cells to cover that are covered; None for another task.
        belief: Whether the probability is a belief, updated with the searches.
        area: (R, C) bool [row, col], the searched cells; None for all.
        searches: (R, C) int [row, col], number of searches of each cell; None if unknown.
        waits: (R, C) int [row, col], number of steps in which a drone waited in each cell: it
            searched where nobody could be. None if unknown.
        circle: (col, row, radius) of the circle of the map in cells, None for none.
        origin: WGS84 latitude and longitude in degrees of the grid's south-west corner and its
            height in metres; None if the place is unknown.
        step_s: Time of one step in seconds, None if unknown.
        flown: For each drone, the positions (M, 2) of the vehicle that flew its track, in metres
            to the east and north of the grid's south-west corner; empty without vehicles.
        legs: Legs of a track in each step.
        looked: (N, K - 1) bool, whether a drone in metres looked on each leg of its track; None if
            all did.
        headings: (N,) float64, headings of the drones in metres, radians clockwise from north;
            None if unknown.
        strips_m: Width of the strip that each drone in metres sees on its path; empty if drones
            move from cell to cell.
        sea: Wind, current, shore and sightings.
        ending: How the search ended, see `ending`; empty while it goes on.
    """

    probability: NDArray[np.float32]
    tracks: NDArray[Any]
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
    waits: NDArray[np.integer[Any]] | None = None
    circle: tuple[float, float, float] | None = None
    origin: tuple[float, float, float] | None = None
    step_s: float | None = None
    flown: tuple[NDArray[np.floating[Any]], ...] = ()
    legs: int = 1
    looked: NDArray[np.bool_] | None = None
    headings: NDArray[np.float64] | None = None
    strips_m: tuple[float, ...] = ()
    sea: SeaState = SeaState()
    ending: str = ""

    @property
    def status(self) -> str:
        """One line: step, persons found or cells covered, drones in flight or the end, POS."""
        elapsed = "" if self.step_s is None else f"{self.step * self.step_s / 60:.0f} min"
        time = ", ".join(filter(None, [elapsed, self.sea.time]))
        parts = [
            f"step {min(self.step, self.timestep_limit)} of {self.timestep_limit}"
            + (f" ({time})" if time else "")
        ]
        if len(self.persons) > bool(self.ending):
            parts.append(f"{int(self.found.sum())} of {len(self.persons)} found")
        if self.coverage_rate is not None:
            parts.append(f"{self.coverage_rate:.1%} covered")
        in_flight = f"{int(self.alive.sum())} of {len(self.alive)} drones in flight"
        parts.append(self.ending or in_flight)
        if self.pos is not None:
            parts.append(f"POS {self.pos:.1%}")
        return ", ".join(parts)

    @property
    def headline(self) -> str:
        """One line: place and status."""
        return ": ".join(filter(None, [self.title, self.status]))


def ending(
    step: int, finders: Sequence[str], *, persons: int = 1, covered: bool = False,
    out_of_time: bool = False,
) -> str:  # fmt: skip
    """Return in words how a search has ended.

    Args:
        step: Steps done.
        finders: Names of the drones that found a person in the last step.
        persons: Number of persons.
        covered: Whether the task was to cover the cells, and all are covered.
        out_of_time: Whether the search reached its time limit.
    """
    steps = f"{step} step" + "s" * (step != 1)
    if finders:
        whom = "person" if persons == 1 else "last person"
        return f"{whom} found after {steps} by {' and '.join(finders)}"
    if covered:
        return f"all covered after {steps}"
    return f"search over: {'out of time' if out_of_time else 'all drones lost'}"


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

    def put(cell: NDArray[Any], mark: str) -> None:
        col, row = round(float(cell[0])), round(float(cell[1]))
        if 0 <= row < len(rows) and 0 <= col < len(rows[0]):
            rows[row][col] = mark

    for cell in view.persons[~view.found]:
        put(cell, "P")
    for i, track in enumerate(view.tracks):
        put(track[-1], str(i % 10) if view.alive[i] else "x")
    # The drone that found a person is in the same cell.
    for cell in view.persons[view.found]:
        put(cell, "F")
    edge = "+" + "-" * len(rows[0]) + "+"
    body = ["|" + "".join(row) + "|" for row in rows]
    return "\n".join([view.headline, edge, *body, edge]) + "\n"
