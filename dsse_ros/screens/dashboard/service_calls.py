# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands of the page: from a click to the answer of a service, with an age. Without I/O.

A click can wait anywhere: in a browser that has lost its connection, in a page or a node that does
not run, for a service that is not there. No vehicle may obey a command that the operator has
given up: one that is too old is not sent but answered, whatever has become ready meanwhile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, Protocol

MAX_AGE_S = 5.0
"""Age at which a command that has not been sent yet is dropped."""
ANSWER_S = 5.0
"""Time in which a service must answer."""


class Command(NamedTuple):
    """A command to a simulation or to vehicles.

    Attributes:
        namespace: Of the simulation, or of the bridge.
        name: pause, resume, step or reset; of vehicles arm, ground, hold, return or land; the kind
            of an input of a live search.
        clicked_s: When it was clicked, on the steady clock of this process.
        vehicle: Name of the drone whose vehicle is meant; empty for all vehicles.
        seed: Seed of the mission that a reset starts; None for that of the simulation's parameter.
        input: The input as JSON; empty for other commands.
    """

    namespace: str
    name: str
    clicked_s: float
    vehicle: str = ""
    seed: int | None = None
    input: str = ""


def clicked_at(stated: Any, now_s: float) -> float:
    """Return when a click happened, from the time that the browser states.

    Args:
        stated: The page's clock at the click, on the steady clock of this process; a browser that
            does not have the time yet states None.
        now_s: The time.

    Returns:
        The time of the click, never later than `now_s`; minus infinity if it is unknown.
    """
    if isinstance(stated, bool) or not isinstance(stated, int | float) or not math.isfinite(stated):
        return -math.inf
    return min(float(stated), now_s)


class Caller(Protocol):
    """A client of a service, as of rclpy."""

    def service_is_ready(self) -> bool:
        """Return whether the service is there."""

    def call_async(self, request: Any) -> Any:
        """Send a request; return the future of its answer."""

    def remove_pending_request(self, future: Any) -> None:
        """Forget a request, whose answer is then ignored."""


class _Sent(NamedTuple):
    """A request whose answer is awaited until a deadline."""

    command: Command
    caller: Caller
    future: Any
    deadline_s: float


class ServiceCalls:
    """Commands that wait for their service, and those that wait for its answer.

    Args:
        caller_of: Returns the client for a command; None while nobody can serve it.
        request_of: Returns the request of a command.
        answered: Called with a command and its response.
        failed: Called with a command that gets none, and the reason.
    """

    def __init__(
        self,
        caller_of: Callable[[Command], Caller | None],
        request_of: Callable[[Command], Any],
        answered: Callable[[Command, Any], None],
        failed: Callable[[Command, str], None],
    ) -> None:
        self._caller_of, self._request_of = caller_of, request_of
        self._answered, self._failed = answered, failed
        self._waiting: list[tuple[Command, bool]] = []
        self._sent: list[_Sent] = []

    def put(self, commands: Iterable[Command]) -> None:
        """Add commands, which the next `turn` serves."""
        self._waiting += ((command, False) for command in commands)

    def turn(self, now_s: float) -> None:
        """Send what can be sent, take answers, and give up what is too old."""
        waiting, self._waiting = self._waiting, []
        for command, tried in waiting:
            self._serve(command, now_s, tried=tried)
        sent, self._sent = self._sent, []
        for call in sent:
            if call.future.done():
                self._answered(call.command, call.future.result())
            elif now_s > call.deadline_s:
                call.caller.remove_pending_request(call.future)
                self._failed(
                    call.command, f"no answer within {ANSWER_S:g} s: it may still be obeyed"
                )
            else:
                self._sent.append(call)

    def _serve(self, command: Command, now_s: float, *, tried: bool) -> None:
        """Send a command, give it up, or let it wait.

        Args:
            command: The command.
            now_s: The time.
            tried: Whether its service has been missing before.
        """
        # First of all: a service that has just appeared must not get what was given up.
        if now_s - command.clicked_s > MAX_AGE_S:
            why = ": nobody served it" if tried else ""
            self._failed(command, f"not sent within {MAX_AGE_S:g} s of the click{why}; click again")
            return
        caller = self._caller_of(command)
        # A request that is sent before the service is discovered would be lost.
        if caller is None or not caller.service_is_ready():
            self._waiting.append((command, True))
            return
        future = caller.call_async(self._request_of(command))
        self._sent.append(_Sent(command, caller, future, now_s + ANSWER_S))
