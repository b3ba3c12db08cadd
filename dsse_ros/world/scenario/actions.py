# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The actions of a search by number: their names and moves."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.shortest_paths import ShortestPaths
from dsse_ros.world.searchers.searcher import Searcher
from dsse_ros.world.sensors.sensor import SEARCH

Cell = tuple[int, int]
"""(col, row): col grows to the east, row to the south."""

ACTION_VECTORS: dict[str, tuple[int, int]] = {
    "left": (-1, 0),
    "right": (1, 0),
    "up": (0, -1),
    "down": (0, 1),
    "up_left": (-1, -1),
    "up_right": (1, -1),
    "down_left": (-1, 1),
    "down_right": (1, 1),
    SEARCH: (0, 0),
}
"""Move of each action in cells (dx to the east, dy to the south)."""

STRAIGHT = ("left", "right", "up", "down")
DIAGONAL = ("up_left", "up_right", "down_left", "down_right")


class ActionSet:
    """Actions by number, and the routes over the grid that their moves allow; none in metres.

    Routes use diagonal moves if all four are possible, or if a straight one is not. An action with
    an unknown name stays in its cell and is never chosen.

    Args:
        names: Names of the actions; the index is the action number.
        area: (R, C) bool [row, col], the cells that moves may enter; None for the whole grid.
        able: Names of the actions that a drone can do besides `search`, see `of_kind`; None for
            all.

    Attributes:
        names: The names.
        area: As given.
        moves: Move (dx, dy) of each action in cells, to the east and to the south.
        search: Number of the action `search`; -1 without actions.
        able: Whether the drone can do each action.
        steps: Moves that routes use, straight ones first.
        diagonal: Whether routes may change both coordinates at each move.

    Raises:
        ValueError: If the action `search` is missing.
    """

    def __init__(
        self,
        names: Iterable[str],
        area: NDArray[np.bool_] | None = None,
        able: Collection[str] | None = None,
    ) -> None:
        self.names = tuple(names)
        self.area = area
        if self.names:
            self._check(SEARCH)
        self.moves = tuple(ACTION_VECTORS.get(name, (0, 0)) for name in self.names)
        self.search = self.names.index(SEARCH) if self.names else -1
        self.able = tuple(able is None or name in (*able, SEARCH) for name in self.names)
        known = {name for name, can in zip(self.names, self.able, strict=True) if can}
        straight = [name for name in STRAIGHT if name in known]
        diagonal = [name for name in DIAGONAL if name in known]
        crosses = able is None or len(straight) == len(STRAIGHT)
        self.diagonal = crosses and len(diagonal) == len(DIAGONAL)
        usable = straight if crosses and not self.diagonal else [*straight, *diagonal]
        able_to = (*usable, SEARCH) if self.names else ()
        self._number = {ACTION_VECTORS[name]: self.names.index(name) for name in able_to}
        self.steps = tuple(ACTION_VECTORS[name] for name in usable)
        self._paths = None if area is None else ShortestPaths(area, self.steps)

    def __len__(self) -> int:
        return len(self.names)

    def __str__(self) -> str:
        """All actions with their numbers, for messages to users."""
        return ", ".join(f"{number} {name}" for number, name in enumerate(self.names))

    def _check(self, *needed: str) -> None:
        missing = [name for name in needed if name not in self.names]
        if missing:
            raise ValueError(f"actions: {', '.join(missing)} missing in {list(self.names)!r}")

    def within(self, area: NDArray[np.bool_] | None) -> ActionSet:
        """Return the actions of the rules restricted to an area."""
        return ActionSet(self.names, area)

    def of_kind(self, kind: Searcher, grid: GridShape) -> ActionSet:
        """Return these actions without those that a kind of drone cannot do.

        Routes go without their moves.

        Args:
            kind: The kind of drone.
            grid: Its shape.
        """
        able = [name for name in self.names if kind.can_do(name)]
        if len(able) == len(self.names):
            return self
        area = self.area
        if area is None and not {*STRAIGHT} <= {*able}:
            # Distances have a closed form only if a drone can fly in all directions.
            area = np.ones(grid.matrix, np.bool_)
        return ActionSet(self.names, area, able)

    def with_moves(self) -> ActionSet:
        """Return these actions after checking that they reach every cell of a grid.

        Raises:
            ValueError: If one of the four straight moves is missing.
        """
        self._check(*STRAIGHT)
        return self

    def action(self, start: Cell, end: Cell) -> int:
        """Return the action number of the move from a cell to its neighbour, search if equal."""
        return self._number[end[0] - start[0], end[1] - start[1]]

    def end(self, cell: Cell, number: int) -> Cell:
        """Return the cell in which an action ends, on the grid or off it."""
        (col, row), (dx, dy) = cell, self.moves[number]
        return col + dx, row + dy

    def ends(self, cells: Iterable[Cell], numbers: Iterable[int]) -> list[Cell]:
        """Return the cell in which each action ends."""
        return [self.end(cell, number) for cell, number in zip(cells, numbers, strict=True)]

    def towards(self, start: Cell, goal: Cell) -> Cell:
        """Return the cell one step closer to the goal, or the goal itself once there.

        The step is diagonal while both axes differ. Without diagonal moves it is along the axis
        with the larger difference, or along the row if they are equal. If that cell is not on a
        shortest path within the area, return one that is. If no path leads to the goal, return the
        present cell.
        """
        (col, row), (goal_col, goal_row) = start, goal
        d_col, d_row = goal_col - col, goal_row - row
        if not self.diagonal:
            if abs(d_col) >= abs(d_row):
                d_row = 0
            else:
                d_col = 0
        straight = col + (d_col > 0) - (d_col < 0), row + (d_row > 0) - (d_row < 0)
        return straight if self._paths is None else self._paths.next_cell(start, goal, straight)

    def distance(self, start: Cell, end: Cell) -> int:
        """Return the number of moves between two cells, -1 without a path."""
        if self._paths is not None:
            return int(self._paths.distances_to(end)[start[1], start[0]])
        d_col, d_row = abs(start[0] - end[0]), abs(start[1] - end[1])
        return max(d_col, d_row) if self.diagonal else d_col + d_row

    def distances(
        self, cell: Cell, grid: GridShape, *, as_if_open: bool = False
    ) -> NDArray[np.int32]:
        """Return the `distance` from a cell to each cell of a grid.

        Args:
            cell: The cell.
            grid: Its shape.
            as_if_open: Whether to measure as if nothing but the rules limited the moves.

        Returns:
            (R, C) [row, col].
        """
        if self._paths is not None and not as_if_open:
            return self._paths.distances_from(cell)
        cols, rows = (np.arange(size, dtype=np.int32) for size in grid)
        across, down = abs(cols - cell[0])[np.newaxis], abs(rows - cell[1])[:, np.newaxis]
        return np.maximum(across, down) if self.diagonal else across + down

    def neighbours(self, cell: Cell, grid: GridShape) -> list[Cell]:
        """Return the cells one move away, within a grid and the area."""
        col, row = cell
        cells = [
            (col + d_col, row + d_row)
            for d_col, d_row in self.steps
            if grid.holds(col + d_col, row + d_row)
        ]
        return cells if self.area is None else [(x, y) for x, y in cells if self.area[y, x]]

    @property
    def reaches_all(self) -> bool:
        """Whether moves lead from each cell of the grid to every other cell."""
        return self._paths is None

    @property
    def two_way(self) -> bool:
        """Whether each path can be flown in both directions."""
        return self._paths is None or self._paths.two_way

    def reachable(self, cell: Cell) -> NDArray[np.bool_] | None:
        """Return the cells to which moves lead from a cell on the grid.

        Returns:
            (R, C) bool [row, col], none for a cell outside the area; None for the whole grid.
        """
        return None if self._paths is None else self._paths.distances_from(cell) >= 0


