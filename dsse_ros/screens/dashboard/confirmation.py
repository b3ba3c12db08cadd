# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The question before a command that cannot be undone."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from dsse_ros.screens.dashboard.clicks import BUTTON, Clicks
from dsse_ros.screens.dashboard.service_calls import Command


class Confirmation:
    """A dialog that asks, and sends the command in its question with the time of the answer.

    What is chosen on the page may change meanwhile. Awaiting the dialog would not do: after two
    quick clicks it answers the first one.

    Args:
        clicks: Makes the button.
        label: What a screen reader calls the dialog.
        send: Sends a command.
    """

    def __init__(self, clicks: Clicks, label: str, send: Callable[[Command], None]) -> None:
        self._send = send
        self._command: Command | None = None
        with ui.dialog().props(f"aria-label='{label}'") as self._dialog, ui.card():
            self._question = ui.label()
            with ui.row():
                cancel = ui.button("Cancel", icon="close", on_click=self._dialog.close, color=None)
                cancel.props(BUTTON).props("autofocus")
                self._yes = clicks.button("", "check", self._on_yes)

    def ask(self, command: Command, question: str, answer: str) -> None:
        """Ask whether to send a command.

        Args:
            command: The command.
            question: The question.
            answer: Text of the button that sends it.
        """
        self._command = command
        self._question.set_text(question)
        self._yes.set_text(answer)
        self._dialog.open()

    def _on_yes(self, clicked_s: float) -> None:
        self._dialog.close()
        command, self._command = self._command, None
        if command is not None:
            self._send(command._replace(clicked_s=clicked_s))
