# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The search of one world, compiled: its step from top to bottom, and its start.

Arguments are as in `sea_map` and `WorldState`; `scratch` is the `kernels.Scratch` of a thread. A
function that does something else in the coverage task, with an ensemble, in metres or with
vehicles, takes this field of the task as an argument of its own: Numba prunes branches only for
arguments that are None.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.draws import draw_unit
from dsse_ros.compiled.jit import inlined, part
from dsse_ros.step.collisions import can_collide, has_collided, next_stamp, occupy
from dsse_ros.step.coverage_kernels import cells_to_cover, cover, put_back
from dsse_ros.step.ensemble_kernels import ensemble_step, probability_in, put_on_tracks
from dsse_ros.step.flight import detect_in_passing, fly, start_flights, stay
from dsse_ros.step.viewpoints import NO_LOOK, Viewpoint, clear_viewpoints, set_viewpoint
from dsse_ros.targets.person_kernels import draw_own_drift, persons_step, scatter_persons
from dsse_ros.targets.sea_map import (
    Sea,
    cell_probability,
    is_inside,
    is_open,
    map_step,
    start_map,
)

MOVED, LEFT, SEARCHED, FOUND, OUT_OF_TIME, MET, COVERED, COVERED_ALL = range(8)
"""Events of a drone's step, which `reward_of` rewards."""


class WorldState(NamedTuple):
    """All that the step of a world reads and writes.

    Attributes:
        constants: Of `constants.CONSTANTS`, never written.
        world: Of `kernels.WORLDS`.
        sea: Its sea.
        crew: A `kernels.Crew`, its drones and persons.
        task: A `kernels.Task`, what the drones look for.
    """

    constants: np.void
    world: np.void
    sea: Sea
    crew: Any
    task: Any


class Turn(NamedTuple):
    """What each drone's action reads of the constants, under the same names.

    It is read once a step: the compiler must assume that writes to a drone can change a constant.
    """

    grid_size: int
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
def turn_of(constants):
    """Return the constants of a drone's action."""
    return Turn(
        constants.grid_size, constants.dx, constants.dy, constants.num_actions,
        constants.search_action, constants.moves_look, constants.leave_flies_on,
        constants.leave_terminates, constants.probability_of_detection, constants.collisions,
        constants.ends_together,
    )  # fmt: skip


@inlined
def step_world(state, scratch, actions, coverage, flight, viewpoints):
    """Advance one world by one step.

    Drones act in index order against the map of the last observation, and the sea drifts. Drones
    that share a cell collide when all have moved. `actions` are (N,) int8; a number that is not an
    action does nothing. In metres `flight` has them. `viewpoints` are those of vehicles.
    """
    constants, world, sea, crew, task = state
    drones, turn = crew.drones, turn_of(constants)
    eventful = begin(constants, world, drones, crew.persons)
    acts, out_of_time = acts_at(constants, world.t), is_out_of_time(constants, world.t)
    stamp, shared = next_stamp(scratch.occupied), False
    for n in range(len(drones)):
        drone, action = drones[n], actions[n]
        drone.found = False
        if not drone.alive:
            drone.reward = 0.0
            if flight is not None:
                stay(flight, n)
            if viewpoints is not None:
                set_viewpoint(viewpoints[n], 0, 0, NO_LOOK)
            # A withdrawn drone has no flag yet.
            eventful |= not (drone.terminated or drone.truncated)
            continue
        event, amount, looks = MOVED, 0.0, False
        if flight is not None:
            if acts:
                event, amount = fly_and_look(state, n, flight)
            else:
                stay(flight, n)
        elif acts and 0 <= action < turn.num_actions:
            event, amount = move(turn, world, sea, drone, action, coverage)
            looks = coverage is None and (event == SEARCHED or turn.moves_look)
            if looks and viewpoints is None:
                view = Viewpoint(drone.x, drone.y, action)
                event, amount = look(state, n, view, event)
        if viewpoints is not None:
            own = np.int64(action) if looks else np.int64(NO_LOOK)
            event, amount = look_from_vehicle(state, n, own, event)
        if out_of_time:
            event, amount = OUT_OF_TIME, drone.episode_return
            drone.truncated = True
        reward = reward_of(constants, world, coverage, event, amount)
        drone.reward = reward
        drone.episode_return += reward
        eventful |= drone.found or drone.terminated or drone.truncated
        if turn.collisions and can_collide(turn, drone):
            shared |= occupy(turn.grid_size, drone, scratch.occupied, stamp)
    world.t += 1
    if coverage is None:
        drift(constants, world, sea, crew.persons, scratch.circle, task.ensemble)
    else:
        reward_if_all_covered(constants, world, drones, coverage)
    if shared:
        meet(constants, world, drones, scratch.occupied)
    if shared or eventful:
        end(constants, world, drones, crew.persons)


