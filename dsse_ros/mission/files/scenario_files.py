# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lookup of scenario files, and of those with an incident."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from dsse_ros.base.fields import FieldError
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.scenario import Scenario

_SHIPPED = Path("share") / "dsse_ros" / "config"


def find_scenario(name: str) -> Path:
    """Return the absolute path of a scenario: a file, or the name of one in the package.

    Raises:
        FieldError: If neither exists.
    """
    if Path(name).exists() and not Path(name).is_dir():
        return Path(name).resolve()
    # ament may not know a virtual environment, and a source tree has no share folder.
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    folders = [Path(prefix) / _SHIPPED for prefix in prefixes if prefix]
    folders.append(Path(__file__).resolve().parents[3] / "config")
    for folder in folders:
        path = folder / f"{name.removesuffix('.yaml')}.yaml"
        if path.is_file():
            return path.resolve()
    names = sorted({path.stem for folder in folders for path in folder.glob("*.yaml")})
    raise FieldError(f"scenario: {name!r} is not a file or a known scenario: {', '.join(names)}")


def scenario_with_incident(name: str) -> tuple[Scenario, Incident]:
    """Return a scenario, see `find_scenario`, and its incident.

    Raises:
        FieldError: If there is no such scenario, it has no incident, or a value is not allowed.
    """
    scenario = Scenario.from_yaml(find_scenario(name))
    if scenario.incident is None:
        raise FieldError(f"scenario must have an incident, got {name!r}")
    return scenario, scenario.incident
