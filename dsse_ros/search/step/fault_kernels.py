# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled faults and kinds of drones, which make drones deviate from their commands.

`before_step` decides the action of each drone and takes its energy from the battery, the world
steps with these actions, and `after_step` updates the drones' conditions. Neither runs if there
are no faults, each action takes one step, and all drones can do all actions without end. All draws
come from the world's generator, drone by drone in index order: loss, dropped command and stuck
before the step, false alarm and position after it, each only if the scenario has its fault.
"""

from __future__ import annotations

import math
from math import ceil, cos, log, pi, sin, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.draws import draw_unit
from dsse_ros.base.compiled.jit import expanded, kernel, part
from dsse_ros.base.compiled.records import Int, Int8, dtype_of
from dsse_ros.search.step.constants import MAX_ACTIONS, NO_ACTION, Constants
from dsse_ros.search.step.entities import Actions, Area, Drone, Masks, Records, WorldRecord
from dsse_ros.search.step.recipe import cell_after
from dsse_ros.search.step.world_state import Batch
from dsse_ros.world.scenario.battery_fields import FULL
from dsse_ros.world.scenario.fault_fields import MAX_DELAY
from dsse_ros.world.targets.sea_map import grid_of, is_inside

STATUSES = ("searching", "stuck", "identifying", "returning", "home", "lost", "under_way")
"""Drone status codes; the index is the number."""
SEARCHING, STUCK, IDENTIFYING, RETURNING, HOME, LOST, UNDER_WAY = range(len(STATUSES))

WORKS = ("done", "coming_back", "acting")
"""What the vehicle of a drone still has to do for its action; the index is the number."""
DONE, COMING_BACK, ACTING = range(len(WORKS))

ROUNDING = 1e-9
"""Tolerance for energy and the progress of a move: sums of decimal fractions are not exact."""


class FaultConstants:
    """The fields of `fault_fields.FAULTS`."""

    battery: bool  # batteries run down
    battery_move: float
    battery_search: float
    battery_hover: float
    battery_return: float
    battery_reserve: float
    relief_steps: int  # 0: no relief
    loss_rate: float
    stuck_rate: float
    stuck_steps: int
    command_delay: int
    command_drop_rate: float
    false_alarm_steps: int
    position_noise: float
    has_limits: bool  # a drone may be under way, lacks an action, or has an endurance


FAULT_CONSTANTS = dtype_of(FaultConstants)


class Ability:
    """The abilities of a drone: of its kind, with fields of `action_times.ActionTimes`."""

    share: Annotated[
        NDArray[np.float64], ("f8", (MAX_ACTIONS,))
    ]  # fields of `action_times.ActionTimes`
    takes: Annotated[NDArray[np.float64], ("f8", (MAX_ACTIONS,))]
    after: Annotated[NDArray[np.float64], ("f8", (MAX_ACTIONS,))]
    binding: bool
    vehicle_timed: bool  # `CONDITIONS.work` counts instead of the times
    # Probability of a false alarm when an action looks and finds nobody.
    false_alarms: Annotated[NDArray[np.float64], ("f8", (MAX_ACTIONS,))]
    endurance: int  # steps that the drone can fly; 0: no limit


ABILITIES = dtype_of(Ability)


class Condition:
    """The condition of a drone under its faults."""

    seen_x: int  # reported position
    seen_y: int
    battery: float  # percent
    progress: float  # completed share of a move, or steps since a binding action began
    spare: float  # share of the last step that a binding action has left
    until: int  # step until which the drone is stuck, identifies, or is home
    status: Int8  # number in `STATUSES`
    applied: Int8  # action of the last step, `NO_ACTION` for none
    heading: Int8  # action in progress
    work: Int8  # number in `WORKS`, reported before a step
    pending: Annotated[NDArray[np.int8], ("i1", (MAX_DELAY,))]  # delayed commands


CONDITIONS = dtype_of(Condition)


class FaultArrays(NamedTuple):
    """The faults of B worlds, and the abilities of their drones.

    Attributes:
        faults: (1,) of `FAULT_CONSTANTS`.
        abilities: (N,) of `ABILITIES`.
        conditions: (B, N) of `CONDITIONS`.
        losses: (N,) int64, step in which each drone is lost; 0 for never.
        home_steps: (N, R, C) int32 of `ways_home.WaysHome`; (N, 0, 0) without batteries.
        home_actions: (N, R, C) int8 of `ways_home.WaysHome`; (N, 0, 0) without batteries.
        applied: (B, N) int8, actions that the drones did in the last step.
    """

    faults: NDArray[np.void]
    abilities: NDArray[np.void]
    conditions: NDArray[np.void]
    losses: NDArray[np.int64]
    home_steps: NDArray[np.int32]
    home_actions: NDArray[np.int8]
    applied: NDArray[np.int8]


class DroneRecords(NamedTuple):
    """One drone of one world.

    Attributes:
        drone: Of `entities.DRONES`.
        condition: Of `CONDITIONS`.
        ability: Of `ABILITIES`.
        home_steps: (R, C) int32, of `FaultArrays`.
        home_actions: (R, C) int8, of `FaultArrays`.
    """

    drone: Drone
    condition: Condition
    ability: Ability
    home_steps: NDArray[np.int32]
    home_actions: NDArray[np.int8]


@expanded
def records_of(drones: Records, fault_arrays: FaultArrays, b: int, n: int) -> DroneRecords:
    """Return drone n of world b."""
    return DroneRecords(
        drone=drones[b, n],
        condition=fault_arrays.conditions[b, n],
        ability=fault_arrays.abilities[n],
        home_steps=fault_arrays.home_steps[n],
        home_actions=fault_arrays.home_actions[n],
    )


@part
def can_afford(
    faults: FaultConstants,
    records: DroneRecords,
    x: int,
    y: int,
    to_x: int,
    to_y: int,
    energy: float,
) -> bool:
    """Return whether a drone can spend this energy and still return home with its reserve.

    It must be able to return from both cells, because a move against the wind may not complete.
    """
    steps = max(records.home_steps[y, x], records.home_steps[to_y, to_x])
    left = records.condition.battery - energy - steps * faults.battery_return
    return left >= faults.battery_reserve - ROUNDING


@part
def is_able(constants: Constants, records: DroneRecords, action: Int) -> bool:
    """Return whether an action is `NO_ACTION` or possible for the drone's kind."""
    return not 0 <= action < constants.num_actions or records.ability.share[action] > 0.0


