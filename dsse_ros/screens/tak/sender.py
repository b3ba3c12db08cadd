# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sends events in a thread of its own, so that a slow receiver delays nobody."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pytak

from dsse_ros.screens.tak.settings import reason_of_pytak

_PATIENCE_S = 5.0
"""Time to connect, or to send an event."""


class CotSender:
    """Sends the latest events, as often as there are new ones; older unsent ones are dropped.

    A lost connection is opened again for the next events.

    Args:
        config: Settings as pytak names them.
        report: Called from the thread with a line when the receiver is lost or there again.
    """

    def __init__(self, config: Mapping[str, str], report: Callable[[str], None]) -> None:
        self._config, self._report = dict(config), report
        self._events: Sequence[bytes] = ()
        self._loop = asyncio.new_event_loop()
        self._new = asyncio.Event()
        self._writer: Any = None
        self._reading: asyncio.Task[None] | None = None
        self._trouble = ""
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="cot", daemon=True)
        self._thread.start()

    def send(self, events: Sequence[bytes]) -> None:
        """Have these events sent in place of those that have not been sent yet."""
        self._loop.call_soon_threadsafe(self._put, events)

    def close(self) -> None:
        """End the thread and its connection."""
        self._closing = True
        self._loop.call_soon_threadsafe(self._new.set)
        self._thread.join(2 * _PATIENCE_S)

    def _put(self, events: Sequence[bytes]) -> None:
        self._events = events
        self._new.set()

    def _run(self) -> None:
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self) -> None:
        while True:
            await self._new.wait()
            self._new.clear()
            if self._closing:
                break
            events, self._events = self._events, ()
            try:
                await self._send(events)
            except (OSError, ValueError, SyntaxError, asyncio.TimeoutError) as error:
                self._close_writer()
                self._say(reason_of_pytak(error))
            else:
                self._say("")
        self._close_writer()

    async def _send(self, events: Sequence[bytes]) -> None:
        if self._writer is None:
            opening = pytak.protocol_factory(self._config)
            reader, self._writer = await asyncio.wait_for(opening, _PATIENCE_S)
            if isinstance(reader, asyncio.StreamReader):
                self._reading = self._loop.create_task(self._discard(reader))
        worker = pytak.TXWorker(asyncio.Queue(), self._config, self._writer)
        for event in events:
            await asyncio.wait_for(worker.send_data(event), _PATIENCE_S)

    async def _discard(self, reader: asyncio.StreamReader) -> None:
        """Read what a server sends until it leaves, so that it need not wait."""
        with contextlib.suppress(OSError):
            while await reader.read(1 << 16):
                pass
        self._close_writer()

    def _close_writer(self) -> None:
        writer, self._writer = self._writer, None
        if self._reading is not None and self._reading is not asyncio.current_task():
            self._reading.cancel()
        self._reading = None
        if writer is not None:
            writer.close()

    def _say(self, trouble: str) -> None:
        """Report a change between sending and not sending."""
        if bool(trouble) != bool(self._trouble):
            self._report(f"not sent: {trouble}" if trouble else "sent again")
        self._trouble = trouble
