# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled faults and kinds of drones, which make drones deviate from their commands.

`before_step` decides the action of each drone and takes its energy from the battery, the world
steps with these actions, and `after_step` updates the drones' conditions. Neither runs if there
are no faults and all drones are equally fast, can do all actions and have no endurance. All draws
come from the world's generator, drone by drone in index order: loss, dropped command and stuck
before the step, false alarm and position after it, each only if the scenario has its fault.
"""

from __future__ import annotations

from math import ceil, cos, log, pi, sin, sqrt

import numpy as np

from dsse_ros.compiled.draws import draw_unit
from dsse_ros.compiled.jit import kernel, part
from dsse_ros.scenario.battery_fields import FULL
from dsse_ros.scenario.fault_fields import MAX_DELAY
from dsse_ros.step.constants import MAX_ACTIONS
from dsse_ros.targets.sea_map import is_inside, is_open

STATUSES = ("searching", "stuck", "identifying", "returning", "home", "lost", "under_way")
"""Drone status codes; the index is the number."""
SEARCHING, STUCK, IDENTIFYING, RETURNING, HOME, LOST, UNDER_WAY = range(len(STATUSES))

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
        ("has_limits", "?"),  # a drone is slower than another, lacks an action, or has an endurance
    ],
    align=True,
)
"""The fields of `fault_fields.FAULTS` in the kernels' format."""

ABILITIES = np.dtype(
    [
        ("pace", "f8", (MAX_ACTIONS,)),  # share of each move covered per step; 0: cannot do it
        # Probability of a false alarm when an action looks and finds nobody.
        ("false_alarms", "f8", (MAX_ACTIONS,)),
        ("endurance", "i8"),  # steps that the drone can fly; 0: no limit
        ("slower", "?"),  # than the fastest drone: its status during a move is under_way
    ],
    align=True,
)
"""Abilities of each drone's kind."""

CONDITIONS = np.dtype(
    [
        ("seen_x", "i8"),  # reported position
        ("seen_y", "i8"),
        ("battery", "f8"),  # percent
        ("progress", "f8"),  # completed share of a move
        ("until", "i8"),  # step until which the drone is stuck, identifies, or is home
        ("status", "i1"),  # number in `STATUSES`
        ("applied", "i1"),  # action of the last step, `HELD` for none
        ("heading", "i1"),  # action of the move in progress
        ("pending", "i1", (MAX_DELAY,)),  # delayed commands
    ],
    align=True,
)
"""Condition of each drone under its faults."""


@part
def can_afford(f, o, home_steps, x, y, to_x, to_y, energy):
    """Return whether a drone can spend this energy and still return home with its reserve.

    It must be able to return from both cells, because a move against the wind may not complete.
    """
    steps = max(home_steps[y, x], home_steps[to_y, to_x])
    left = o.battery - energy - steps * f.battery_return
    return left >= f.battery_reserve - ROUNDING


@part
def is_able(c, s, action):
    """Return whether an action is `HELD` or possible for the drone's kind."""
    return not 0 <= action < c.num_actions or s.pace[action] > 0.0


@part
def is_between(s, o):
    """Return whether a slower drone has a move in progress."""
    return s.slower and o.heading != HELD and o.status != RETURNING


@part
def can_do(c, f, area, d, o, s, home_steps, action):
    """Return whether a drone on the grid can do an action and still return home."""
    x, y = d.x, d.y
    to_x, to_y = x, y
    if action == c.search_action:
        energy = f.battery_search
    elif not 0 <= action < c.num_actions or s.pace[action] <= 0.0:
        energy = f.battery_hover
    else:
        energy = f.battery_move
        if is_open(area, c.grid_size, x + c.dx[action], y + c.dy[action]):
            to_x, to_y = x + c.dx[action], y + c.dy[action]
        if s.pace[action] >= 1.0:
            x, y = to_x, to_y
        elif s.slower:
            # A slower drone completes every move that it begins.
            x, y = to_x, to_y
            left = 1.0 - (o.progress if action == o.heading else 0.0)
            energy *= ceil(left / s.pace[action] - ROUNDING)
    return can_afford(f, o, home_steps, x, y, to_x, to_y, energy)


