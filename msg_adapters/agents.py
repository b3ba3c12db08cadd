# SPDX-License-Identifier: Apache-2.0
"""What a planner has to know of the search, as JSON in std_msgs/String."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Any, NoReturn

from std_msgs.msg import String

from msg_adapters.frames import GridFrame
from msg_adapters.result import shown


@dataclass(frozen=True)
class Origin:
    """WGS84 position of the grid's south-west corner."""

    lat_deg: float
    lon_deg: float
    alt_m: float


@dataclass(frozen=True)
class AgentsInfo:
    """The search as the topic `agents` tells it.

    Attributes:
        agents: Names of the drones in their fixed order.
        actions: Legend: the action with number i is actions[i].
        rules: Name of the rules profile.
        seed: Seed of the mission, None if it was not given.
        grid_size: Cells along a side, G.
        cell_size_m: Side of a cell.
        timestep_limit: Limit of the mission in steps.
        step_duration_s: Simulated time that a step takes.
        map_frame: Name of the map frame.
        origin: Where the map frame lies on the Earth.
        alt_m: Flight altitude above the map plane.
        mission: Number of the mission; grows by one with each reset.
    """

    agents: tuple[str, ...]
    actions: tuple[str, ...]
    rules: str
    seed: int | None
    grid_size: int
    cell_size_m: float
    timestep_limit: int
    step_duration_s: float
    map_frame: str
    origin: Origin
    alt_m: float
    mission: int

    @property
    def frame(self) -> GridFrame:
        """The grid in the map frame."""
        return GridFrame(
            grid_size=self.grid_size,
            cell_size_m=self.cell_size_m,
            origin_lat_deg=self.origin.lat_deg,
            origin_lon_deg=self.origin.lon_deg,
            origin_alt_m=self.origin.alt_m,
            alt_m=self.alt_m,
            map_frame=self.map_frame,
        )


def agents_message(info: AgentsInfo) -> String:
    """Return the message for `agents`; the same information gives the same bytes."""
    return String(data=json.dumps(asdict(info), sort_keys=True, allow_nan=False))


def agents_from_message(message: String) -> AgentsInfo:
    """Return the information in a message of `agents`: the inverse of `agents_message`.

    Unknown keys are ignored, so that later versions may add some.

    Raises:
        ValueError: If the text is not such JSON; one line that names the key.
    """
    try:
        document = json.loads(message.data, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"agents: not JSON: {shown(str(error))}") from None
    keys = _Keys(document, "agents")
    origin = _Keys(keys.value("origin"), "agents.origin")
    info = AgentsInfo(
        agents=keys.names("agents"),
        actions=keys.names("actions"),
        rules=keys.text("rules"),
        seed=None if keys.value("seed") is None else keys.integer("seed", None),
        grid_size=keys.integer("grid_size", 1),
        cell_size_m=keys.number("cell_size_m"),
        timestep_limit=keys.integer("timestep_limit", 1),
        step_duration_s=keys.number("step_duration_s"),
        map_frame=keys.text("map_frame"),
        origin=Origin(
            lat_deg=origin.number("lat_deg"),
            lon_deg=origin.number("lon_deg"),
            alt_m=origin.number("alt_m"),
        ),
        alt_m=keys.number("alt_m"),
        mission=keys.integer("mission", 0),
    )
    try:
        _ = info.frame
    except ValueError as error:
        raise ValueError(f"agents: {error}") from None
    return info


class _Keys:
    """Typed access to the keys of a JSON object."""

    def __init__(self, document: Any, where: str) -> None:
        if not isinstance(document, dict):
            raise ValueError(f"{where}: {shown(document)} is not allowed; an object")
        self._document = document
        self._where = where

    def value(self, key: str) -> Any:
        if key not in self._document:
            raise ValueError(f"{self._where}.{key}: missing")
        return self._document[key]

    def text(self, key: str) -> str:
        value = self.value(key)
        if not isinstance(value, str) or not value:
            self._refuse(key, "a text that is not empty")
        return str(value)

    def names(self, key: str) -> tuple[str, ...]:
        value = self.value(key)
        wanted = "a list of different names"
        if not isinstance(value, list) or not value:
            self._refuse(key, wanted)
        if not all(isinstance(name, str) and name for name in value):
            self._refuse(key, wanted)
        if len(set(value)) != len(value):
            self._refuse(key, wanted)
        return tuple(value)

    def integer(self, key: str, least: int | None) -> int:
        value = self.value(key)
        if isinstance(value, bool) or not isinstance(value, int):
            self._refuse(key, "a whole number")
        if least is not None and value < least:
            self._refuse(key, f"at least {least}")
        return int(value)

    def number(self, key: str) -> float:
        value = self.value(key)
        wanted = "a finite number"
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._refuse(key, wanted)
        # An integer too large for a float raises; every other is finite.
        if abs(value) > 1e300 or not math.isfinite(value):
            self._refuse(key, wanted)
        return float(value)

    def _refuse(self, key: str, wanted: str) -> NoReturn:
        value = shown(self._document[key])
        raise ValueError(f"{self._where}.{key}: {value} is not allowed; {wanted}")


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not allowed")
