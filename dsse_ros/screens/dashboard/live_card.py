# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The part of the page for the one who keeps a live search: contacts, and inputs by hand."""

from __future__ import annotations

import json
import math
import secrets
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from nicegui import ui

from dsse_ros.screens.dashboard import live_forms
from dsse_ros.screens.dashboard.clicks import BUTTON, Clicks
from dsse_ros.screens.dashboard.confirmation import Confirmation
from dsse_ros.screens.dashboard.live_marks import NO_SKETCH, Sketch, contact_at, ranked
from dsse_ros.screens.dashboard.missions import ShownMission
from dsse_ros.screens.dashboard.service_calls import Command

_TEMPLATES = Environment(
    loader=PackageLoader("dsse_ros.screens.dashboard", "."),
    autoescape=True,
    undefined=StrictUndefined,
)
_CONTACTS, _INPUTS = map(_TEMPLATES.get_template, ("contacts.html", "inputs.html"))
MAX_ROWS = 50
"""Rows of a table: the most probable contacts, the last inputs."""
_TABS = ("Contacts", "Sighting", "Searched", "Weather", "Inputs")
_MAKE = {
    "sighting": live_forms.sighting,
    "searched": live_forms.searched,
    "weather": live_forms.weather,
}
"""Kinds of inputs that have a form, and what makes them of its fields."""
_FINAL = ("confirm", "withdraw")
"""Kinds of inputs that cannot be withdrawn."""
_SEEN_S = 0.5
"""Wall time that a change needs to be seen."""
_ROW = """(event) => {
  const row = event.target.closest("tr[data-contact]");
  if (row) emit(row.dataset.contact);
}"""
_TIME = "2026-01-17T13:50Z; empty: now"


class _Choice:
    """A list whose buttons are about the chosen option.

    Args:
        label: Its label.
        changed: Called when another option is chosen.
    """

    def __init__(self, label: str, changed: Callable[[], None]) -> None:
        self._select = ui.select([], label=label).props("dense outlined")
        self._select.on_value_change(changed)
        self._changed_s = -math.inf

    @property
    def value(self) -> str | None:
        """The chosen option."""
        chosen: str | None = self._select.value
        return chosen

    def offer(self, options: dict[str, str]) -> None:
        """Offer options by label; keep the chosen one if it is among them, else choose the first.

        Args:
            options: Labels by option.
        """
        chosen = self.value if self.value in options else next(iter(options), None)
        if self._select.options != options or self.value != chosen:
            if self.value not in (None, chosen):
                self._changed_s = time.monotonic()
            self._select.set_options(options, value=chosen)
        self._select.set_enabled(bool(options))

    def choose(self, option: str) -> None:
        """Choose an option, if it is offered: somebody has clicked what it stands for."""
        if option in self._select.options:
            self._select.set_value(option)
            # It needs no time to be seen.
            self._changed_s = -math.inf

    def is_meant(self, clicked_s: float) -> bool:
        """Return whether somebody who clicked at this time can have seen the chosen option."""
        return self.value is not None and clicked_s > self._changed_s + _SEEN_S


