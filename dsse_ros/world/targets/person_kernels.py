# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled start and step of persons, whatever their motion, and the data of motions.

Arguments with the same names mean the same as in `sea_map`.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Iterable
from typing import Any

from dsse_ros.base.compiled.draws import draw_below, draw_unit
from dsse_ros.base.compiled.jit import inlined, kernel, part
from dsse_ros.world.targets.motion import NO_STEP, STAND_STILL
from dsse_ros.world.targets.registry import MOTIONS
from dsse_ros.world.targets.sea_map import drift_per_step, grid_of, is_masked, less_one

MotionData = namedtuple("MotionData", MOTIONS, rename=True)  # type: ignore[misc]
"""The data of each motion under its name, None of those not in use."""


def motion_data(scenario: Any, rules: Any) -> MotionData:
    """Return the data of the motion of a `ResolvedScenario` and its `Rules`."""
    data: dict[str, Any] = dict.fromkeys(MOTIONS)
    if rules.person_motion in MOTIONS:
        data[rules.person_motion] = MOTIONS[rules.person_motion].data(scenario)
    return MotionData(*data.values())


def of_motion(functions: Iterable[Any], number: int = 0) -> Any:
    """Return a compiled function that calls the function with the number `constants.motion`."""
    first, *others = functions
    if not others:
        return first
    rest = of_motion(others, number + 1)

    @inlined
    def call(constants, *arguments):
        if constants.motion == number:
            first(constants, *arguments)
        else:
            rest(constants, *arguments)

    return call


move_person = of_motion(motion.move for motion in MOTIONS.values())
step_chances = of_motion(motion.chances for motion in MOTIONS.values())


@kernel
def persons_step(constants, world, sea, persons):
    """Move every person not found yet."""
    for p in range(len(persons)):
        person = persons[p]
        if person.found and not constants.found_persons_stay:
            continue
        direction = gathered_step(person) if constants.own_drift else NO_STEP
        if direction != STAND_STILL:
            move_person(constants, world, sea, person, direction)


@part
def gathered_step(person):
    """Advance a person's own drift by one step; return the step accumulated before.

    The result is the number of a step, or `STAND_STILL`. A step taken reduces the remainder.
    """
    reached = abs(person.remainder_x) >= 1 or abs(person.remainder_y) >= 1
    person.remainder_x += person.drift_x
    person.remainder_y += person.drift_y
    if not reached:
        return STAND_STILL
    dx, dy = step_along(person.remainder_x), step_along(person.remainder_y)
    person.remainder_x = less_one(person.remainder_x)
    person.remainder_y = less_one(person.remainder_y)
    return 3 * (dy + 1) + dx + 1


@part
def step_along(remainder):
    """Return the sign of a remainder rounded to a whole number, halves to even."""
    return int(remainder > 0.5) - int(remainder < -0.5)


DRIFT_RANGES = 4
"""Number of ranges of angles for a person's own drift; see `own_drift`."""


@part
def own_drift(constants, world, k, share):
    """Return the drift (x, y) of a person whose angle is `share` of the way along range k of 4.

    It is the mean of the vector and a rotated and scaled copy of it. The scale decreases with the
    angle's distance from a right angle (measured on DSSE 1.1.9).
    """
    low = (0.0, 20.0, 300.0, 315.0)[k]
    high = (45.0, 55.0, 360.0, 360.0)[k]
    angle = math.radians(low + share * (high - low))
    scale = 0.5 + math.exp(-abs(angle - math.pi / 2) / math.pi)
    turned_x = scale * (math.cos(angle) * world.vector_x - math.sin(angle) * world.vector_y)
    turned_y = scale * (math.sin(angle) * world.vector_x + math.cos(angle) * world.vector_y)
    return drift_per_step(
        constants, (world.vector_x + turned_x) / 2, (world.vector_y + turned_y) / 2
    )


@part
def draw_own_drift(constants, world, person):
    """Draw a person's drift: all ranges, and all angles in a range, are equally likely."""
    k = draw_below(world, DRIFT_RANGES)
    person.drift_x, person.drift_y = own_drift(constants, world, k, draw_unit(world))


@part
def scatter_persons(constants, world, area, persons, cells):
    """Put all but the first person in different cells within `person_scatter` of the start."""
    grid, s = grid_of(constants), constants.person_scatter
    x0, y0 = max(world.start_x - s, 0), max(world.start_y - s, 0)
    width = min(world.start_x + s, grid.columns - 1) - x0 + 1
    height = min(world.start_y + s, grid.rows - 1) - y0 + 1
    count = start = 0
    for k in range(width * height):
        x, y = x0 + k % width, y0 + k // width
        if is_masked(area, grid, x, y):
            continue
        if x == world.start_x and y == world.start_y:
            start = count
        cells[count] = k
        count += 1
    cells[0], cells[start] = cells[start], cells[0]
    for p in range(1, len(persons)):
        k = p + draw_below(world, count - p)
        cells[p], cells[k] = cells[k], cells[p]
        persons[p].x, persons[p].y = x0 + cells[p] % width, y0 + cells[p] // width
