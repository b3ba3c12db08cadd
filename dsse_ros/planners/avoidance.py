# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Collision avoidance: chooses the next cells of all drones at once, never two drones in one.

Drones move at the same time, so a drone may enter a cell that another leaves, and two may
swap. A drone that stays cannot give way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from dsse_ros.planners.planner import Cell
from dsse_ros.world.scenario.actions import ActionSet


def resolve_conflicts(present: Sequence[Cell], requested: Sequence[Cell]) -> list[Cell]:
    """Return the next cell of each drone: the one it requests, or its present one.

    If several drones request a cell, the drone that stays there gets it, else the first one. The
    others stay where they are, which can block the drones behind them in turn.

    Args:
        present: Cell of each drone, all different.
        requested: Present or neighbouring cell that each drone should be in next.
    """
    granted = list(requested)
    owner: dict[Cell, int] = {}
    unchecked = list(range(len(granted)))
    for drone in unchecked:
        cell = granted[drone]
        holder = owner.setdefault(cell, drone)
        if holder == drone:
            continue
        refused = drone
        if cell == present[drone]:
            owner[cell] = drone
            refused = holder
        if granted[refused] != present[refused]:
            granted[refused] = present[refused]
            unchecked.append(refused)
    return granted


def resolve_actions(
    actions: ActionSet, present: Sequence[Cell], numbers: Sequence[int]
) -> list[int]:
    """Return the actions, with a search for each drone that `resolve_conflicts` refuses.

    Args:
        actions: The actions.
        present: Cell of each drone, all different.
        numbers: Number of each drone's action.
    """
    requested = actions.ends(present, numbers)
    granted = resolve_conflicts(present, requested)
    return [
        number if end == wanted else actions.search
        for number, wanted, end in zip(numbers, requested, granted, strict=True)
    ]


def approach(
    actions: Sequence[ActionSet], present: Sequence[Cell], goals: Sequence[Cell]
) -> list[Cell]:
    """Return each drone's next cell towards its goal.

    A drone stays if this is another drone's present or already chosen cell.

    Args:
        actions: Actions of each drone.
        present: Cell of each drone.
        goals: Goal of each drone.
    """
    taken, ends = set(present), []
    for able, cell, goal in zip(actions, present, goals, strict=True):
        end = able.towards(cell, goal)
        ends.append(cell if end in taken else end)
        taken.add(ends[-1])
    return ends


def resolve_conflicts_with_yielding(
    present: Sequence[Cell],
    requested: Sequence[Cell | None],
    exits: Mapping[int, Sequence[Cell]],
) -> list[Cell]:
    """Return the next cell of each drone when some drones only have to make room.

    The function first resolves the conflicts among the drones that request a cell. The others
    then move to one of their exits, to the first free one if possible, and stay only if they have
    no way out. A drone that requested the cell of a drone that must stay also stays.

    Args:
        present: Cell of each drone, all different.
        requested: As for `resolve_conflicts`; None for a drone that makes room.
        exits: Cells that a drone can move to, by the index of each drone that makes room.
    """
    requests = {drone: cell for drone, cell in enumerate(requested) if cell is not None}
    yielding = [drone for drone, cell in enumerate(requested) if cell is None]
    if not yielding:
        return resolve_conflicts(present, list(requests.values()))
    granted = list(present)
    occupied = {present[drone] for drone in yielding}
    while True:
        movers = list(requests)
        resolved = resolve_conflicts([present[drone] for drone in movers], list(requests.values()))
        placed = _make_room(yielding, present, exits, set(resolved))
        entering = [d for d, cell in zip(movers, resolved, strict=True) if cell in occupied]
        if len(placed) == len(yielding) or not entering:
            break
        requests.update((drone, present[drone]) for drone in entering)
        # Without a collision rule, several drones can be in one cell: handle each cell once.
        occupied -= {present[drone] for drone in entering}
    for drone, cell in (*zip(movers, resolved, strict=True), *placed.items()):
        granted[drone] = cell
    return granted


def _make_room(
    drones: Sequence[int],
    present: Sequence[Cell],
    exits: Mapping[int, Sequence[Cell]],
    taken: set[Cell],
) -> dict[int, Cell]:
    """Give as many drones as possible a free exit of their own, and the others their own cell."""
    options = {drone: list(exits[drone]) for drone in drones}
    held: dict[int, Cell] = {}
    holder: dict[Cell, int] = {}
    left = [drone for drone in drones if not _place(drone, options, held, holder, taken)]
    if left:
        for drone in drones:
            options[drone].append(present[drone])
        for drone in left:
            _place(drone, options, held, holder, taken)
    return held


def _place(
    drone: int,
    options: Mapping[int, Iterable[Cell]],
    held: dict[int, Cell],
    holder: dict[Cell, int],
    taken: set[Cell],
) -> bool:
    """Find a cell for a drone, moving others to another of their options where needed.

    This is one augmenting path of a bipartite matching (Kuhn), found breadth first.
    """
    reached_by: dict[Cell, int] = {}
    queue = [drone]
    for candidate in queue:
        for cell in options[candidate]:
            if cell in taken or cell in reached_by:
                continue
            reached_by[cell] = candidate
            if cell in holder:
                queue.append(holder[cell])
                continue
            while True:
                mover = reached_by[cell]
                left_cell = held.get(mover)
                held[mover], holder[cell] = cell, mover
                if left_cell is None:
                    return True
                cell = left_cell
    return False
