# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Classes of the package simulation_interfaces, which is not among the wheels.

They are made from its definitions (the same in versions 1.0.0 to 2.1.0, but for `ADDED`), without
type support: handlers can be called with them, DDS cannot carry them.
"""

from __future__ import annotations

import re
from types import ModuleType
from typing import Any

DEFINITIONS = {
    "msg/Result": """
        uint8 RESULT_FEATURE_UNSUPPORTED = 0
        uint8 RESULT_OK = 1
        uint8 RESULT_NOT_FOUND = 2
        uint8 RESULT_INCORRECT_STATE = 3
        uint8 RESULT_OPERATION_FAILED = 4
        uint8 result
        string error_message
    """,
    "msg/SimulationState": """
        uint8 STATE_STOPPED = 0
        uint8 STATE_PLAYING = 1
        uint8 STATE_PAUSED = 2
        uint8 STATE_QUITTING = 3
        uint8 state
    """,
    "msg/SimulatorFeatures": """
        uint8 SPAWNING = 0
        uint8 SIMULATION_RESET = 20
        uint8 SIMULATION_RESET_TIME = 21
        uint8 SIMULATION_RESET_STATE = 22
        uint8 SIMULATION_RESET_SPAWNED = 23
        uint8 SIMULATION_STATE_GETTING = 24
        uint8 SIMULATION_STATE_SETTING = 25
        uint8 SIMULATION_STATE_PAUSE = 26
        uint8 STEP_SIMULATION_SINGLE = 31
        uint8 STEP_SIMULATION_MULTIPLE = 32
        uint8 STEP_SIMULATION_ACTION = 33
        uint16[] features
        string[] spawn_formats
        string custom_info
    """,
    "srv/ResetSimulation": """
        uint8 SCOPE_DEFAULT = 0
        uint8 SCOPE_TIME = 1
        uint8 SCOPE_STATE = 2
        uint8 SCOPE_SPAWNED = 4
        uint8 SCOPE_ALL = 255
        uint8 scope
        ---
        Result result
    """,
    "srv/SetSimulationState": """
        SimulationState state
        ---
        uint8 ALREADY_IN_TARGET_STATE = 101
        uint8 STATE_TRANSITION_ERROR = 102
        uint8 INCORRECT_TRANSITION = 103
        Result result
    """,
    "srv/GetSimulationState": """
        ---
        SimulationState state
        Result result
    """,
    "srv/StepSimulation": """
        uint64 steps 1
        ---
        Result result
    """,
    "srv/GetSimulatorFeatures": """
        ---
        SimulatorFeatures features
    """,
}

ADDED = {
    "msg/SimulationState": """
        uint8 STATE_NO_WORLD = 4
        uint8 STATE_LOADING_WORLD = 5
    """,
    "msg/SimulatorFeatures": """
        uint8 WORLD_LOADING = 40
        uint8 WORLD_UNLOADING = 43
        uint8 SPAWNING_ENTITIES = 50
    """,
}
"""Further lines of version 2, which later releases of version 1 have too."""

_LINE = re.compile(r"(?P<type>[\w\[\]]+) (?P<name>\w+)(?: (?P<constant>= )?(?P<value>\d+))?")


class Double:
    """A message: its constants are of the class, its fields of the instance and no others."""

    FIELDS: dict[str, Any] = {}

    def __init__(self, **fields: Any) -> None:
        for name, make in self.FIELDS.items():
            object.__setattr__(self, name, make())
        for name, value in fields.items():
            setattr(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self.FIELDS:
            raise AttributeError(f"{type(self).__name__} has no field {name}")
        wanted = type(self.FIELDS[name]())
        assert isinstance(value, wanted), f"{name}: {value!r} is no {wanted.__name__}"
        object.__setattr__(self, name, value)


def _message(name: str, lines: list[str], known: dict[str, type[Double]]) -> type[Double]:
    fields: dict[str, Any] = {}
    constants: dict[str, int] = {}
    for line in lines:
        match = _LINE.fullmatch(line)
        assert match, line
        kind, field, value = match["type"], match["name"], int(match["value"] or 0)
        if match["constant"]:
            constants[field] = value
        elif kind in known:
            fields[field] = known[kind]
        elif kind.endswith("[]"):
            fields[field] = list
        else:
            fields[field] = str if kind == "string" else lambda value=value: value
    return type(name, (Double,), {"FIELDS": fields, **constants})


def modules(version: int) -> dict[str, ModuleType]:
    """Return the modules of the package, version 1 or 2, by their names in `sys.modules`."""
    made = {
        name: ModuleType(name)
        for name in (
            "simulation_interfaces",
            "simulation_interfaces.msg",
            "simulation_interfaces.srv",
        )
    }
    known: dict[str, type[Double]] = {}
    for path, text in DEFINITIONS.items():
        kind, name = path.split("/")
        text += ADDED.get(path, "") if version > 1 else ""
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        if kind == "msg":
            known[name] = _message(name, lines, known)
            setattr(made["simulation_interfaces.msg"], name, known[name])
        else:
            at = lines.index("---")
            parts = {
                "Request": _message(f"{name}_Request", lines[:at], known),
                "Response": _message(f"{name}_Response", lines[at + 1 :], known),
            }
            setattr(made["simulation_interfaces.srv"], name, type(name, (), parts))
    return made
