# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planner that flies each drone along its own route and looks at each cell on it."""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.avoidance import resolve_conflicts_with_yielding
from dsse_ros.planners.masking import is_under_way, masked_moves
from dsse_ros.planners.mission_watch import MissionWatch
from dsse_ros.planners.planner import (
    Cell,
    Infos,
    Observations,
    Plans,
    as_plan,
    cells_of,
    probability_of,
)
from dsse_ros.world.scenario.actions import ActionSet
from dsse_ros.world.scenario.swarm import Swarm

MAX_WAIT = 2
"""Turns that a drone waits for a blocked cell before it steps aside."""

RouteLayout: TypeAlias = Callable[
    [Sequence[Cell], NDArray[np.float32], Sequence[ActionSet]], Sequence[Sequence[Cell]]
]
"""Maps the drones' cells, the map (R, C) and the actions of each drone to one route per drone, none
empty. `RoutePlanner` flies them."""


@dataclass
class RouteProgress:
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

    def skip_unreachable(self, actions: ActionSet, cell: Cell) -> None:
        """Advance to a cell of the route that a drone with these actions can reach."""
        for _ in range(2 * len(self.route)):
            if actions.distance(cell, self.goal) >= 0:
                return
            self.advance()

    def advance(self) -> None:
        """Go on to the next goal; turn back at the end of the route."""
        self.index += self.stride
        if not 0 <= self.index < len(self.route):
            self.finished = True
            self.stride = -self.stride
            self.index = min(max(self.index + 2 * self.stride, 0), len(self.route) - 1)


class RouteGuidance:
    """Flies each drone along its route: to the next cell, search there, and on.

    Drones that look in passing do not stop to search.

    A drone that has searched its whole route waits for the others, flying next to the route's end
    without searching. When all live drones have finished, each flies its route backwards, and so on
    back and forth.

    Two drones never enter the same cell: a drone whose path is blocked searches where it is, and
    steps aside after `MAX_WAIT` turns.

    Args:
        swarm: What the drones can do.
        seed: Seed for the choice of the cell to step aside to.
        in_passing: Whether drones look at the cells that they enter.

    Attributes:
        drawn: See `Shareable`.

    Raises:
        ValueError: If a straight move is missing.
    """

    def __init__(self, swarm: Swarm, *, seed: int = 0, in_passing: bool = False) -> None:
        self._swarm = swarm.with_moves()
        self._in_passing, self._seed = in_passing, seed
        self._rng = np.random.default_rng(seed)
        self._shuffled: list[int] = []
        self.drawn = False
        self._tracks: dict[Hashable, RouteProgress] = {}
        self._grid = GridShape(0, 0)
        self._swept = False

    def copy(self) -> RouteGuidance:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._rng, twin._tracks = copy.deepcopy((self._rng, self._tracks))
        twin._shuffled = list(self._shuffled)
        return twin

    def with_seed(self, seed: int) -> RouteGuidance:
        """Return a copy that draws with this seed."""
        twin = self.copy()
        twin._seed, twin._rng = seed, np.random.default_rng(seed)
        for length in self._shuffled:
            twin._rng.shuffle([0] * length)
        return twin

    def plans(self) -> Plans:
        """See `Planning`; the plan of a drone is the rest of its route."""
        return {
            agent: as_plan(track.route[track.index :: track.stride])
            for agent, track in self._tracks.items()
        }

    def has_routes(self, agents: Collection[Hashable]) -> bool:
        """Return whether each of these drones has a route."""
        return self._tracks.keys() >= set(agents)

    def start(
        self, agents: Sequence[Hashable], routes: Sequence[Sequence[Cell]], grid: GridShape
    ) -> None:
        """Begin a mission with one route for each drone, on a grid of this shape."""
        self._rng, self._shuffled = np.random.default_rng(self._seed), []
        self._grid = grid
        self._tracks = {a: RouteProgress(route) for a, route in zip(agents, routes, strict=True)}
        self._swept = False

    def next_cells(
        self,
        agents: Sequence[Hashable],
        present: Sequence[Cell],
        under_way: Collection[Hashable] = (),
        left: NDArray[np.float32] | None = None,
    ) -> list[Cell]:
        """Return the next cell of each drone; its present cell means a search there.

        Args:
            agents: The live drones.
            present: Their cells.
            under_way: Drones that take no commands.
            left: (R, C), what is left to cover: drones skip the covered cells of their routes. None
                if they search.
        """
        tracks = [self._tracks[agent] for agent in agents]
        actions = self._swarm.actions_of(agents)
        self._skip(tracks, actions, present, left)
        self._swept = self._swept or all(track.finished for track in tracks)
        requested: list[Cell | None] = []
        ways: dict[int, Cell] = {}
        exits: dict[int, list[Cell]] = {}
        for drone, (agent, track, cell) in enumerate(zip(agents, tracks, present, strict=True)):
            if agent in under_way:
                requested.append(cell)
                continue
            end = self._request(track, actions[drone], cell)
            requested.append(end)
            if end is None:
                ways[drone] = self._way_out(track, actions[drone], cell)
                exits[drone] = self._exits(actions[drone], cell, ways[drone])
        granted = self._resolved(present, requested, exits)
        # If all drones take their preferred exit, the random order of the others does not matter.
        self.drawn = self.drawn or any(
            present[drone] == way or granted[drone] != way for drone, way in ways.items()
        )
        for track, request, end in zip(tracks, requested, granted, strict=True):
            blocked = request is not None and request != end
            track.waited = track.waited + 1 if blocked else 0
        return granted

    def _skip(
        self,
        tracks: Sequence[RouteProgress],
        actions: Sequence[ActionSet],
        present: Sequence[Cell],
        left: NDArray[np.float32] | None,
    ) -> None:
        """Skip the cells of routes that need no visit, or to which no moves lead."""
        if left is None and all(able.two_way for able in self._swarm.of_kinds):
            return
        for track, able, cell in zip(tracks, actions, present, strict=True):
            if left is not None:
                track.skip_covered(left)
            if not able.two_way:
                track.skip_unreachable(able, cell)

    def _request(self, track: RouteProgress, actions: ActionSet, cell: Cell) -> Cell | None:
        """Return the cell that a drone wants to be in next; None if it only makes room."""
        if track.finished and not self._swept:
            return None
        if cell == track.goal:
            track.advance()
            if not self._in_passing:
                return cell
            if track.finished and not self._swept:
                return None
        return None if track.waited >= MAX_WAIT else actions.towards(cell, track.goal)

    def _way_out(self, track: RouteProgress, actions: ActionSet, cell: Cell) -> Cell:
        """Return the cell that a drone which makes room would rather be in next."""
        if not track.finished or self._swept:
            return actions.towards(cell, track.goal)
        # At the route's last cell, go to the one before it: a drone keeps moving.
        holding = track.route[-1] if cell != track.route[-1] else track.goal
        return actions.towards(cell, holding)

    def _exits(self, actions: ActionSet, cell: Cell, ahead: Cell) -> list[Cell]:
        """Return the neighbouring cells, the one ahead first, without the drone's own cell."""
        others = actions.neighbours(cell, self._grid)
        self._rng.shuffle(others)
        self._shuffled.append(len(others))
        return others if ahead == cell else [ahead, *(c for c in others if c != ahead)]

    def _resolved(
        self,
        present: Sequence[Cell],
        requested: Sequence[Cell | None],
        exits: Mapping[int, Sequence[Cell]],
    ) -> list[Cell]:
        """Return the next cell of each drone; see `resolve_conflicts_with_yielding`."""
        if self._swarm.may_be_under_way:
            # A cell with another drone in it may stay occupied.
            occupied = set(present)
            requested = [
                cell if end in occupied else end
                for cell, end in zip(present, requested, strict=True)
            ]
            exits = {n: [c for c in cells if c not in occupied] for n, cells in exits.items()}
        return resolve_conflicts_with_yielding(present, requested, exits)


