# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The options of an environment and of a reset, for both the single environment and the batch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dsse_ros.base.fields import FieldError, Spec, check_known, shown
from dsse_ros.world.scenario.cell_checks import (
    check_cell,
    check_multipliers,
    check_positions,
    check_scatter,
)
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import SPECS, ResolvedScenario

RESET_OPTIONS = (
    "drones_positions",
    "vector",
    "person_initial_position",
    "person_pod_multipliers",
)

OBSERVED = Spec("str", "What agents observe.", choices=("map", "belief"))
"""The argument `observe` of the environments."""

IGNORED_OPTION = "options"
"""Option that PettingZoo's own tests pass to every environment."""


def check_mapping(options: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Return the options of a reset, an empty mapping for none.

    Raises:
        FieldError: If they are not a mapping.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise FieldError(f"options must be a mapping, got {shown(options)}")
    return options


def check_options(
    options: Mapping[str, Any] | None, scenario: ResolvedScenario, rules: Rules
) -> dict[str, Any]:
    """Return the reset options that were given, in their canonical types.

    Raises:
        FieldError: If an option is unknown or not allowed.
    """
    options = check_mapping(options)
    check_known("the reset options", options, (*RESET_OPTIONS, IGNORED_OPTION))
    for name in RESET_OPTIONS[1:] if rules.covers else ():
        if options.get(name) is not None:
            raise FieldError(
                f"{name} must not be an option of a reset with rules {rules.profile}, whose map "
                f"does not change, got {shown(options[name])}"
            )
    for name in ("vector", "person_initial_position") if scenario.incident is not None else ():
        if options.get(name) is not None:
            raise FieldError(
                f"{name} must not be an option of a reset with an incident, got "
                f"{shown(options[name])}"
            )
    mask = scenario.area_mask
    start = {
        name: SPECS[name].check(name, options[name])
        for name in RESET_OPTIONS
        if options.get(name) is not None
    }
    if "drones_positions" in start:
        positions, count = start["drones_positions"], scenario.num_drones
        check_positions(positions, scenario.grid_size, count, mask, rules.collisions)
    check_multipliers(start.get("person_pod_multipliers"), scenario.person_amount)
    if "person_initial_position" in start:
        cell = start["person_initial_position"]
        check_cell("person_initial_position", cell, scenario.grid_size, mask)
        if rules.person_scatter:
            scatter = rules.person_scatter
            check_scatter(scenario.person_amount, cell, scenario.grid_size, scatter, mask)
    return start


def check_seed(seed: Any) -> int:
    """Return the seed as an int.

    Raises:
        FieldError: If it is not an integer >= 0.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise FieldError(f"seed must be an integer >= 0, got {shown(seed)}")
    return int(seed)