@inlined
def is_out_of_time(constants, t):
    """Return whether the time of a mission is over after t steps."""
    return t >= constants.timestep_limit + constants.time_out_grace


@inlined
def acts_at(constants, t):
    """Return whether drones do their actions after t steps."""
    return constants.time_out_acts or not is_out_of_time(constants, t)


@inlined
def begin(constants, world, drones, persons):
    """Clear what counts for a single step; return whether the flags need a look at its end."""
    if constants.ends_together:
        for n in range(len(drones)):
            if drones[n].alive:
                drones[n].terminated = drones[n].truncated = False
    if constants.found_persons_stay:
        for p in range(len(persons)):
            persons[p].found = False
    return world.done or world.num_missing != len(persons)


@inlined
def move(turn, world, sea, drone, action, coverage):
    """Move a drone; return the event and, in the coverage task, the probability of the cell.

    A search moves no drone; in the coverage task it is a visit to the drone's own cell.
    """
    if coverage is None and action == turn.search_action:
        return SEARCHED, 0.0
    x, y, inside = end_of(turn, sea.area, drone.x, drone.y, action)
    # Drones may fly on outside the grid, but not outside the area within it.
    if inside or (turn.leave_flies_on and not is_inside(turn.grid_size, x, y)):
        drone.x, drone.y = x, y
    drone.terminated = (turn.leave_terminates or turn.leave_flies_on) and not inside
    if not inside:
        return LEFT, 0.0
    probability = cover(turn, world, coverage, x, y)
    return COVERED if probability > 0.0 else MOVED, probability


@inlined
def fly_and_look(state, n, flight):
    """Fly a drone for a step; return the event and the persons found on the way."""
    constants, world, sea, crew, task = state
    drone = crew.drones[n]
    inside = fly(constants, crew, flight, n)
    finds = detect_in_passing(constants, world, sea, crew, flight, task.ensemble, n)
    drone.found = finds > 0
    drone.terminated = constants.leave_terminates and not inside
    if finds > 0:
        return FOUND, np.float64(finds)
    return (MOVED if inside else LEFT), 0.0


@inlined
def end_of(constants, area, x, y, action):
    """Return the cell in which an action from (x, y) ends, and whether it may be entered."""
    to_x, to_y = x + constants.dx[action], y + constants.dy[action]
    return to_x, to_y, is_open(area, constants.grid_size, to_x, to_y)


@inlined
def look_from_vehicle(state, n, own, event):
    """Do the looks of drone n from where its vehicle looked; see `look`.

    Without a preset viewpoint, the drone does those of its `own` action in its cell.
    """
    drone, viewpoint = state.crew.drones[n], state.task.viewpoints[n]
    if not (viewpoint.preset and acts_at(state.constants, state.world.t)):
        set_viewpoint(viewpoint, drone.x, drone.y, own)
    viewpoint.preset = False
    if viewpoint.action < 0:
        return event, 0.0
    view = Viewpoint(viewpoint.x, viewpoint.y, np.int64(viewpoint.action))
    return look(state, n, view, event)


@inlined
def look(state, n, view, event):
    """Do the looks of drone n; return the event and the persons found, or the probability seen."""
    crew = state.crew
    kind = 0 if len(crew.looks) == 1 else crew.kinds[n]
    first, last = crew.looks[kind, view.action], crew.looks[kind, view.action + 1]
    drone, count = crew.drones[n], 0
    if last > first:
        count, bits = detect(state, view, first, last)
        if count > 0:
            crew.finds[n] = bits
            drone.found = True
            if state.constants.ends_together:
                for m in range(len(crew.drones)):
                    crew.drones[m].terminated = True
            return FOUND, np.float64(count)
    if event == SEARCHED:
        return SEARCHED, probability_seen(state, view, first, last)
    return event, 0.0


