# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled faults and kinds of drones, which make drones deviate from their commands.

`before_step` decides the action of each drone and takes its energy from the battery, the world
steps with these actions, and `after_step` updates the drones' conditions. Neither runs if there
are no faults, each action takes one step, and all drones can do all actions without end. All draws
come from the world's generator, drone by drone in index order: loss, dropped command and stuck
before the step, false alarm and position after it, each only if the scenario has its fault.

Arguments with the same names mean the same everywhere: `constants` is an element of
`constants.CONSTANTS`, `faults` of `FAULT_CONSTANTS`, `world` of `kernels.WORLDS`; `flyer` is a
`fleet.Flyer`, and `area` a field of `sea_map.Sea`.
"""

from __future__ import annotations

import math
from math import ceil, cos, log, pi, sin, sqrt

import numpy as np

from dsse_ros.compiled.draws import draw_unit
from dsse_ros.compiled.jit import kernel, part
from dsse_ros.scenario.battery_fields import FULL
from dsse_ros.scenario.fault_fields import MAX_DELAY
from dsse_ros.step.constants import MAX_ACTIONS
from dsse_ros.step.fleet import flyer_of
from dsse_ros.step.recipe import end_of
from dsse_ros.targets.sea_map import is_inside

STATUSES = ("searching", "stuck", "identifying", "returning", "home", "lost", "under_way")
"""Drone status codes; the index is the number."""
SEARCHING, STUCK, IDENTIFYING, RETURNING, HOME, LOST, UNDER_WAY = range(len(STATUSES))

WORKS = ("done", "coming_back", "acting")
"""What the vehicle of a drone still has to do for its action; the index is the number."""
DONE, COMING_BACK, ACTING = range(len(WORKS))

HELD = -1
"""The action of a drone that does nothing, `world.HOLD`."""
ROUNDING = 1e-9
"""Tolerance for energy and the progress of a move: sums of decimal fractions are not exact."""

FAULT_CONSTANTS = np.dtype(
    [
        ("battery", "?"),  # batteries run down
        ("battery_move", "f8"),
        ("battery_search", "f8"),
        ("battery_hover", "f8"),
        ("battery_return", "f8"),
        ("battery_reserve", "f8"),
        ("relief_steps", "i8"),  # 0: no relief
        ("loss_rate", "f8"),
        ("stuck_rate", "f8"),
        ("stuck_steps", "i8"),
        ("command_delay", "i8"),
        ("command_drop_rate", "f8"),
        ("false_alarm_steps", "i8"),
        ("position_noise", "f8"),
        ("has_limits", "?"),  # a drone may be under way, lacks an action, or has an endurance
    ],
    align=True,
)
"""The fields of `fault_fields.FAULTS` in the kernels' format."""

ABILITIES = np.dtype(
    [
        ("share", "f8", (MAX_ACTIONS,)),  # fields of `action_times.ActionTimes`
        ("takes", "f8", (MAX_ACTIONS,)),
        ("after", "f8", (MAX_ACTIONS,)),
        ("binding", "?"),
        ("vehicle_timed", "?"),  # `CONDITIONS.work` counts instead of the times
        # Probability of a false alarm when an action looks and finds nobody.
        ("false_alarms", "f8", (MAX_ACTIONS,)),
        ("endurance", "i8"),  # steps that the drone can fly; 0: no limit
    ],
    align=True,
)
"""Abilities of each drone's kind."""

CONDITIONS = np.dtype(
    [
        ("seen_x", "i8"),  # reported position
        ("seen_y", "i8"),
        ("battery", "f8"),  # percent
        ("progress", "f8"),  # completed share of a move, or steps since a binding action began
        ("spare", "f8"),  # share of the last step that a binding action has left
        ("until", "i8"),  # step until which the drone is stuck, identifies, or is home
        ("status", "i1"),  # number in `STATUSES`
        ("applied", "i1"),  # action of the last step, `HELD` for none
        ("heading", "i1"),  # action in progress
        ("work", "i1"),  # number in `WORKS`, reported before a step
        ("pending", "i1", (MAX_DELAY,)),  # delayed commands
    ],
    align=True,
)
"""Condition of each drone under its faults."""


@part
def can_afford(faults, flyer, x, y, to_x, to_y, energy):
    """Return whether a drone can spend this energy and still return home with its reserve.

    It must be able to return from both cells, because a move against the wind may not complete.
    """
    steps = max(flyer.home_steps[y, x], flyer.home_steps[to_y, to_x])
    left = flyer.condition.battery - energy - steps * faults.battery_return
    return left >= faults.battery_reserve - ROUNDING


