# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contents of one page: the shown step, its map, and the texts beside it."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from dsse_ros.picture.mission_view import ending
from dsse_ros.picture.sea_chart import corner_rows
from dsse_ros.picture.theme import drone_colour
from dsse_ros.screens.dashboard.drone_states import battery_of, collided_with, flight_of, state_of
from dsse_ros.screens.dashboard.live_marks import NO_SKETCH, live_marks
from dsse_ros.screens.dashboard.map_chart import Window, chart_of, edges_of
from dsse_ros.screens.dashboard.map_image import level_at
from dsse_ros.screens.dashboard.missions import ShownMission, ShownMissions
from dsse_ros.screens.dashboard.search_history import (
    LAYERS,
    DroneState,
    MapImage,
    SearchHistory,
    has_field,
)
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.geodesy import cell_to_geodetic
from dsse_ros.world.scenario.sea_state import SeaState

MAX_POINTS = 400
"""Largest number of points of the POS line, about one for each pixel of the chart."""
_DRONES = Environment(
    loader=PackageLoader("dsse_ros.screens.dashboard", "."),
    autoescape=True,
    undefined=StrictUndefined,
).get_template("drones.html")

RATES = (1, 2, 4, 8, 16, 32)
"""Speeds of a replay in steps per second."""

ORDERS = ("number", "state", "battery", "reward")
"""Columns by which the table of the drones can be sorted."""
MAX_ROWS = 12
"""Rows of the table of the drones while it is folded."""


@dataclass
class Sent:
    """What the browser already has.

    Attributes:
        key: Search, revision of its history, and layer.
        rows: Number of steps.
        image: Stamp of the map and its top, None without one.
        state: Everything else in a frame.
    """

    key: object = None
    rows: int = 0
    image: tuple[int, float | None] | None = None
    state: object = None


