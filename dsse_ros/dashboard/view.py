# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contents of one page: the shown step, its map, and the texts beside it."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from dsse_ros.dashboard.history import DroneState, SearchHistory
from dsse_ros.dashboard.missions import LAYERS, Mission, Missions
from msg_adapters.geodesy import cell_to_geodetic

STATES = {
    DroneState.FLYING: "in flight",
    DroneState.FINDER: "found the person",
    DroneState.OVER: "search over",
    DroneState.LOST: "lost",
    DroneState.OUT_OF_TIME: "out of time",
}
MAX_POINTS = 400
"""Largest number of points of the POS line, about one for each pixel of the chart."""
_DRONES = Environment(
    loader=PackageLoader("dsse_ros.dashboard", "."), autoescape=True, undefined=StrictUndefined
).get_template("drones.html")


@dataclass
class Sent:
    """What the browser already has.

    Attributes:
        key: Search, revision of its history, and layer.
        rows: Number of steps.
        image: Stamp of the map, None without one.
        state: Everything else in a frame.
    """

    key: object = None
    rows: int = 0
    image: int | None = None
    state: object = None


class PageView:
    """One page in one browser.

    Args:
        missions: All missions.

    Attributes:
        namespace: Namespace of the shown mission; None for the first one.
        layer: Topic of the shown map; None for the belief if it is published, else the map.
        step: The shown step; None for the last one.
    """

    def __init__(self, missions: Missions) -> None:
        self._missions = missions
        self.namespace: str | None = None
        self.layer: str | None = None
        self.step: int | None = None
        self._sent = Sent()
        self._number = 0

    @property
    def mission(self) -> Mission | None:
        """The shown mission; None if there is none."""
        missions = self._missions.by_namespace
        if self.namespace is None:
            return next(iter(missions.values()), None)
        return missions.get(self.namespace)

    @property
    def history(self) -> SearchHistory | None:
        """The steps of the shown search; None before the first is known."""
        mission = self.mission
        if mission is None or mission.info is None or not mission.history:
            return None
        return mission.history

    @property
    def shown_layer(self) -> str:
        """Topic of the shown map."""
        if self.layer is not None:
            return self.layer
        mission = self.mission
        has_belief = mission is not None and mission.maps["belief_grid"]
        return "belief_grid" if has_belief else "probability_grid"

    def choose(self, namespace: str) -> None:
        """Show the mission of a namespace, live."""
        self.namespace, self.step = namespace, None

    def forget_sent(self) -> None:
        """Send everything again, because the browser has lost it."""
        self._sent = Sent()

    # The map

    def frame(self) -> dict[str, Any] | None:
        """Return what the map has to draw; None if the browser already shows it.

        The keys are the number of the frame, search, grid, names of the drones, first index and
        rows of the new steps (see `SearchHistory.paths`), the shown step, image (a data URL, only
        if it has changed) and vehicles (drone, column, row).
        """
        mission, history = self.mission, self.history
        if mission is None or history is None:
            empty: dict[str, Any] = {"search": "", "grid": 0, "names": [], "first": 0, "rows": []}
            return self._numbered(None, 0, None, {**empty, "shown": None, "vehicles": []}, None)
        info = mission.info
        assert info is not None
        i = history.index(self.step)
        key = (mission.namespace, history.key, history.revision, self.shown_layer)
        found = history.map_at(mission.maps[self.shown_layer], i)
        # An earlier step must not show the current position of a vehicle.
        vehicles = [] if self.step is not None else [
            (info.agents.index(name), *vehicle.place)
            for name, vehicle in mission.vehicles.items()
            if vehicle.place is not None and name in info.agents
        ]  # fmt: skip
        first = self._sent.rows if key == self._sent.key else 0
        frame = {
            "search": f"{history.key[0]}/{history.key[1]}",
            "grid": info.grid_size,
            "names": info.agents,
            "first": first,
            "rows": [] if first == len(history) else list(history.paths(mission.looks, first)),
            "shown": history.steps[i],
            "vehicles": vehicles,
        }
        return self._numbered(key, len(history), found, frame, (history.steps[i], vehicles))

    def _numbered(
        self, key: object, rows: int, found: tuple[int, bytes] | None, frame: dict[str, Any],
        state: object,
    ) -> dict[str, Any] | None:  # fmt: skip
        """Return a frame with its number, and the image if it is new; None if nothing is new."""
        stamp = found[0] if found is not None else None
        sent, now = self._sent, Sent(key, rows, stamp, state)
        if self._number and now == sent:
            return None
        if key != sent.key or stamp != sent.image:
            frame["image"] = None if found is None else _data_url(found[1])
        self._sent = now
        self._number += 1
        return {"number": self._number, **frame}

    # Texts

    def waiting(self) -> str:
        """Return what the page is waiting for, "" if it has a mission to show."""
        if not self._missions.by_namespace:
            return "Waiting for a simulation: no step_report in any namespace yet."
        mission = self.mission
        if mission is None:
            return f"Waiting for a simulation in {self.namespace}."
        if not mission.history:
            return f"Waiting for the first step_report in {mission.title}."
        if mission.info is None:
            return f"Waiting for agents in {mission.title}, which say what is searched."
        if mission.publishers == 0 and mission.history.done:
            return "The simulation has ended with its mission, which the time line shows again."
        if mission.publishers == 0:
            return f"The simulation in {mission.title} is gone. Waiting until it is back."
        return ""

    def trouble(self) -> str:
        """Return what is wrong with the messages, "" for nothing."""
        mission = self.mission
        if mission is None:
            return ""
        lines = [f"{topic}: {reason}" for topic, reason in mission.trouble.items()]
        if mission.publishers > 1:
            lines.append(f"{mission.publishers} nodes publish step_report: missions are mixed")
        return "; ".join(lines)

    def headline(self) -> str:
        """Return the state of the search in the shown step."""
        mission, history = self.mission, self.history
        if mission is None or history is None or mission.info is None:
            return ""
        i, info = history.index(self.step), mission.info
        states = history.states[i]
        flying = int((states == DroneState.FLYING).sum())
        seconds = history.steps[i] * info.step_duration_s
        parts = [
            f"Mission {history.key[1]}",
            f"step {history.steps[i]} of {info.timestep_limit}",
            f"{int(seconds // 60)} min {int(seconds % 60)} s at sea",
            f"{flying} of {len(states)} drones in flight" if flying else _outcome(states),
        ]
        pos = history.pos_at(i)
        if pos is not None:
            parts.append(f"POS {pos:.1%}")
        return ", ".join(parts)

    def drones_table(self) -> str:
        """Return an HTML table of the drones in the shown step, or of the vehicles before any."""
        mission, history = self.mission, self.history
        if mission is None:
            return ""
        names, steps = sorted(mission.vehicles), []
        if history is not None and mission.info is not None:
            i, actions = history.index(self.step), mission.info.actions
            names = list(mission.info.agents)
            for entry, state, reward in zip(
                history.reports[i], history.states[i], history.rewards[i], strict=True
            ):
                action = int(entry["action"])
                steps.append({
                    "state": STATES[DroneState(int(state))] + (", held" if entry["held"] else ""),
                    "col": entry["col"],
                    "row": entry["row"],
                    "action": actions[action] if 0 <= action < len(actions) else "none",
                    "reward": reward,
                })  # fmt: skip
        return _DRONES.render(names=names, steps=steps, vehicles=mission.vehicles) if names else ""

    def place(self, cell: tuple[int, int]) -> str:
        """Return a cell (col, row) with the latitude and longitude of its centre."""
        mission = self.mission
        if mission is None or mission.info is None:
            return ""
        lat, lon, _ = cell_to_geodetic(mission.info.frame, float(cell[0]), float(cell[1]), 0.0)
        north, east = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
        return f"cell {cell[0]}, {cell[1]}: {abs(lat):.6f}° {north}, {abs(lon):.6f}° {east}"

    def pos_line(self) -> list[tuple[int, float]]:
        """Return at most `MAX_POINTS` points (step, POS in percent)."""
        history = self.history
        if history is None:
            return []
        points = history.pos
        every = -(-len(points) // MAX_POINTS) or 1
        kept = points[::every]
        if points and kept[-1] != points[-1]:
            kept.append(points[-1])
        return [(step, round(100 * pos, 3)) for step, pos in kept]


def layers_of(mission: Mission | None) -> dict[str, str]:
    """Return the names of the layers that a mission has published, by topic."""
    if mission is None:
        return {}
    return {topic: name for topic, name in LAYERS.items() if mission.maps[topic]}


def _outcome(states: Any) -> str:
    if (states == DroneState.FINDER).any():
        return "search over: person found"
    if (states == DroneState.OUT_OF_TIME).any():
        return "search over: out of time"
    if (states == DroneState.OVER).any():
        return "search over: all covered"
    return "search over: all drones lost"


def _data_url(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
