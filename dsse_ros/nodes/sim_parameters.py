# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of `sim_node`: its settings, and the fields of the scenario and of the rules."""

from __future__ import annotations

import contextlib
import secrets
from typing import Any

import numpy as np

from dsse_ros.mission.scenario_files import find_scenario
from dsse_ros.mission.step_scheduler import Timing
from dsse_ros.nodes.settings import RUN_TIME_SETTINGS, SimSettings
from dsse_ros.runtime.parameters import declare
from dsse_ros.runtime.qos import Endpoints
from dsse_ros.runtime.ros_arguments import from_ros
from dsse_ros.runtime.run_node import AlarmNode
from dsse_ros.scenario.fields import specs
from dsse_ros.scenario.limits import check_cells
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.search import FieldError, Scenario, SearchEnv, profile
from dsse_ros.search.compiler import prepared_env
from msg_adapters.agents import MAX_ID
from msg_adapters.frames import GridFrame, scenario_frame

SCENARIO_SPECS = specs(Scenario)
RULES_SPECS = {
    name: spec
    for name, spec in specs(Rules).items()
    # If the scenario has the same field, its value counts.
    if name not in SCENARIO_SPECS and name != "profile"
}
SETTINGS_SPECS = specs(SimSettings)

OF_TIMING = {"step_mode", "step_rate", "real_time_factor", "odom_rate", "command_timeout"}
"""Settings of the time at which steps are due."""


def read_parameters(node: AlarmNode) -> tuple[SimSettings, SearchEnv, Endpoints]:
    """Declare the parameters of a node; return the settings, environment and endpoints from them.

    Raises:
        FieldError: If a parameter or the scenario is not allowed.
    """
    known = {**SETTINGS_SPECS, **SCENARIO_SPECS, **RULES_SPECS}
    given, qos = node.take_overrides(known)
    given = {name: from_ros(known[name], value) for name, value in given.items()}

    def of(part: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in given.items() if name in part}

    settings = SimSettings(**of(SETTINGS_SPECS))
    rules = profile(settings.rules, **of(RULES_SPECS))
    if rules.covers and settings.publish_belief:
        raise FieldError(
            f"publish_belief: true is not allowed with rules {rules.profile}, which have no persons"
        )
    path = find_scenario(settings.scenario) if settings.scenario else None
    scenario = Scenario.of(path).override(**of(SCENARIO_SPECS))
    _check_size(settings, scenario, rules)
    env = prepared_env(scenario, rules, node.get_logger().info, has_belief=settings.has_belief)
    declare(node, SETTINGS_SPECS, vars(settings), RUN_TIME_SETTINGS)
    declare(node, SCENARIO_SPECS, _in_force(env.scenario))
    declare(node, RULES_SPECS, vars(rules))
    return settings, env, Endpoints(node, qos)


def _check_size(settings: SimSettings, scenario: Scenario, rules: Rules) -> None:
    """Check that the grid has at most `max_cells`, before allocating memory for it.

    Raises:
        FieldError: If the grid is larger, or not allowed.
    """
    side, _ = scenario.grid_of(rules)
    check_cells(side, settings.max_cells)


def grid_frame(scenario: ResolvedScenario, settings: SimSettings) -> GridFrame:
    """Return the frame of a scenario's grid."""
    return scenario_frame(
        scenario,
        map_frame=settings.frame_prefix + settings.map_frame,
        frame_prefix=settings.frame_prefix,
    )


def timing(settings: SimSettings, step_duration_s: float) -> Timing:
    """Return when steps of this length are due."""
    return Timing(
        mode=settings.step_mode,
        step_rate=settings.step_rate,
        command_timeout_s=settings.command_timeout,
        real_time_factor=settings.real_time_factor,
        step_duration_s=step_duration_s,
    )


def draw_seed(settings: SimSettings) -> int:
    """Return the seed of the parameter, or a drawn one for -1."""
    seed = settings.seed
    return seed if seed >= 0 else int(np.random.SeedSequence().generate_state(1)[0])


def draw_run_id(settings: SimSettings) -> int:
    """Return the run_id of the parameter, or a drawn one for -1."""
    # Not from the mission's generator: the same seed must give the same mission.
    return settings.run_id if settings.run_id > 0 else 1 + secrets.randbelow(MAX_ID)


def _in_force(scenario: ResolvedScenario) -> dict[str, Any]:
    """Return the values of all fields, including those that restate another field."""
    values = dict(vars(scenario))
    for name, value in scenario.other_ways.items():
        # If drones are faster than any current, there is no such current.
        with contextlib.suppress(FieldError):
            values[name] = SCENARIO_SPECS[name].check(name, value)
    return values
