# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The field of a scenario for an incident, and the fields that follow from it."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.base.fields import field
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.rules import AUTO


@dataclass(frozen=True, kw_only=True)
class IncidentFields:
    """What is missing at sea."""

    incident: Incident | None = field(
        "custom",
        "Object, sightings, wind and current, which give origin, grid, datum, drift and spread. "
        "In a parameter, JSON.",
        None,
        reader=Incident,
    )

    def rules_of(self, name: str) -> str:
        """Return the profile of this name; for auto, sea with an incident and else paper."""
        if not isinstance(name, str) or name != AUTO:
            return name
        return "paper" if self.incident is None else "sea"
