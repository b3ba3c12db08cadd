# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search of one world, compiled: its step from top to bottom, and its start.

A function that does something else in the coverage task, with an ensemble, in metres or with
vehicles, takes this field of the extensions as an argument of its own: Numba prunes branches only
for arguments that are None.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.draws import draw_unit
from dsse_ros.base.compiled.jit import inlined, part
from dsse_ros.base.compiled.records import Int
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.step.constants import Constants
from dsse_ros.search.step.coverage_kernels import (
    CoverageTask,
    cells_to_cover,
    cover,
    start_coverage,
)
from dsse_ros.search.step.ensemble_kernels import (
    SeaEnsemble,
    ensemble_step,
    pod_column,
    probability_in,
    put_on_tracks,
)
from dsse_ros.search.step.entities import Actions, Area, Drone, Records, WorldRecord
from dsse_ros.search.step.metres_kernels import (
    MetresArrays,
    detect_in_passing,
    fly,
    start_in_metres,
    stay,
)
from dsse_ros.search.step.viewpoints import (
    NO_LOOK,
    VehicleViewpoint,
    Viewpoint,
    clear_viewpoints,
    set_viewpoint,
)
from dsse_ros.search.step.world_state import Scratch, WorldState
from dsse_ros.world.targets.person_kernels import draw_own_drift, persons_step, scatter_persons
from dsse_ros.world.targets.sea_map import (
    Sea,
    cell_probability,
    grid_of,
    is_inside,
    is_open,
    map_step,
    start_map,
)

MOVED, LEFT_GRID, SEARCHED, FOUND, OUT_OF_TIME, COLLIDED, COVERED, COVERED_ALL = range(8)
"""Events of a drone's step, which `reward_of` rewards."""


class ActionConstants(NamedTuple):
    """The constants that each drone's action reads, under the same names.

    They are read once a step: the compiler must assume that writes to a drone can change a
    constant.
    """

    columns: int
    rows: int
    dx: NDArray[np.int64]
    dy: NDArray[np.int64]
    num_actions: int
    search_action: int
    moves_look: bool
    leave_flies_on: bool
    leave_terminates: bool
    probability_of_detection: float
    collisions: bool
    ends_together: bool


@inlined
def action_constants_of(constants: Constants) -> ActionConstants:
    """Return the constants of a drone's action."""
    return ActionConstants(
        columns=constants.columns,
        rows=constants.rows,
        dx=constants.dx,
        dy=constants.dy,
        num_actions=constants.num_actions,
        search_action=constants.search_action,
        moves_look=constants.moves_look,
        leave_flies_on=constants.leave_flies_on,
        leave_terminates=constants.leave_terminates,
        probability_of_detection=constants.probability_of_detection,
        collisions=constants.collisions,
        ends_together=constants.ends_together,
    )


@inlined
def step_world(
    state: WorldState,
    scratch: Scratch,
    actions: Actions,
    coverage: CoverageTask | None,
    metres: MetresArrays | None,
    viewpoints: Records | None,
) -> None:
    """Advance one world by one step.

    Drones act in index order against the map of the last observation; then the map and the persons
    move. Drones that share a cell collide when all have moved. In metres, `metres` has the actions.
    """
    constants, world, sea, entities, extensions = state
    drones, acting = entities.drones, action_constants_of(constants)
    eventful = begin_step(constants, world, drones, entities.persons)
    acts, out_of_time = acts_at(constants, world.t), is_out_of_time(constants, world.t)
    stamp, shared = next_stamp(scratch.occupied), False
    for n in range(len(drones)):
        drone, action = drones[n], actions[n]
        drone.found = False
        if not drone.alive:
            drone.reward = 0.0
            if metres is not None:
                stay(metres, n)
            if viewpoints is not None:
                set_viewpoint(viewpoints[n], 0, 0, NO_LOOK)
            # A withdrawn drone has no flag yet.
            eventful |= not (drone.terminated or drone.truncated)
            continue
        event, amount, looks = MOVED, 0.0, False
        if metres is not None:
            if acts:
                event, amount = fly_and_look(state, n, metres)
            else:
                stay(metres, n)
        elif acts and 0 <= action < acting.num_actions:
            event, amount = move(acting, world, sea, drone, action, coverage)
            looks = coverage is None and (event == SEARCHED or acting.moves_look)
            if looks and viewpoints is None:
                view = Viewpoint(drone.x, drone.y, action)
                event, amount = look(state, n, view, event)
        if viewpoints is not None:
            own = np.int64(action) if looks else np.int64(NO_LOOK)
            event, amount = look_from_vehicle(state, n, viewpoints[n], own, event)
        if out_of_time:
            event, amount = OUT_OF_TIME, drone.episode_return
            drone.truncated = True
        reward = reward_of(constants, world, coverage, event, amount)
        drone.reward = reward
        drone.episode_return += reward
        eventful |= drone.found or drone.terminated or drone.truncated
        if acting.collisions and can_collide(acting, drone):
            shared |= occupy(grid_of(acting), drone, scratch.occupied, stamp)
    world.t += 1
    if coverage is None:
        advance_sea(constants, world, sea, entities.persons, scratch.circle, extensions.ensemble)
    else:
        reward_if_all_covered(constants, world, drones, coverage)
    if shared:
        apply_collisions(constants, world, drones, scratch.occupied)
    if shared or eventful:
        end_step(constants, world, drones, entities.persons)