@part
def has_action_in_progress(records: DroneRecords) -> bool:
    """Return whether a drone has a binding action in progress."""
    condition = records.condition
    is_busy = condition.heading != NO_ACTION and condition.status != RETURNING
    return records.ability.binding and is_busy


@part
def can_do(
    constants: Constants, faults: FaultConstants, area: Area, records: DroneRecords, action: Int
) -> bool:
    """Return whether a drone on the grid can do an action and still return home."""
    ability, condition = records.ability, records.condition
    x, y = records.drone.x, records.drone.y
    to_x, to_y = x, y
    if action == constants.search_action:
        energy = faults.battery_search
    elif not 0 <= action < constants.num_actions or ability.share[action] <= 0.0:
        energy = faults.battery_hover
    else:
        energy = faults.battery_move
        to_x, to_y, inside = cell_after(constants, area, x, y, action)
        if not inside:
            to_x, to_y = x, y
        if ability.share[action] >= 1.0 or ability.binding:
            x, y = to_x, to_y
    if ability.binding and 0 <= action < constants.num_actions and ability.share[action] > 0.0:
        # A drone completes every binding action that it begins.
        begun = condition.progress if action == condition.heading else condition.spare
        left = ability.takes[action] + ability.after[action] - begun
        energy *= max(ceil(left - ROUNDING), 1)
    return can_afford(faults, records, x, y, to_x, to_y, energy)


@part
def can_go_on(
    constants: Constants, faults: FaultConstants, area: Area, records: DroneRecords
) -> bool:
    """Return whether a drone can do anything other than return home."""
    if records.condition.status == IDENTIFYING:
        return can_do(constants, faults, area, records, NO_ACTION)
    if has_action_in_progress(records):
        return can_do(constants, faults, area, records, records.condition.heading)
    for action in range(constants.num_actions):
        _, _, inside = cell_after(constants, area, records.drone.x, records.drone.y, action)
        is_possible = records.ability.share[action] > 0.0 and inside
        if is_possible and can_do(constants, faults, area, records, action):
            return True
    return False


@part
def land(faults: FaultConstants, world: WorldRecord, records: DroneRecords) -> None:
    """Record that a drone is home."""
    records.condition.status = HOME
    records.condition.until = world.t + faults.relief_steps


@part
def turn_home(faults: FaultConstants, world: WorldRecord, records: DroneRecords) -> None:
    """Send a drone home, above the others; in its home cell it has arrived."""
    drone, condition = records.drone, records.condition
    condition.status = RETURNING
    if records.home_steps[drone.y, drone.x] == 0:
        land(faults, world, records)
    condition.progress = 0.0
    condition.heading = NO_ACTION
    drone.cannot_collide = True