@part
def can_go_on(c, f, area, d, o, s, home_steps):
    """Return whether a drone can do anything other than return home."""
    if o.status == IDENTIFYING:
        return can_do(c, f, area, d, o, s, home_steps, HELD)
    if is_between(s, o):
        return can_do(c, f, area, d, o, s, home_steps, o.heading)
    for action in range(c.num_actions):
        to_x, to_y = d.x + c.dx[action], d.y + c.dy[action]
        is_possible = s.pace[action] > 0.0 and is_open(area, c.grid_size, to_x, to_y)
        if is_possible and can_do(c, f, area, d, o, s, home_steps, action):
            return True
    return False


@part
def land(f, w, o):
    """Record that a drone is home."""
    o.status = HOME
    o.until = w.t + f.relief_steps


@part
def turn_home(f, w, d, o, home_steps):
    """Send a drone home, above the others; in its home cell it has arrived."""
    o.status = RETURNING
    if home_steps[d.y, d.x] == 0:
        land(f, w, o)
    o.progress = 0.0
    o.heading = HELD
    d.clear = True


@part
def lose(w, d, o):
    """Take a drone out of the mission; the following step terminates it."""
    o.status = LOST
    d.alive = False
    w.num_active -= 1


@part
def arrived_command(f, w, o, command):
    """Return the command that reaches a drone in this step, `HELD` if none does."""
    if f.command_delay > 0:
        slot = w.t % f.command_delay
        delayed = o.pending[slot]
        o.pending[slot] = command
        command = delayed
    if f.command_drop_rate > 0.0 and draw_unit(w) < f.command_drop_rate:
        command = HELD
    return command


@part
def make_way(s, o, action, num_actions, search_action):
    """Add a step to a move's progress; return the move once it is complete, else `HELD`."""
    if not 0 <= action < num_actions or action == search_action or s.pace[action] >= 1.0:
        o.progress = 0.0
        o.heading = HELD
        return action
    if action != o.heading:
        o.progress = 0.0
        o.heading = action
    o.progress += s.pace[action]
    if o.progress < 1.0 - ROUNDING:
        return np.int64(HELD)
    o.progress -= 1.0
    if s.slower:
        o.progress = 0.0
        o.heading = HELD
    return action


@part
def may_turn(f, o, inside):
    """Return whether a drone returns home when its battery suffices for nothing else."""
    flies = o.status == SEARCHING or o.status == IDENTIFYING or o.status == UNDER_WAY
    return f.battery and inside and flies


@part
def decide(c, f, area, w, d, o, s, home_steps, home_actions, command):
    """Return the action of a drone in the air, and take its energy from the battery."""
    action = np.int64(arrived_command(f, w, o, command))
    if o.status != STUCK and f.stuck_rate > 0.0 and draw_unit(w) < f.stuck_rate:
        o.status = STUCK
        o.until = w.t + f.stuck_steps
    inside = is_inside(c.grid_size, d.x, d.y)
    if is_between(s, o):
        action = np.int64(o.heading)
    if o.status == STUCK or o.status == IDENTIFYING or not is_able(c, s, action):
        action = np.int64(HELD)
    if may_turn(f, o, inside) and not can_do(c, f, area, d, o, s, home_steps, action):
        turn_home(f, w, d, o, home_steps)
        if o.status == HOME:
            return np.int64(HELD)
    energy = f.battery_move
    if o.status == RETURNING and inside:
        action = np.int64(home_actions[d.y, d.x])
        energy = f.battery_return
    elif action == c.search_action:
        energy = f.battery_search
    elif not 0 <= action < c.num_actions:
        energy = f.battery_hover
    if o.status != STUCK:
        action = make_way(s, o, action, c.num_actions, c.search_action)
    if s.slower and (o.status == SEARCHING or o.status == UNDER_WAY):
        o.status = UNDER_WAY if is_between(s, o) else SEARCHING
    if f.battery:
        o.battery = max(o.battery - energy, 0.0)
    return action


