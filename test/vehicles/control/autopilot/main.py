# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The process: a vehicle, its sockets and the wall clock."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from selectors import EVENT_READ, DefaultSelector

from . import options
from .ardupilot import ArduCopter
from .arduplane import ArduPlane
from .channel import Channel
from .endpoints import Endpoint, TcpEndpoint, UdpEndpoint
from .px4 import Px4
from .px4plane import Px4Plane
from .settings import AutopilotName, Settings
from .vehicle import Vehicle

# However fast vehicle time goes, the process sleeps this long when nothing arrives, and then
# catches up. Twenty of them have to share two cores.
_MIN_SLEEP_S = 0.02
_VEHICLES: Mapping[AutopilotName, type[Vehicle]] = {
    "ardupilot": ArduCopter,
    "arduplane": ArduPlane,
    "px4": Px4,
    "px4plane": Px4Plane,
}
# Vehicle time that may pass at once. On a machine that is too busy vehicle time goes more slowly,
# as it does with SITL: otherwise messages waiting in the sockets would arrive too late for a
# failsafe.
_STRIDE_S = 0.25


def make_vehicle(settings: Settings) -> Vehicle:
    """Return a vehicle with the behaviour of its autopilot."""
    return _VEHICLES[settings.autopilot](settings)


def run(
    vehicle: Vehicle, endpoints: Sequence[Endpoint], speedup: float, *, until_eof: bool
) -> None:
    """Fly until the standard input ends, or forever.

    With TCP, vehicle time starts when the first client of the first such endpoint connects.
    """
    stride_s = max(_STRIDE_S, 2 * _MIN_SLEEP_S * speedup)
    awaited = next((end for end in endpoints if isinstance(end, TcpEndpoint)), None)
    start_s: float | None = None
    ended = False

    def advance() -> None:
        nonlocal start_s
        if start_s is None:
            return
        behind_s = (time.monotonic() - start_s) * speedup - vehicle.time_s
        if behind_s > stride_s:
            start_s += (behind_s - stride_s) / speedup
        vehicle.advance(vehicle.time_s + min(behind_s, stride_s))

    def receive(channel: Channel, data: bytes) -> None:
        advance()
        vehicle.receive(channel, data)

    def read_input() -> None:
        nonlocal ended
        ended = not os.read(sys.stdin.fileno(), 1024)

    with DefaultSelector() as selector:
        for endpoint in endpoints:
            channel = vehicle.connect(endpoint.transmit, datagram=endpoint.datagram)
            endpoint.register(selector, partial(receive, channel))
        if until_eof:
            selector.register(sys.stdin, EVENT_READ, read_input)
        while not ended:
            wait_s = None
            if start_s is None and (awaited is None or awaited.has_client):
                start_s = time.monotonic()
            if start_s is not None:
                advance()
                due_s = start_s + vehicle.next_s / speedup
                wait_s = max(due_s - time.monotonic(), _MIN_SLEEP_S)
            for key, _ in selector.select(wait_s):
                serve: Callable[[], None] = key.data
                serve()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; its end is a signal, or that of the standard input."""
    chosen = options.parse(arguments)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: sys.exit(0))
    endpoints: list[Endpoint] = [
        *(TcpEndpoint(local) for local in chosen.tcp),
        *(UdpEndpoint(local) for local in chosen.udpin),
        *(UdpEndpoint(_beside(peer[0]), peer) for peer in chosen.udp),
    ]
    for endpoint in endpoints:
        print(endpoint.connection)
    sys.stdout.flush()
    vehicle = make_vehicle(chosen.settings)
    vehicle.set_speedup(chosen.speedup)
    run(vehicle, endpoints, chosen.speedup, until_eof=chosen.until_eof)
    return 0


def _beside(host: str) -> tuple[str, int]:
    """Return the address to bind to: this machine alone, if the peer is on it."""
    return ("127.0.0.1" if host in ("localhost", "127.0.0.1") else "", 0)
