# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled beam search for the plan of a drone in metres: a turn and a speed for each step.

A plan is worth what it adds to the finds of the other drones' plans, see `metres_futures`, and a
share of the persons left at its end, by their distance from there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, inlined, part
from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.planners.metres_futures import BinnedFutures, Seen, write_seen
from dsse_ros.search.belief.motion_kernels import Floats, Ints
from dsse_ros.search.step.metres_paths import MOTION_STATES, MotionState, Wind, write_path
from dsse_ros.search.step.metres_steering import LEAST_ROOM_M, copy_state, room_after

CAP = 3
"""Nodes kept at each step in one square of half a leg."""
MOST_CELLS = 96
"""Cells along a side of a `Field`."""


class Field(NamedTuple):
    """The persons left at the end, in cells over the whole grid.

    Attributes:
        left: (R, C) float64, the weight left in each cell.
        places: (E,) int64, the cells with any.
        nearness: (R, C) float64, worth of a person by the distance, [y, x].
        worths: (R, C) float64, the worth of all persons seen from a cell; -1 until it is computed.
        size: Side of a cell.
        fade: Logarithm of the factor on the worth per metre.
    """

    left: NDArray[np.float64]
    places: NDArray[np.int64]
    nearness: NDArray[np.float64]
    worths: NDArray[np.float64]
    size: float
    fade: float


class MetresProblem(NamedTuple):
    """What a drone plans for.

    Attributes:
        airframes: (1,) of `AIRFRAMES`.
        detectors: (A,) of `DETECTORS`, see `write_seen`.
        wind: The wind and the time of a step.
        extent: Of the grid, which the drone must not leave.
        turns: (A,) float64, the turns tried in each step, in radians.
        futures: The persons.
        worth: (H, M) float64, see `write_worth`.
        left: (M,) float64, see `write_worth`.
        field: Where they are at the end.
        kappa: Weight of the persons left at the end.
        fixed: (G, 2) float64, turns and speeds of the first steps; none to search for them too.
    """

    airframes: NDArray[np.void]
    detectors: NDArray[np.void]
    wind: Wind
    extent: GridExtent
    turns: NDArray[np.float64]
    futures: BinnedFutures
    worth: NDArray[np.float64]
    left: NDArray[np.float64]
    field: Field
    kappa: float
    fixed: NDArray[np.float64]


class MetresTree(NamedTuple):
    """The nodes of a beam search: W of each step.

    Attributes:
        flights: (H + 1, W) of `MOTION_STATES`.
        parents: (H + 1, W) int64, node of the step before.
        actions: (H + 1, W, 2) float64, the turn and the speed that lead to a node.
    """

    flights: NDArray[np.void]
    parents: NDArray[np.int64]
    actions: NDArray[np.float64]


class MetresLevel(NamedTuple):
    """What the paths to the nodes of a step have found.

    Attributes:
        survival: (W, M) float32, how likely the path has missed each person.
        gains: (W,) float64, discounted finds in addition to those of the other drones.
        finds: (W, H) float64, finds of each step among the persons whom nobody else finds.
    """

    survival: NDArray[np.float32]
    gains: NDArray[np.float64]
    finds: NDArray[np.float64]


class MetresCandidates(NamedTuple):
    """Flights from the nodes of a step.

    Attributes:
        flights: (W A,) of `MOTION_STATES`, after the step.
        parents: (W A,) int64.
        actions: (W A, 2) float64.
        gains: (W A,) float64.
        finds: (W A,) float64.
        ranks: (W A,) float64, gains and the weighted worth of what is left.
    """

    flights: NDArray[np.void]
    parents: NDArray[np.int64]
    actions: NDArray[np.float64]
    gains: NDArray[np.float64]
    finds: NDArray[np.float64]
    ranks: NDArray[np.float64]


class PathScratch(NamedTuple):
    """Memory for one path.

    Attributes:
        path: (K + 1, 2) float64.
        seen: The persons seen from it.
        counts: (Q, Q) int64, nodes in each square of half a leg, zeros between uses.
    """

    path: NDArray[np.float64]
    seen: Seen
    counts: NDArray[np.int64]


