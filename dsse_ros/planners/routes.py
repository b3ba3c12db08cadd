# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planner that flies each drone along its own route and searches each cell on it."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.avoidance import resolve_conflicts_with_yielding
from dsse_ros.planners.masking import is_under_way, masked_moves
from dsse_ros.planners.planner import Cell, Infos, Observations, cells_of, probability_of
from dsse_ros.scenario.actions import ActionSet

MAX_WAIT = 2
"""Turns that a drone waits for a blocked cell before it steps aside."""

RoutePlan: TypeAlias = Callable[
    [Sequence[Cell], NDArray[np.float32], ActionSet], Sequence[Sequence[Cell]]
]
"""Maps the drones' cells, the map (G, G) and the actions to one route per drone, none empty."""


@dataclass
class Track:
    """Progress of one drone along its route, which it flies back and forth."""

    route: Sequence[Cell]
    index: int = 0
    stride: int = 1
    finished: bool = False
    """Whether the drone has searched the whole route once."""
    waited: int = 0
    """Turns spent in front of a blocked cell."""

    @property
    def goal(self) -> Cell:
        """The next cell to search."""
        return self.route[self.index]

    def skip_covered(self, left: NDArray[np.float32]) -> None:
        """Advance to the next cell of the route where probability is left, or to its end."""
        while not self.finished and left[self.goal[1], self.goal[0]] <= 0:
            self.advance()

    def advance(self) -> None:
        """Go on to the next goal; turn back at the end of the route."""
        self.index += self.stride
        if not 0 <= self.index < len(self.route):
            self.finished = True
            self.stride = -self.stride
            self.index = min(max(self.index + 2 * self.stride, 0), len(self.route) - 1)


class RouteFollower:
    """Flies each drone along its route: to the next cell, search there, and on.

    It plans the routes from the first observation. A drone that has searched its whole route
    waits for the others, flying next to the route's end without searching. When all live drones
    have finished, each flies its route backwards, and so on back and forth.

    Two drones never enter the same cell: a drone whose path is blocked searches where it is, and
    steps aside after `MAX_WAIT` turns. The planner makes new routes if a new agent appears.

    In coverage tasks, where a drone covers each cell that it enters, it flies over the cells of its
    route that are left to cover, without a search.

    Args:
        plan: Makes the routes.
        actions: Names of the actions by number.
        seed: Seed for the choice of the cell to step aside to.
        area: (G, G) bool [row, col], the cells to search; None for the whole grid.
        covers: Whether the task is to cover cells.
        apart: Whether drones may be slow to leave their cells, see `masking.keep_apart`.

    Attributes:
        drawn: See `SharedPlanner`.

    Raises:
        ValueError: If search or a straight move is missing.
    """

    def __init__(
        self,
        plan: RoutePlan,
        actions: Sequence[str],
        *,
        seed: int = 0,
        area: NDArray[np.bool_] | None = None,
        covers: bool = False,
        apart: bool = False,
    ) -> None:
        self._plan = plan
        self._apart = apart
        self._covers = covers
        self._actions = ActionSet(actions, area).with_moves()
        self._rng = np.random.default_rng(seed)
        self._shuffled: list[int] = []
        self.drawn = False
        self._tracks: dict[str, Track] = {}
        self._size = 0
        self._swept = False

    def copy(self) -> RouteFollower:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._rng, twin._tracks = copy.deepcopy((self._rng, self._tracks))
        twin._shuffled = list(self._shuffled)
        return twin

    def with_seed(self, seed: int) -> RouteFollower:
        """Return a copy that draws with this seed."""
        twin = self.copy()
        twin._rng = np.random.default_rng(seed)
        for length in self._shuffled:
            twin._rng.shuffle([0] * length)
        return twin

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        if not observations:
            return {}
        present = cells_of(observations)
        if not observations.keys() <= self._tracks.keys():
            self._start(list(observations), present, probability_of(observations))
        tracks = [self._tracks[agent] for agent in observations]
        if self._covers:
            left = probability_of(observations)
            for track in tracks:
                track.skip_covered(left)
        self._swept = self._swept or all(track.finished for track in tracks)

        requested: list[Cell | None] = []
        exits: dict[int, list[Cell]] = {}
        ways: dict[int, Cell] = {}
        for drone, (agent, track, cell) in enumerate(
            zip(observations, tracks, present, strict=True)
        ):
            if is_under_way(infos.get(agent, {})):
                requested.append(cell)
            elif track.finished and not self._swept:
                ways[drone] = self._actions.towards(cell, self._holding_cell(track, cell))
                exits[drone] = self._exits(cell, ways[drone])
                requested.append(None)
            elif cell == track.goal:
                track.advance()
                requested.append(cell)
            elif track.waited >= MAX_WAIT:
                ways[drone] = self._actions.towards(cell, track.goal)
                exits[drone] = self._exits(cell, ways[drone])
                requested.append(None)
            else:
                requested.append(self._actions.towards(cell, track.goal))

        if self._apart:
            # A cell with another drone in it may stay occupied.
            occupied = set(present)
            free = [
                cell if end in occupied else end
                for cell, end in zip(present, requested, strict=True)
            ]
            exits = {n: [c for c in cells if c not in occupied] for n, cells in exits.items()}
            granted = resolve_conflicts_with_yielding(present, free, exits)
        else:
            granted = resolve_conflicts_with_yielding(present, requested, exits)
        # If all drones take their preferred exit, the random order of the others does not matter.
        self.drawn = self.drawn or any(
            present[drone] == way or granted[drone] != way for drone, way in ways.items()
        )
        for track, request, end in zip(tracks, requested, granted, strict=True):
            blocked = request is not None and request != end
            track.waited = track.waited + 1 if blocked else 0
        cells = dict(zip(observations, present, strict=True))
        return masked_moves(cells, granted, infos, self._actions, apart=self._apart)

    def _start(
        self, agents: Sequence[str], cells: Sequence[Cell], probability: NDArray[np.float32]
    ) -> None:
        self._size = len(probability)
        routes = self._plan(cells, probability, self._actions)
        self._tracks = {a: Track(route) for a, route in zip(agents, routes, strict=True)}
        self._swept = False

    @staticmethod
    def _holding_cell(track: Track, cell: Cell) -> Cell:
        """Return the route's last cell or, once there, the one before it: a drone keeps moving."""
        return track.route[-1] if cell != track.route[-1] else track.goal

    def _exits(self, cell: Cell, ahead: Cell) -> list[Cell]:
        """Return the neighbouring cells, the one ahead first, without the drone's own cell."""
        others = self._actions.neighbours(cell, self._size)
        self._rng.shuffle(others)
        self._shuffled.append(len(others))
        return others if ahead == cell else [ahead, *(c for c in others if c != ahead)]
