# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The description of a search for planners as JSON, the text of the topic `agents`."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.base.json_reader import read_json
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.json_keys import Keys
from dsse_ros.world.scenario.limits import MAX_ID, MAX_SIDE
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import (
    CUSTOM_FIELDS,
    SPECS,
    ResolvedScenario,
    Scenario,
    altitudes_of,
)
from dsse_ros.world.scenario.sea_state import sea_state

MAX_SPEED_MPS = 1000.0
_ORIGIN = ("lat_deg", "lon_deg", "alt_m")


@dataclass(frozen=True)
class AgentsInfo:
    """The search as the topic `agents` describes it.

    Attributes:
        agents: Names of the drones in their fixed order.
        actions: Names of the actions: the action with number i is actions[i]. None in metres.
        rules: Name of the rules profile.
        seed: Seed of the mission, None if it was not given.
        frame: The grid in the map frame: all fields but the altitudes of kinds of drones, which
            follow from the definition, are keys of the message.
        timestep_limit: Limit of the mission in steps.
        step_duration_s: Simulated time that a step takes.
        mission: Number of the mission; grows by one with each reset. A mission that is resumed
            from a snapshot keeps its own.
        run_id: Identity of the simulation since its start, 1 to 2**32 - 1: with the mission it
            identifies a search.
        area: Which cells are searched: a text for each row, from the north, with a 1 for each of
            them and a 0 for each other one, from the west; None for the whole grid.
        decision_time_s: Wall time that a step waits for commands; None where it waits forever.
        commanded: Whether each drone has had a command in this mission, or a step waits for none:
            until then nobody may be there who plans the search.
        speeds_mps: Airspeed of cruise of each drone in metres, m/s; none on cells.
    """

    agents: tuple[str, ...]
    actions: tuple[str, ...]
    rules: str
    seed: int | None
    frame: GridFrame
    timestep_limit: int
    step_duration_s: float
    mission: int
    run_id: int
    definition: SearchDefinition | None = None
    area: tuple[str, ...] | None = None
    decision_time_s: float | None = None
    commanded: bool = True
    speeds_mps: tuple[float, ...] = ()

    @property
    def area_mask(self) -> NDArray[np.bool_] | None:
        """The cells that are searched, (R, C) bool [row, col]; None for all."""
        if self.area is None:
            return None
        return np.array([[cell == "1" for cell in row] for row in self.area])


def area_rows(mask: NDArray[np.bool_] | None) -> tuple[str, ...] | None:
    """Return the `area` of `AgentsInfo` with this mask (R, C) bool; None for None."""
    if mask is None:
        return None
    return tuple("".join("1" if cell else "0" for cell in row) for row in mask.tolist())


def definition_values(definition: SearchDefinition) -> dict[str, Any]:
    """Return the rules and the scenario as JSON values: the inverse of `definition_from`."""
    rules, scenario = definition.rules, definition.scenario
    fields = {name: getattr(scenario, name) for name in SPECS}
    for name in CUSTOM_FIELDS:
        if fields[name] is not None:
            fields[name] = fields[name].to_json()
    return {"rules": asdict(rules), "scenario": fields}


def agents_json(info: AgentsInfo) -> str:
    """Return the text for `agents`; the same information gives the same bytes."""
    values = asdict(replace(info, definition=None))
    values |= values.pop("frame")
    del values["alts_m"]
    values["origin"] = {name: values.pop(f"origin_{name}") for name in _ORIGIN}
    if info.definition is not None:
        values["definition"] = definition_values(info.definition)
        values |= _of_incident(info.definition.scenario)
    return json.dumps(values, sort_keys=True, allow_nan=False)


def _of_incident(scenario: Scenario) -> dict[str, Any]:
    """Return what a person wants to see of an incident; it follows from the definition."""
    if not isinstance(scenario, ResolvedScenario) or scenario.incident is None:
        return {}
    sea, summary = sea_state(scenario, 0), scenario.incident.grid_summary
    assert summary is not None
    shown: dict[str, Any] = {"stranded": summary.stranded, "poc_outside": 1.0 - summary.inside}
    shown |= {"wind": None, "current": None}
    for flow in sea.flows:
        direction = f"{flow.sense}_deg"
        shown[flow.kind] = {"speed_mps": flow.speed_mps, direction: flow.direction_deg}
    return {"sea": shown}


def definition_from(keys: Keys, num_drones: int | None, grid: GridShape | None) -> SearchDefinition:
    """Return the rules and the scenario that a message or a file states.

    Args:
        keys: What is stated.
        num_drones: How many drones the message or file has, None if it does not state that.
        grid: Shape of its grid, None if it does not state one: what is derived of a scenario
            takes memory by both.

    Raises:
        ValueError: If a value is not allowed or a field is missing, or of another search.
    """
    parts = {name: keys.value(name) for name in ("rules", "scenario")}
    for name, value in parts.items():
        if not isinstance(value, dict):
            keys.refuse(name, "an object")
    # A message names no file to be read here, except an array whose digest it knows.
    for name, reader in CUSTOM_FIELDS.items():
        value = parts["scenario"].get(name)
        if value is not None and not (isinstance(value, dict) and reader.may_be_sent(value)):
            keys.inner("scenario").refuse(name, f"{reader.IN_MESSAGE} or null")
    try:
        rules = profile("paper", **parts["rules"])
        scenario = Scenario.from_dict(parts["scenario"])
        shape, _ = scenario.grid_of(rules)
        drones = scenario.num_drones or len(scenario.drones_positions or [0])
        for name, stated, value in (
            ("grid_size", shape, grid),
            ("num_drones", drones, num_drones),
        ):
            if value is not None and stated != value:
                raise ValueError(f"{name} must be {value!s}, as in agents, got {stated!s}")
        return SearchDefinition(rules, scenario.resolve(rules))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{keys.where}: {error}") from None


