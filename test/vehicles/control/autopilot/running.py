# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Starts autopilots and relays as processes of their own, for a while.

`with running_autopilot(speedup=10) as autopilot: connect(autopilot.connection)`
"""

from __future__ import annotations

import contextlib
import json
import random
import select
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from .settings import AutopilotName

FOLDER = Path(__file__).resolve().parent
TIMEOUT_S = 120.0
"""Wall time within which a process starts or ends."""

Link = Literal["udpin", "udp", "tcp"]


@dataclass(frozen=True)
class Running:
    """A process that runs.

    Attributes:
        process: The process.
        connection: Connection string with which a client connects to it:
            `udpout:`, `udpin:` or `tcp:`, host and port.
    """

    process: subprocess.Popen[bytes]
    connection: str

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self.process.pid

    @property
    def host(self) -> str:
        """Host of the connection."""
        return self.connection.split(":")[1]

    @property
    def port(self) -> int:
        """Port of the connection."""
        return int(self.connection.split(":")[2])

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        return self.process.poll() is None

    def kill(self) -> None:
        """End it at once, as a crash would."""
        self.process.kill()
        self.process.wait(TIMEOUT_S)


_PORTS = range(61_000, 65_536)
"""What Linux gives to nobody who asks for any port (ip_local_port_range), nor ROS 2 to a domain."""
_reserved: list[socket.socket] = []


def free_udp_port() -> int:
    """Return a free port of this machine, and keep it from other processes that ask here.

    Raises:
        RuntimeError: If none is free.
    """
    for port in random.sample(_PORTS, len(_PORTS)):
        # A name of this machine that ends with the process; it is not a file.
        reservation = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            reservation.bind(f"\0dsse_ros_test_port_{port}")
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(("127.0.0.1", port))
        except OSError:
            reservation.close()
            continue
        _reserved.append(reservation)
        return port
    raise RuntimeError("no UDP port is free")


@contextlib.contextmanager
def running_autopilot(
    autopilot: AutopilotName = "ardupilot",
    *,
    link: Link = "udpin",
    port: int = 0,
    system: int = 1,
    home: tuple[float, float, float] | None = None,
    speedup: float = 1.0,
    seed: int = 0,
    ready_s: float | None = None,
    requests_lost_s: float | None = None,
    key_file: Path | None = None,
    faults: Sequence[str] = (),
    options: Sequence[str] = (),
) -> Iterator[Running]:
    """Run an autopilot; it is stopped at the end, and must not have failed.

    Args:
        autopilot: Whose behaviour it has.
        link: `udpin` listens, `udp` sends first, with `tcp` vehicle time starts when a client
            connects.
        port: Of the link; 0 takes a free one. With `udp` it is the client's.
        system: System id.
        home: Latitude and longitude in degrees, metres above the sea.
        speedup: Vehicle time in a second of wall time.
        seed: Random seed.
        ready_s: Vehicle time until it can be armed.
        requests_lost_s: Vehicle time in which requests for messages are lost.
        key_file: With the key to sign with.
        faults: Each as on the command line.
        options: Further arguments of the command line.

    Raises:
        AssertionError: If it does not start, or if it ends with an error.
    """
    if link == "udp" and not port:
        port = free_udp_port()
    command = [f"--autopilot={autopilot}", f"--{link}={port}", f"--sysid={system}"]
    command += [f"--speedup={speedup}", f"--seed={seed}", *(f"--fault={fault}" for fault in faults)]
    if home is not None:
        command.append("--home={},{},{}".format(*home))
    for name, value in (
        ("ready", ready_s),
        ("requests-lost", requests_lost_s),
        ("signing-key", key_file),
    ):
        if value is not None:
            command.append(f"--{name}={value}")
    with _running([str(FOLDER), *command, *options]) as running:
        yield running


@contextlib.contextmanager
def running_relay(
    to_port: int,
    *,
    loss: float = 0.0,
    duplicate: float = 0.0,
    reorder: float = 0.0,
    delay_s: float = 0.0,
    jitter_s: float = 0.0,
    hold_s: float = 0.05,
    seed: int = 0,
    counts: dict[str, Any] | None = None,
) -> Iterator[Running]:
    """Run a relay to a UDP port of this machine; see `relay.Impairments`.

    Args:
        to_port: Where datagrams go that are sent to the relay.
        loss: Share that never arrives.
        duplicate: Share of the others that arrives twice.
        reorder: Share that is held back.
        delay_s: Time that each takes.
        jitter_s: Time by which it may take longer.
        hold_s: Time by which some are held back.
        seed: Random seed.
        counts: Filled at the end: `outward` and `homeward`, each with `received`, `lost` and
            `sent`.

    Raises:
        AssertionError: If it does not start, or if it ends with an error.
    """
    command = [f"--to={to_port}", f"--loss={loss}", f"--duplicate={duplicate}"]
    command += [f"--reorder={reorder}", f"--delay={delay_s}", f"--jitter={jitter_s}"]
    command += [f"--hold={hold_s}", f"--seed={seed}"]
    output: list[str] = []
    with _running([str(FOLDER / "relay.py"), *command], output) as running:
        yield running
    if counts is not None and output:
        counts.update(json.loads(output[-1]))


@contextlib.contextmanager
def _running(arguments: list[str], output: list[str] | None = None) -> Iterator[Running]:
    with tempfile.TemporaryFile() as errors:

        def errors_text() -> str:
            errors.seek(0)
            return errors.read().decode(errors="replace")

        process = subprocess.Popen(
            [sys.executable, *arguments, "--until-eof"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
        )
        assert process.stdin is not None and process.stdout is not None
        try:
            ready, _, _ = select.select([process.stdout], [], [], TIMEOUT_S)
            first = process.stdout.readline().decode().strip() if ready else ""
            assert first, f"{arguments} did not start: {errors_text()}"
            running = Running(process, first)
            yield running
            if running.running:
                process.stdin.close()
                code = process.wait(TIMEOUT_S)
                rest = process.stdout.read().decode().split("\n")
                if output is not None:
                    output += [line for line in rest if line]
                assert code == 0, f"{arguments} ended with {code}: {errors_text()}"
            assert "Traceback" not in errors_text(), errors_text()
        finally:
            if process.poll() is None:
                process.kill()
                process.wait(TIMEOUT_S)
            with contextlib.suppress(OSError):
                process.stdin.close()
            process.stdout.close()