class RoutePlanner:
    """Flies routes; a `Planner`.

    It lays them out at the first observation of a mission, and again if a new agent appears.

    Args:
        layout: Lays out the routes.
        swarm: What the drones can do.
        watch: Recognizes a mission's first observation.
        seed: See `RouteGuidance`.
        covers: Whether the task is to cover cells.
        in_passing: See `RouteGuidance`.

    Raises:
        ValueError: If a straight move is missing.
    """

    def __init__(
        self, layout: RouteLayout, swarm: Swarm, watch: MissionWatch | None = None, *,
        seed: int = 0, covers: bool = False, in_passing: bool = False,
    ) -> None:  # fmt: skip
        self._layout = layout
        self._swarm, self._watch = swarm, watch or MissionWatch()
        self._covers = covers
        self._guidance = RouteGuidance(swarm, seed=seed, in_passing=in_passing)

    @property
    def drawn(self) -> bool:
        """See `Shareable`."""
        return self._guidance.drawn

    def copy(self) -> RoutePlanner:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._watch, twin._guidance = self._watch.copy(), self._guidance.copy()
        return twin

    def with_seed(self, seed: int) -> RoutePlanner:
        """Return a copy that draws with this seed."""
        twin = self.copy()
        twin._guidance = self._guidance.with_seed(seed)
        return twin

    def plans(self) -> Plans:
        """See `Planning`."""
        return self._guidance.plans()

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        if not observations:
            return {}
        agents, present = list(observations), cells_of(observations)
        probability = probability_of(observations)
        is_new = self._watch.is_new(observations, infos)
        if is_new or not self._guidance.has_routes(agents):
            routes = self._layout(present, probability, self._swarm.actions_of(agents))
            self._guidance.start(agents, routes, GridShape.of(probability))
        under_way = [agent for agent in agents if is_under_way(infos.get(agent, {}))]
        left = probability if self._covers else None
        ends = self._guidance.next_cells(agents, present, under_way, left)
        return masked_moves(dict(zip(agents, present, strict=True)), ends, infos, self._swarm)
