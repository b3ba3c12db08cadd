# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled step of B worlds at once: drones, map, persons and rewards.

The state of the worlds is in three structured arrays, `worlds` (B,), `drones` (B, N) and `persons`
(B, P); `constants` (1,) is shared and never written. x is the column and grows to the east, y is
the row and grows to the south.

If only a part of the grid is searched, `area` (G, G) bool is true in its cells, and `runs`
(R, 3) int64 has them as (row, first column, last column). Otherwise both are None, and the compiler
removes their code. The same applies to `coverage`, see `coverage_kernels`, and `ensemble`, see
`ensemble_kernels`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.compiled.streaming import ALIGNMENT, LANES
from dsse_ros.step.collisions import collide, next_stamp, occupy
from dsse_ros.step.coverage_kernels import put_back, reward_if_all_covered, visit, write_left
from dsse_ros.step.ensemble_kernels import (
    SeaEnsemble,
    ensemble_step,
    put_on_tracks,
    write_present,
)
from dsse_ros.step.look_kernels import look, reward_find, reward_search
from dsse_ros.targets.person_kernels import draw_own_drift, persons_step, scatter_persons
from dsse_ros.targets.sea_map import (
    disperse,
    drift_per_step,
    is_inside,
    is_open,
    map_step,
    write_map,
)

WORLDS = np.dtype(
    [
        ("rng", "u8"),  # state of the world's own generator
        ("t", "i8"),  # steps done
        ("map_steps", "i8"),
        ("datum_x", "i8"),
        ("datum_y", "i8"),
        ("circle_x", "i8"),
        ("circle_y", "i8"),
        ("remainder_x", "f8"),  # drift not yet applied, cells
        ("remainder_y", "f8"),
        ("vector_x", "f8"),  # the scenario's drift
        ("vector_y", "f8"),
        ("drift_x", "f8"),  # drift per step, cells
        ("drift_y", "f8"),
        ("scale", "f8"),  # 1 / sum of the Gaussian over the possible cells; 0: all in one cell
        ("start_x", "i8"),  # cell of the person at reset
        ("start_y", "i8"),
        ("num_active", "i8"),  # drones still in the search
        ("num_missing", "i8"),  # persons not found, or cells not covered
        ("done", "?"),  # the search has ended: none missing, time limit, or no drone left
    ],
    align=True,
)

DRONES = np.dtype(
    [
        ("x", "i8"),
        ("y", "i8"),
        ("episode_return", "f8"),  # sum of rewards without the replacements by collisions
        ("reward", "f8"),  # of the last step
        ("alive", "?"),  # in the search; a drone neither alive nor flagged was withdrawn
        ("terminated", "?"),  # since the last reset
        ("truncated", "?"),
        ("found", "?"),  # found a person in the last step
        ("clear", "?"),  # of the others, above them or on the ground: it does not collide
    ],
    align=True,
)


class Sea(NamedTuple):
    """The sea of B worlds.

    Attributes:
        constants: (1,) of `constants.CONSTANTS`.
        worlds: (B,) of `WORLDS`.
        gauss: (1 or B, 2, 2 G + 1) float64, exponentials along x and y.
        tails: (1 or B, 2, G + 2) float64, their tail sums.
        area: (G, G) bool, the searched cells; None for all.
        runs: (R, 3) int64, the same by row, first and last column; None for all.
        transitions: (G, G, 9) float64, the probabilities of the steps of a `markov_chain` from each
            cell [row, col], read-only; None if they are the same in all cells.
        coverage: See `coverage_kernels`; None in a search for persons.
        ensemble: See `ensemble_kernels`; None if persons move step by step.
    """

    constants: NDArray[np.void]
    worlds: NDArray[np.void]
    gauss: NDArray[np.float64]
    tails: NDArray[np.float64]
    area: NDArray[np.bool_] | None
    runs: NDArray[np.int64] | None
    transitions: NDArray[np.float64] | None
    coverage: Any
    ensemble: SeaEnsemble | None = None


class Crew(NamedTuple):
    """The drones, their looks, and the persons.

    Attributes:
        starts: (B, N, 2) int64, cells of the drones at reset.
        drones: (B, N) of `DRONES`.
        finds: (B, N) uint64, one bit per successful look of a drone that found a person in the last
            step; undefined for other drones.
        persons: (B, P) of `PERSONS`.
        kinds: (N,) of `looks.Looks.kind`.
        looks: (K, A + 1) of `looks.Looks.first`.
        offsets: (L, 2) of `looks.Looks`.
        pods: (L, P) of `looks.Looks`.
    """

    starts: NDArray[np.int64]
    drones: NDArray[np.void]
    finds: NDArray[np.uint64]
    persons: NDArray[np.void]
    kinds: NDArray[np.int64]
    looks: NDArray[np.int64]
    offsets: NDArray[np.int64]
    pods: NDArray[np.float64]


