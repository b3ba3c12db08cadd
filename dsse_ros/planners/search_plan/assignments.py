# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a unit does: it flies to its area, along a pattern, and back to its base if it must.

Positions are metres to the east and to the south of the grid's north-west corner. Times are seconds
since the search began.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.metres_patterns import to_south
from dsse_ros.planners.patterns import SearchPattern
from dsse_ros.planners.search_plan.rectangles import Rectangle
from dsse_ros.planners.search_plan.timed_tracks import TimedTrack, TrackSearch
from dsse_ros.search.step.polylines import along
from dsse_ros.world.sensors.lateral_range import LateralRange

Floats = NDArray[np.float64]

PARALLEL_TRACK, CREEPING_LINE = "PS", "CS"
PATTERNS = (PARALLEL_TRACK, CREEPING_LINE)
"""Patterns that are planned: legs along the long side of the area, or along the short one."""
_HALVINGS = 30
"""Of the interval in which the length of the legs is found: to less than a millimetre."""


@dataclass(frozen=True)
class SearchUnit:
    """What a unit can do.

    Attributes:
        name: Its name.
        speed_mps: Speed over ground, in transit and in search.
        base: Where it starts, and where it returns to if it has an endurance.
        ready_s: When it leaves its base.
        until_s: When it stops searching at the latest.
        on_scene_s: Longest time of its search.
        endurance_s: Longest time from its base to its base.
        lateral: How it sees what it passes.
        patterns: Some of `PATTERNS`.
        altitude_m: Height of its eyes or camera above the sea.
        turn_s: Time of each turn of its track, in which it stays where it turns and sees nothing.
        afloat: Whether its track must not cross land.
    """

    name: str
    speed_mps: float
    base: tuple[float, float]
    ready_s: float
    until_s: float
    lateral: LateralRange
    on_scene_s: float = math.inf
    endurance_s: float = math.inf
    patterns: tuple[str, ...] = PATTERNS
    altitude_m: float = 0.0
    turn_s: float = 0.0
    afloat: bool = False

    @property
    def returns(self) -> bool:
        """Whether it flies back to its base."""
        return self.endurance_s < math.inf

    @property
    def sweep_width_m(self) -> float:
        """The sweep width; that of a definite range is its width times its POD."""
        return self.lateral.sweep_width_m or 2 * self.lateral.reach_m * self.lateral.pod

    @property
    def strip_m(self) -> float:
        """Width of the strip that it sees on its path, see `strips_of`."""
        return self.lateral.sweep_width_m or 2 * self.lateral.reach_m

    @property
    def longest_m(self) -> float:
        """Length of a search track that begins at its base."""
        return self.speed_mps * min(self.on_scene_s, self.endurance_s, self.until_s - self.ready_s)


class Choice(NamedTuple):
    """What a plan chooses for a unit; the length of the legs follows from its time.

    Attributes:
        east: Centre of the area.
        south: The same.
        heading_deg: Of the first leg, clockwise from north.
        port: Whether the first turn is to port, not to starboard.
        lanes: Number of legs.
        spacing_m: Track spacing.
    """

    east: float
    south: float
    heading_deg: float
    port: bool
    lanes: int
    spacing_m: float


