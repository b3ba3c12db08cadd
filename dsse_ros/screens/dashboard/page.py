# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page itself: its layout and its controls."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from nicegui import ui
from nicegui.element import Element

from dsse_ros.screens.dashboard.clicks import BUTTON, Clicks
from dsse_ros.screens.dashboard.inbox import Inbox
from dsse_ros.screens.dashboard.live_card import LiveCard
from dsse_ros.screens.dashboard.live_marks import place_at
from dsse_ros.screens.dashboard.map_chart import Window
from dsse_ros.screens.dashboard.missions import ShownMissions
from dsse_ros.screens.dashboard.service_calls import Command
from dsse_ros.screens.dashboard.vehicles_card import VehiclesCard
from dsse_ros.screens.dashboard.view import ORDERS, RATES, PageView, layers_of

STYLE = Path(__file__).with_name("style.css")
_SLOW_S = 0.5
"""Wall time between updates of tables and charts."""
_LOST_S = 2.0
"""Wall time after which a frame that was not drawn counts as lost."""
_BLUE = "#0072B2"
_THEMES = {None: "auto", False: "light", True: "dark"}


class MissionMap(Element, component="mission_map.js"):
    """The map of a mission; see mission_map.js."""

    def __init__(self) -> None:
        super().__init__()
        self._props["label"] = (
            "Map of the mission. Arrow keys move the cell that is read out; Enter picks it for a "
            "form; plus, minus and 0 zoom."
        )

    def draw(self, frame: dict[str, Any]) -> None:
        """Draw a frame of `PageView.frame`."""
        self.run_method("draw", frame)


