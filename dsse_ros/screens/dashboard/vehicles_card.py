# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The buttons of the page for vehicles."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from nicegui import ui

from dsse_ros.screens.dashboard.clicks import Clicks
from dsse_ros.screens.dashboard.confirmation import Confirmation
from dsse_ros.screens.dashboard.missions import ShownMission
from dsse_ros.screens.dashboard.service_calls import Command

_OPERATIONS = {
    "arm": ("Arm", "flight_takeoff"),
    "ground": ("Ground", "block"),
    "hold": ("Hold", "pause_circle"),
    "return": ("Return", "home"),
    "land": ("Land", "flight_land"),
}
"""Commands for vehicles: the labels and icons of their buttons."""
_TO_CONFIRM = {
    "arm": "Clear {} to fly? Motors may start and vehicles take off at once: nobody may be near.",
    "land": "Land {} directly below, even on water?",
}
"""Commands that cannot be undone, and the questions to confirm them."""


class VehiclesCard:
    """The buttons, the questions that some of them ask, and the answers.

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
        self._build()
        self._confirmation = Confirmation(clicks, "Vehicles", send)

    def _build(self) -> None:
        self._operate: dict[tuple[str, bool], ui.button] = {}
        with ui.element("div").classes("card vehicles") as self._card:
            ui.html("Vehicles", tag="h2", sanitize=False)
            for single in (False, True):
                whom = "One vehicle" if single else "All vehicles"
                with ui.element("div").classes("buttons").props(f"role=group aria-label='{whom}'"):
                    if single:
                        self._drone = ui.select([], label="Vehicle").props("dense outlined")
                        # A button must never show another vehicle than the one it commands.
                        self._drone.on_value_change(self.update)
                    for name, (text, icon) in _OPERATIONS.items():
                        button = self._clicks.button(
                            text if single else f"{text} all", icon,
                            partial(self._on_operate, name, single),
                        )  # fmt: skip
                        self._operate[name, single] = button
            self._bridge_gone = ui.label("The bridge is gone.").classes("trouble")
            self._answer = ui.label().classes("note").props("role=status")
        self._card.set_visibility(False)

    def _on_operate(self, name: str, single: bool, clicked_s: float) -> None:
        mission = self._mission()
        if mission is None or (single and self._drone.value is None):
            return
        vehicle = self._drone.value if single else ""
        command = Command(mission.namespace, name, clicked_s, vehicle)
        if name not in _TO_CONFIRM:
            self._send(command)
            return
        whom = command.vehicle or "all vehicles"
        where = f" in {mission.namespace}" if mission.namespace else ""
        question = _TO_CONFIRM[name].format(f"{whom}{where}")
        self._confirmation.ask(command, question, f"{_OPERATIONS[name][0]} {whom}")

    def update(self) -> None:
        """Show the bridge of the shown mission, and its last answer."""
        mission = self._mission()
        if mission is None or not mission.had_bridge:
            self._card.set_visibility(False)
            return
        self._card.set_visibility(True)
        drones, chosen = list(mission.bridge), self._drone.value
        self._bridge_gone.set_visibility(not drones)
        # The vehicles of a bridge that is gone stay visible.
        if drones and (self._drone.options != drones or chosen not in drones):
            self._drone.set_options(drones, value=chosen if chosen in drones else drones[0])
        self._drone.set_enabled(bool(drones))
        for (name, single), button in self._operate.items():
            button.set_enabled(bool(drones))
            if single and self._drone.value is not None:
                button.set_text(f"{_OPERATIONS[name][0]} {self._drone.value}")
        self._answer.set_text(mission.vehicle_answer)
