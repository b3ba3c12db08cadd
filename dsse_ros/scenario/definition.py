# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is public of a search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import Scenario


@dataclass(frozen=True)
class SearchDefinition:
    """What is searched and by which rules: all that is public of a mission, values overridden too.

    Attributes:
        rules: The rules of the search.
        scenario: That of the mission.
        observed: What agents observe, as in `SearchEnv`: the map.
        steps_done: None: the infos say it.
    """

    rules: Rules
    scenario: Scenario

    observed: ClassVar[str] = "map"
    steps_done: ClassVar[None] = None

    @property
    def mission_scenario(self) -> Scenario:
        """The scenario."""
        return self.scenario