@part
def is_able(constants, flyer, action):
    """Return whether an action is `HELD` or possible for the drone's kind."""
    return not 0 <= action < constants.num_actions or flyer.ability.share[action] > 0.0


@part
def is_between(flyer):
    """Return whether a drone has a binding action in progress."""
    condition = flyer.condition
    is_busy = condition.heading != HELD and condition.status != RETURNING
    return flyer.ability.binding and is_busy


@part
def can_do(constants, faults, area, flyer, action):
    """Return whether a drone on the grid can do an action and still return home."""
    ability, condition = flyer.ability, flyer.condition
    x, y = flyer.drone.x, flyer.drone.y
    to_x, to_y = x, y
    if action == constants.search_action:
        energy = faults.battery_search
    elif not 0 <= action < constants.num_actions or ability.share[action] <= 0.0:
        energy = faults.battery_hover
    else:
        energy = faults.battery_move
        to_x, to_y, inside = end_of(constants, area, x, y, action)
        if not inside:
            to_x, to_y = x, y
        if ability.share[action] >= 1.0 or ability.binding:
            x, y = to_x, to_y
    if ability.binding and 0 <= action < constants.num_actions and ability.share[action] > 0.0:
        # A drone completes every binding action that it begins.
        begun = condition.progress if action == condition.heading else condition.spare
        left = ability.takes[action] + ability.after[action] - begun
        energy *= max(ceil(left - ROUNDING), 1)
    return can_afford(faults, flyer, x, y, to_x, to_y, energy)


@part
def can_go_on(constants, faults, area, flyer):
    """Return whether a drone can do anything other than return home."""
    if flyer.condition.status == IDENTIFYING:
        return can_do(constants, faults, area, flyer, HELD)
    if is_between(flyer):
        return can_do(constants, faults, area, flyer, flyer.condition.heading)
    for action in range(constants.num_actions):
        _, _, inside = end_of(constants, area, flyer.drone.x, flyer.drone.y, action)
        is_possible = flyer.ability.share[action] > 0.0 and inside
        if is_possible and can_do(constants, faults, area, flyer, action):
            return True
    return False


@part
def land(faults, world, flyer):
    """Record that a drone is home."""
    flyer.condition.status = HOME
    flyer.condition.until = world.t + faults.relief_steps


@part
def turn_home(faults, world, flyer):
    """Send a drone home, above the others; in its home cell it has arrived."""
    drone, condition = flyer.drone, flyer.condition
    condition.status = RETURNING
    if flyer.home_steps[drone.y, drone.x] == 0:
        land(faults, world, flyer)
    condition.progress = 0.0
    condition.heading = HELD
    drone.clear = True


@part
def lose(world, flyer):
    """Take a drone out of the mission; the following step terminates it."""
    flyer.condition.status = LOST
    flyer.drone.alive = False
    world.num_active -= 1


@part
def arrived_command(faults, world, flyer, command):
    """Return the command that reaches a drone in this step, `HELD` if none does."""
    if faults.command_delay > 0:
        slot = world.t % faults.command_delay
        delayed = flyer.condition.pending[slot]
        flyer.condition.pending[slot] = command
        command = delayed
    if faults.command_drop_rate > 0.0 and draw_unit(world) < faults.command_drop_rate:
        command = HELD
    return command


@part
def take_time(flyer, action):
    """Add a step to a binding action; return the action in the step of its effect, else `HELD`."""
    condition, ability = flyer.condition, flyer.ability
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
        condition.heading = HELD
    return action if has_effect else np.int64(HELD)


@part
def make_way(constants, flyer, action):
    """Add a step to a move's progress; return the move once it is complete, else `HELD`."""
    condition, ability = flyer.condition, flyer.ability
    if ability.binding and 0 <= action < constants.num_actions:
        return take_time(flyer, action)
    condition.spare = 0.0
    moves = 0 <= action < constants.num_actions and action != constants.search_action
    if not moves or ability.share[action] >= 1.0:
        condition.progress = 0.0
        condition.heading = HELD
        return action
    if action != condition.heading:
        condition.progress = 0.0
        condition.heading = action
    condition.progress += ability.share[action]
    if condition.progress < 1.0 - ROUNDING:
        return np.int64(HELD)
    condition.progress -= 1.0
    return action


@part
def may_turn(faults, flyer, inside):
    """Return whether a drone returns home when its battery suffices for nothing else."""
    status = flyer.condition.status
    flies = status in (SEARCHING, IDENTIFYING, UNDER_WAY)
    return faults.battery and inside and flies