class LiveCard:
    """Contacts with their buttons, a form for each kind of input, and what each has changed.

    Args:
        clicks: Makes the buttons.
        mission: Returns the shown mission, None without one.
        send: Sends a command.
    """

    def __init__(
        self, clicks: Clicks, mission: Callable[[], ShownMission | None],
        send: Callable[[Command], None],
    ) -> None:  # fmt: skip
        self._clicks, self._mission, self._send = clicks, mission, send
        self._fields: dict[str, dict[str, Any]] = {kind: {} for kind in _MAKE}
        # Two clicks on a form are one input; the next input gets another identity.
        self._ids = {kind: _new_id() for kind in _MAKE}
        self._answered = ""
        with ui.element("div").classes("card live") as self._card:
            ui.html("Live search", tag="h2", sanitize=False)
            with ui.tabs().props("dense no-caps align=left") as self._tabs:
                for name in _TABS:
                    ui.tab(name)
            panels = ui.tab_panels(self._tabs, value=_TABS[0], animated=False, keep_alive=True)
            builds = (
                self._build_contacts, self._build_sighting, self._build_searched,
                self._build_weather, self._build_inputs,
            )  # fmt: skip
            with panels:
                for name, build in zip(_TABS, builds, strict=True):
                    with ui.tab_panel(name):
                        build()
            self._answer = ui.label().classes("note answer").props("role=status")
        self._card.set_visibility(False)
        self._confirmation = Confirmation(clicks, "Contact", send)

    # Layout

    def _build_contacts(self) -> None:
        with ui.element("div").classes("buttons").props("role=group aria-label='Contacts'"):
            # A button must never show another contact than the one it is about.
            self._contact = _Choice("Contact", self.update)
            self._close = {
                name: self._clicks.button(text, icon, partial(self._on_close, name))
                for name, text, icon in (
                    ("confirm", "Confirm", "check_circle"), ("dismiss", "Dismiss", "cancel"),
                )
            }  # fmt: skip
        self._contacts = self._table("Contacts")
        # A click on a row chooses its contact.
        self._contacts.on(
            "click", lambda event: self._contact.choose(str(event.args)), js_handler=_ROW
        )

    def _build_sighting(self) -> None:
        self._text("sighting", "place", "Latitude, longitude", "or click on the map")
        with ui.element("div").classes("fields"):
            self._text("sighting", "time", "Time (UTC)", _TIME)
            self._number("sighting", "radius", "Radius (m)", 1e5)
            self._number("sighting", "time_error", "Time error (min)", 1e4)
            self._number("sighting", "weight", "Weight", 1e6)
        self._button_of("sighting", "Add the sighting", "person_pin_circle")

    def _build_searched(self) -> None:
        shape = ui.radio({"area": "Area", "track": "Track"}, value="area").props("inline dense")
        shape.props("aria-label='Shape'")
        self._fields["searched"]["shape"] = shape
        places = ui.textarea("Places: latitude, longitude").props("dense outlined rows=4")
        places.props("hint='one on each line, or click on the map'")
        self._fields["searched"]["places"] = places
        with ui.element("div").classes("fields"):
            self._number("searched", "pod", "POD (%)", 100)
            self._number("searched", "sweep_width", "Sweep width (m)", 1e5)
            self._text("searched", "time", "From (UTC)", _TIME)
            self._text("searched", "end", "To (UTC)", _TIME)
            self._text("searched", "by", "By", "who has searched")
        self._button_of("searched", "Add what was searched", "grid_on")

    def _build_weather(self) -> None:
        with ui.element("div").classes("fields"):
            self._number("weather", "wind_speed", "Wind (m/s)", 100)
            self._number("weather", "wind_from", "Wind from (°)", 360)
            self._number("weather", "current_speed", "Current (m/s)", 10)
            self._number("weather", "current_toward", "Current toward (°)", 360)
            self._text("weather", "time", "Since (UTC)", _TIME)
        self._button_of("weather", "Set wind and current", "air")

    def _build_inputs(self) -> None:
        with ui.element("div").classes("buttons").props("role=group aria-label='Inputs'"):
            self._input = _Choice("Input", self.update)
            self._withdraw = self._clicks.button("Withdraw", "undo", self._on_withdraw)
        self._inputs = self._table("Inputs")

    def _table(self, name: str) -> ui.html:
        table = ui.html("", sanitize=False).classes("drones")
        return table.props(f"tabindex=0 role=region aria-label='Table of the {name.lower()}'")

    def _text(self, kind: str, name: str, label: str, hint: str) -> None:
        field = ui.input(label).props("dense outlined").props(f"hint={json.dumps(hint)}")
        self._fields[kind][name] = field

    def _number(self, kind: str, name: str, label: str, most: float) -> None:
        self._fields[kind][name] = ui.number(label, min=0, max=most).props("dense outlined")

    def _button_of(self, kind: str, text: str, icon: str) -> None:
        with ui.element("div").classes("buttons"):
            self._clicks.button(text, icon, partial(self._on_form, kind))
            clear = ui.button(
                "Clear", icon="backspace", color=None, on_click=lambda: self._empty(kind)
            )
            clear.props(BUTTON)

    # The map

    def pick(self, lat_deg: float, lon_deg: float) -> None:
        """Take a click on the map into the form that is open, or choose the contact there."""
        line = live_forms.place_line(lat_deg, lon_deg)
        mission = self._mission()
        if self._tabs.value == "Contacts" and mission is not None and mission.info is not None:
            name = contact_at(mission.info.frame, mission.contacts, lat_deg, lon_deg)
            if name is not None:
                self._contact.choose(name)
        elif self._tabs.value == "Sighting":
            self._fields["sighting"]["place"].set_value(line)
        elif self._tabs.value == "Searched":
            places = self._fields["searched"]["places"]
            places.set_value("\n".join(filter(None, [(places.value or "").strip(), line])))

    @property
    def sketch(self) -> Sketch:
        """What the open form has of the map."""
        mission = self._mission()
        kind = self._tabs.value.lower() if self._tabs.value else ""
        if mission is None or not mission.is_live or kind not in ("sighting", "searched"):
            return NO_SKETCH
        fields = self._fields[kind]
        try:
            places = live_forms.places_of((fields.get("places") or fields["place"]).value or "")
        except ValueError:
            # It is being written.
            return NO_SKETCH
        return Sketch(tuple(places), closed=kind == "searched" and fields["shape"].value == "area")

    # Clicks

    def _on_form(self, kind: str, clicked_s: float) -> None:
        values = {name: field.value for name, field in self._fields[kind].items()}
        try:
            content = _MAKE[kind](values)
            if kind == "sighting" and (mission := self._mission()) is not None and mission.utc:
                # A sighting must have a time, other inputs are of the present without one.
                content = {"time": mission.utc} | content
        except ValueError as error:
            self._refuse(f"{kind}: {error}")
            return
        self._put(kind, content, clicked_s, self._ids[kind])

    def _on_close(self, kind: str, clicked_s: float) -> None:
        mission, contact = self._mission(), self._contact.value
        if mission is None or not self._contact.is_meant(clicked_s):
            self._refuse(f"{kind}: not sent, because another contact is shown; click again")
            return
        command = self._command(mission, kind, {"contact": contact}, clicked_s)
        if kind == "dismiss":
            self._send(command)
            return
        self._confirmation.ask(
            command,
            f"Is {contact} the person? This ends the search for him or her.",
            f"Confirm that {contact} is the person",
        )

    def _on_withdraw(self, clicked_s: float) -> None:
        if self._input.is_meant(clicked_s):
            self._put("withdraw", {"input": self._input.value}, clicked_s)
        else:
            self._refuse("withdraw: not sent, because another input is shown; click again")

    def _put(
        self, kind: str, content: Mapping[str, Any], clicked_s: float, id_: str | None = None
    ) -> None:
        mission = self._mission()
        if mission is not None:
            self._send(self._command(mission, kind, content, clicked_s, id_))

    @staticmethod
    def _command(
        mission: ShownMission, kind: str, content: Mapping[str, Any], clicked_s: float,
        id_: str | None = None,
    ) -> Command:  # fmt: skip
        text = json.dumps({"id": id_ or _new_id(), **content})
        return Command(mission.namespace, kind, clicked_s, input=text)

    def _refuse(self, text: str) -> None:
        """Show a text until the next answer of the simulation."""
        mission = self._mission()
        self._answered = "" if mission is None else mission.live_answer
        self._answer.set_text(text)

    def _empty(self, kind: str) -> None:
        """Empty a form, for another input."""
        self._ids[kind] = _new_id()
        for name, field in self._fields[kind].items():
            if name != "shape":
                field.set_value(None if isinstance(field, ui.number) else "")

    # Updates

    def update(self) -> None:
        """Show the contacts and inputs of the shown mission, and its last answer."""
        mission = self._mission()
        is_live = mission is not None and mission.is_live
        self._card.set_visibility(is_live)
        if mission is None or not is_live:
            return
        contacts = ranked(mission.contacts)
        open_ = [contact.name for contact in contacts if contact.state == "open"]
        self._contact.offer({name: name for name in open_})
        for name, button in self._close.items():
            text = name.capitalize()
            button.set_text(f"{text} {self._contact.value}" if open_ else text)
            button.set_enabled(bool(open_))
        self._contacts.set_content(
            _CONTACTS.render(contacts=contacts[:MAX_ROWS], chosen=self._contact.value)
        )
        answers = list(mission.inputs.values())
        withdrawn = {answer.input for answer in answers if answer.ok and answer.input}
        for kind, id_ in self._ids.items():
            if id_ in mission.inputs and mission.inputs[id_].ok:
                self._empty(kind)
        kept = {
            answer.id: f"{answer.kind} {answer.id}"
            for answer in reversed(answers)
            if answer.ok and answer.id not in withdrawn and answer.kind not in _FINAL
        }
        self._input.offer(kept)
        self._withdraw.set_enabled(bool(kept))
        self._inputs.set_content(
            _INPUTS.render(
                inputs=answers[: -MAX_ROWS - 1 : -1],
                withdrawn=withdrawn,
                change_of=live_forms.change_of,
            )
        )
        if mission.live_answer != self._answered:
            self._answered = mission.live_answer
            self._answer.set_text(self._answered)


def _new_id() -> str:
    return f"page-{secrets.token_hex(6)}"
