# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The environments of a scenario and rules: one or many worlds, on cells or in metres."""

from __future__ import annotations

from typing import Any

from dsse_ros.base.extras import pip_install
from dsse_ros.base.fields import FieldError, shown
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.vector_env import DEVICES, VectorEnv
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario, ScenarioSource, scenario_and_rules


def parallel_env(
    scenario: ScenarioSource = None,
    *,
    rules: str | Rules = "auto",
    render_mode: str | None = None,
    observe: str = "map",
    **fields: Any,
) -> SearchEnv:
    """Return the search as a PettingZoo parallel environment.

    Args:
        scenario: A `Scenario`, a mapping of its fields, the path of a YAML file, or None for the
            profile's defaults.
        rules: The name of a profile or a `Rules` value; `auto` is `sea` with an incident, else
            `paper`.
        render_mode: ansi, rgb_array, human or None.
        observe: The map that agents observe: `map`, drawn by the rules, or `belief`, updated with
            the searches.
        fields: Fields of `Scenario` or `Rules` by name, such as `grid_size`, `num_drones` and
            `timestep_limit`; they replace those of the scenario and the rules.

    Raises:
        FieldError: If a field is unknown or a value is not allowed.
    """
    chosen = scenario_and_rules(scenario, rules, **fields)
    return SearchEnv(*chosen, render_mode, observe=observe)


def vector_env(
    num_envs: int,
    scenario: ScenarioSource = None,
    *,
    rules: str | Rules = "auto",
    lazy: bool = False,
    copy: bool = True,
    threads: int = 1,
    observe: str = "map",
    device: str = "cpu",
    **fields: Any,
) -> VectorEnv:
    """Return many searches at once; fields as in `parallel_env`.

    Args:
        num_envs: B.
        scenario: As in `parallel_env`.
        rules: As in `parallel_env`.
        lazy: As in `VectorEnv`.
        copy: As in `VectorEnv`.
        threads: As in `VectorEnv`.
        observe: As in `VectorEnv`.
        device: `cpu`, or `cuda` for a `DeviceVectorEnv` on the current CUDA device.
        fields: As in `parallel_env`.

    Raises:
        FieldError: If a field is unknown or a value is not allowed, or there is no such device.
    """
    chosen = scenario_and_rules(scenario, rules, **fields)
    if DEVICES.check("device", device) == "cuda":
        return _on_cuda(num_envs, *chosen, lazy=lazy, copy=copy, threads=threads, observe=observe)
    return VectorEnv(num_envs, *chosen, lazy=lazy, copy=copy, threads=threads, observe=observe)


def _on_cuda(
    num_envs: int, scenario: Scenario, rules: Rules, *, threads: int, **options: Any
) -> VectorEnv:
    """Return a `DeviceVectorEnv`.

    Raises:
        FieldError: If there is no CUDA device, or a value is not allowed there.
    """
    try:
        from numba import cuda

        found = cuda.is_available()
    except ImportError:
        found = False
    if not found:
        raise FieldError(
            f"device must be cpu, as Numba finds no GPU or no CUDA ({pip_install('cuda')}), got "
            "'cuda'"
        )
    if threads != 1:
        raise FieldError(f"threads must be 1 with device cuda, got {shown(threads)}")
    from dsse_ros.search.environments.device_vector_env import DeviceVectorEnv

    return DeviceVectorEnv(num_envs, scenario, rules, **options)