class Scratch(NamedTuple):
    """Memory of a thread.

    Attributes:
        occupied: (G * G + 1,) uint16, see `occupy`.
        circle: (G + 1,) int64, see `update_circle`.
        cells: (K,) int64, the cells over which persons are scattered.
        span: (G,) float64.
    """

    occupied: NDArray[np.uint16]
    circle: NDArray[np.int64]
    cells: NDArray[np.int64]
    span: NDArray[np.float64]


@part
def sea_step(c, w, persons, gauss, tails, area, runs, transitions, ensemble, b, circle):
    """Advance the map and the persons by one step."""
    if ensemble is not None:
        ensemble_step(c, w, persons, area, ensemble, b)
        return
    if c.person_first:
        persons_step(c, w, gauss, area, transitions, persons)
    map_step(c, w, gauss, tails, area, runs, circle)
    if not c.person_first:
        persons_step(c, w, gauss, area, transitions, persons)


@part
def reset_world(
    c, w, starts, drones, persons, gauss, tails, area, runs, transitions, coverage, ensemble, b,
    circle, cells,
):  # fmt: skip
    """Set a world to its start: the start cell has the persons and all the probability."""
    w.t = w.map_steps = 0
    w.datum_x = w.circle_x = w.start_x
    w.datum_y = w.circle_y = w.start_y
    w.remainder_x = w.remainder_y = 0.0
    w.drift_x, w.drift_y = drift_per_step(c, w.vector_x, w.vector_y)
    w.scale = 0.0
    w.done = False
    w.num_active = len(drones)
    w.num_missing = len(persons)
    for n in range(len(drones)):
        d = drones[n]
        d.x, d.y = starts[n, 0], starts[n, 1]
        d.episode_return = d.reward = 0.0
        d.alive = True
        d.terminated = d.truncated = d.found = False
    if coverage is not None:
        put_back(w, coverage, b)
        return
    for p in range(len(persons)):
        person = persons[p]
        person.x, person.y = w.start_x, w.start_y
        person.remainder_x = person.remainder_y = 0.0
        person.found = False
        if c.own_drift:
            draw_own_drift(c, w, person)
    if ensemble is not None:
        put_on_tracks(w, persons, ensemble, b)
    elif c.person_scatter > 0:
        scatter_persons(c, w, area, persons, cells)
    for _ in range(c.pre_search_steps + c.reset_sea_steps):
        sea_step(c, w, persons, gauss, tails, area, runs, transitions, ensemble, b, circle)


@part
def step_drones(
    c, w, drones, finds, persons, kinds, looks, offsets, pods, gauss, area, coverage, ensemble, b,
    occupied, actions,
):  # fmt: skip
    """Do the actions in index order against the map of the last observation.

    Returns:
        Whether active drones may share a cell, and whether any drone found a person or got a flag.
    """
    # Read these once: the compiler must assume that writes to the drones can change them.
    grid_size, move_reward, leave_reward = c.grid_size, c.move, c.leave_grid
    search_action, num_actions, leave_flies_on = c.search_action, c.num_actions, c.leave_flies_on
    leave_flags = c.leave_terminates or leave_flies_on
    ends_together, collisions = c.ends_together, c.collisions
    out_of_time = w.t >= c.timestep_limit + c.time_out_grace
    idle = out_of_time and not c.time_out_acts
    moves_x, moves_y = c.dx, c.dy
    alike, moves_look = len(looks) == 1, c.moves_look and coverage is None
    stamp = next_stamp(occupied)
    shared = eventful = False
    for n in range(len(drones)):
        d, action = drones[n], actions[n]
        if not d.alive:
            d.reward = 0.0
            d.found = False
            # A withdrawn drone has no flag yet.
            eventful |= not (d.terminated or d.truncated)
            continue
        reward, found, terminated = move_reward, False, d.terminated
        if 0 <= action < num_actions and not idle:
            searches = coverage is None and action == search_action
            if not searches:
                x, y = d.x + moves_x[action], d.y + moves_y[action]
                inside = is_open(area, grid_size, x, y)
                # Drones may fly on outside the grid, but not outside the area within it.
                if inside or (leave_flies_on and not is_inside(grid_size, x, y)):
                    d.x, d.y = x, y
                if not inside:
                    reward = leave_reward
                elif coverage is not None:
                    reward = visit(c, w, coverage, b, x, y)
                terminated = leave_flags and not inside
            if searches or moves_look:
                kind = 0 if alike else kinds[n]
                first, last = looks[kind, action], looks[kind, action + 1]
                count = 0
                if last > first:
                    count, bits = look(c, w, d, persons, area, offsets, pods, first, last)
                if count > 0:
                    finds[n] = bits
                    reward, found = reward_find(c, w, count), True
                    if ends_together:
                        for m in range(len(drones)):
                            drones[m].terminated = True
                        terminated = True
                elif searches:
                    reward = reward_search(c, w, gauss, area, ensemble, d, offsets, first, last)
        if out_of_time:
            reward = c.time_out - (d.episode_return if c.time_out_total else 0.0)
            d.truncated = True
        d.reward = reward
        d.episode_return += reward
        d.found = found
        d.terminated = terminated
        eventful |= found or terminated or d.truncated
        if collisions and not d.clear and (ends_together or not terminated):
            shared |= occupy(grid_size, d, occupied, stamp)
    return shared, eventful