@kernel
def before_step(
    constants, faults, abilities, area, worlds, drones, conditions, losses, home_steps,
    home_actions, actions, applied, first, last,
):  # fmt: skip
    """Decide the actions of the drones in worlds first..last - 1.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        faults: (1,) of `FAULT_CONSTANTS`.
        abilities: (N,) of `ABILITIES`.
        area: Of `kernels.Sea`.
        worlds: (B,) of `kernels.WORLDS`.
        drones: (B, N) of `kernels.DRONES`.
        conditions: (B, N) of `CONDITIONS`.
        losses: (N,) int64, step in which each drone is lost; 0 for never.
        home_steps: (N, G, G) int32 of `ways_home.WaysHome`; (N, 0, 0) without batteries.
        home_actions: (N, G, G) int8 of `ways_home.WaysHome`; (N, 0, 0) without batteries.
        actions: (B, N) int8, the commands.
        applied: (B, N) int8 out, the drones' actions.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    c, f = constants[0], faults[0]
    for b in range(first, last):
        w = worlds[b]
        for n in range(drones.shape[1]):
            applied[b, n] = HELD
            d, o = drones[b, n], conditions[b, n]
            if w.done or not d.alive:
                continue
            if o.status == HOME:
                if f.relief_steps == 0:
                    d.alive = False
                    w.num_active -= 1
                continue
            lost = w.t + 1 == losses[n] or (f.battery and o.battery <= 0.0)
            if f.loss_rate > 0.0:
                lost |= draw_unit(w) < f.loss_rate
            if lost:
                lose(w, d, o)
                continue
            applied[b, n] = decide(
                c, f, area, w, d, o, abilities[n], home_steps[n], home_actions[n], actions[b, n]
            )


@part
def is_vacant(c, drones, n):
    """Return whether a drone can take off in its cell without a collision there."""
    if not c.collisions:
        return True
    d = drones[n]
    for m in range(len(drones)):
        other = drones[m]
        if m != n and other.alive and not other.clear and other.x == d.x and other.y == d.y:
            return False
    return True


@part
def observe(c, f, w, d, o):
    """Record the drone's reported position: with a normal error along each axis, on the grid."""
    o.seen_x, o.seen_y = d.x, d.y
    if f.position_noise > 0.0 and d.alive and is_inside(c.grid_size, d.x, d.y):
        # Box and Muller; 1 - u is never 0.
        reach = f.position_noise * sqrt(-2.0 * log(1.0 - draw_unit(w)))
        turn = 2.0 * pi * draw_unit(w)
        edge = c.grid_size - 1
        # Cut the error to the size of the grid: the cast of a larger one is undefined.
        error_x = min(max(np.floor(reach * cos(turn) + 0.5), -edge), edge)
        error_y = min(max(np.floor(reach * sin(turn) + 0.5), -edge), edge)
        o.seen_x = min(max(d.x + np.int64(error_x), 0), edge)
        o.seen_y = min(max(d.y + np.int64(error_y), 0), edge)


@part
def start(c, f, area, w, d, o, s, home_steps):
    """Set the condition of a drone to that at the start of a mission."""
    d.clear = False
    o.battery = FULL
    o.progress = 0.0
    o.until = 0
    o.status = SEARCHING
    o.applied = o.heading = HELD
    for k in range(MAX_DELAY):
        o.pending[k] = HELD
    if f.battery and not can_go_on(c, f, area, d, o, s, home_steps):
        turn_home(f, w, d, o, home_steps)
    observe(c, f, w, d, o)