def connected_components(
    actions: Sequence[ActionSet], cells: Sequence[Cell]
) -> list[tuple[list[int], NDArray[np.bool_] | None]]:
    """Group drones by the cells that they can reach.

    A drone observed outside the area is alone, in a component without cells.

    Args:
        actions: Actions of each drone.
        cells: Cell of each drone, on the grid.

    Returns:
        For each component, the indices of its drones and its cells (R, C) bool [row, col], None for
        the whole grid.
    """
    components: list[tuple[list[int], NDArray[np.bool_] | None]] = []
    left = list(range(len(cells)))
    if all(able.reaches_all for able in actions):
        return [(left, None)]
    while left:
        first, *others = left
        component = actions[first].reachable(cells[first])
        members = [first]
        for drone in others:
            alike = actions[drone] is actions[first] and actions[drone].two_way
            if _reaches_the_same(actions[drone], cells[drone], component, alike):
                members.append(drone)
        components.append((members, component))
        left = [drone for drone in others if drone not in members]
    return components


def _reaches_the_same(
    actions: ActionSet, cell: Cell, component: NDArray[np.bool_] | None, alike: bool
) -> bool:
    """Return whether a drone can reach the cells of a component, and no others.

    Args:
        actions: Actions of the drone.
        cell: Cell of the drone.
        component: Cells that another drone can reach.
        alike: Whether both drones have the same actions, and paths lead both ways.
    """
    if component is None:
        return actions.reachable(cell) is None
    if not component[cell[1], cell[0]]:
        return False
    if alike:
        return True
    reached = actions.reachable(cell)
    return reached is not None and np.array_equal(reached, component)
