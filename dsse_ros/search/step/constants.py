# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenario, rules and area in the kernels' format."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.records import dtype_of
from dsse_ros.search.step.looks import Looks, moves_look
from dsse_ros.world.scenario.area import runs_of
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.targets.motion import STEPS
from dsse_ros.world.targets.registry import MOTIONS, has_own_drift

MAX_ACTIONS = 16

NO_ACTION = -1
"""The action of a drone that does nothing; its reward is that of a move."""


class Constants:
    """The scenario, the rules and the options of the batch in the kernels' format."""

    # Fields of the scenario
    columns: int
    rows: int
    timestep_limit: int
    probability_of_detection: float
    sigma_x: float
    sigma_y: float
    dispersion_inc: float
    cell_size: float
    person_amount: int
    pre_search_steps: int
    step_duration_s: float
    # Fields of the rules
    move: float
    leave_grid: float
    collisions: bool
    collision: float
    search_min_probability: float
    search_min_inclusive: bool
    search_below: float
    search_scale: float
    find: float
    find_bonus: float
    cover: float
    cover_scale: float
    cover_all: float
    cover_all_bonus: float
    one_find_per_search: bool
    found_persons_stay: bool
    time_out: float
    time_out_grace: int
    time_out_acts: bool
    time_out_total: bool
    both_flags: bool
    ends_together: bool
    drift_axes_independent: bool
    drift_by_speed: bool
    reset_sea_steps: int
    circle: bool
    circle_on_previous_datum: bool
    person_first: bool
    person_walks_blind: bool
    person_scatter: int
    person_steps: Annotated[NDArray[np.float64], ("f8", (STEPS,))]
    # What follows from the rules
    num_actions: int
    search_action: int
    dx: Annotated[NDArray[np.int64], ("i8", (MAX_ACTIONS,))]  # columns that each action moves
    dy: Annotated[NDArray[np.int64], ("i8", (MAX_ACTIONS,))]
    leave_terminates: bool
    leave_flies_on: bool
    drift_remainder_dropped: bool
    drift_remainder_less_one: bool
    motion: int  # number of the persons' motion
    own_drift: bool
    # Options
    moves_look: bool  # actions other than a search look too
    auto_reset: bool  # a step resets a world that is done, whatever its actions


CONSTANTS = dtype_of(Constants)


def _moves(rules: Rules, axis: int) -> list[int]:
    moves = [move[axis] for move in rules.action_set.moves]
    return moves + [0] * (MAX_ACTIONS - len(moves))


def _motion(rules: Rules) -> int:
    """Return the number of the persons' motion; for an ensemble it is arbitrary and not read."""
    return [*MOTIONS, rules.person_motion].index(rules.person_motion)


def constants_of(
    scenario: ResolvedScenario,
    rules: Rules,
    *,
    looks: Looks | None = None,
    auto_reset: bool = False,
) -> NDArray[np.void]:
    """Return scenario and rules for the kernels, (1,) of `CONSTANTS`.

    Args:
        scenario: The scenario.
        rules: The rules.
        looks: The looks of the drones; needed only for their steps.
        auto_reset: See `Constants`.
    """
    values = {
        **scenario.grid_size._asdict(),
        "num_actions": len(rules.action_set),
        "search_action": rules.action_set.search,
        "dx": _moves(rules, 0),
        "dy": _moves(rules, 1),
        "leave_terminates": rules.leave_policy == "terminate",
        "leave_flies_on": rules.leave_policy == "fly_on",
        "drift_remainder_dropped": rules.drift_remainder == "dropped",
        "drift_remainder_less_one": rules.drift_remainder == "less_one",
        "motion": _motion(rules),
        "own_drift": has_own_drift(rules.person_motion),
        "moves_look": looks is not None and moves_look(looks, rules),
        "auto_reset": auto_reset,
    }
    constants = np.zeros(1, CONSTANTS)
    for name in CONSTANTS.names or ():
        source = scenario if hasattr(scenario, name) else rules
        constants[name] = values[name] if name in values else getattr(source, name)
    return constants


def area_of(
    scenario: ResolvedScenario,
) -> tuple[NDArray[np.bool_] | None, NDArray[np.int64] | None]:
    """Return `area` and `runs` for the kernels, None if the whole grid is searched."""
    mask = scenario.area_mask
    # Copy the mask: Numba would compile the kernels again for a read-only array.
    return (None, None) if mask is None else (mask.copy(), runs_of(mask))