@compiled()
def field_of(
    futures: BinnedFutures, left: Floats, extent: GridExtent, leg: float, closeness: float
) -> Field:
    """Return where the persons are at the end.

    Args:
        left: (M,) float64, the weight left of each.
        extent: Of the grid.
        leg: Length of a step's path.
        closeness: Factor on the worth of a person for each leg to him.
    """
    size = max(leg, max(extent.width, extent.height) / MOST_CELLS)
    columns, rows = int(math.ceil(extent.width / size)), int(math.ceil(extent.height / size))
    in_cell, nearness = np.zeros((rows, columns)), np.empty((rows, columns))
    fade = math.log(closeness) / leg
    last = len(futures.ways) - 1
    for place in range(futures.starts[last, -1]):
        way, s = futures.ways[last, place], futures.members[last, place]
        column = min(max(int(way[2] / size), 0), columns - 1)
        row = min(max(int(way[3] / size), 0), rows - 1)
        in_cell[row, column] += left[s]
    for y in range(rows):
        for x in range(columns):
            nearness[y, x] = math.exp(fade * size * math.hypot(x, y))
    places = np.flatnonzero(in_cell)
    return Field(in_cell, places, nearness, np.full((rows, columns), -1.0), size, fade)


@inlined
def worth_from(field: Field, row: int, column: int) -> float:
    """Return the worth of the persons left to a drone in a cell."""
    if field.worths[row, column] < 0.0:
        total, columns = 0.0, field.left.shape[1]
        for place in field.places:
            y, x = place // columns, place % columns
            total += field.left[y, x] * field.nearness[abs(y - row), abs(x - column)]
        field.worths[row, column] = total
    return field.worths[row, column]


@part
def worth_at(field: Field, x: float, y: float) -> float:
    """Return the worth of the persons left to a drone at a position, between those of cells."""
    last_row, last_column = field.left.shape[0] - 1, field.left.shape[1] - 1
    across = min(max(x / field.size - 0.5, 0.0), float(last_column))
    down = min(max(y / field.size - 0.5, 0.0), float(last_row))
    column = min(int(across), max(last_column - 1, 0))
    row = min(int(down), max(last_row - 1, 0))
    u, v = across - column, down - row
    right, below = min(column + 1, last_column), min(row + 1, last_row)
    upper = (1.0 - u) * worth_from(field, row, column) + u * worth_from(field, row, right)
    lower = (1.0 - u) * worth_from(field, below, column) + u * worth_from(field, below, right)
    return (1.0 - v) * upper + v * lower


@part
def worth_left(
    problem: MetresProblem,
    tree: MetresTree,
    level: MetresLevel,
    h: int,
    node: int,
    flight: MotionState,
    finds: float,
) -> float:
    """Return the worth of what a path leaves, seen from its end.

    Args:
        h: Number of steps of the path to the node.
        flight: One of `MOTION_STATES`, after one more step.
        finds: Of that step.
    """
    field = problem.field
    worth, at, back = worth_at(field, flight.east, flight.south) - finds, node, h
    while back > 0:
        # Of the persons left by the others, the path's own looks have found some.
        if level.finds[node, back - 1] > 0.0:
            near = tree.flights[back, at]
            distance = math.hypot(flight.east - near.east, flight.south - near.south)
            worth -= level.finds[node, back - 1] * math.exp(field.fade * distance)
        at = tree.parents[back, at]
        back -= 1
    return worth