@part
def update_flags(c, w, drones, persons, coverage):
    """Flag the drones whose search has ended, and the world when all of them have ended."""
    if coverage is None:
        w.num_missing = 0
        for p in range(len(persons)):
            w.num_missing += not persons[p].found
    all_found = w.num_missing == 0 and not c.ends_together
    any_flag = False
    num_active = 0
    for n in range(len(drones)):
        d = drones[n]
        if not d.alive:
            # A drone without a flag was withdrawn since the last step.
            d.terminated = d.terminated or not d.truncated
            continue
        d.terminated = d.terminated or all_found
        if d.terminated or d.truncated:
            any_flag = True
            d.terminated = d.terminated or c.both_flags
            d.truncated = d.truncated or c.both_flags
            d.alive = c.ends_together
        num_active += d.alive
    w.num_active = num_active
    w.done = num_active == 0 or (c.ends_together and any_flag)
    if c.ends_together and w.done:
        # Drones that end only because the search ended are truncated.
        for n in range(len(drones)):
            drones[n].truncated = drones[n].truncated or not drones[n].terminated


@part
def step_world(
    c, w, drones, finds, persons, kinds, looks, offsets, pods, gauss, tails, area, runs,
    transitions, coverage, ensemble, b, occupied, circle, actions,
):  # fmt: skip
    """Advance one world: drones in index order, then the sea, then collisions."""
    if c.ends_together:
        for n in range(len(drones)):
            if drones[n].alive:
                drones[n].terminated = drones[n].truncated = False
    if c.found_persons_stay:
        for p in range(len(persons)):
            persons[p].found = False
    unchanged = not w.done and w.num_missing == len(persons)
    shared, eventful = step_drones(
        c, w, drones, finds, persons, kinds, looks, offsets, pods, gauss, area, coverage, ensemble,
        b, occupied, actions,
    )  # fmt: skip
    w.t += 1
    if coverage is None:
        sea_step(c, w, persons, gauss, tails, area, runs, transitions, ensemble, b, circle)
    else:
        reward_if_all_covered(c, w, coverage, b, drones)
    if shared:
        collide(c, drones, occupied)
    if shared or eventful or not unchanged:
        update_flags(c, w, drones, persons, coverage)


STREAMED_BYTES = 1 << 25
"""Larger maps are written past the caches, because they would not fit."""


@part
def is_streamed(maps):
    """Return whether maps (B, G, G) are large and aligned enough to be written past the caches."""
    large = maps.size * maps.itemsize > STREAMED_BYTES
    return large and maps.shape[1] % LANES == 0 and maps.ctypes.data % ALIGNMENT == 0


@inlined
def write_observed(c, w, gauss, area, coverage, ensemble, b, circle, span, stream, out):
    """Write the observed map of a world, or its probability left to cover."""
    if ensemble is not None:
        write_present(w, ensemble, out)
    elif coverage is None:
        write_map(c, w, gauss, area, circle, span, stream, out)
    else:
        write_left(coverage, b, out)


