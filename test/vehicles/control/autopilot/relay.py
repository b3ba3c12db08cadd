# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A bad network: passes UDP datagrams on, but loses, doubles, delays and reorders some of them.

`python test/vehicles/control/autopilot/relay.py --listen PORT --to PORT --loss 0.3`. What happens
to the n-th datagram of a direction depends on the seed alone. At its end it prints, as
JSON, how many datagrams of each direction were received, lost and sent.
"""

from __future__ import annotations

import argparse
import contextlib
import heapq
import itertools
import json
import os
import random
import signal
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from selectors import EVENT_READ, DefaultSelector

_MAX_DATAGRAM = 65535
_MAX_DATAGRAMS_AT_ONCE = 64
# Large enough that the sockets lose no datagram.
_BUFFER = 1 << 22

Address = tuple[str, int]


@dataclass(frozen=True)
class Impairments:
    """What happens to datagrams; shares are probabilities, times are in seconds.

    Attributes:
        loss: Share that never arrives.
        duplicate: Share of the others that arrives twice.
        reorder: Share of copies that is held back, so that later ones overtake it.
        delay_s: Time that every copy takes.
        jitter_s: Time by which it may take longer.
        hold_s: Time by which copies are held back.
    """

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    hold_s: float = 0.05


@dataclass
class Counts:
    """Datagrams of a direction."""

    received: int = 0
    lost: int = 0
    sent: int = 0


class Direction:
    """Datagrams that travel one way."""

    def __init__(self, impairments: Impairments, seed: str) -> None:
        self.counts = Counts()
        self._impairments = impairments
        self._random = random.Random(seed)

    def delays_s(self) -> list[float]:
        """Return how long each copy of the next datagram takes."""
        impairments, draw = self._impairments, self._random.random
        # As many draws for each datagram, so that what happens to one does not affect another.
        lost, doubled = draw() < impairments.loss, draw() < impairments.duplicate
        delays = []
        for _ in range(2):
            held_s = impairments.hold_s if draw() < impairments.reorder else 0.0
            delays.append(impairments.delay_s + impairments.jitter_s * draw() + held_s)
        self.counts.received += 1
        self.counts.lost += lost
        copies = 0 if lost else 1 + doubled
        self.counts.sent += copies
        return delays[:copies]


class Relay:
    """Two sockets: one for the client, one towards the far end.

    Args:
        listen: What to bind to; port 0 takes a free one.
        to: The far end.
        impairments: Of both directions.
        seed: Random seed.
    """

    def __init__(self, listen: Address, to: Address, impairments: Impairments, seed: int) -> None:
        self._near = _udp_socket(listen)
        self._far = _udp_socket(("127.0.0.1" if to[0] == "127.0.0.1" else "", 0))
        self._to = to
        self._client: Address | None = None
        self.outward = Direction(impairments, f"{seed} outward")
        self.homeward = Direction(impairments, f"{seed} homeward")
        self._order = itertools.count()
        self._travelling: list[tuple[float, int, bool, bytes]] = []

    @property
    def address(self) -> Address:
        """Where it listens."""
        host, port = self._near.getsockname()
        return host, port

    def run(self, *, until_eof: bool) -> None:
        """Pass on until the standard input ends, or forever."""
        with DefaultSelector() as selector:
            selector.register(self._near, EVENT_READ, "near")
            selector.register(self._far, EVENT_READ, "far")
            if until_eof:
                selector.register(sys.stdin, EVENT_READ, "end")
            while True:
                self._send_due()
                wait_s = None
                if self._travelling:
                    wait_s = max(0.0, self._travelling[0][0] - time.monotonic())
                for key, _ in selector.select(wait_s):
                    if key.data != "end":
                        self._take(outward=key.data == "near")
                    elif not os.read(sys.stdin.fileno(), 1024):
                        return

    def _take(self, *, outward: bool) -> None:
        source = self._near if outward else self._far
        direction = self.outward if outward else self.homeward
        for _ in range(_MAX_DATAGRAMS_AT_ONCE):
            try:
                data, peer = source.recvfrom(_MAX_DATAGRAM)
            except OSError:
                return
            if outward:
                self._client = peer
            now_s = time.monotonic()
            for delay_s in direction.delays_s():
                entry = (now_s + delay_s, next(self._order), outward, data)
                heapq.heappush(self._travelling, entry)

    def _send_due(self) -> None:
        now_s = time.monotonic()
        while self._travelling and self._travelling[0][0] <= now_s:
            _, _, outward, data = heapq.heappop(self._travelling)
            with contextlib.suppress(OSError):
                if outward:
                    self._far.sendto(data, self._to)
                elif self._client is not None:
                    self._near.sendto(data, self._client)


def _udp_socket(local: Address) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
    made.bind(local)
    return made


def _address(text: str) -> Address:
    host, _, port = text.rpartition(":")
    return host or "127.0.0.1", int(port)


def _share(text: str) -> float:
    number = float(text)
    if not 0 <= number <= 1:
        raise ValueError(f"share must be 0 to 1, got {text}")
    return number


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; its end is a signal, or that of the standard input."""
    parser = argparse.ArgumentParser(prog="relay", description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("--listen", type=_address, default=("127.0.0.1", 0), metavar="[HOST:]PORT",
        help="port 0 takes a free one, and it is printed")  # fmt: skip
    add("--to", type=_address, required=True, metavar="[HOST:]PORT", help="the far end")
    for name in ("loss", "duplicate", "reorder"):
        add(f"--{name}", type=_share, default=0.0, metavar="SHARE", help="(%(default)s)")
    for name in ("delay", "jitter", "hold"):
        add(f"--{name}", type=float, default=getattr(Impairments, f"{name}_s"), metavar="SECONDS",
            help="(%(default)s)")  # fmt: skip
    add("--seed", type=int, default=0, help="(%(default)s)")
    add("--until-eof", action="store_true", help="end when the standard input does")
    chosen = parser.parse_args(arguments)
    impairments = Impairments(
        chosen.loss, chosen.duplicate, chosen.reorder, chosen.delay, chosen.jitter, chosen.hold
    )
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: sys.exit(0))
    relay = Relay(chosen.listen, chosen.to, impairments, chosen.seed)
    print("udpout:{}:{}".format(*relay.address), flush=True)
    try:
        relay.run(until_eof=chosen.until_eof)
    finally:
        counts = {"outward": relay.outward.counts, "homeward": relay.homeward.counts}
        print(json.dumps({name: asdict(count) for name, count in counts.items()}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