@part
def decide(constants, faults, area, world, flyer, command):
    """Return the action of a drone in the air, and take its energy from the battery."""
    drone, condition = flyer.drone, flyer.condition
    action = np.int64(arrived_command(faults, world, flyer, command))
    may_stick = condition.status != STUCK and faults.stuck_rate > 0.0
    if may_stick and draw_unit(world) < faults.stuck_rate:
        condition.status = STUCK
        condition.until = world.t + faults.stuck_steps
    inside = is_inside(constants.grid_size, drone.x, drone.y)
    if is_between(flyer):
        action = np.int64(condition.heading)
    stays = condition.status == STUCK or condition.status == IDENTIFYING
    if stays or not is_able(constants, flyer, action):
        action = np.int64(HELD)
    if may_turn(faults, flyer, inside) and not can_do(constants, faults, area, flyer, action):
        turn_home(faults, world, flyer)
        if condition.status == HOME:
            return np.int64(HELD)
    energy = faults.battery_move
    if condition.status == RETURNING and inside:
        action = np.int64(flyer.home_actions[drone.y, drone.x])
        energy = faults.battery_return
    elif action == constants.search_action:
        energy = faults.battery_search
    elif not 0 <= action < constants.num_actions:
        energy = faults.battery_hover
    if not (condition.status == STUCK or (condition.status == IDENTIFYING and is_between(flyer))):
        action = make_way(constants, flyer, action)
    if flyer.ability.binding and (condition.status == SEARCHING or condition.status == UNDER_WAY):
        condition.status = UNDER_WAY if is_between(flyer) else SEARCHING
    if faults.battery:
        condition.battery = max(condition.battery - energy, 0.0)
    return action


@kernel
def before_step(batch, fleet, commands, first, last):
    """Write the actions of the drones in worlds first..last - 1 to `fleet.applied`.

    Args:
        batch: The worlds, a `kernels.Batch`.
        fleet: Their faults.
        commands: (B, N) int8.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    constants, faults, area = batch.constants[0], fleet.faults[0], batch.sea.area
    drones = batch.crew.drones
    for b in range(first, last):
        world = batch.worlds[b]
        for n in range(drones.shape[1]):
            fleet.applied[b, n] = HELD
            if world.done or not drones[b, n].alive:
                continue
            flyer = flyer_of(drones, fleet, b, n)
            if takes_part(faults, world, flyer, fleet.losses[n]):
                action = decide(constants, faults, area, world, flyer, commands[b, n])
                fleet.applied[b, n] = action


@part
def takes_part(faults, world, flyer, loss):
    """Return whether a drone is in the air, and take it out of the mission if it is lost.

    `loss` is the step in which it is lost by the scenario, 0 for never.
    """
    if flyer.condition.status == HOME:
        if faults.relief_steps == 0:
            flyer.drone.alive = False
            world.num_active -= 1
        return False
    lost = world.t + 1 == loss or (faults.battery and flyer.condition.battery <= 0.0)
    if faults.loss_rate > 0.0:
        lost |= draw_unit(world) < faults.loss_rate
    if lost:
        lose(world, flyer)
    return not lost


@part
def is_vacant(constants, drones, n):
    """Return whether a drone can take off in its cell without a collision there."""
    if not constants.collisions:
        return True
    drone = drones[n]
    for m in range(len(drones)):
        other = drones[m]
        in_the_way = m != n and other.alive and not other.clear
        if in_the_way and other.x == drone.x and other.y == drone.y:
            return False
    return True


@part
def observe(constants, faults, world, flyer):
    """Record the drone's reported position: with a normal error along each axis, on the grid."""
    drone, condition = flyer.drone, flyer.condition
    condition.seen_x, condition.seen_y = drone.x, drone.y
    is_noisy = faults.position_noise > 0.0 and drone.alive
    if is_noisy and is_inside(constants.grid_size, drone.x, drone.y):
        # Box and Muller; 1 - u is never 0.
        reach = faults.position_noise * sqrt(-2.0 * log(1.0 - draw_unit(world)))
        turn = 2.0 * pi * draw_unit(world)
        edge = constants.grid_size - 1
        # Cut the error to the size of the grid: the cast of a larger one is undefined.
        error_x = math.floor(min(max(reach * cos(turn) + 0.5, -edge), edge))
        error_y = math.floor(min(max(reach * sin(turn) + 0.5, -edge), edge))
        condition.seen_x = min(max(drone.x + error_x, 0), edge)
        condition.seen_y = min(max(drone.y + error_y, 0), edge)


@part
def start(constants, faults, area, world, flyer):
    """Set the condition of a drone to that at the start of a mission."""
    condition = flyer.condition
    flyer.drone.clear = False
    condition.battery = FULL
    condition.progress = 0.0
    condition.spare = 0.0
    condition.until = 0
    condition.status = SEARCHING
    condition.work = DONE
    condition.applied = condition.heading = HELD
    for k in range(MAX_DELAY):
        condition.pending[k] = HELD
    if faults.battery and not can_go_on(constants, faults, area, flyer):
        turn_home(faults, world, flyer)
    observe(constants, faults, world, flyer)