@inlined
def is_out_of_time(constants: Constants, t: int) -> bool:
    """Return whether the time of a mission is over after t steps."""
    return t >= constants.timestep_limit + constants.time_out_grace


@inlined
def acts_at(constants: Constants, t: int) -> bool:
    """Return whether drones do their actions after t steps."""
    return constants.time_out_acts or not is_out_of_time(constants, t)


@inlined
def begin_step(constants: Constants, world: WorldRecord, drones: Records, persons: Records) -> bool:
    """Clear what counts for a single step; return whether `end_step` is needed."""
    if constants.ends_together:
        for n in range(len(drones)):
            if drones[n].alive:
                drones[n].terminated = drones[n].truncated = False
    if constants.found_persons_stay:
        for p in range(len(persons)):
            persons[p].found = False
    return world.done or world.num_missing != len(persons)


@inlined
def move(
    acting: ActionConstants,
    world: WorldRecord,
    sea: Sea,
    drone: Drone,
    action: int,
    coverage: CoverageTask | None,
) -> tuple[int, float]:
    """Move a drone; return the event and, in the coverage task, the probability of the cell.

    A search moves no drone; in the coverage task it is a visit to the drone's own cell.
    """
    if coverage is None and action == acting.search_action:
        return SEARCHED, 0.0
    x, y, inside = cell_after(acting, sea.area, drone.x, drone.y, action)
    # Drones may fly on outside the grid, but not outside the area within it.
    if inside or (acting.leave_flies_on and not is_inside(grid_of(acting), x, y)):
        drone.x, drone.y = x, y
    drone.terminated = (acting.leave_terminates or acting.leave_flies_on) and not inside
    if not inside:
        return LEFT_GRID, 0.0
    probability = cover(world, coverage, x, y, acting.probability_of_detection)
    return COVERED if probability > 0.0 else MOVED, probability


@inlined
def fly_and_look(state: WorldState, n: int, metres: MetresArrays) -> tuple[int, float]:
    """Fly a drone for a step; return the event and the persons found on the way."""
    constants, world, sea, entities, extensions = state
    drone = entities.drones[n]
    inside = fly(constants, entities, metres, n)
    # In metres persons follow an ensemble.
    ensemble: SeaEnsemble = extensions.ensemble  # type: ignore[assignment]
    finds = detect_in_passing(constants, world, sea, entities, metres, ensemble, n)
    drone.found = finds > 0
    drone.terminated = constants.leave_terminates and not inside
    if finds > 0:
        return FOUND, np.float64(finds)
    return (MOVED if inside else LEFT_GRID), 0.0


@inlined
def cell_after(
    constants: Constants | ActionConstants, area: Area, x: int, y: int, action: Int
) -> tuple[int, int, bool]:
    """Return the cell in which an action from (x, y) ends, and whether it may be entered."""
    to_x, to_y = x + constants.dx[action], y + constants.dy[action]
    return to_x, to_y, is_open(area, grid_of(constants), to_x, to_y)


