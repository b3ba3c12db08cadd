# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The promises of a motion of persons, tested: its draws have the probabilities that it states.

The motion is compiled into a separate small sea, because it need not be registered.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dsse_ros.belief import belief_kernels
from dsse_ros.belief.belief_kernels import (
    MARGIN,
    Steps,
    forecast_step,
    index_of,
    is_lost,
    offset_of,
    step_of_drift,
)
from dsse_ros.conformance.agreement import SIGMAS, excess
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario, Scenario
from dsse_ros.step import kernels
from dsse_ros.step.constants import area_of, constants_of, transitions_of
from dsse_ros.targets import sea_map
from dsse_ros.targets.motion import (
    CHANCES,
    NO_STEP,
    PERSONS,
    SCRATCH,
    STAND_STILL,
    STEPS,
    PersonMotion,
)
from dsse_ros.targets.person_kernels import gathered_step
from dsse_ros.targets.sea_map import map_step

COUNT = 20_000
"""Number of simulated persons."""
TOLERANCE = 1e-9
"""Tolerance for a sum of chances, which is 1."""

FINE, NOT_A_CHANCE, NOT_ONE, NOT_A_STEP, NO_CHANCE = range(5)
BROKEN = {
    NOT_A_CHANCE: "a probability is not from 0 to 1",
    NOT_ONE: "the probabilities of a cell do not sum to 1",
    NOT_A_STEP: "a person moves further than to a cell of the window",
    NO_CHANCE: "a person takes a step of probability 0",
}


class _Sea(NamedTuple):
    """A world of one sea."""

    constants: NDArray[np.void]
    worlds: NDArray[np.void]
    sea: sea_map.Sea
    circle: NDArray[np.int64]


def motion_test(
    model: PersonMotion, scenario: Scenario, rules: Rules, steps: int, seed: int
) -> None:
    """Test that persons follow their motion's probabilities, step after step.

    Args:
        model: The motion.
        scenario: The scenario.
        rules: The rules; `person_motion` has no effect.
        steps: Number of steps of the sea to simulate.
        seed: Seed of the draws.

    Raises:
        AssertionError: If a promise is broken; one line names it.
    """
    resolved = scenario.resolve(rules)
    play, spread = _kernels(model)
    first, again = (_played(model, resolved, rules, steps, seed, play, spread) for _ in range(2))
    assert np.array_equal(first, again), "the same seed gives different steps"


def _played(
    model: PersonMotion,
    scenario: ResolvedScenario,
    rules: Rules,
    steps: int,
    seed: int,
    play: Callable[..., Any],
    spread: Callable[..., Any],
) -> NDArray[np.int64]:
    """Simulate persons, compare them with their chances, and return their last cells (N, 2)."""
    truth, known = (_new_sea(model, scenario, rules) for _ in range(2))
    truth.worlds["rng"] = seed
    side = scenario.grid_size + 2 * MARGIN
    drifts, persons = np.zeros(1, PERSONS), np.zeros(COUNT, PERSONS)
    for sea in (truth, known):
        belief_kernels.start_sea(sea.constants, sea.worlds, drifts)
    persons[:] = drifts[0]
    persons["x"], persons["y"] = scenario.person_initial_position
    x, y = scenario.person_initial_position
    now = np.zeros(side**2)
    now[(y + MARGIN) * side + x + MARGIN] = 1.0
    map_now, direction = np.zeros(side**2), np.zeros(1, np.int64)
    apart, still = np.zeros((2, 1), np.bool_)
    now_step = Steps(map_now, np.zeros((0, side**2)), direction, apart)
    for step in range(1, steps + 1):
        before = persons.copy()
        forecast_step(*known, drifts, now_step, still)
        after = now if direction[0] == STAND_STILL else np.zeros_like(now)
        steps_of = np.zeros((side**2, STEPS))
        row = np.zeros(CHANCES + STEPS + SCRATCH)
        broken = play(*truth, persons)
        if direction[0] != STAND_STILL:
            broken = broken or spread(
                known.constants, known.sea, map_now, direction[0], now, after, steps_of, row
            )  # fmt: skip
        broken = broken or _checked(before, persons, steps_of, side, direction[0])
        assert not broken, f"step {step}: {BROKEN[broken]}"
        now = after
        counts = np.bincount(_columns(persons, side), minlength=side**2)
        beyond = excess(counts, now)
        assert beyond <= SIGMAS, (
            f"step {step}: persons are not where they should be, by {beyond:.1f} sigmas"
        )
    return np.stack([persons["x"], persons["y"]], axis=1)


