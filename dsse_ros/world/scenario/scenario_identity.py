# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Values of a scenario as JSON, by which searches differ: large ones by their digest."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np

from dsse_ros.world.drift.flow import digest_of
from dsse_ros.world.scenario.area import Area
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import SPECS, ResolvedScenario
from dsse_ros.world.scenario.scenario_array import ScenarioArray
from dsse_ros.world.searchers.registry import DEFAULT


def plain(values: Any) -> Any:
    """Return values as JSON values; different ones stay different.

    Raises:
        TypeError, ValueError: If a value has no JSON form.
    """
    # Convert through JSON, because a file of it has lists for tuples.
    return json.loads(json.dumps(values, default=_plain, sort_keys=True))


def identity_of(scenario: ResolvedScenario, rules: Rules) -> dict[str, Any]:
    """Return the fields of scenario, rules and kinds of drones as JSON, without names of files."""
    parts: dict[str, Any] = {
        "scenario": {name: getattr(scenario, name) for name in SPECS},
        "rules": dataclasses.asdict(rules),
    }
    if set(scenario.searchers) != {DEFAULT}:
        names = dict.fromkeys(scenario.searchers)
        parts["searchers"] = {
            name: dataclasses.asdict(dataclasses.replace(kind, doc=""))
            for name, kind in zip(names, scenario.kinds, strict=True)
        }
    identity: dict[str, Any] = plain(parts)
    return identity


def _plain(value: Any) -> Any:
    match value:
        case Area() | ScenarioArray() | Incident():
            return value.identity
        case np.ndarray() if not value.dtype.hasobject:
            return digest_of([value])
        case np.generic():
            return value.item()
    raise TypeError(f"{type(value).__name__} has no form in JSON")