@inlined
def look_from_vehicle(
    state: WorldState, n: int, viewpoint: VehicleViewpoint, own: Int, event: int
) -> tuple[int, float]:
    """Do the looks of drone n from where its vehicle looked; see `look`.

    Without a preset viewpoint, the drone does those of its `own` action in its cell.
    """
    drone = state.entities.drones[n]
    if not (viewpoint.preset and acts_at(state.constants, state.world.t)):
        set_viewpoint(viewpoint, drone.x, drone.y, own)
    viewpoint.preset = False
    if viewpoint.action < 0:
        return event, 0.0
    view = Viewpoint(viewpoint.x, viewpoint.y, np.int64(viewpoint.action))
    return look(state, n, view, event)


@inlined
def look(state: WorldState, n: int, view: Viewpoint, event: int) -> tuple[int, float]:
    """Do the looks of drone n; return the event and the persons found, or the probability seen."""
    entities = state.entities
    kind = 0 if len(entities.look_starts) == 1 else entities.kinds[n]
    first, last = (
        entities.look_starts[kind, view.action],
        entities.look_starts[kind, view.action + 1],
    )
    drone, count = entities.drones[n], 0
    if last > first:
        count, bits = detect(state, view, first, last, state.extensions.ensemble)
        if count > 0:
            entities.finds[n] = bits
            drone.found = True
            if state.constants.ends_together:
                for m in range(len(entities.drones)):
                    entities.drones[m].terminated = True
            return FOUND, np.float64(count)
    if event == SEARCHED:
        return SEARCHED, probability_seen(state, view, first, last)
    return event, 0.0


@inlined
def detect(
    state: WorldState, view: Viewpoint, first: int, last: int, ensemble: SeaEnsemble | None
) -> tuple[int, np.uint64]:
    """Do the looks first..last - 1 from a `Viewpoint`.

    A look off the grid or outside the area finds nobody. After the end of a mission of v1 it does:
    its drones fly on off the grid, and search there.

    Returns:
        Number of persons found, and a bit for each look that found any.
    """
    constants, world, sea, entities, _ = state
    finds, bits, bit = 0, np.uint64(0), np.uint64(1)
    for k in range(first, last):
        x, y = view.x + entities.look_offsets[k, 0], view.y + entities.look_offsets[k, 1]
        for p in range(len(entities.persons)):
            person = entities.persons[p]
            gone = person.found and not constants.found_persons_stay
            if gone or person.x != x or person.y != y:
                continue
            if not is_open(sea.area, grid_of(constants), x, y) and not world.done:
                break
            chance = entities.look_pods[k, pod_column(ensemble, len(entities.persons), p)]
            if chance >= 1.0 or draw_unit(world) < chance:
                person.found = True
                finds += 1
                bits |= bit
            if constants.one_find_per_search:
                break
        bit <<= np.uint64(1)
    return finds, bits


@inlined
def probability_seen(state: WorldState, view: Viewpoint, first: int, last: int) -> float:
    """Return the probability of the cells of the looks first..last - 1, by the map."""
    constants, world, sea, entities, extensions = state
    probability = 0.0
    for k in range(first, last):
        x, y = view.x + entities.look_offsets[k, 0], view.y + entities.look_offsets[k, 1]
        if constants.leave_flies_on:
            # For a drone outside to the west or north, a negative index selects the cell.
            x = x + constants.columns if x < 0 else x
            y = y + constants.rows if y < 0 else y
        probability += probability_of(constants, world, sea, x, y, extensions.ensemble)
    return probability


@inlined
def probability_of(
    constants: Constants, world: WorldRecord, sea: Sea, x: int, y: int, ensemble: SeaEnsemble | None
) -> float:
    """Return the probability of the cell (x, y), 0 outside the grid and the area."""
    if ensemble is not None:
        return probability_in(constants, world, ensemble, x, y)
    return cell_probability(constants, world, sea.gauss, sea.area, x, y)


