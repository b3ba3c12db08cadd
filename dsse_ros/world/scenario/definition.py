# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The public part of a search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario


@dataclass(frozen=True)
class SearchDefinition:
    """The public part of a mission: its scenario, with overridden values, and its rules.

    Attributes:
        rules: The rules of the search.
        scenario: The scenario of the mission.
        observed: The map that agents observe, as in `SearchEnv`: always `map`.
        steps_done: None; the infos have it.
    """

    rules: Rules
    scenario: Scenario

    observed: ClassVar[str] = "map"
    steps_done: ClassVar[None] = None

    @property
    def mission_scenario(self) -> Scenario:
        """The scenario."""
        return self.scenario