# Python passes the fields of the tuples as separate arguments: unpacking the tuples in compiled
# functions would take as long as a small step.
@kernel
def step_worlds(
    constants, worlds, gauss, tails, area, runs, transitions, coverage, ensemble,
    starts, drones, finds, persons, kinds, looks, offsets, pods,
    occupied, circle, cells, span,
    actions, maps, first, last,
):  # fmt: skip
    """Advance the worlds first..last - 1 by one step and write their maps.

    The arguments are the fields of `Sea`, `Crew` and `Scratch`, then `actions` (B, N) int8, where a
    number that is not an action does nothing, and `maps` out, (B, G, G) float32 as [y, x],
    C-contiguous, or (B, 0, 0) to write none.
    """
    c = constants[0]
    stream = is_streamed(maps)
    for b in range(first, last):
        w = worlds[b]
        table = min(b, len(gauss) - 1)
        if c.auto_reset and w.done:
            reset_world(
                c, w, starts[b], drones[b], persons[b], gauss[table], tails[table], area, runs,
                transitions, coverage, ensemble, b, circle, cells,
            )  # fmt: skip
        else:
            step_world(
                c, w, drones[b], finds[b], persons[b], kinds, looks, offsets, pods, gauss[table],
                tails[table], area, runs, transitions, coverage, ensemble, b, occupied, circle,
                actions[b],
            )  # fmt: skip
        if maps.shape[1] > 0:
            write_observed(
                c, w, gauss[table], area, coverage, ensemble, b, circle, span, stream, maps[b]
            )


@kernel
def reset_worlds(
    constants, worlds, gauss, tails, area, runs, transitions, coverage, ensemble,
    starts, drones, finds, persons, kinds, looks, offsets, pods,
    occupied, circle, cells, span,
    maps, which,
):  # fmt: skip
    """Reset the worlds with which[b] and write their maps; arguments as in `step_worlds`."""
    c = constants[0]
    stream = is_streamed(maps)
    for b in range(len(worlds)):
        if which[b]:
            table = min(b, len(gauss) - 1)
            reset_world(
                c, worlds[b], starts[b], drones[b], persons[b], gauss[table], tails[table], area,
                runs, transitions, coverage, ensemble, b, circle, cells,
            )  # fmt: skip
            if maps.shape[1] > 0:
                write_observed(
                    c, worlds[b], gauss[table], area, coverage, ensemble, b, circle, span, stream,
                    maps[b],
                )  # fmt: skip


@kernel
def refresh_worlds(
    constants, worlds, gauss, tails, area, runs, transitions, coverage, ensemble,
    circle, span, maps,
):  # fmt: skip
    """Write the tables and the maps that the state requires.

    The arguments begin with the fields of `Sea`; the others are as in `step_worlds`.
    """
    c = constants[0]
    stream = is_streamed(maps)
    for b in range(len(gauss)):
        disperse(c, worlds[b], gauss[b], tails[b])
    if maps.shape[1] > 0:
        for b in range(len(worlds)):
            table = gauss[min(b, len(gauss) - 1)]
            write_observed(
                c, worlds[b], table, area, coverage, ensemble, b, circle, span, stream, maps[b]
            )


@kernel
def report_worlds(
    constants, area, drones, positions, rewards, terminated, truncated, action_masks, first, last
):
    """Write positions, rewards, flags and action masks of the drones of the worlds first..last - 1.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        area: As in `step_worlds`.
        drones: (B, N) of `DRONES`.
        positions: (B, N, 2) int64 out, as (x, y).
        rewards: (B, N) float64 out.
        terminated: (B, N) bool out.
        truncated: (B, N) bool out.
        action_masks: (B, N, A) int8 out, 0 for moves out of the grid or the area.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    c = constants[0]
    edge, num_actions = c.grid_size - 1, action_masks.shape[2]
    inner = np.uint64(max(edge - 1, 0))
    for b in range(first, last):
        of_world, cells, masks = drones[b], positions[b], action_masks[b]
        reward, ended, stopped = rewards[b], terminated[b], truncated[b]
        masks[:] = 1
        for n in range(len(of_world)):
            d = of_world[n]
            x, y = d.x, d.y
            cells[n, 0], cells[n, 1] = x, y
            reward[n] = d.reward
            ended[n], stopped[n] = d.terminated, d.truncated
            if area is not None and is_inside(c.grid_size, x, y):
                for a in range(num_actions):
                    masks[n, a] = is_open(area, c.grid_size, x + c.dx[a], y + c.dy[a])
            elif (np.uint64(x - 1) >= inner) | (np.uint64(y - 1) >= inner):
                for a in range(num_actions):
                    dx, dy = c.dx[a], c.dy[a]
                    west, east = dx < 0 and x == 0, dx > 0 and x == edge
                    north, south = dy < 0 and y == 0, dy > 0 and y == edge
                    masks[n, a] = not (west or east or north or south)