def _new_sea(model: PersonMotion, scenario: ResolvedScenario, rules: Rules) -> _Sea:
    g = scenario.grid_size
    constants = constants_of(scenario, rules)
    constants["own_drift"] = model.own_drift
    worlds = np.zeros(1, kernels.WORLDS)
    worlds["vector_x"], worlds["vector_y"] = scenario.vector
    worlds["start_x"], worlds["start_y"] = scenario.person_initial_position
    area, runs = area_of(scenario)
    gauss, tails = np.zeros((2, 2 * g + 1)), np.zeros((2, g + 2))
    sea = sea_map.Sea(gauss, tails, area, runs, transitions_of(scenario))
    sea_map.disperse(constants[0], worlds[0], sea)
    return _Sea(constants, worlds, sea, np.zeros(g + 1, np.int64))


def _columns(persons: NDArray[np.void], side: int) -> NDArray[np.int64]:
    """Return the persons' columns in a belief; persons too far off the grid get the nearest one."""
    x, y = (np.clip(persons[axis] + MARGIN, 0, side - 1) for axis in ("x", "y"))
    columns: NDArray[np.int64] = y * side + x
    return columns


def _checked(
    before: NDArray[np.void],
    after: NDArray[np.void],
    steps_of: NDArray[np.float64],
    side: int,
    direction: int,
) -> int:
    """Return the promise that the persons' steps break, `FINE` if they break none."""
    dx, dy = after["x"] - before["x"], after["y"] - before["y"]
    if (np.maximum(abs(dx), abs(dy)) > 1).any():
        return NOT_A_STEP
    if direction == STAND_STILL:
        return NO_CHANCE if (dx | dy).any() else FINE
    lost = steps_of[_columns(before, side)].sum(axis=1) == 0.0
    taken = steps_of[_columns(before, side), 3 * (dy + 1) + dx + 1]
    return NO_CHANCE if (taken[~lost] <= 0.0).any() else FINE


# Of the same motion in each profile: compiling takes longer than the test.
@lru_cache(maxsize=8)
def _kernels(model: PersonMotion) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the compiled step of the sea, and that of the knowledge of it."""
    move, chances = model.move, model.chances

    @njit
    def play(constants, worlds, sea, circle, persons):
        """Advance map and persons by one step, like `recipe.drift`."""
        c, w = constants[0], worlds[0]
        if not c.person_first:
            map_step(c, w, sea, circle)
        for p in range(len(persons)):
            direction = gathered_step(persons[p]) if c.own_drift else NO_STEP
            if direction != STAND_STILL:
                move(c, w, sea, persons[p], direction)
        if c.person_first:
            map_step(c, w, sea, circle)
        return FINE

    @njit
    def spread(constants, sea, map_now, direction, now, after, steps_of, row):
        """Spread probability over the cells, like `belief_kernels.predict`, and check it."""
        c = constants[0]
        side = c.grid_size + 2 * MARGIN
        out = row[:CHANCES]
        window, scratch = row[CHANCES : CHANCES + STEPS], row[CHANCES + STEPS :]
        for i in range(len(now)):
            if now[i] <= 0.0:
                continue
            if is_lost(c, i):
                after[i] += now[i]
                continue
            x, y = i % side - MARGIN, i // side - MARGIN
            for step in range(STEPS):
                window[step] = map_now[index_of(c, x, y) + offset_of(c, step)]
            out[:] = 0.0
            chances(c, sea, x, y, window, out, scratch)
            total = 0.0
            for k in range(CHANCES):
                if not 0.0 <= out[k] <= 1.0 + TOLERANCE:
                    return NOT_A_CHANCE
                total += out[k]
            if abs(total - 1.0) > TOLERANCE:
                return NOT_ONE
            if out[STEPS] > 0.0:
                out[step_of_drift(c, sea.area, x, y, direction)] += out[STEPS]
            for step in range(STEPS):
                steps_of[i, step] = out[step]
                after[i + offset_of(c, step)] += now[i] * out[step]
        return FINE

    return play, spread
