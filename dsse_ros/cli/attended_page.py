# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The live page of a mission that somebody at a terminal opens and closes."""

from __future__ import annotations

import html
import socket
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dsse_ros.dashboard.settings import OPENED, DashboardSettings
from dsse_ros.private_files import open_private
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


def open_browser(address: str, file: Path) -> None:
    """Open a page by a private file that leads to it.

    Everybody on the machine can see the arguments of a process, such as an address with a token.
    """
    with open_private(file) as page:
        meta = f'<meta http-equiv="refresh" content="0;url={html.escape(address)}">'
        page.write(f"<!doctype html>{meta}".encode())
    webbrowser.open(file.resolve().as_uri())


def default_port_free() -> bool:
    """Return whether the default port of the page is free."""
    try:
        socket.create_server(("127.0.0.1", DashboardSettings().port)).close()
    except OSError:
        return False
    return True