@inlined
def reward_of(
    constants: Constants,
    world: WorldRecord,
    coverage: CoverageTask | None,
    event: int,
    amount: float,
) -> float:
    """Return a drone's reward for an event: the table of rewards, by fields of the rules.

    Args:
        constants: Scenario and rules.
        world: The world; t is the number of steps done.
        coverage: None in a search for persons.
        event: What happened.
        amount: Of `FOUND`, the persons found; of `SEARCHED` and `COVERED`, the probability of the
            cells; of `OUT_OF_TIME`, the sum of the drone's rewards; of `COVERED_ALL`, the cells to
            cover for each drone.
    """
    if event == MOVED:
        return constants.move
    if event == LEFT_GRID:
        return constants.leave_grid
    if event == SEARCHED:
        least = constants.search_min_probability
        if amount > least or (constants.search_min_inclusive and amount == least):
            return amount * constants.search_scale
        return constants.search_below
    if event == FOUND:
        left = 1.0 - world.t / constants.timestep_limit
        return amount * (constants.find + constants.find_bonus * left)
    if event == OUT_OF_TIME:
        return constants.time_out - (amount if constants.time_out_total else 0.0)
    if event == COLLIDED:
        return constants.collision
    if event == COVERED:
        left = 1.0 - (world.t + 1) / constants.timestep_limit
        cells = cells_to_cover(coverage)
        return constants.cover + left * amount * constants.cover_scale * cells
    left = 1.0 - world.t / constants.timestep_limit
    return constants.cover_all * amount + left * constants.cover_all_bonus * amount


@part
def advance_sea(
    constants: Constants,
    world: WorldRecord,
    sea: Sea,
    persons: Records,
    circle: NDArray[np.int64],
    ensemble: SeaEnsemble | None,
) -> None:
    """Advance the map and the persons by one step."""
    if ensemble is not None:
        ensemble_step(constants, world, persons, sea.area, ensemble)
        return
    if constants.person_first:
        persons_step(constants, world, sea, persons)
    map_step(constants, world, sea, circle)
    if not constants.person_first:
        persons_step(constants, world, sea, persons)


@part
def reward_if_all_covered(
    constants: Constants, world: WorldRecord, drones: Records, coverage: CoverageTask
) -> None:
    """Flag and reward each drone in the search if this step covered the last cell."""
    if world.done or world.num_missing > 0:
        return
    share = cells_to_cover(coverage) / len(drones)
    reward = reward_of(constants, world, coverage, COVERED_ALL, share)
    for n in range(len(drones)):
        drone = drones[n]
        if drone.alive:
            drone.episode_return += reward - drone.reward
            drone.reward = reward
            drone.terminated = True


@part
def apply_collisions(
    constants: Constants, world: WorldRecord, drones: Records, occupied: NDArray[np.uint16]
) -> None:
    """Reward and terminate the drones that share a cell, which are recorded by `occupy`."""
    reward = reward_of(constants, world, None, COLLIDED, 0.0)
    for n in range(len(drones)):
        drone = drones[n]
        if can_collide(constants, drone) and has_collided(grid_of(constants), drones, n, occupied):
            drone.reward = reward
            drone.terminated = True


@part
def next_stamp(occupied: NDArray[np.uint16]) -> int:
    """Return a number with which no cell is marked; see `occupy`."""
    last = len(occupied) - 1
    if occupied[last] > 65532:
        for cell in range(last + 1):
            occupied[cell] = 0
    occupied[last] += 2
    return occupied[last]


@part
def occupy(grid: GridShape, drone: Drone, occupied: NDArray[np.uint16], stamp: int) -> bool:
    """Mark the cell of a drone; return whether the drone may share it.

    The last element of `occupied` (R C + 1,) uint16 is the stamp of this world's step, an even
    number. A cell with one drone is marked with the stamp, a cell with more drones with the next
    number. Smaller numbers are from earlier steps.
    """
    if not is_inside(grid, drone.x, drone.y):
        return True
    # Numba does not check an unsigned index for negative values.
    cell = np.uint64(drone.y * grid.columns + drone.x)
    shared = occupied[cell] >= stamp
    occupied[cell] = stamp + shared
    return shared


