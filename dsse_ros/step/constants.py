# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenario, rules and area as the kernels read them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.area import runs_of
from dsse_ros.scenario.fields import specs
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.step import kernels
from dsse_ros.targets.person_motion import MOTIONS

_OF_SCENARIO = (
    "grid_size", "timestep_limit", "pre_search_steps", "probability_of_detection", "sigma_x",
    "sigma_y", "dispersion_inc", "cell_size", "step_duration_s",
)  # fmt: skip
_OF_RULES = tuple(
    name
    for name in kernels.CONSTANTS.names or ()
    if name in specs(Rules) and name not in _OF_SCENARIO
)
"""Fields of the rules that the kernels read as they are, by the same name."""


def constants_of(
    scenario: ResolvedScenario, rules: Rules, *, auto_reset: bool = False
) -> NDArray[np.void]:
    """Return scenario and rules as the kernels read them, (1,) of `kernels.CONSTANTS`.

    Raises:
        TypeError: If the kernels read other names than are set here.
    """
    actions = rules.action_set
    unused = [(0, 0)] * (kernels.MAX_ACTIONS - len(actions))
    dx, dy = zip(*actions.moves, *unused, strict=True)
    values: dict[str, Any] = {
        **{name: getattr(scenario, name) for name in _OF_SCENARIO},
        **{name: getattr(rules, name) for name in _OF_RULES},
        "num_actions": len(actions),
        "search_action": actions.search,
        "dx": dx,
        "dy": dy,
        "leave_terminates": rules.leave_policy == "terminate",
        "leave_flies_on": rules.leave_policy == "fly_on",
        "drift_remainder_dropped": rules.drift_remainder == "dropped",
        "drift_remainder_less_one": rules.drift_remainder == "less_one",
        "motion": list(MOTIONS).index(rules.person_motion),
        "own_drift": MOTIONS[rules.person_motion].own_drift,
        "auto_reset": auto_reset,
    }
    if differing := values.keys() ^ set(kernels.CONSTANTS.names or ()):
        raise TypeError(f"kernels.CONSTANTS: not on both sides: {', '.join(sorted(differing))}")
    constants = np.zeros(1, kernels.CONSTANTS)
    for name, value in values.items():
        constants[name] = value
    return constants


def area_of(
    scenario: ResolvedScenario,
) -> tuple[NDArray[np.bool_] | None, NDArray[np.int64] | None]:
    """Return `area` and `runs` as the kernels read them, None where the whole grid is searched."""
    mask = scenario.area_mask
    # A read-only array would have them compiled anew.
    return (None, None) if mask is None else (mask.copy(), runs_of(mask))
