# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is wrong, logged once however long it lasts, and however often it comes and goes."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Literal

Level = Literal["debug", "info", "warning", "error"]
Log = Callable[[Level, str], None]

QUIET_S = 30.0
"""Time for which a text must have been gone before it is logged again."""
_NUMBER = re.compile(r"-?\d+(\.\d+)?(?= (m|m/s|degrees|s)\b)")
"""Measured numbers: one that jitters makes no other text."""


class Notices:
    """Logs texts that are true for a while.

    Args:
        log: Takes log lines.
    """

    def __init__(self, log: Log) -> None:
        self._log = log
        # When each text was shown last.
        self._shown_s: dict[str, float] = {}

    def show(self, level: Level, text: str, now_s: float) -> None:
        """Take a text as long as it is true, the name of a vehicle included; log it if it is new.

        Args:
            level: Level of the log line.
            text: The text.
            now_s: Time on a steady clock.
        """
        self._shown_s = {
            shown: time_s for shown, time_s in self._shown_s.items() if now_s - time_s < QUIET_S
        }
        about = _NUMBER.sub("", text)
        if about not in self._shown_s:
            self._log(level, text)
        self._shown_s[about] = now_s
