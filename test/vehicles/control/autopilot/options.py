# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from . import ardupilot, arduplane, px4
from .endpoints import Address
from .faults import KINDS, Fault
from .local_frame import Place
from .settings import Settings

T = TypeVar("T")

_READY_S = {"ardupilot": 42.0, "arduplane": 42.0, "px4": 10.0, "px4plane": 10.0}
_MODES = {
    "ardupilot": ardupilot.Mode,
    "arduplane": arduplane.Mode,
    "px4": px4.Mode,
    "px4plane": px4.Mode,
}


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return `settings`, `udp`, `udpin` and `tcp` (addresses), `speedup` and `until_eof`.

    Raises:
        SystemExit: If they are not allowed.
    """
    parser = argparse.ArgumentParser(
        prog="autopilot",
        description="A simulated autopilot that behaves as ArduCopter or PX4.",
        epilog="It prints the connection strings for pymavlink, one a line.",
    )
    add = parser.add_argument
    add("--sysid", type=_system, default=1, help="system id (%(default)s)")
    add("--autopilot", choices=_MODES, default="ardupilot", help="whose behaviour (%(default)s)")
    add("--udp", type=_argument(address), action="append", default=[], metavar="[HOST:]PORT",
        help="send there first, and to every peer that sends something")  # fmt: skip
    add("--udpin", type=_argument(address), action="append", default=[], metavar="[HOST:]PORT",
        help="listen there; port 0 takes a free one")  # fmt: skip
    add("--tcp", type=_argument(address), action="append", default=[], metavar="[HOST:]PORT",
        help="serve one client; vehicle time starts when the first one connects")  # fmt: skip
    add("--home", type=_argument(_place), default=Settings.home, metavar="LAT,LON,ALT",
        help="where it stands, degrees and metres above the sea")  # fmt: skip
    add("--speedup", type=_argument(_positive), default=1.0, metavar="FACTOR",
        help="vehicle time in a second of wall time, if the machine can (%(default)s)")  # fmt: skip
    add("--seed", type=int, default=0, help="random seed (%(default)s)")
    add("--signing-key", type=_argument(_key), default=None, metavar="FILE", dest="key",
        help="32 bytes or 64 hexadecimal digits; then unsigned messages are dropped")  # fmt: skip
    add("--ready", type=_argument(_positive), default=None, metavar="SECONDS",
        help="vehicle time until it can be armed (42, px4: 10)")  # fmt: skip
    add("--requests-lost", type=float, default=Settings.requests_lost_s, metavar="SECONDS",
        help="time in which message requests are acknowledged and lost (%(default)s)")  # fmt: skip
    add("--no-gps", action="store_false", dest="gps", help="never have a position")
    add("--endurance", type=_argument(_positive), default=Settings.endurance_s, metavar="SECONDS",
        help="time in the air that the battery lasts (%(default)s)")  # fmt: skip
    add("--fault", type=_argument(Fault.parse), action="append", default=[],
        metavar="KIND@[airborne:]SECONDS[+SECONDS][=VALUE]",
        help=f"a failure, its time and duration, of {', '.join(KINDS)}; "
        "the value of acks is a probability, that of pilot a mode")  # fmt: skip
    add("--param", type=_argument(_parameter), action="append", default=[], metavar="NAME=VALUE",
        help="value of a parameter instead of the usual one")  # fmt: skip
    add("--until-eof", action="store_true", help="end when the standard input does")
    options = parser.parse_args(arguments)
    if not options.udp + options.udpin + options.tcp:
        parser.error("no link: give --udp, --udpin or --tcp")
    modes = _MODES[options.autopilot].__members__
    for fault in options.fault:
        if fault.kind == "pilot" and fault.value not in {"", *modes}:
            parser.error(f"pilot must be one of {', '.join(modes)}, got {fault.value}")
    options.settings = Settings(
        system=options.sysid,
        autopilot=options.autopilot,
        home=options.home,
        seed=options.seed,
        key=options.key,
        ready_s=options.ready or _READY_S[options.autopilot],
        requests_lost_s=options.requests_lost,
        gps=options.gps,
        endurance_s=options.endurance,
        faults=tuple(options.fault),
        parameters=tuple(options.param),
    )
    return options


def address(text: str) -> Address:
    """Read `[HOST:]PORT`; the host is this machine if none is given."""
    host, _, port = text.rpartition(":")
    number = int(port)
    if not 0 <= number < 1 << 16:
        raise ValueError(f"port must be 0 to 65535, got {number}")
    return host or "127.0.0.1", number


def _argument(read: Callable[[str], T]) -> Callable[[str], T]:
    """Have argparse show the reason of an error."""

    def convert(text: str) -> T:
        try:
            return read(text)
        except (OSError, ValueError) as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return convert


def _positive(text: str) -> float:
    number = float(text)
    if not number > 0:
        raise ValueError(f"number must be > 0, got {text}")
    return number


@_argument
def _system(text: str) -> int:
    number = int(text)
    if not 1 <= number <= 255:
        raise ValueError(f"system id must be 1 to 255, got {text}")
    return number


def _place(text: str) -> Place:
    numbers = [float(part) for part in text.split(",")]
    if len(numbers) != 3 or abs(numbers[0]) > 90 or abs(numbers[1]) > 180:
        raise ValueError(f"place must be latitude,longitude,altitude, got {text}")
    return Place(*numbers)


def _key(text: str) -> bytes:
    key = Path(text).read_bytes()
    if len(key.strip()) == 64:
        key = bytes.fromhex(key.strip().decode("ascii"))
    if len(key) != 32:
        raise ValueError(f"{text} must have 32 bytes, got {len(key)}")
    return key


def _parameter(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    return name, float(value)
