# SPDX-License-Identifier: Apache-2.0
"""Collision avoidance: next cells for all drones at once, never two drones in one.

Drones move at the same time, so a drone may enter a cell that another leaves, and two may
swap. A drone that stays cannot give way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from dsse_ros.planners.planner import Cell


def settle(present: Sequence[Cell], wishes: Sequence[Cell]) -> list[Cell]:
    """Return the cell that each drone gets: the one it wishes, or its present one.

    Among drones that wish for one cell the one that stays there wins, else the first; the
    losers stay where they are, which can make losers of those behind them.

    Args:
        present: Cell of each drone, all different.
        wishes: Present or neighbouring cell that each drone would like to be in next.
    """
    granted = list(wishes)
    owner: dict[Cell, int] = {}
    claims = list(range(len(granted)))
    for drone in claims:
        cell = granted[drone]
        holder = owner.setdefault(cell, drone)
        if holder == drone:
            continue
        loser = drone
        if cell == present[drone]:
            owner[cell] = drone
            loser = holder
        if granted[loser] != present[loser]:
            granted[loser] = present[loser]
            claims.append(loser)
    return granted


def settle_around(
    present: Sequence[Cell],
    wishes: Sequence[Cell | None],
    exits: Mapping[int, Sequence[Cell]],
) -> list[Cell]:
    """Return the cell that each drone gets when some drones only have to make room.

    The drones with a wish settle among themselves. The others then go to one of their exits
    (the first that is free, as far as possible), and stay only if there is no way out; a drone
    that wished for the cell of one that must stay, stays too.

    Args:
        present: Cell of each drone, all different.
        wishes: As for `settle`; None for a drone that makes room.
        exits: By the index of each drone that makes room, the cells that it can move to.
    """
    wished = {drone: wish for drone, wish in enumerate(wishes) if wish is not None}
    yielding = [drone for drone, wish in enumerate(wishes) if wish is None]
    if not yielding:
        return settle(present, list(wished.values()))
    granted = list(present)
    occupied = {present[drone] for drone in yielding}
    while True:
        movers = list(wished)
        settled = settle([present[drone] for drone in movers], list(wished.values()))
        placed = _make_room(yielding, present, exits, set(settled))
        intruders = [d for d, cell in zip(movers, settled, strict=True) if cell in occupied]
        if len(placed) == len(yielding) or not intruders:
            break
        wished.update((drone, present[drone]) for drone in intruders)
        # Cells of drones without a collision rule can coincide: nobody is asked twice.
        occupied -= {present[drone] for drone in intruders}
    for drone, cell in (*zip(movers, settled, strict=True), *placed.items()):
        granted[drone] = cell
    return granted


def _make_room(
    drones: Sequence[int],
    present: Sequence[Cell],
    exits: Mapping[int, Sequence[Cell]],
    taken: set[Cell],
) -> dict[int, Cell]:
    """Give as many drones as possible an exit of their own that is not taken, others their cell."""
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
    newcomer: int,
    options: Mapping[int, Iterable[Cell]],
    held: dict[int, Cell],
    holder: dict[Cell, int],
    taken: set[Cell],
) -> bool:
    """Find the newcomer a cell, moving others to another of their options where needed.

    One augmenting path of a bipartite matching (Kuhn), by breadth first search.
    """
    reached_by: dict[Cell, int] = {}
    queue = [newcomer]
    for drone in queue:
        for cell in options[drone]:
            if cell in taken or cell in reached_by:
                continue
            reached_by[cell] = drone
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