def agents_from_json(text: str, *, with_definition: bool = True) -> AgentsInfo:
    """Return the information in a text of `agents`: the inverse of `agents_json`.

    Unknown keys are ignored, so that later versions may add some.

    Args:
        text: The text.
        with_definition: Whether to read the definition, which may name files.

    Raises:
        ValueError: If the text is not such JSON; one line that names the key.
    """
    keys = Keys(read_json(text, "agents"), "agents")
    agents, definition = keys.names("agents"), None
    if agents != tuple(f"drone{i}" for i in range(len(agents))):
        keys.refuse("agents", "drone0, drone1, ...")
    if with_definition and keys.value("definition") is not None:
        definition = definition_from(keys.inner("definition"), len(agents), _grid_of(keys))
    return AgentsInfo(
        agents=agents,
        actions=keys.names("actions", may_be_none=_in_metres(keys)),
        rules=keys.text("rules"),
        seed=None if keys.value("seed") is None else keys.integer("seed", None),
        frame=_frame_of(keys, definition),
        timestep_limit=keys.integer("timestep_limit", 1),
        step_duration_s=keys.number("step_duration_s"),
        mission=keys.integer("mission", 0, MAX_ID),
        run_id=keys.integer("run_id", 1, MAX_ID),
        definition=definition,
        area=_area_of(keys),
        decision_time_s=_decision_time_s(keys),
        commanded=keys.flag("commanded", default=True),
        speeds_mps=_speeds_mps(keys, len(agents)),
    )


def _in_metres(keys: Keys) -> bool:
    """Return whether the search is stated to be in metres."""
    definition = keys.value("definition")
    rules = definition.get("rules") if isinstance(definition, dict) else None
    return isinstance(rules, dict) and rules.get("space") == "metres"


def _frame_of(keys: Keys, definition: SearchDefinition | None) -> GridFrame:
    """Return the grid in the map frame.

    Raises:
        ValueError: If a key is missing or not allowed.
    """
    origin = keys.inner("origin")
    values: dict[str, Any] = {
        "grid_size": _grid_of(keys),
        "map_frame": keys.text("map_frame"),
        "frame_prefix": keys.text("frame_prefix", may_be_empty=True),
        "alts_m": () if definition is None else altitudes_of(definition.scenario),
        **{name: keys.number(name) for name in ("cell_size_m", "alt_m")},
        **{f"origin_{name}": origin.number(name) for name in _ORIGIN},
    }
    try:
        return GridFrame(**values)
    except ValueError as error:
        raise ValueError(f"agents: {error}") from None


def _grid_of(keys: Keys) -> GridShape:
    """Return the shape of the grid, [columns, rows]."""
    sizes = keys.entries("grid_size", 2)
    if not all(type(size) is int and 1 <= size <= MAX_SIDE for size in sizes):
        keys.refuse("grid_size", f"two whole numbers [columns, rows] from 1 to {MAX_SIDE}")
    return GridShape(*sizes)


def _decision_time_s(keys: Keys) -> float | None:
    """Return how long a step waits, None forever."""
    if keys.value("decision_time_s") is None:
        return None
    time_s = keys.number("decision_time_s")
    if time_s <= 0:
        keys.refuse("decision_time_s", "above 0")
    return time_s


def _speeds_mps(keys: Keys, num_drones: int) -> tuple[float, ...]:
    """Return the airspeeds of drones in metres.

    Raises:
        ValueError: If the value is not a speed for each drone, or none.
    """
    if not keys.has("speeds_mps"):
        return ()
    speeds = keys.entries("speeds_mps")
    known = all(isinstance(speed, int | float) and 0 < speed < MAX_SPEED_MPS for speed in speeds)
    if len(speeds) not in (0, num_drones) or not known:
        keys.refuse("speeds_mps", f"a speed for each of {num_drones} drones, or empty")
    return tuple(map(float, speeds))


def _area_of(keys: Keys) -> tuple[str, ...] | None:
    """Return the area, None for all of the grid.

    Raises:
        ValueError: If the value is not an area of a grid of this size.
    """
    if keys.value("area") is None:
        return None
    columns, height = _grid_of(keys)
    rows = keys.entries("area", height)
    if not all(
        isinstance(row, str) and len(row) == columns and not row.strip("01") for row in rows
    ):
        keys.refuse("area", f"{height} texts of {columns} digits 0 and 1")
    return tuple(rows)