@part
def write_candidate(
    problem: MetresProblem,
    tree: MetresTree,
    level: MetresLevel,
    h: int,
    node: int,
    tried: MetresCandidates,
    found: int,
    scratch: PathScratch,
) -> bool:
    """Fly from a node as `tried.actions[found]` says; write it, and return whether it stays inside.

    Args:
        found: Number of the candidate.
    """
    flight, (turn, speed) = tried.flights[found], (tried.actions[found, 0], tried.actions[found, 1])
    copy_state(tree.flights[h, node], flight)
    write_path(problem.airframes[0], problem.wind, flight, turn, speed, scratch.path)
    room = room_after(problem.airframes[0], problem.wind, problem.extent, flight, scratch.path)
    if room < LEAST_ROOM_M:
        return False
    futures, seen, gain, finds = problem.futures, scratch.seen, level.gains[node], 0.0
    count = write_seen(problem.detectors, futures, h, scratch.path, problem.wind, seen)
    for j in range(count):
        s = futures.members[h, seen.places[j]]
        detected = level.survival[node, s] * (1.0 - seen.missed[j])
        gain += detected * problem.worth[h, seen.places[j]]
        finds += detected * problem.left[s]
    tried.parents[found], tried.gains[found], tried.finds[found] = node, gain, finds
    left = worth_left(problem, tree, level, h, node, flight, finds)
    tried.ranks[found] = gain + problem.kappa * left
    return True


@part
def expand(
    problem: MetresProblem,
    tree: MetresTree,
    level: MetresLevel,
    h: int,
    nodes: int,
    speed: float,
    tried: MetresCandidates,
    scratch: PathScratch,
) -> int:
    """Write the flights from the nodes of a step, and return their number."""
    found, is_fixed = 0, h < len(problem.fixed)
    for node in range(nodes):
        for a in range(1 if is_fixed else len(problem.turns)):
            tried.actions[found, 0], tried.actions[found, 1] = problem.turns[a], speed
            if is_fixed:
                tried.actions[found, 0] = problem.fixed[h, 0]
                tried.actions[found, 1] = problem.fixed[h, 1]
            found += write_candidate(problem, tree, level, h, node, tried, found, scratch)
    return found


@inlined
def take(
    level: MetresLevel, h: int, tried: MetresCandidates, k: int, after: MetresLevel, kept: int
) -> None:
    """Write to a node of the next level what the path to it has found."""
    node = tried.parents[k]
    for s in range(level.survival.shape[1]):
        after.survival[kept, s] = level.survival[node, s]
    for back in range(h):
        after.finds[kept, back] = level.finds[node, back]
    after.finds[kept, h], after.gains[kept] = tried.finds[k], tried.gains[k]


@part
def keep_best(
    problem: MetresProblem,
    tree: MetresTree,
    level: MetresLevel,
    h: int,
    tried: MetresCandidates,
    order: Ints,
    after: MetresLevel,
    scratch: PathScratch,
) -> int:
    """Keep the flights of the highest rank as the nodes of the next step, and return their number.

    Args:
        order: (F,) int64, its flights in order of their ranks.
    """
    kept, width, counts = 0, tree.parents.shape[1], scratch.counts
    for k in order:
        flight = tried.flights[k]
        row, column = square_of(problem.extent, flight, counts)
        if counts[row, column] >= CAP or is_twin(tree, h, tried, k, after, kept):
            continue
        counts[row, column] += 1
        copy_state(flight, tree.flights[h + 1, kept])
        tree.parents[h + 1, kept] = tried.parents[k]
        tree.actions[h + 1, kept, 0] = tried.actions[k, 0]
        tree.actions[h + 1, kept, 1] = tried.actions[k, 1]
        take(level, h, tried, k, after, kept)
        kept += 1
        if kept == width:
            break
    for node in range(kept):
        row, column = square_of(problem.extent, tree.flights[h + 1, node], counts)
        counts[row, column] = 0
        mark_seen(problem, tree, h, node, after, scratch)
    return kept


@inlined
def square_of(
    extent: GridExtent, flight: MotionState, counts: NDArray[np.int64]
) -> tuple[int, int]:
    """Return the row and the column of a position, of those of the counts."""
    rows, columns = counts.shape
    row, column = flight.south / (extent.height / rows), flight.east / (extent.width / columns)
    return min(int(row), rows - 1), min(int(column), columns - 1)


