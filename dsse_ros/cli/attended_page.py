# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The live page of a mission that somebody at a terminal opens and closes."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dsse_ros.dashboard.settings import OPENED
from dsse_ros.runtime.interrupts import Stop


@dataclass
class LivePage:
    """The page of a mission.

    Attributes:
        stop: Whether a signal has come.
        child: The process; None without a page.
        log: Its log.
        check: Raises if the process has ended.
    """

    stop: Stop
    child: subprocess.Popen[bytes] | None = None
    log: Path = Path()
    check: Callable[[], None] = lambda: None

    @property
    def attended(self) -> bool:
        """Whether the page belongs to somebody at a terminal."""
        return self.child is not None and sys.stdin.isatty()

    def wait_for_browser(self) -> None:
        """Wait until a browser has opened the page, if somebody is there to open it.

        Raises:
            MissionFailed: If the page ends.
            KeyboardInterrupt: If a signal has come.
        """
        if not self.attended or self.child is None:
            return
        print("The mission starts once a browser has opened the page.", flush=True)
        while OPENED not in self.log.read_text(errors="replace"):
            if self.stop.wanted:
                raise KeyboardInterrupt
            self.check()
            time.sleep(0.05)

    def stay(self) -> None:
        """Keep everything running until Ctrl-C, if somebody watches."""
        if not self.attended or self.child is None:
            return
        print("Page and simulation stay until Ctrl-C; Reset starts another mission.", flush=True)
        while not self.stop.wanted and self.child.poll() is None:
            time.sleep(0.05)