@part
def update(constants, faults, area, world, drones, n, flyer):
    """Update the condition of a drone still in the mission after a step."""
    drone, condition, ability = flyer.drone, flyer.condition, flyer.ability
    inside = is_inside(constants.grid_size, drone.x, drone.y)
    is_over = world.t >= condition.until
    if condition.status == HOME:
        if faults.relief_steps > 0 and is_over and is_vacant(constants, drones, n):
            condition.status = SEARCHING
            condition.battery = FULL
            drone.clear = False
    elif condition.status == RETURNING:
        if inside and flyer.home_steps[drone.y, drone.x] == 0:
            land(faults, world, flyer)
    elif (condition.status == STUCK or condition.status == IDENTIFYING) and is_over:
        under_way = UNDER_WAY if is_between(flyer) else SEARCHING
        condition.status = RETURNING if drone.clear else under_way
    has_acted = 0 <= condition.applied < constants.num_actions
    rate = ability.false_alarms[condition.applied] if has_acted else 0.0
    if rate > 0.0 and not drone.found and draw_unit(world) < rate:
        condition.status = IDENTIFYING
        condition.until = world.t + faults.false_alarm_steps
    if may_turn(faults, flyer, inside) and not can_go_on(constants, faults, area, flyer):
        turn_home(faults, world, flyer)
    if ability.endurance > 0 and world.t >= ability.endurance and not faults.battery:
        land(faults, world, flyer)
        condition.progress = 0.0
        condition.heading = HELD
        drone.clear = True


@kernel
def after_step(batch, fleet, first, last):
    """Update the drones' conditions after a step of the worlds first..last - 1."""
    constants, faults, area = batch.constants[0], fleet.faults[0], batch.sea.area
    drones = batch.crew.drones
    for b in range(first, last):
        world = batch.worlds[b]
        for n in range(drones.shape[1]):
            flyer = flyer_of(drones, fleet, b, n)
            if world.t == 0:
                # The batch reset this world in the step.
                start(constants, faults, area, world, flyer)
                continue
            flyer.condition.applied = fleet.applied[b, n]
            if flyer.drone.alive and not world.done:
                update(constants, faults, area, world, drones[b], n, flyer)
            observe(constants, faults, world, flyer)


@kernel
def start_conditions(batch, fleet, which, first, last):
    """Begin the missions of those of the worlds first..last - 1 with which[b], (B,) bool."""
    constants, faults, area = batch.constants[0], fleet.faults[0], batch.sea.area
    drones = batch.crew.drones
    for b in range(first, last):
        if which[b]:
            fleet.applied[b, :] = HELD
            for n in range(drones.shape[1]):
                flyer = flyer_of(drones, fleet, b, n)
                start(constants, faults, area, batch.worlds[b], flyer)


@part
def restrict_mask(constants, faults, area, flyer, mask):
    """Clear the actions that a drone cannot do in its mask (A,); at least one stays."""
    drone, condition = flyer.drone, flyer.condition
    if is_between(flyer):
        mask[:] = 0
        mask[condition.heading] = 1
        return
    to_home = faults.battery and is_inside(constants.grid_size, drone.x, drone.y)
    steered = condition.status == HOME or condition.status == RETURNING
    if faults.battery and not to_home:
        steered = False
    left = 0
    for a in range(constants.num_actions):
        if mask[a] and (
            steered
            or flyer.ability.share[a] <= 0.0
            or (to_home and not can_do(constants, faults, area, flyer, a))
        ):
            mask[a] = 0
        left += mask[a]
    if left == 0:
        home = flyer.home_actions[drone.y, drone.x] if to_home else HELD
        mask[home if home >= 0 else constants.search_action] = 1


@kernel
def restrict_masks(batch, fleet, masks, first, last):
    """Clear the actions that drones cannot do or that would keep them from returning home.

    For a drone that is under way, returning or home, only the action that continues this stays. At
    least one action always stays. `masks` are (B, N, A) int8, 0 for moves out of the grid or the
    area.
    """
    constants, faults, area = batch.constants[0], fleet.faults[0], batch.sea.area
    drones = batch.crew.drones
    if not (faults.battery or faults.has_limits):
        return
    for b in range(first, last):
        for n in range(drones.shape[1]):
            if drones[b, n].alive:
                flyer = flyer_of(drones, fleet, b, n)
                restrict_mask(constants, faults, area, flyer, masks[b, n])
