# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenario, rules and area in the kernels' format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.area import runs_of
from dsse_ros.scenario.fields import specs
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import SPECS, ResolvedScenario
from dsse_ros.step.looks import Looks, moves_look
from dsse_ros.targets.motion import STEPS
from dsse_ros.targets.registry import MOTIONS, has_own_drift

MAX_ACTIONS = 16

_OF_SCENARIO = (
    "grid_size", "timestep_limit", "probability_of_detection", "sigma_x",
    "sigma_y", "dispersion_inc", "cell_size", "person_amount",
)  # fmt: skip
_OF_RULES = (
    "move", "leave_grid", "collisions", "collision", "search_min_probability",
    "search_min_inclusive", "search_below", "search_scale", "find", "find_bonus", "cover",
    "cover_scale", "cover_all", "cover_all_bonus", "one_find_per_search", "found_persons_stay",
    "time_out", "time_out_grace", "time_out_acts", "time_out_total", "both_flags", "ends_together",
    "drift_axes_independent", "drift_by_speed", "reset_sea_steps", "circle",
    "circle_on_previous_datum", "person_first", "person_walks_blind", "person_scatter",
)  # fmt: skip
"""Fields that the kernels read unchanged, under the same name."""


def _moves(rules: Rules, axis: int) -> list[int]:
    moves = [move[axis] for move in rules.action_set.moves]
    return moves + [0] * (MAX_ACTIONS - len(moves))


def _motion(rules: Rules) -> int:
    """Return the number of the persons' motion; for an ensemble it is arbitrary and not read."""
    return [*MOTIONS, rules.person_motion].index(rules.person_motion)


_DERIVED: Mapping[str, tuple[Any, Callable[[ResolvedScenario, Rules], Any]]] = {
    "pre_search_steps": ("i8", lambda scenario, _: scenario.pre_search_steps),
    "step_duration_s": ("f8", lambda scenario, _: scenario.step_duration_s),
    "num_actions": ("i8", lambda _, rules: len(rules.action_set)),
    "search_action": ("i8", lambda _, rules: rules.action_set.search),
    "dx": (("i8", (MAX_ACTIONS,)), lambda _, rules: _moves(rules, 0)),
    "dy": (("i8", (MAX_ACTIONS,)), lambda _, rules: _moves(rules, 1)),
    "leave_terminates": ("?", lambda _, rules: rules.leave_policy == "terminate"),
    "leave_flies_on": ("?", lambda _, rules: rules.leave_policy == "fly_on"),
    "drift_remainder_dropped": ("?", lambda _, rules: rules.drift_remainder == "dropped"),
    "drift_remainder_less_one": ("?", lambda _, rules: rules.drift_remainder == "less_one"),
    "motion": ("i8", lambda _, rules: _motion(rules)),
    "person_steps": (("f8", (STEPS,)), lambda _, rules: rules.person_steps),
    "own_drift": ("?", lambda _, rules: has_own_drift(rules.person_motion)),
}
"""Type and value of the constants derived from the fields."""

_TYPES = {"bool": "?", "int": "i8", "float": "f8"}
_SPECS = {**specs(Rules), **SPECS}
CONSTANTS = np.dtype(
    [
        *((name, _TYPES[_SPECS[name].kind]) for name in (*_OF_SCENARIO, *_OF_RULES)),
        *((name, kind) for name, (kind, _) in _DERIVED.items()),
        ("moves_look", "?"),
        ("auto_reset", "?"),
    ],
    align=True,
)
"""The scenario, the rules and the options of the batch in the kernels' format.

With `moves_look`, actions other than a search look too. With `auto_reset`, a step resets a world
that is done, whatever its actions."""


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
        auto_reset: See `CONSTANTS`.
    """
    constants = np.zeros(1, CONSTANTS)
    for name in _OF_SCENARIO:
        constants[name] = getattr(scenario, name)
    for name in _OF_RULES:
        constants[name] = getattr(rules, name)
    for name, (_, value) in _DERIVED.items():
        constants[name] = value(scenario, rules)
    constants["moves_look"] = looks is not None and moves_look(looks, rules)
    constants["auto_reset"] = auto_reset
    return constants


def area_of(
    scenario: ResolvedScenario,
) -> tuple[NDArray[np.bool_] | None, NDArray[np.int64] | None]:
    """Return `area` and `runs` for the kernels, None if the whole grid is searched."""
    mask = scenario.area_mask
    # Copy the mask: Numba would compile the kernels again for a read-only array.
    return (None, None) if mask is None else (mask.copy(), runs_of(mask))