@part
def mark_lost(world: WorldRecord, records: DroneRecords) -> None:
    """Take a drone out of the mission; the following step terminates it."""
    records.condition.status = LOST
    records.drone.alive = False
    world.num_active -= 1


@part
def arrived_command(
    faults: FaultConstants, world: WorldRecord, records: DroneRecords, command: int
) -> int:
    """Return the command that reaches a drone in this step, `NO_ACTION` if none does."""
    if faults.command_delay > 0:
        slot = world.t % faults.command_delay
        delayed = records.condition.pending[slot]
        records.condition.pending[slot] = command
        command = delayed
    if faults.command_drop_rate > 0.0 and draw_unit(world) < faults.command_drop_rate:
        command = NO_ACTION
    return command


@part
def take_time(records: DroneRecords, action: Int) -> Int:
    """Add a step to a binding action; return it in the step of its effect, else `NO_ACTION`."""
    condition, ability = records.condition, records.ability
    if action != condition.heading:
        condition.progress = condition.spare
        condition.heading = action
    before, takes = condition.progress, ability.takes[action]
    condition.progress += 1.0
    left = takes + ability.after[action] - condition.progress
    if ability.vehicle_timed:
        # The progress stays below `takes` until the vehicle has acted.
        still_acts = condition.work == ACTING
        condition.progress = min(condition.progress, takes - 1.0) if still_acts else takes
        left = 0.0 if condition.work == DONE else 1.0
    has_effect = before < takes - ROUNDING and condition.progress >= takes - ROUNDING
    if left < ROUNDING:
        condition.spare = max(-left, 0.0)
        condition.progress = 0.0
        condition.heading = NO_ACTION
    return action if has_effect else np.int64(NO_ACTION)


@part
def advance_move(constants: Constants, records: DroneRecords, action: Int) -> Int:
    """Add a step to a move's progress; return the move once it is complete, else `NO_ACTION`."""
    condition, ability = records.condition, records.ability
    if ability.binding and 0 <= action < constants.num_actions:
        return take_time(records, action)
    condition.spare = 0.0
    moves = 0 <= action < constants.num_actions and action != constants.search_action
    if not moves or ability.share[action] >= 1.0:
        condition.progress = 0.0
        condition.heading = NO_ACTION
        return action
    if action != condition.heading:
        condition.progress = 0.0
        condition.heading = action
    condition.progress += ability.share[action]
    if condition.progress < 1.0 - ROUNDING:
        return np.int64(NO_ACTION)
    condition.progress -= 1.0
    return action


@part
def may_turn(faults: FaultConstants, records: DroneRecords, inside: bool) -> bool:
    """Return whether a drone returns home when its battery suffices for nothing else."""
    status = records.condition.status
    flies = status in (SEARCHING, IDENTIFYING, UNDER_WAY)
    return faults.battery and inside and flies


@part
def decide(
    constants: Constants,
    faults: FaultConstants,
    area: Area,
    world: WorldRecord,
    records: DroneRecords,
    command: int,
) -> Int:
    """Return the action of a drone in the air, and take its energy from the battery."""
    drone, condition = records.drone, records.condition
    action: Int = np.int64(arrived_command(faults, world, records, command))
    may_stick = condition.status != STUCK and faults.stuck_rate > 0.0
    if may_stick and draw_unit(world) < faults.stuck_rate:
        condition.status = STUCK
        condition.until = world.t + faults.stuck_steps
    inside = is_inside(grid_of(constants), drone.x, drone.y)
    if has_action_in_progress(records):
        action = np.int64(condition.heading)
    stays = condition.status == STUCK or condition.status == IDENTIFYING
    if stays or not is_able(constants, records, action):
        action = np.int64(NO_ACTION)
    if may_turn(faults, records, inside) and not can_do(constants, faults, area, records, action):
        turn_home(faults, world, records)
        if condition.status == HOME:
            return np.int64(NO_ACTION)
    energy = faults.battery_move
    if condition.status == RETURNING and inside:
        action = np.int64(records.home_actions[drone.y, drone.x])
        energy = faults.battery_return
    elif action == constants.search_action:
        energy = faults.battery_search
    elif not 0 <= action < constants.num_actions:
        energy = faults.battery_hover
    if not (
        condition.status == STUCK
        or (condition.status == IDENTIFYING and has_action_in_progress(records))
    ):
        action = advance_move(constants, records, action)
    if records.ability.binding and (condition.status == SEARCHING or condition.status == UNDER_WAY):
        condition.status = UNDER_WAY if has_action_in_progress(records) else SEARCHING
    if faults.battery:
        condition.battery = max(condition.battery - energy, 0.0)
    return action