@inlined
def is_twin(
    tree: MetresTree, h: int, tried: MetresCandidates, k: int, after: MetresLevel, kept: int
) -> bool:
    """Return whether a flight finds as much as a node that is kept, and ends at the same place."""
    for node in range(kept):
        near, flight = tree.flights[h + 1, node], tried.flights[k]
        away = abs(near.east - flight.east) + abs(near.south - flight.south)
        if away < 5.0 and abs(after.gains[node] - tried.gains[k]) < 1e-12:
            return True
    return False


@part
def mark_seen(
    problem: MetresProblem,
    tree: MetresTree,
    h: int,
    node: int,
    after: MetresLevel,
    scratch: PathScratch,
) -> None:
    """Multiply the survival of a new node by what its last step has missed."""
    flight, futures, seen = tree.flights[h + 1, node], problem.futures, scratch.seen
    east, south, heading, speed = flight.east, flight.south, flight.heading, flight.speed
    copy_state(tree.flights[h, tree.parents[h + 1, node]], flight)
    turn, airspeed = tree.actions[h + 1, node, 0], tree.actions[h + 1, node, 1]
    write_path(problem.airframes[0], problem.wind, flight, turn, airspeed, scratch.path)
    flight.east, flight.south, flight.heading, flight.speed = east, south, heading, speed
    for j in range(write_seen(problem.detectors, futures, h, scratch.path, problem.wind, seen)):
        after.survival[node, futures.members[h, seen.places[j]]] *= seen.missed[j]


@compiled()
def new_level(width: int, count: int, horizon: int) -> MetresLevel:
    """Return a level of W nodes."""
    return MetresLevel(
        np.ones((width, count), np.float32), np.zeros(width), np.zeros((width, horizon))
    )


@compiled()
def new_candidates(most: int) -> MetresCandidates:
    """Return memory for so many flights."""
    return MetresCandidates(
        np.zeros(most, MOTION_STATES), np.zeros(most, np.int64), np.zeros((most, 2)),
        np.zeros(most), np.zeros(most), np.zeros(most),
    )  # fmt: skip


@compiled()
def plan_flight(
    problem: MetresProblem,
    flights: NDArray[np.void],
    width: int,
    scratch: PathScratch,
    actions: Floats,
) -> tuple[int, float]:
    """Search for a drone's best plan.

    Args:
        flights: (1,) of `MOTION_STATES`, the drone at present.
        actions: (H, 2) float64 out, turns in radians and airspeeds.

    Returns:
        The number of planned steps, less than H if the drone cannot stay on the grid for longer,
        and the rank of the plan.
    """
    horizon, count = problem.worth.shape
    tree = MetresTree(
        np.zeros((horizon + 1, width), MOTION_STATES),
        np.zeros((horizon + 1, width), np.int64),
        np.zeros((horizon + 1, width, 2)),
    )
    now, after = new_level(width, count, horizon), new_level(width, count, horizon)
    tried = new_candidates(width * len(problem.turns))
    copy_state(flights[0], tree.flights[0, 0])
    airframe, nodes, depth, rank = problem.airframes[0], 1, 0, 0.0
    for h in range(horizon):
        found = expand(problem, tree, now, h, nodes, airframe.cruise, tried, scratch)
        if found == 0:
            found = expand(problem, tree, now, h, nodes, airframe.slowest, tried, scratch)
        if found == 0:
            break
        order = np.argsort(-tried.ranks[:found], kind="mergesort")
        rank = tried.ranks[order[0]]
        nodes = keep_best(problem, tree, now, h, tried, order, after, scratch)
        now, after, depth = after, now, h + 1
    node = 0
    for h in range(depth, 0, -1):
        actions[h - 1] = tree.actions[h, node]
        node = tree.parents[h, node]
    return depth, rank


@compiled()
def write_legs(
    airframes: NDArray[np.void],
    wind: Wind,
    flights: NDArray[np.void],
    actions: Floats,
    legs: Floats,
) -> None:
    """Write the path of each step of a plan, (H, K + 1, 2), from flights (1,) at present."""
    flown = np.zeros(1, MOTION_STATES)
    copy_state(flights[0], flown[0])
    for h in range(len(actions)):
        write_path(airframes[0], wind, flown[0], actions[h, 0], actions[h, 1], legs[h])
