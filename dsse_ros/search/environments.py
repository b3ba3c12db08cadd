# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The environment of a scenario and rules, on cells or in metres."""

from __future__ import annotations

from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.search.flight_env import FlightEnv
from dsse_ros.search.parallel_env import SearchEnv


def search_env(
    scenario: Scenario, rules: Rules, render_mode: str | None = None, *, observe: str = "map"
) -> SearchEnv:
    """Return the environment of a scenario and rules; in metres a `FlightEnv`.

    Args:
        scenario: The scenario.
        rules: Its rules.
        render_mode: See `parallel_env`.
        observe: See `parallel_env`.

    Raises:
        FieldError: If the scenario does not fit the rules.
    """
    kind = FlightEnv if rules.in_metres else SearchEnv
    return kind(scenario, rules, render_mode, observe=observe)