@kernel
def before_step(
    batch: Batch, fault_arrays: FaultArrays, commands: Actions, first: int, last: int
) -> None:
    """Write the actions of the drones in worlds first..last - 1 to `fault_arrays.applied`.

    Args:
        batch: The worlds, a `world_state.Batch`.
        fault_arrays: Their faults.
        commands: (B, N) int8.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    constants, faults, area = batch.constants[0], fault_arrays.faults[0], batch.sea.area
    drones = batch.entities.drones
    for b in range(first, last):
        world = batch.worlds[b]
        for n in range(drones.shape[1]):
            fault_arrays.applied[b, n] = NO_ACTION
            if world.done or not drones[b, n].alive:
                continue
            records = records_of(drones, fault_arrays, b, n)
            if takes_part(faults, world, records, fault_arrays.losses[n]):
                action = decide(constants, faults, area, world, records, commands[b, n])
                fault_arrays.applied[b, n] = action


@part
def takes_part(
    faults: FaultConstants, world: WorldRecord, records: DroneRecords, loss: int
) -> bool:
    """Return whether a drone is in the air, and take it out of the mission if it is lost.

    `loss` is the step in which it is lost by the scenario, 0 for never.
    """
    if records.condition.status == HOME:
        if faults.relief_steps == 0:
            records.drone.alive = False
            world.num_active -= 1
        return False
    lost = world.t + 1 == loss or (faults.battery and records.condition.battery <= 0.0)
    if faults.loss_rate > 0.0:
        lost |= draw_unit(world) < faults.loss_rate
    if lost:
        mark_lost(world, records)
    return not lost


@part
def is_vacant(constants: Constants, drones: Records, n: int) -> bool:
    """Return whether a drone can take off in its cell without a collision there."""
    if not constants.collisions:
        return True
    drone = drones[n]
    for m in range(len(drones)):
        other = drones[m]
        in_the_way = m != n and other.alive and not other.cannot_collide
        if in_the_way and other.x == drone.x and other.y == drone.y:
            return False
    return True


@part
def report_position(
    constants: Constants, faults: FaultConstants, world: WorldRecord, records: DroneRecords
) -> None:
    """Record the drone's reported position: with a normal error along each axis, on the grid."""
    drone, condition = records.drone, records.condition
    condition.seen_x, condition.seen_y = drone.x, drone.y
    is_noisy = faults.position_noise > 0.0 and drone.alive
    if is_noisy and is_inside(grid_of(constants), drone.x, drone.y):
        # Box and Muller; 1 - u is never 0.
        reach = faults.position_noise * sqrt(-2.0 * log(1.0 - draw_unit(world)))
        turn = 2.0 * pi * draw_unit(world)
        edge_x, edge_y = constants.columns - 1, constants.rows - 1
        # Cut the error to the size of the grid: the cast of a larger one is undefined.
        error_x = math.floor(min(max(reach * cos(turn) + 0.5, -edge_x), edge_x))
        error_y = math.floor(min(max(reach * sin(turn) + 0.5, -edge_y), edge_y))
        condition.seen_x = min(max(drone.x + error_x, 0), edge_x)
        condition.seen_y = min(max(drone.y + error_y, 0), edge_y)


@part
def start_condition(
    constants: Constants,
    faults: FaultConstants,
    area: Area,
    world: WorldRecord,
    records: DroneRecords,
) -> None:
    """Set the condition of a drone to that at the start of a mission."""
    condition = records.condition
    records.drone.cannot_collide = False
    condition.battery = FULL
    condition.progress = 0.0
    condition.spare = 0.0
    condition.until = 0
    condition.status = SEARCHING
    condition.work = DONE
    condition.applied = condition.heading = NO_ACTION
    for k in range(MAX_DELAY):
        condition.pending[k] = NO_ACTION
    if faults.battery and not can_go_on(constants, faults, area, records):
        turn_home(faults, world, records)
    report_position(constants, faults, world, records)