@part
def has_collided(grid: GridShape, drones: Records, n: int, occupied: NDArray[np.uint16]) -> bool:
    """Return whether drone n shares its cell; only those on the grid are in `occupied`."""
    drone = drones[n]
    if is_inside(grid, drone.x, drone.y):
        return occupied[drone.y * grid.columns + drone.x] > occupied[grid.columns * grid.rows]
    collided = False
    for m in range(len(drones)):
        collided = collided or (m != n and drones[m].x == drone.x and drones[m].y == drone.y)
    return collided


@part
def can_collide(constants: Constants | ActionConstants, drone: Drone) -> bool:
    """Return whether a drone can collide; if drones end together, flags do not matter."""
    return (
        drone.alive
        and not drone.cannot_collide
        and (constants.ends_together or not drone.terminated)
    )


@part
def end_step(constants: Constants, world: WorldRecord, drones: Records, persons: Records) -> None:
    """Flag the drones that have ended their search, and the world when all of them have."""
    if len(persons) > 0:
        world.num_missing = 0
        for p in range(len(persons)):
            world.num_missing += not persons[p].found
    all_found = world.num_missing == 0 and not constants.ends_together
    any_flag = False
    num_active = 0
    for n in range(len(drones)):
        drone = drones[n]
        if not drone.alive:
            # A drone without a flag was withdrawn since the last step.
            drone.terminated = drone.terminated or not drone.truncated
            continue
        drone.terminated = drone.terminated or all_found
        if drone.terminated or drone.truncated:
            any_flag = True
            drone.terminated = drone.terminated or constants.both_flags
            drone.truncated = drone.truncated or constants.both_flags
            drone.alive = constants.ends_together
        num_active += drone.alive
    world.num_active = num_active
    world.done = num_active == 0 or (constants.ends_together and any_flag)
    if constants.ends_together and world.done:
        # Drones that end only because the search ended are truncated.
        for n in range(len(drones)):
            drones[n].truncated = drones[n].truncated or not drones[n].terminated


@part
def start_world(state: WorldState, scratch: Scratch) -> None:
    """Set a world to its start: the start cell has the persons and all the probability."""
    constants, world, sea, entities, extensions = state
    start_map(constants, world)
    world.done = False
    world.num_active = len(entities.drones)
    world.num_missing = constants.person_amount
    for n in range(len(entities.drones)):
        drone = entities.drones[n]
        drone.x, drone.y = entities.start_cells[n, 0], entities.start_cells[n, 1]
        drone.episode_return = drone.reward = 0.0
        drone.alive = True
        drone.terminated = drone.truncated = drone.found = False
    start_in_metres(world, entities, extensions.metres)
    clear_viewpoints(extensions.viewpoints)
    start_task(
        constants, world, sea, entities.persons, scratch, extensions.coverage, extensions.ensemble
    )


@part
def start_task(
    constants: Constants,
    world: WorldRecord,
    sea: Sea,
    persons: Records,
    scratch: Scratch,
    coverage: CoverageTask | None,
    ensemble: SeaEnsemble | None,
) -> None:
    """Put the persons where they start, and let them drift until the drones arrive."""
    if coverage is not None:
        start_coverage(world, coverage)
        return
    start_persons(constants, world, sea, persons, scratch.cells, ensemble)
    for _ in range(constants.pre_search_steps + constants.reset_sea_steps):
        advance_sea(constants, world, sea, persons, scratch.circle, ensemble)


@part
def start_persons(
    constants: Constants,
    world: WorldRecord,
    sea: Sea,
    persons: Records,
    cells: NDArray[np.int64],
    ensemble: SeaEnsemble | None,
) -> None:
    """Put the persons in the start cell or around it, or on their tracks."""
    for p in range(len(persons)):
        person = persons[p]
        person.x, person.y = world.start_x, world.start_y
        person.remainder_x = person.remainder_y = 0.0
        person.found = False
        if constants.own_drift:
            draw_own_drift(constants, world, person)
    if ensemble is not None:
        put_on_tracks(world, persons, ensemble)
    elif constants.person_scatter > 0:
        scatter_persons(constants, world, sea.area, persons, cells)
