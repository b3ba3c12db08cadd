# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Buttons for commands, whose clicks have an age."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from nicegui import ui
from nicegui.element import Element

from dsse_ros.screens.dashboard.service_calls import clicked_at

BUTTON = "no-caps unelevated outline"
"""Look of the buttons."""


class CommandButton(ui.button):
    """A button for a command."""

    @property
    def is_ignoring_events(self) -> bool:
        """False: a click made before the button was disabled is answered too."""
        return False


class Clicks(Element, component="clicks.js"):
    """Sends the clicks on commands with their times; see clicks.js."""

    def send_time(self, now_s: float) -> None:
        """Send the browser the time, on the steady clock of this process."""
        self.run_method("sendTime", now_s)

    def button(self, text: str, icon: str, on_click: Callable[[float], None]) -> ui.button:
        """Return a button whose callback gets the time of the click, see `clicked_at`."""

        def clicked(event: Any) -> None:
            self.run_method("confirm", event.args["number"])
            on_click(clicked_at(event.args["at"], time.monotonic()))

        return CommandButton(text, icon=icon, color=None).props(BUTTON).on(
            "click", clicked, js_handler="(event) => window.sendClick(emit, event)"
        )  # fmt: skip