@part
def update(c, f, area, w, drones, n, o, s, home_steps):
    """Update the condition of a drone still in the mission after a step."""
    d = drones[n]
    inside = is_inside(c.grid_size, d.x, d.y)
    if o.status == HOME:
        if f.relief_steps > 0 and w.t >= o.until and is_vacant(c, drones, n):
            o.status = SEARCHING
            o.battery = FULL
            d.clear = False
    elif o.status == RETURNING:
        if inside and home_steps[d.y, d.x] == 0:
            land(f, w, o)
    elif (o.status == STUCK or o.status == IDENTIFYING) and w.t >= o.until:
        under_way = UNDER_WAY if is_between(s, o) else SEARCHING
        o.status = RETURNING if d.clear else under_way
    rate = s.false_alarms[o.applied] if 0 <= o.applied < c.num_actions else 0.0
    if rate > 0.0 and not d.found and draw_unit(w) < rate:
        o.status = IDENTIFYING
        o.until = w.t + f.false_alarm_steps
    if may_turn(f, o, inside) and not can_go_on(c, f, area, d, o, s, home_steps):
        turn_home(f, w, d, o, home_steps)
    if s.endurance > 0 and w.t >= s.endurance and not f.battery:
        land(f, w, o)
        o.progress = 0.0
        o.heading = HELD
        d.clear = True


@kernel
def after_step(
    constants, faults, abilities, area, worlds, drones, conditions, home_steps, applied, first, last
):
    """Update the drones' conditions after a step; arguments as in `before_step`."""
    c, f = constants[0], faults[0]
    for b in range(first, last):
        w = worlds[b]
        for n in range(drones.shape[1]):
            d, o, s = drones[b, n], conditions[b, n], abilities[n]
            if w.t == 0:
                # The batch reset this world in the step.
                start(c, f, area, w, d, o, s, home_steps[n])
                continue
            o.applied = applied[b, n]
            if d.alive and not w.done:
                update(c, f, area, w, drones[b], n, o, s, home_steps[n])
            observe(c, f, w, d, o)


@kernel
def start_conditions(
    constants, faults, abilities, area, worlds, drones, conditions, home_steps, which
):
    """Begin the missions of the worlds with which[b], (B,) bool; see `before_step`."""
    c, f = constants[0], faults[0]
    for b in range(len(worlds)):
        if which[b]:
            for n in range(drones.shape[1]):
                d, o, s = drones[b, n], conditions[b, n], abilities[n]
                start(c, f, area, worlds[b], d, o, s, home_steps[n])


@part
def restrict_mask(c, f, area, d, o, s, home_steps, home_actions, mask):
    """Clear the actions that a drone cannot do in its mask (A,); at least one stays."""
    if is_between(s, o):
        mask[:] = 0
        mask[o.heading] = 1
        return
    to_home = f.battery and is_inside(c.grid_size, d.x, d.y)
    steered = o.status == HOME or o.status == RETURNING
    if f.battery and not to_home:
        steered = False
    left = 0
    for a in range(c.num_actions):
        if mask[a] and (
            steered
            or s.pace[a] <= 0.0
            or (to_home and not can_do(c, f, area, d, o, s, home_steps, a))
        ):
            mask[a] = 0
        left += mask[a]
    if left == 0:
        home = home_actions[d.y, d.x] if to_home else HELD
        mask[home if home >= 0 else c.search_action] = 1


@kernel
def restrict_masks(
    constants, faults, abilities, area, drones, conditions, home_steps, home_actions, masks, first,
    last,
):  # fmt: skip
    """Clear the actions that drones cannot do or that would keep them from returning home.

    For a drone that is under way, returning or home, only the action that continues this stays. At
    least one action always stays. `masks` are (B, N, A) int8, 0 for moves out of the grid or the
    area; the other arguments are as in `before_step`.
    """
    c, f = constants[0], faults[0]
    if not (f.battery or f.has_limits):
        return
    for b in range(first, last):
        for n in range(drones.shape[1]):
            d, o, s = drones[b, n], conditions[b, n], abilities[n]
            if d.alive:
                restrict_mask(c, f, area, d, o, s, home_steps[n], home_actions[n], masks[b, n])