@dataclass(frozen=True, eq=False)
class Assignment:
    """A unit with its area and its track.

    Attributes:
        unit: The unit.
        choice: What was chosen for it.
        along_m: Side of the area along the legs.
    """

    unit: SearchUnit
    choice: Choice
    along_m: float

    @property
    def across_m(self) -> float:
        """Side of the area across the legs."""
        return self.choice.lanes * self.choice.spacing_m

    @property
    def pattern(self) -> str:
        """One of `PATTERNS`."""
        return PARALLEL_TRACK if self.along_m >= self.across_m else CREEPING_LINE

    @cached_property
    def area(self) -> Rectangle:
        """The area; its side `along` has the direction of the legs."""
        east, south, heading_deg, *_ = self.choice
        return Rectangle(east, south, heading_deg, self.along_m, self.across_m)

    @cached_property
    def search_pattern(self) -> SearchPattern:
        """The pattern, about the centre of the area."""
        short, long = sorted((self.along_m, self.across_m))
        return SearchPattern(
            pattern=self.pattern, heading=self.choice.heading_deg, length=long, width=short,
            track_spacing=self.choice.spacing_m,
            first_turn="port" if self.choice.port else "starboard",
        )  # fmt: skip

    @cached_property
    def track(self) -> Floats:
        """(K, 2) turning points; the first one is the commence search point."""
        points = to_south(self.search_pattern.track.points_m)
        return points + np.array([self.area.east, self.area.south])

    @cached_property
    def way(self) -> Floats:
        """(M, 2) from the base along the track and, if the unit returns, to the base."""
        base = np.array([self.unit.base])
        return np.concatenate([base, self.track, base[: int(self.unit.returns)]])

    @cached_property
    def timed_way(self) -> TimedTrack:
        """The way with the times of its points; a unit waits where it turns."""
        base, back = np.array([self.unit.base]), int(self.unit.returns)
        points, times = self.search.track
        return TimedTrack(
            np.concatenate([base, points, base[:back]]),
            np.concatenate([[self.unit.ready_s], times, [self.returns_s][:back]]),
        )

    @cached_property
    def search(self) -> TrackSearch:
        """The search along the track."""
        track, times = self.track, self.commences_s + along(self.track) / self.unit.speed_mps
        if self.unit.turn_s:
            number = np.arange(len(track))
            arrives = times + self.unit.turn_s * np.maximum(number - 1, 0)
            leaves = times + self.unit.turn_s * np.minimum(number, self.turns)
            track = np.repeat(track, 2, axis=0)[1:-1]
            times = np.stack([arrives, leaves], axis=1).ravel()[1:-1]
        return TrackSearch(TimedTrack(track, times), self.unit.lateral)

    @property
    def turns(self) -> int:
        """Number of its turns."""
        return 2 * (self.choice.lanes - 1)

    @property
    def length_m(self) -> float:
        """Length of the search track."""
        return self.choice.lanes * self.along_m - self.choice.spacing_m

    @cached_property
    def commences_s(self) -> float:
        """When the search begins."""
        return self.unit.ready_s + _distance(self.unit.base, self.track[0]) / self.unit.speed_mps

    @property
    def ends_s(self) -> float:
        """When it ends."""
        search_s = self.length_m / self.unit.speed_mps + self.turns * self.unit.turn_s
        return self.commences_s + search_s

    @property
    def returns_s(self) -> float:
        """When the unit is back at its base, if it returns."""
        return self.ends_s + _distance(self.unit.base, self.track[-1]) / self.unit.speed_mps

    @property
    def coverage(self) -> float:
        """Coverage factor: sweep width over track spacing."""
        return self.unit.sweep_width_m / self.choice.spacing_m


def assignment_of(unit: SearchUnit, choice: Choice) -> Assignment | None:
    """Return the assignment with the longest legs for which a unit has time.

    Returns:
        None if there is not time for legs longer than the track spacing, or the unit does not fly
        the pattern.
    """
    lanes, spacing = choice.lanes, choice.spacing_m
    heading = math.radians(choice.heading_deg)
    sin, cos = math.sin(heading), math.cos(heading)
    side = (lanes - 1) * spacing / 2 * (-1 if choice.port else 1)
    base_east, base_south = unit.base[0] - choice.east, unit.base[1] - choice.south
    # The base in the directions of the first leg and of the first turn, from the centre.
    ahead, beside = base_east * sin - base_south * cos, base_east * cos + base_south * sin
    # What it would fly in the time of its turns.
    turns_m = unit.speed_mps * unit.turn_s * 2 * (lanes - 1)
    most_m = unit.longest_m - turns_m
    allowed_m = unit.speed_mps * unit.on_scene_s
    until_m = unit.speed_mps * (unit.until_s - unit.ready_s)
    endurance_m = unit.speed_mps * unit.endurance_s

    def has_time(along: float) -> bool:
        length, half = lanes * along - spacing + turns_m, (along - spacing) / 2
        out = math.hypot(ahead + half, beside + side)
        back = math.hypot(ahead - (half if lanes % 2 else -half), beside - side)
        return (
            length <= allowed_m and out + length <= until_m and out + length + back <= endurance_m
        )

    low, high = spacing, (most_m + spacing) / lanes
    if high <= low or not has_time(low):
        return None
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if has_time(middle):
            low = middle
        else:
            high = middle
    laid = Assignment(unit, choice, low)
    if laid.pattern not in unit.patterns or low <= spacing * (1 + 1e-9):
        return None
    return laid


def _distance(a: tuple[float, float] | Floats, b: Floats) -> float:
    return math.hypot(a[0] - float(b[0]), a[1] - float(b[1]))
