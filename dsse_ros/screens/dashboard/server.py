# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Serves the page in its own thread, so that a slow browser delays no messages."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
import threading
from collections.abc import AsyncIterator

import nicegui
import uvicorn
from fastapi import FastAPI
from nicegui import ui

from dsse_ros.base.fields import FieldError
from dsse_ros.screens.dashboard.guard import Guard
from dsse_ros.screens.dashboard.inbox import Inbox
from dsse_ros.screens.dashboard.missions import ShownMissions
from dsse_ros.screens.dashboard.page import MissionPage
from dsse_ros.screens.dashboard.settings import DashboardSettings

_OF_PORT = (errno.EADDRINUSE, errno.EACCES)
_STOP_S = 0.5
"""Wall time for connections to end."""
_KEPT_MESSAGES = 20
"""Wall time for a page to reconnect; a reconnected page gets everything again."""


class PageServer:
    """Serves the page.

    Args:
        inbox: Messages for the page, and commands from it.
        settings: See `DashboardSettings`.
        domain: ROS domain, which the page shows while it waits for a mission.

    Attributes:
        missions: State of the missions; only the server's thread may use it.
        url: Address of the page, with the token unless a file has it.

    Raises:
        FieldError: If a setting is not allowed, or the address cannot be bound.
    """

    def __init__(self, inbox: Inbox, settings: DashboardSettings, domain: int) -> None:
        self._inbox = inbox
        self._settings = settings
        self.missions = ShownMissions()
        token = settings.read_token()
        self._socket = bind(settings.host, settings.port)
        host, port = self._socket.getsockname()[:2]
        wildcard = host in ("0.0.0.0", "::")
        named = socket.gethostname() if wildcard else f"[{host}]" if ":" in host else host
        self.url = f"http://{named}:{port}/" + ("" if settings.token_file else f"?token={token}")
        app = FastAPI(lifespan=self._lifespan, docs_url=None, redoc_url=None, openapi_url=None)

        @ui.page("/", title="dsse_ros", language="en-US")
        def page(mission: str | None = None, theme: str = "") -> None:
            shown = MissionPage(self.missions, inbox, settings.frame_rate, domain)
            shown.choose(mission, theme)

        # A bar that shows how requests load has no name for screen readers, and no use here.
        nicegui.app.config.quasar_config["loadingBar"]["skipHijack"] = True
        ui.run_with(
            app, dark=None, tailwind=False, show_welcome_message=False,
            binding_refresh_interval=None, gzip_middleware_factory=None,
            message_history_length=_KEPT_MESSAGES,
        )  # fmt: skip
        names = (settings.host, socket.gethostname(), *settings.allowed_hosts)
        guarded = Guard(app, token=token, names=names, any_address=wildcard)
        config = uvicorn.Config(
            guarded, log_config=None, access_log=False,
            server_header=False, lifespan="on",
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._serve, name="page", daemon=True)

    def start(self) -> None:
        """Start serving."""
        self._thread.start()

    def stop(self) -> None:
        """Close all connections; those that do not end soon end with the process."""
        self._server.should_exit = True
        if self._thread.ident is not None:
            self._thread.join(_STOP_S)
        self._socket.close()

    def _serve(self) -> None:
        self._server.run(sockets=[self._socket])

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: FastAPI) -> AsyncIterator[None]:
        taking = asyncio.create_task(self._take())
        yield
        taking.cancel()

    async def _take(self) -> None:
        """Read the new messages at the frame rate, even if no page is open."""
        while True:
            self.missions.take(self._inbox.take())
            await asyncio.sleep(1.0 / self._settings.frame_rate)


def bind(host: str, port: int) -> socket.socket:
    """Return a socket that listens at an address.

    Raises:
        FieldError: If the address cannot be bound.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (OSError, UnicodeError):
        raise FieldError(f"host must be an address of this machine, got {host!r}") from None
    bound = socket.socket(family, kind, protocol)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(address)
        bound.listen()
    except OSError as error:
        bound.close()
        name, value = ("port", port) if error.errno in _OF_PORT else ("host", repr(host))
        raise FieldError(f"{name}: {value} cannot be bound: {error.strerror}") from None
    return bound