class MissionPage:
    """One page in one browser.

    Args:
        missions: All missions.
        inbox: Receives the commands.
        frame_rate: Largest number of frames per second.
        domain: ROS domain, shown while the page waits for a mission.
    """

    def __init__(
        self, missions: ShownMissions, inbox: Inbox, frame_rate: float, domain: int
    ) -> None:
        self._missions = missions
        self._inbox = inbox
        self._domain = domain
        self._updated_s = time.monotonic()
        self._view = PageView(missions)
        self._drawn = 0
        self._sent: tuple[int, float] = (0, 0.0)
        self._texts: dict[int, object] = {}
        self._slow_s = 0.0
        self._to_reset: str | None = None
        self._line: object = None
        ui.add_css(STYLE)
        self._dark = ui.dark_mode(None)
        self._clicks = Clicks()
        with ui.element("div").classes("page"):
            self._build_header()
            self._build_status()
            with ui.element("div").classes("board"):
                self._build_map()
                self._build_side()
        self._build_dialog()
        ui.timer(1.0 / frame_rate, self._update)

    # Layout

    def _build_header(self) -> None:
        with ui.element("header").classes("bar"):
            with ui.element("div").classes("place-name"):
                with ui.element("h1"):
                    self._title = ui.label("dsse_ros")
                self._about = ui.label().classes("about")
            self._mission = ui.select([], label="Mission").props("dense outlined")
            self._mission.on_value_change(self._on_mission)
            self._layer = ui.select([], label="Map").props("dense outlined")
            self._layer.on_value_change(self._on_layer)
            with ui.element("div").classes("buttons").props("role=group aria-label='Simulation'"):
                self._pause = self._clicks.button("Pause", "pause", self._on_pause)
                self._step = self._clicks.button("Step", "skip_next", self._on_step)
                self._reset = self._button("Reset", "replay", self._on_reset)
            self._theme = (
                self._button("Theme: auto", "contrast", self._on_theme)
                .classes("theme")
                .props("flat")
            )

    def _button(self, text: str, icon: str, on_click: Any) -> ui.button:
        return ui.button(text, icon=icon, on_click=on_click, color=None).props(BUTTON)

    def _build_status(self) -> None:
        """Build what stays in view however far the page is scrolled."""
        status = ui.element("section").classes("status").props("tabindex=0 aria-label='State'")
        self._clicks.move(status)
        with status:
            self._waiting = ui.label().classes("waiting").props("role=status")
            self._headline = ui.label().classes("headline")
            with ui.element("div").classes("reports"):
                self._state = ui.label().props("role=status")
                self._answer = ui.label().classes("note").props("role=status")
                self._trouble = ui.label().classes("trouble").props("role=alert")

    def _build_map(self) -> None:
        with ui.element("section").classes("map").props("aria-label='Map and time line'"):
            self._map = MissionMap()
            self._map.on("window", self._on_window, throttle=0.05)
            self._map.on("ready", self._view_again)
            self._map.on("drawn", self._on_drawn)
            self._map.on("point", self._on_point, throttle=0.05)
            self._map.on("pick", self._on_pick)
            self._place = ui.label().classes("place").props("role=status")
            with ui.element("div").classes("timeline"):
                # The browser's own element has the expected keys and name for screen readers.
                self._time = ui.element("input")
                self._time.props("type=range min=0 max=1 aria-label='Step that is shown'")
                self._time.on(
                    "input", self._on_seek, js_handler="(e) => emit(Number(e.target.value))",
                    throttle=0.05,
                )  # fmt: skip
                with ui.element("div").classes("replay").props("role=group aria-label='Replay'"):
                    self._play = self._button("Play", "play_arrow", self._on_play)
                    rates = {rate: f"{rate} steps/s" for rate in RATES}
                    self._rate = ui.select(rates, label="Speed", value=self._view.rate)
                    self._rate.props("dense outlined").on_value_change(self._on_rate)
                    self._live = self._button("Live", "fast_forward", self._on_live)
            with ui.element("div").classes("key"):
                ui.html('<span class="mark map-mark"></span>', sanitize=False)
                self._scale = ui.label()
            ui.html(
                '<ul class="key" aria-label="Key">'
                '<li><span class="mark searched-mark"></span>searched, thicker if more often; '
                "a shade in metres</li>"
                "<li>▲ in flight</li><li>★ has found a person</li><li>✕ lost</li>"
                "<li>△ search over</li><li>■ out of time</li><li>⊕ vehicle</li></ul>",
                sanitize=False,
            )
            self._sea_key = ui.html(
                '<ul class="key" aria-label="Key of the sea">'
                '<li><span class="mark land-mark"></span>land</li>'
                '<li><span class="lkp-mark">⊙</span>last known position (LKP) with its 99 % '
                "circle</li></ul>",
                sanitize=False,
            )

    def _build_side(self) -> None:
        with ui.element("section").classes("side").props("aria-label='Figures'"):
            self._vehicles = VehiclesCard(
                self._clicks, lambda: self._view.mission, self._inbox.command
            )
            self._live_search = LiveCard(
                self._clicks, lambda: self._view.mission, self._inbox.command
            )
            with ui.element("div").classes("card"):
                with ui.element("h2"):
                    self._chart_title = ui.label("Probability of success")
                self._chart = ui.echart(_chart_options(), renderer="svg").classes("pos-chart")
                self._chart.props("role=img aria-label='Probability of success over the steps'")
                self._no_pos = ui.label().classes("note")
            with ui.element("div").classes("card table-card"):
                ui.html("Drones", tag="h2", sanitize=False)
                with ui.element("div").classes("choices"):
                    self._filter_text = ui.input("Name or state").props("dense outlined clearable")
                    self._order = ui.select(list(ORDERS), label="Sorted by", value=ORDERS[0])
                    for choice in (self._filter_text, self._order.props("dense outlined")):
                        choice.on_value_change(self._on_table)
                self._drones = ui.html("", sanitize=False).classes("drones")
                self._drones.props("tabindex=0 role=region aria-label='Table of the drones'")
                self._fold = self._button("", "unfold_more", self._on_fold)

    def _build_dialog(self) -> None:
        with ui.dialog().props("aria-label='Reset'") as self._dialog, ui.card():
            ui.label("Start a new mission? The one under way ends, also for its vehicles.")
            self._seed = ui.number("Seed", min=0, max=2**53, precision=0)
            self._seed.props("dense outlined hint='empty: as the simulation is set'")
            with ui.row():
                self._button("Cancel", "close", self._dialog.close).props("autofocus")
                self._clicks.button("Reset the mission", "replay", self._on_reset_confirmed)

    # Controls

    def choose(self, mission: str | None, theme: str) -> None:
        """Show the mission of a namespace, None for the first one, in a theme of `_THEMES`."""
        if mission is not None:
            self._view.choose(mission)
        self._set_theme(next((dark for dark, name in _THEMES.items() if name == theme), None))

    def _set_theme(self, dark: bool | None) -> None:
        self._dark.value = dark
        self._theme.set_text(f"Theme: {_THEMES[dark]}")

    def _keep_in_address(self) -> None:
        """Put mission and theme into the address, so that a reload keeps them."""
        kept = {"mission": self._view.namespace, "theme": _THEMES[self._dark.value]}
        query = urlencode({name: value for name, value in kept.items() if value is not None})
        ui.run_javascript(f"history.replaceState(null, '', {json.dumps('?' + query)})")

    def _view_again(self) -> None:
        self._view.forget_sent()
        self._sent = (0, 0.0)

    def _on_drawn(self, event: Any) -> None:
        self._drawn = int(event.args["number"])

    def _on_point(self, event: Any) -> None:
        cell = event.args["cell"]
        text = "" if cell is None else self._view.place((int(cell[0]), int(cell[1])))
        self._place.set_text(text)

    def _on_pick(self, event: Any) -> None:
        mission = self._view.mission
        if mission is not None and mission.info is not None:
            east, south = float(event.args["east"]), float(event.args["south"])
            self._live_search.pick(*place_at(mission.info.frame, east, south))

    def _on_window(self, event: Any) -> None:
        west, north, zoom = (float(event.args[name]) for name in Window._fields)
        self._view.window = Window(west, north, max(zoom, 1.0))

    # What `_update_choices` shows is no choice of the user.

    def _on_mission(self) -> None:
        mission = self._view.mission
        if self._mission.value not in (None, mission and mission.namespace):
            self._view.choose(self._mission.value)
            self._map.run_method("zoomBy", 0)
            self._keep_in_address()
            self._slow_s = 0.0

    def _on_layer(self) -> None:
        if self._layer.value not in (None, self._view.shown_layer):
            self._view.layer = self._layer.value

    def _on_table(self) -> None:
        self._view.filter_text, self._view.order = self._filter_text.value or "", self._order.value
        self._slow_s = 0.0

    def _on_fold(self) -> None:
        self._view.folded = not self._view.folded
        self._slow_s = 0.0

    def _on_seek(self, event: Any) -> None:
        history = self._view.history
        step = int(event.args)
        if history is not None:
            self._view.seek(None if step >= history.steps[-1] else step)
        # The browser has already moved the slider there.
        self._time.props["value"] = step
        self._slow_s = 0.0

    def _on_live(self) -> None:
        self._view.seek(None)
        self._slow_s = 0.0

    def _on_play(self) -> None:
        if self._view.playing:
            self._view.seek(self._view.step)
        else:
            self._view.play()
        self._slow_s = 0.0

    def _on_rate(self) -> None:
        self._view.rate = self._rate.value

    def _on_pause(self, clicked_s: float) -> None:
        mission = self._view.mission
        if mission is not None:
            name = "resume" if mission.paused else "pause"
            self._inbox.command(Command(mission.namespace, name, clicked_s))

    def _on_step(self, clicked_s: float) -> None:
        mission = self._view.mission
        if mission is not None:
            self._inbox.command(Command(mission.namespace, "step", clicked_s))

    def _on_reset(self) -> None:
        mission, history = self._view.mission, self._view.history
        if mission is None:
            return
        seed = mission.info.seed if history is not None and mission.info is not None else None
        self._seed.set_value(None if seed is None else seed + 1)
        # The mission in the question is reset, even if another one is chosen meanwhile.
        self._to_reset = mission.namespace
        self._dialog.open()

    def _on_reset_confirmed(self, clicked_s: float) -> None:
        self._dialog.close()
        namespace, self._to_reset = self._to_reset, None
        if namespace is not None:
            self._view.seek(None)
            seed = None if self._seed.value is None else int(self._seed.value)
            self._inbox.command(Command(namespace, "reset", clicked_s, seed=seed))

    def _on_theme(self) -> None:
        order = list(_THEMES)
        self._set_theme(order[(order.index(self._dark.value) + 1) % len(order)])
        self._keep_in_address()

    # Updates; NiceGUI sends a text, an icon or a table only if it differs.

    def _update(self) -> None:
        now_s = time.monotonic()
        self._view.advance(now_s - self._updated_s)
        self._updated_s = now_s
        self._view.sketch = self._live_search.sketch
        number, sent_s = self._sent
        # The next frame has all changes since the last: a slow browser skips frames.
        if number <= self._drawn or now_s - sent_s > _LOST_S:
            frame = self._view.frame()
            if frame is not None:
                self._sent = (frame["number"], now_s)
                self._map.draw(frame)
                self._headline.set_text(self._view.headline())
                self._scale.set_text(self._view.scale())
                self._update_time()
        if now_s - self._slow_s >= _SLOW_S:
            self._slow_s = now_s
            self._clicks.send_time(now_s)
            self._update_slowly()

    def _update_time(self) -> None:
        history = self._view.history
        if history is None:
            return
        first, last = history.steps[0], history.steps[-1]
        shown = last if self._view.step is None else self._view.step
        now: dict[str, Any] = {"min": first, "max": max(last, first + 1), "value": shown}
        now["aria-valuetext"] = f"step {shown} of {last}"
        if any(self._time.props.get(name) != value for name, value in now.items()):
            self._time.props.update(now)
            self._time.update()

    def _update_slowly(self) -> None:
        view, mission = self._view, self._view.mission
        waiting = view.waiting()
        if waiting and not self._missions.by_namespace:
            waiting += f" ROS_DOMAIN_ID is {self._domain}."
        self._waiting.set_text(waiting)
        self._waiting.set_visibility(bool(waiting))
        self._headline.set_text(view.headline())
        self._sea_key.set_visibility(bool(view.sea.sightings))
        self._update_choices()
        self._drones.set_content(view.drones_table())
        self._update_fold()
        line = (view.pos_line(), view.step)
        if line != self._line:
            self._line = line
            self._show_line(*line)
        has = mission is not None and mission.publishers > 0
        done = mission is not None and mission.done
        self._reset.set_enabled(has)
        self._step.set_enabled(has and not done)
        # A pause after the end would hold the next mission.
        paused = mission is not None and mission.paused
        self._pause.set_enabled(has and (not done or paused))
        self._live.set_enabled(view.step is not None)
        self._play.set_enabled(view.history is not None and len(view.history) > 1)
        self._play.set_text("Stop" if view.playing else "Play")
        self._play.set_icon("stop" if view.playing else "play_arrow")
        self._vehicles.update()
        self._live_search.update()
        self._trouble.set_text(view.trouble())
        self._state.set_text(view.state())
        title, about = view.about()
        self._title.set_text(title)
        self._about.set_text(about)
        self._no_pos.set_text(view.no_pos())
        self._chart_title.set_text("Coverage rate" if view.covers else "Probability of success")
        if mission is not None:
            text, icon = ("Resume", "play_arrow") if mission.paused else ("Pause", "pause")
            self._pause.set_text(text)
            self._pause.set_icon(icon)
            self._answer.set_text(mission.answer)

    def _update_fold(self) -> None:
        folded, hidden = self._view.folded, self._view.hidden
        self._fold.set_visibility(bool(hidden) or not folded)
        self._fold.set_text(f"Show {hidden} more" if folded else "Show fewer")
        self._fold.set_icon("unfold_more" if folded else "unfold_less")

    def _update_choices(self) -> None:
        view, mission = self._view, self._view.mission
        missions = {name: mission.title for name, mission in self._missions.by_namespace.items()}
        layers = layers_of(mission)
        for select, options, value in (
            (self._mission, missions, mission.namespace if mission is not None else None),
            (self._layer, layers, view.shown_layer if view.shown_layer in layers else None),
        ):
            if select.options != options or select.value != value:
                select.set_options(options, value=value)

    def _show_line(self, points: list[tuple[int, float]], step: int | None) -> None:
        options = self._chart.options
        series = options["series"][0]
        name = "coverage rate (%)" if self._view.covers else "POS (%)"
        series["name"] = options["yAxis"]["name"] = name
        series["data"] = [list(point) for point in points]
        series["markLine"]["data"] = [] if step is None else [{"xAxis": step}]
        self._chart.update()


def _chart_options() -> dict[str, Any]:
    axis = {
        "type": "value",
        "nameLocation": "middle",
        "splitLine": {"lineStyle": {"color": "#80808040"}},
    }
    return {
        "animation": False,
        "grid": {"left": 52, "right": 16, "top": 12, "bottom": 44},
        "tooltip": {"trigger": "axis", "confine": True},
        "xAxis": {**axis, "name": "step", "nameGap": 26, "minInterval": 1},
        "yAxis": {**axis, "name": "POS (%)", "nameGap": 36, "min": 0, "max": 100, "interval": 25},
        "series": [
            {
                "type": "line", "name": "POS (%)", "showSymbol": False, "step": "end",
                "color": _BLUE, "lineStyle": {"width": 2.5}, "areaStyle": {"opacity": 0.15},
                "data": [],
                "markLine": {"symbol": "none", "silent": True, "label": {"show": False},
                             "lineStyle": {"color": "#D55E00"}, "data": []},
            }
        ],
    }  # fmt: skip
