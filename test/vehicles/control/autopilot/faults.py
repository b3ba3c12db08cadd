# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Failures that happen at a given time of the flight."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

KINDS = ("link", "acks", "mission_acks", "battery", "pilot")

_FORM = re.compile(
    r"(?P<kind>\w+)@(?P<origin>airborne:)?(?P<start>\d+(\.\d*)?)"
    r"(\+(?P<duration>\d+(\.\d*)?))?(=(?P<value>[\w.]+))?"
)


@dataclass(frozen=True)
class Fault:
    """One failure.

    Attributes:
        kind: `link`: nothing is sent or received. `acks`: each COMMAND_ACK is lost, with a
            probability if the value is one. `mission_acks`: likewise each MISSION_ACK.
            `battery`: it runs low, and the vehicle returns, PX4's holds and lands. `pilot`: a
            pilot takes over, in the mode that the value names.
        start_s: Vehicle time since the start, or since it was first airborne.
        since_airborne: Which of the two.
        duration_s: How long `link`, `acks` and `mission_acks` last.
        value: See `kind`.
    """

    kind: str
    start_s: float
    since_airborne: bool = False
    duration_s: float = math.inf
    value: str = ""

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read `KIND@[airborne:]SECONDS[+SECONDS][=VALUE]`.

        Raises:
            ValueError: If it is not of that form.
        """
        match = _FORM.fullmatch(text)
        if match is None or match["kind"] not in KINDS:
            raise ValueError(
                "fault must be KIND@[airborne:]SECONDS[+SECONDS][=VALUE] with a KIND of "
                f"{', '.join(KINDS)}, got {text!r}"
            )
        return cls(
            match["kind"],
            float(match["start"]),
            match["origin"] is not None,
            float(match["duration"]) if match["duration"] else math.inf,
            match["value"] or "",
        )


class Schedule:
    """Faults, as time goes by."""

    def __init__(self, faults: tuple[Fault, ...]) -> None:
        self._waiting = list(faults)
        self._lasting: list[tuple[float, Fault]] = []

    def due(self, time_s: float, airborne_s: float | None) -> list[Fault]:
        """Return the faults that start by now.

        Args:
            time_s: Vehicle time since the start.
            airborne_s: Vehicle time at which it was first airborne, if it was.
        """
        started = []
        for fault in self._waiting:
            origin_s = airborne_s if fault.since_airborne else 0.0
            if origin_s is not None and time_s >= origin_s + fault.start_s:
                started.append(fault)
        for fault in started:
            self._waiting.remove(fault)
            self._lasting.append((time_s + fault.duration_s, fault))
        self._lasting = [entry for entry in self._lasting if entry[0] > time_s]
        return started

    def lasting(self, kind: str) -> Fault | None:
        """Return the fault of a kind that lasts, if there is one."""
        return next((fault for _, fault in self._lasting if fault.kind == kind), None)