class PageView:
    """One page in one browser.

    Args:
        missions: All missions.

    Attributes:
        namespace: Namespace of the shown mission; None for the first one.
        layer: Topic of the map to show if the mission has it; else the belief if it is published,
            else the map.
        step: The shown step; None for the last one.
        filter_text: The table lists drones whose name or state contains it.
        order: Column by which the table is sorted.
        folded: Whether the table has at most `MAX_ROWS` rows.
        hidden: Number of rows that the table lacks because it is folded.
        window: The part of the map that is shown.
        playing: Whether the page replays the steps it has, up to the last one.
        rate: Speed of the replay in steps per second.
        sketch: Places of a form, which the map shows.
    """

    def __init__(self, missions: ShownMissions) -> None:
        self._missions = missions
        self.namespace: str | None = None
        self.layer: str | None = None
        self.step: int | None = None
        self.filter_text = ""
        self.order = ORDERS[0]
        self.folded, self.hidden = True, 0
        self.window = Window()
        self.playing = False
        self.rate = RATES[1]
        self.sketch = NO_SKETCH
        self._played = 0.0
        self._sent = Sent()
        self._number = 0

    @property
    def mission(self) -> ShownMission | None:
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
    def sea(self) -> SeaState:
        """Wind, current, shore and sightings in the shown step."""
        mission, history = self.mission, self.history
        if mission is None or history is None:
            return SeaState()
        return mission.sea(history.steps[history.index(self.step)])

    @property
    def shown_layer(self) -> str:
        """Topic of the shown map."""
        layers = layers_of(self.mission)
        if self.layer in layers:
            return self.layer
        return "belief_grid" if "belief_grid" in layers else "probability_grid"

    def choose(self, namespace: str) -> None:
        """Show the mission of a namespace, live."""
        self.namespace, self.window = namespace, Window()
        self.seek(None)

    def seek(self, step: int | None) -> None:
        """Show a step, None for the last one, and end the replay."""
        self.step, self.playing = step, False

    def play(self) -> None:
        """Replay from the shown step, or from the first one if the last one is shown."""
        history = self.history
        if history is not None and len(history) > 1:
            self.step = history.steps[0] if self.step is None else self.step
            self.playing, self._played = True, 0.0

    def advance(self, elapsed_s: float) -> None:
        """Continue the replay after a time; at the last step it ends."""
        history = self.history
        if not self.playing or history is None or self.step is None:
            return
        self._played += self.rate * elapsed_s
        steps, self._played = divmod(self._played, 1.0)
        i = history.index(self.step) + int(steps)
        if i < len(history) - 1:
            self.step = history.steps[i]
        else:
            self.seek(None)

    def forget_sent(self) -> None:
        """Send everything again, because the browser has lost it."""
        self._sent = Sent()

    # The map

    def frame(self) -> dict[str, Any] | None:
        """Return what the map has to draw; None if the browser already shows it.

        The keys are the number of the frame, search, grid, names of the drones, strips (see
        `ShownMission.strips`), first index and rows of the new steps (see `SearchHistory.paths`
        and, in metres, `flights`), the shown step, mapped (the step of the map, which may be
        older), image (a data URL, only if it has changed), vehicles (drone, column, row), corner
        (see `CornerRow`), edges (see `edges_of`), live (see `live_marks`), and chart (see
        `chart_of`, only if it has changed).
        """
        mission, history = self.mission, self.history
        if mission is None or history is None:
            empty: dict[str, Any] = {
                "search": "",
                "grid": [0, 0],
                "names": [],
                "first": 0,
                "rows": [],
            }
            empty |= {"shown": None, "mapped": None, "vehicles": [], "corner": [], "image": None}
            empty |= {"strips": [], "live": None}
            return None if self._is_sent(Sent()) else self._numbered(Sent(), empty)
        info = mission.info
        assert info is not None
        i = history.index(self.step)
        key = (mission.namespace, history.key, history.revision, self.shown_layer)
        found = history.map_at(self.shown_layer, i)
        # An earlier step must not show the current position of a vehicle.
        vehicles = [] if self.step is not None else [
            (info.agents.index(name), *vehicle.place)
            for name, vehicle in mission.vehicles.items()
            if vehicle.place is not None and name in info.agents
        ]  # fmt: skip
        image = None if found is None else (found.stamp_ns, found.top)
        live = live_marks(info.frame, mission.contacts, self.sketch)
        sent, state = self._sent, (history.steps[i], vehicles, self.window, live)
        now = Sent(key, len(history), image, state)
        if self._is_sent(now):
            return None
        first = sent.rows if key == sent.key else 0
        frame = {
            "search": f"{history.key[0]}/{history.key[1]}",
            "grid": list(info.frame.grid_size),
            "names": info.agents,
            "strips": mission.strips,
            "first": first,
            "rows": [] if first == len(history) else self._rows(mission, history, info, first),
            "shown": history.steps[i],
            "mapped": None if found is None else history.step_at(found.stamp_ns),
            "vehicles": vehicles,
            "corner": [*map(list, corner_rows(self.sea, info.frame.extent))],
            "edges": edges_of(info, self.window),
            "live": live,
        }
        if key != sent.key:
            frame["chart"] = chart_of(info, self.sea)
        if key != sent.key or image != sent.image:
            frame["image"] = None if found is None else _data_url(found.png)
        return self._numbered(now, frame)

    @staticmethod
    def _rows(
        mission: ShownMission, history: SearchHistory, info: AgentsInfo, first: int
    ) -> list[list[Any]]:
        """Return what the map draws of the known steps from this index."""
        if mission.strips:
            return list(history.flights(info.frame, first))
        return list(history.paths(mission.looks, first))

    def _is_sent(self, now: Sent) -> bool:
        """Return whether the browser already has this."""
        return self._number > 0 and now == self._sent

    def _numbered(self, now: Sent, frame: dict[str, Any]) -> dict[str, Any]:
        """Return a new frame with its number."""
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
            return f"Waiting for agents in {mission.title}, which describes the search."
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
        if mission.publishers > 1 and mission.mixed:
            lines.append(f"{mission.publishers} nodes publish step_report: missions are mixed")
        return "; ".join(lines)

    def state(self) -> str:
        """Return the state of the simulation."""
        mission = self.mission
        if mission is None or mission.publishers == 0:
            return "" if mission is None else "gone"
        parts = mission.state.split("; ")
        return "; ".join(part for part in parts if mission.mixed or " nodes publish " not in part)

    def headline(self) -> str:
        """Return the state of the search in the shown step."""
        mission, history = self.mission, self.history
        if mission is None or history is None or mission.info is None:
            return ""
        i, info = history.index(self.step), mission.info
        states = history.states[i]
        aborted = self.step is None and mission.state.startswith("mission aborted")
        flying = int((states == DroneState.FLYING).sum())
        seconds = history.steps[i] * info.step_duration_s
        parts = [
            f"Mission {history.key[1]}",
            f"step {min(history.steps[i], info.timestep_limit)} of {info.timestep_limit}",
            f"{int(seconds // 60)} min {int(seconds % 60)} s at sea"
            + (f" ({time})" if (time := self.sea.time) else ""),
            f"{flying} of {len(states)} drones in flight"
            if flying and not aborted
            else self._outcome(states, aborted=aborted),
        ]
        parts += self._found(i)
        pos = history.pos_at(i)
        if self.covers:
            parts += [f"coverage rate {rate:.1%}" for _, rate in _coverage(history, i)]
        elif pos is not None:
            parts.append(f"POS {pos:.1%}")
        if self.step is None:
            parts += [f"{key} {share:.0%}" for key, share in mission.objects.items()]
        return ", ".join(parts)

    @property
    def covers(self) -> bool:
        """Whether the task of the shown mission is to cover the cells."""
        mission = self.mission
        definition = None if mission is None or mission.info is None else mission.info.definition
        return definition is not None and definition.rules.covers

    @property
    def _persons(self) -> int:
        """Number of persons of the shown mission, 1 if unknown."""
        mission = self.mission
        definition = None if mission is None or mission.info is None else mission.info.definition
        return 1 if definition is None else definition.scenario.person_amount

    def _found(self, i: int) -> list[str]:
        """Return how many persons have been found up to known step `i`, where there are several."""
        history, persons = self.history, self._persons
        if history is None or persons == 1 or self.covers:
            return []
        reports = history.reports[: i + 1]
        if has_field(reports[-1], "all_found") and reports[-1]["all_found"].any():
            return [f"{persons} of {persons} persons found"]
        # A report does not state how many persons a search has found.
        finds = sum(int((report["found"] != 0).sum()) for report in reports)
        return [f"{'at least ' if finds else ''}{min(finds, persons)} of {persons} persons found"]

    def _outcome(self, states: NDArray[np.uint8], *, aborted: bool) -> str:
        """Return how the shown search ended."""
        mission, history = self.mission, self.history
        assert mission is not None and mission.info is not None and history is not None
        if aborted:
            return "mission aborted"
        step = min(history.steps[history.index(self.step)], mission.info.timestep_limit)
        out_of_time = bool((states == DroneState.OUT_OF_TIME).any())
        if mission.confirmed:
            return f"{mission.confirmed} after {step} steps"
        return ending(
            step,
            [mission.info.agents[i] for i in np.flatnonzero(states == DroneState.FINDER)],
            persons=self._persons,
            covered=bool((states == DroneState.OVER).any()) and not out_of_time,
            out_of_time=out_of_time,
        )

    def about(self) -> tuple[str, str]:
        """Return the place of the shown search; rules, planner, seed, drones and grid."""
        mission = self.mission
        info = None if mission is None else mission.info
        if mission is None or info is None:
            return "dsse_ros", ""
        name = "" if info.definition is None else info.definition.scenario.name
        seed = "" if info.seed is None else f", seed {info.seed}"
        planner = f", planner {mission.planner}" if mission.planner else ""
        drones = f"{len(info.agents)} drone" + "s" * (len(info.agents) != 1)
        (columns, rows), cell_m = info.frame.grid_size, info.frame.cell_size_m
        grid = f"{columns} × {rows} cells of {cell_m:g} m"
        return (
            name or mission.title,
            f"rules {info.rules}{planner}{seed}, {drones}, {grid}",
        )

    def no_pos(self) -> str:
        """Return why there is no probability of success, "" if there is one."""
        mission, history = self.mission, self.history
        if mission is None or history is None or history.pos or self.covers:
            return ""
        return (
            "No POS: no belief follows this mission. By default there is one on grids of at most "
            "2500 cells; compute_pos:=always makes one on any grid."
        )

    def drones_table(self) -> str:
        """Return an HTML table of the drones in the shown step, or of the vehicles before any."""
        mission, history = self.mission, self.history
        if mission is None:
            return ""
        names = sorted(mission.vehicles)
        steps: list[dict[str, Any]] = []
        if history is not None and mission.info is not None:
            i, actions = history.index(self.step), mission.info.actions
            names = list(mission.info.agents)
            for entry, state, reward in zip(
                history.reports[i], history.states[i], history.rewards[i], strict=True
            ):
                action = int(entry["action"])
                steps.append({
                    "state": state_of(int(state), entry),
                    "collided": collided_with(mission.info, history, i, len(steps)),
                    "number": len(steps),
                    "battery": battery_of(entry),
                    "charge": entry["battery"] if battery_of(entry) else 0.0,
                    "col": entry["col"],
                    "row": entry["row"],
                    "action": actions[action] if 0 <= action < len(actions) else flight_of(entry),
                    "reward": reward,
                })  # fmt: skip
        if not names:
            return ""
        shown = [
            i
            for i, name in enumerate(names)
            if self.filter_text.lower() in f"{name} {steps[i]['state'] if steps else ''}".lower()
        ]
        if steps:
            key = self.order if self.order != "battery" else "charge"
            shown.sort(key=lambda i: steps[i][key])
        batteries = any(step["battery"] for step in steps)
        self.hidden = max(len(shown) - MAX_ROWS, 0) if self.folded else 0
        return _DRONES.render(
            names=names,
            shown=shown[: len(shown) - self.hidden],
            steps=steps,
            vehicles=mission.vehicles,
            batteries=batteries,
            in_metres=bool(mission.strips),
            colour=drone_colour,
        )

    def place(self, cell: tuple[int, int]) -> str:
        """Return a cell (col, row) with the latitude and longitude of its centre."""
        mission = self.mission
        if mission is None or mission.info is None:
            return ""
        lat, lon, _ = cell_to_geodetic(mission.info.frame, float(cell[0]), float(cell[1]), 0.0)
        north, east = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
        text = f"cell {cell[0]}, {cell[1]}: {abs(lat):.6f}° {north}, {abs(lon):.6f}° {east}"
        return text + self._probability(cell)

    @property
    def _map(self) -> MapImage | None:
        """The shown map."""
        history = self.history
        if history is None:
            return None
        return history.map_at(self.shown_layer, history.index(self.step))

    def _probability(self, cell: tuple[int, int]) -> str:
        """Return the probability in a cell (col, row) of the shown map."""
        mission, found = self.mission, self._map
        if mission is None or mission.info is None or found is None:
            return ""
        columns, rows = mission.info.frame.grid_size
        level = level_at(found.png, ((cell[0] + 0.5) / columns, (cell[1] + 0.5) / rows))
        if level is None:
            return ", not searched"
        relative = f"{level} % of the most probable cell"
        if found.top is None:
            return f", {relative}"
        # Any probability has a level of at least 1, which may be that of much less.
        share = level * found.top / 100 if level != 1 else 0.015 * found.top
        return f", {'at most ' if level == 1 else ''}{_percent(share)} ({relative})"

    def scale(self) -> str:
        """Return what the shades of the shown map mean."""
        found = self._map
        if found is None or found.top is None:
            return "0 to 100 % of the most probable cell"
        return f"probability per cell: 0 to {_percent(found.top)}"

    def pos_line(self) -> list[tuple[int, float]]:
        """Return at most `MAX_POINTS` points (step, POS or coverage rate in percent)."""
        history = self.history
        if history is None:
            return []
        points = history.pos
        if self.covers:
            points = [point for i in range(len(history)) for point in _coverage(history, i)]
        every = -(-len(points) // MAX_POINTS) or 1
        kept = points[::every]
        if points and kept[-1] != points[-1]:
            kept.append(points[-1])
        return [(step, round(100 * pos, 3)) for step, pos in kept]


def _coverage(history: SearchHistory, i: int) -> list[tuple[int, float]]:
    """Return known step `i` and its coverage rate; nothing if its report does not state it."""
    report = history.reports[i]
    known = has_field(report, "coverage_rate")
    return [(history.steps[i], float(report["coverage_rate"][0]))] if known else []


def _percent(share: float) -> str:
    """Return a probability in percent with two digits, without an exponent."""
    percent = 100 * share
    if 0 < percent < 0.001:
        return "0.001 %"
    return f"{percent:.0f} %" if percent >= 99.5 else f"{percent:.2g} %"


def layers_of(mission: ShownMission | None) -> dict[str, str]:
    """Return the names of the layers of the shown search, by topic."""
    if mission is None or mission.history is None:
        return {}
    maps = mission.history.maps
    return {topic: name for topic, name in LAYERS.items() if maps[topic]}


def _data_url(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
