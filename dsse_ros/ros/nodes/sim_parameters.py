# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The parameters of `sim_node`: its settings, and the fields of the scenario and of the rules."""

from __future__ import annotations

import contextlib
import secrets
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from dsse_ros.base.fields import FieldError, specs
from dsse_ros.base.work import work_told_to
from dsse_ros.mission.files.mission_files import check_files
from dsse_ros.mission.files.scenario_files import find_scenario
from dsse_ros.mission.run.step_scheduler import Timing
from dsse_ros.ros.nodes.settings import (
    FULL_NAMES,
    PROFILE,
    RUN_TIME_SETTINGS,
    SCENARIO_FILE,
    SHORT_NAMES,
    SIM_PARAMETERS,
    SimSettings,
    without_effect,
)
from dsse_ros.ros.runtime.parameters import declare
from dsse_ros.ros.runtime.qos import Endpoints
from dsse_ros.ros.runtime.ros_arguments import from_ros, without_prefix
from dsse_ros.ros.runtime.run_node import AlarmNode
from dsse_ros.search.environments.compiler import announced, prepared_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.vehicles.fleet.vehicle_time import FOLLOWED
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.limits import MAX_ID, check_cells
from dsse_ros.world.scenario.rules import AUTO, Rules, profile
from dsse_ros.world.scenario.scenario import ResolvedScenario, Scenario, scenario_frame

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
    _check_truth(settings, scenario)
    has_belief = partial(settings.has_belief, live=not scenario.has_persons)

    def tell(line: str) -> None:
        node.get_logger().info(f"{line}; topics and services appear when it is done")

    with announced(tell), work_told_to(tell):
        _check_size(settings, scenario, rules)
        env = prepared_env(scenario, rules, has_belief=has_belief)
    _log_incident(node, env.scenario)
    settings = _in_real_time(node, settings, env.scenario, stated)
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
    if scenario.incident is None or scenario.incident.grid_summary is None:
        return
    begins_s, inside, stranded = scenario.incident.grid_summary
    node.get_logger().info(
        f"incident: the search begins at {utc(begins_s)} on {scenario.grid_size} "
        f"cells; {inside:.1%} of the particles stay there until its end, "
        f"{stranded:.1%} strand"
    )


def _check_truth(settings: SimSettings, scenario: Scenario) -> None:
    """Check that settings fit to whether the persons are simulated."""
    if settings.reveal_person and not scenario.has_persons:
        raise FieldError(f"reveal_person must be false with truth {scenario.truth}, got true")
    if settings.compute_pos == "never" and not scenario.has_persons:
        raise FieldError(
            f"compute_pos must be auto or always with truth {scenario.truth}, got 'never'"
        )
    if settings.journal and scenario.has_persons:
        raise FieldError(f"journal must be empty with truth {scenario.truth}, got "
                         f"{settings.journal!r}")  # fmt: skip
    if settings.journal:
        # It needs an extra: say so before anything is compiled.
        import dsse_ros.mission.live.journal  # noqa: F401
    check_files(
        journal=settings.journal,
        record_file=settings.record_file,
        snapshot_file=settings.snapshot_file,
    )


def _in_real_time(
    node: AlarmNode, settings: SimSettings, scenario: ResolvedScenario, stated: Mapping[str, Any]
) -> SimSettings:
    """Return the settings, for a live search with steps in real time unless others are stated.

    Detectors and people need the time of a step, and without vehicles nothing else takes it.
    """
    if scenario.has_persons:
        return settings
    _log_pod(node, scenario)
    if "step_rate" in stated or settings.step_mode != "lockstep":
        return settings
    if settings.vehicle_time == FOLLOWED:
        return settings
    node.get_logger().info(
        f"a live search takes {scenario.step_duration_s:g} s for a step, as in reality; step_rate "
        "sets another pace"
    )
    return replace(settings, step_rate=1.0 / scenario.step_duration_s)


def _log_pod(node: AlarmNode, scenario: ResolvedScenario) -> None:
    """Log a warning if the POD of a live search is the default one, or 1."""
    pod = scenario.probability_of_detection
    if not {"own_cell", "flown_over"} & {kind.sensor or scenario.sensor for kind in scenario.kinds}:
        return
    if scenario.stated.probability_of_detection is None:
        node.get_logger().warning(
            f"probability_of_detection is {pod:g}, the default of a live search: state the POD of "
            "your detector for a look"
        )
    elif pod == 1.0:
        node.get_logger().warning(
            "probability_of_detection is 1: a single look that finds nobody excludes its place, "
            "whatever is detected there; state the POD of your detector for a look"
        )


def _check_size(settings: SimSettings, scenario: Scenario, rules: Rules) -> None:
    """Check that the grid has at most `max_cells`, before allocating memory for it.

    Raises:
        FieldError: If the grid is larger, or not allowed.
    """
    grid, _ = scenario.grid_of(rules)
    check_cells(grid, settings.max_cells)


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
