# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of `sim_node`: its settings, and the fields of the scenario and of the rules."""

from __future__ import annotations

import contextlib
import secrets
from functools import partial
from typing import Any

import numpy as np

from dsse_ros.drift.flow import utc
from dsse_ros.mission.scenario_files import find_scenario
from dsse_ros.mission.step_scheduler import Timing
from dsse_ros.mission.vehicle_time import FOLLOWED
from dsse_ros.nodes.settings import (
    FULL_NAMES,
    PROFILE,
    RUN_TIME_SETTINGS,
    SCENARIO_FILE,
    SHORT_NAMES,
    SIM_PARAMETERS,
    SimSettings,
    without_effect,
)
from dsse_ros.runtime.parameters import declare
from dsse_ros.runtime.qos import Endpoints
from dsse_ros.runtime.ros_arguments import from_ros, without_prefix
from dsse_ros.runtime.run_node import AlarmNode
from dsse_ros.scenario.fields import specs
from dsse_ros.scenario.frames import GridFrame, scenario_frame
from dsse_ros.scenario.limits import MAX_ID, check_cells
from dsse_ros.scenario.rules import AUTO
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.search import FieldError, Rules, Scenario, SearchEnv, profile
from dsse_ros.search.compiler import announced, prepared_env

OF_TIMING = {"step_mode", "step_rate", "real_time_factor", "odom_rate", "command_timeout"}
"""Settings of the time at which steps are due."""


def read_parameters(node: AlarmNode) -> tuple[SimSettings, SearchEnv, Endpoints]:
    """Declare the parameters of a node; return the settings, environment and endpoints from them.

    Raises:
        FieldError: If a parameter or the scenario is not allowed.
    """
    taken, qos = node.take_overrides({**SIM_PARAMETERS, **SHORT_NAMES}, FULL_NAMES)
    stated = {SHORT_NAMES.get(name, name): value for name, value in taken.items()}
    for name, value in stated.items():
        spec = SIM_PARAMETERS[name]
        stated[name] = spec.check(name, from_ros(spec, value))
    file, base = stated.pop(SCENARIO_FILE, ""), stated.pop(PROFILE, AUTO)
    settings = SimSettings(**{name: value for name, value in stated.items() if "." not in name})
    path = find_scenario(file) if file else None
    scenario = Scenario.read(path).override(**without_prefix("scenario.", stated))
    rules = profile(
        scenario.rules_of(base),
        **without_prefix("rules.", stated),
        vehicle_timed_actions=settings.vehicle_time == FOLLOWED,
    )
    if rules.covers and settings.publish_belief:
        raise FieldError(
            f"publish_belief must be false with rules {rules.profile}, which have no persons, "
            "got true"
        )
    if settings.reveal_person and not scenario.has_persons:
        raise FieldError(f"reveal_person must be false with truth {scenario.truth}, got true")
    if settings.compute_pos == "never" and not scenario.has_persons:
        raise FieldError(
            f"compute_pos must be auto or always with truth {scenario.truth}, got 'never'"
        )
    if settings.journal and scenario.has_persons:
        raise FieldError(f"journal must be empty with truth {scenario.truth}, got "
                         f"{settings.journal!r}")  # fmt: skip
    log = node.get_logger().info
    has_belief = partial(settings.has_belief, live=not scenario.has_persons)
    with announced(lambda line: log(f"{line}; topics and services appear when it is done")):
        _check_size(settings, scenario, rules)
        env = prepared_env(scenario, rules, has_belief=has_belief)
    _log_incident(node, env.scenario)
    values = {
        **vars(settings),
        SCENARIO_FILE: file,
        **{f"scenario.{name}": value for name, value in _in_force(env.scenario).items()},
        **{
            name: value
            for field, value in vars(rules).items()
            if (name := f"rules.{field}") in SIM_PARAMETERS
        },
    }
    declare(node, SIM_PARAMETERS, values, RUN_TIME_SETTINGS)
    for line in without_effect(settings):
        node.get_logger().warning(line)
    return settings, env, Endpoints(node, qos)


def _log_incident(node: AlarmNode, scenario: ResolvedScenario) -> None:
    """Log what became of the particles of an incident."""
    if scenario.incident is None or scenario.incident.laid is None:
        return
    begins_s, inside, stranded = scenario.incident.laid
    node.get_logger().info(
        f"incident: the search begins at {utc(begins_s)} on {scenario.grid_size} x "
        f"{scenario.grid_size} cells; {inside:.1%} of the particles stay there until its end, "
        f"{stranded:.1%} strand"
    )


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
        by_vehicles=settings.vehicle_time == FOLLOWED,
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
            values[name] = specs(Scenario)[name].check(name, value)
    return values