@inlined
def detect(state, view, first, last):
    """Do the looks first..last - 1 from a `Viewpoint`.

    A look off the grid or outside the area finds nobody. After the end of a mission of v1 it does:
    its drones fly on off the grid, and search there.

    Returns:
        Number of persons found, and a bit for each look that found any.
    """
    constants, world, sea, crew, _ = state
    finds, bits, bit = 0, np.uint64(0), np.uint64(1)
    for k in range(first, last):
        x, y = view.x + crew.offsets[k, 0], view.y + crew.offsets[k, 1]
        for p in range(len(crew.persons)):
            person = crew.persons[p]
            gone = person.found and not constants.found_persons_stay
            if gone or person.x != x or person.y != y:
                continue
            if not is_open(sea.area, constants.grid_size, x, y) and not world.done:
                break
            chance = crew.pods[k, p]
            if chance >= 1.0 or draw_unit(world) < chance:
                person.found = True
                finds += 1
                bits |= bit
            if constants.one_find_per_search:
                break
        bit <<= np.uint64(1)
    return finds, bits


@inlined
def probability_seen(state, view, first, last):
    """Return the probability of the cells of the looks first..last - 1, by the map."""
    constants, world, sea, crew, task = state
    probability = 0.0
    for k in range(first, last):
        x, y = view.x + crew.offsets[k, 0], view.y + crew.offsets[k, 1]
        if constants.leave_flies_on:
            # For a drone outside to the west or north, a negative index selects the cell.
            x = x + constants.grid_size if x < 0 else x
            y = y + constants.grid_size if y < 0 else y
        probability += probability_of(constants, world, sea, x, y, task.ensemble)
    return probability


@inlined
def probability_of(constants, world, sea, x, y, ensemble):
    """Return the probability of the cell (x, y), 0 outside the grid and the area."""
    if ensemble is not None:
        return probability_in(constants, world, ensemble, x, y)
    return cell_probability(constants, world, sea.gauss, sea.area, x, y)


@inlined
def reward_of(constants, world, coverage, event, amount):
    """Return a drone's reward for an event: the table of rewards, by fields of the rules.

    Args:
        constants: As in the module.
        world: As in the module; t is the number of steps done.
        coverage: Of the task.
        event: Number of the event.
        amount: Of `FOUND`, the persons found; of `SEARCHED` and `COVERED`, the probability of the
            cells; of `OUT_OF_TIME`, the sum of the drone's rewards; of `COVERED_ALL`, the cells to
            cover for each drone.
    """
    if event == MOVED:
        return constants.move
    if event == LEFT:
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
    if event == MET:
        return constants.collision
    if event == COVERED:
        left = 1.0 - (world.t + 1) / constants.timestep_limit
        cells = cells_to_cover(coverage)
        return constants.cover + left * amount * constants.cover_scale * cells
    left = 1.0 - world.t / constants.timestep_limit
    return constants.cover_all * amount + left * constants.cover_all_bonus * amount


@part
def drift(constants, world, sea, persons, circle, ensemble):
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
def reward_if_all_covered(constants, world, drones, coverage):
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
def meet(constants, world, drones, occupied):
    """Reward and terminate the drones that share a cell, which are recorded by `occupy`."""
    reward = reward_of(constants, world, None, MET, 0.0)
    for n in range(len(drones)):
        drone = drones[n]
        if can_collide(constants, drone) and has_collided(constants.grid_size, drones, n, occupied):
            drone.reward = reward
            drone.terminated = True


@part
def end(constants, world, drones, persons):
    """Flag the drones whose search has ended, and the world when all of them have ended."""
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
def start_world(state, scratch):
    """Set a world to its start: the start cell has the persons and all the probability."""
    constants, world, sea, crew, task = state
    start_map(constants, world)
    world.done = False
    world.num_active = len(crew.drones)
    world.num_missing = constants.person_amount
    for n in range(len(crew.drones)):
        drone = crew.drones[n]
        drone.x, drone.y = crew.starts[n, 0], crew.starts[n, 1]
        drone.episode_return = drone.reward = 0.0
        drone.alive = True
        drone.terminated = drone.truncated = drone.found = False
    start_flights(world, crew, task.flight)
    clear_viewpoints(task.viewpoints)
    start_task(constants, world, sea, crew.persons, scratch, task.coverage, task.ensemble)


@part
def start_task(constants, world, sea, persons, scratch, coverage, ensemble):
    """Put the persons where they start, and let them drift until the drones arrive."""
    if coverage is not None:
        put_back(world, coverage)
        return
    start_persons(constants, world, sea, persons, scratch.cells, ensemble)
    for _ in range(constants.pre_search_steps + constants.reset_sea_steps):
        drift(constants, world, sea, persons, scratch.circle, ensemble)


@part
def start_persons(constants, world, sea, persons, cells, ensemble):
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