@part
def update_condition(
    constants: Constants,
    faults: FaultConstants,
    area: Area,
    world: WorldRecord,
    drones: Records,
    n: int,
    records: DroneRecords,
) -> None:
    """Update the condition of a drone still in the mission after a step."""
    drone, condition, ability = records.drone, records.condition, records.ability
    inside = is_inside(grid_of(constants), drone.x, drone.y)
    is_over = world.t >= condition.until
    if condition.status == HOME:
        if faults.relief_steps > 0 and is_over and is_vacant(constants, drones, n):
            condition.status = SEARCHING
            condition.battery = FULL
            drone.cannot_collide = False
    elif condition.status == RETURNING:
        if inside and records.home_steps[drone.y, drone.x] == 0:
            land(faults, world, records)
    elif (condition.status == STUCK or condition.status == IDENTIFYING) and is_over:
        under_way = UNDER_WAY if has_action_in_progress(records) else SEARCHING
        condition.status = RETURNING if drone.cannot_collide else under_way
    has_acted = 0 <= condition.applied < constants.num_actions
    rate = ability.false_alarms[condition.applied] if has_acted else 0.0
    if rate > 0.0 and not drone.found and draw_unit(world) < rate:
        condition.status = IDENTIFYING
        condition.until = world.t + faults.false_alarm_steps
    if may_turn(faults, records, inside) and not can_go_on(constants, faults, area, records):
        turn_home(faults, world, records)
    if ability.endurance > 0 and world.t >= ability.endurance and not faults.battery:
        land(faults, world, records)
        condition.progress = 0.0
        condition.heading = NO_ACTION
        drone.cannot_collide = True


@kernel
def after_step(batch: Batch, fault_arrays: FaultArrays, first: int, last: int) -> None:
    """Update the drones' conditions after a step of the worlds first..last - 1."""
    constants, faults, area = batch.constants[0], fault_arrays.faults[0], batch.sea.area
    drones = batch.entities.drones
    for b in range(first, last):
        world = batch.worlds[b]
        for n in range(drones.shape[1]):
            records = records_of(drones, fault_arrays, b, n)
            if world.t == 0:
                # The batch reset this world in the step.
                start_condition(constants, faults, area, world, records)
                continue
            records.condition.applied = fault_arrays.applied[b, n]
            if records.drone.alive and not world.done:
                update_condition(constants, faults, area, world, drones[b], n, records)
            report_position(constants, faults, world, records)


@kernel
def start_conditions(
    batch: Batch, fault_arrays: FaultArrays, which: NDArray[np.bool_], first: int, last: int
) -> None:
    """Begin the missions of those of the worlds first..last - 1 with which[b], (B,) bool."""
    constants, faults, area = batch.constants[0], fault_arrays.faults[0], batch.sea.area
    drones = batch.entities.drones
    for b in range(first, last):
        if which[b]:
            fault_arrays.applied[b, :] = NO_ACTION
            for n in range(drones.shape[1]):
                records = records_of(drones, fault_arrays, b, n)
                start_condition(constants, faults, area, batch.worlds[b], records)


@part
def restrict_mask(
    constants: Constants,
    faults: FaultConstants,
    area: Area,
    records: DroneRecords,
    mask: NDArray[np.int8],
) -> None:
    """Clear the actions that a drone cannot do in its mask (A,); at least one stays."""
    drone, condition = records.drone, records.condition
    if has_action_in_progress(records):
        mask[:] = 0
        mask[condition.heading] = 1
        return
    to_home = faults.battery and is_inside(grid_of(constants), drone.x, drone.y)
    steered = condition.status == HOME or condition.status == RETURNING
    if faults.battery and not to_home:
        steered = False
    left = 0
    for a in range(constants.num_actions):
        if mask[a] and (
            steered
            or records.ability.share[a] <= 0.0
            or (to_home and not can_do(constants, faults, area, records, a))
        ):
            mask[a] = 0
        left += mask[a]
    if left == 0:
        home = records.home_actions[drone.y, drone.x] if to_home else NO_ACTION
        mask[home if home >= 0 else constants.search_action] = 1


@kernel
def restrict_masks(
    batch: Batch, fault_arrays: FaultArrays, masks: Masks, first: int, last: int
) -> None:
    """Clear the actions that drones cannot do or that would keep them from returning home.

    For a drone that is under way, returning or home, only the action that continues this stays. At
    least one action always stays. `masks` are (B, N, A) int8, 0 for moves out of the grid or the
    area.
    """
    constants, faults, area = batch.constants[0], fault_arrays.faults[0], batch.sea.area
    drones = batch.entities.drones
    if not (faults.battery or faults.has_limits):
        return
    for b in range(first, last):
        for n in range(drones.shape[1]):
            if drones[b, n].alive:
                records = records_of(drones, fault_arrays, b, n)
                restrict_mask(constants, faults, area, records, masks[b, n])
