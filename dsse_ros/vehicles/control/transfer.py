# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The common part of every exchange of the mission protocol, without a link or a clock.

An exchange is given the time and the messages received, and returns the messages to send. It waits
for a reply, sends again, starts again where that helps, and always ends, within the limits of its
`Timeouts`. Protocol: https://mavlink.io/en/services/mission.html.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import dataclass
from enum import Enum, auto
from typing import ClassVar, get_args

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.base.checks import check_number
from dsse_ros.vehicles.mavlink.messages import (
    MISSION_FAULTS,
    Address,
    MissionAck,
    MissionItemInt,
    MissionMessage,
    enum_name,
)

_MESSAGES = get_args(MissionMessage)


@dataclass(frozen=True)
class Timeouts:
    """Timeouts and retries of an exchange.

    The protocol's guide has 5 retries, which is too few for a link that loses 30 % each way.

    Attributes:
        item_s: Time after which a message about an item is sent again.
        reply_s: The same for any other message.
        retries: How often a message is sent again before the attempt counts as failed.
        upload_retries: How often the whole exchange starts again; vehicles have limits of their
            own.
        settle_s: Longest time that the link may delay a message and the reply to it. An exchange
            that has changed the vehicle, or tried to, waits for as long before it ends: a late
            message would disturb the next exchange.
        stall_s: Longer than a vehicle keeps a stalled transfer open (ArduPilot 8 s, PX4 5 s);
            until then it refuses another.

    Raises:
        ValueError: If a value is not allowed.
    """

    item_s: float = 0.25
    reply_s: float = 1.5
    retries: int = 15
    upload_retries: int = 3
    settle_s: float = 1.0
    stall_s: float = 10.0

    def __post_init__(self) -> None:
        for name in ("item_s", "reply_s", "settle_s", "stall_s"):
            check_number(name, getattr(self, name), 0, 3600, exclusive=True)
        for name in ("retries", "upload_retries"):
            check_number(name, getattr(self, name), 0, 1000)


DEFAULT_TIMEOUTS = Timeouts()


@dataclass(frozen=True)
class Done:
    """An exchange that succeeded.

    Attributes:
        items: The mission as it was sent to the vehicle, or read from it.
    """

    items: tuple[MissionItemInt, ...] = ()


@dataclass(frozen=True)
class Failed:
    """An exchange that failed.

    Attributes:
        code: Short snake_case key: `cancelled`, `no_reply`, `refused` and `stalled` for any;
            `early_ack`, `cancelled_by_vehicle` and `mismatch` for uploads.
        reason: One line for people.
        changed: Whether the vehicle may hold another mission than before, or none, or with
            ArduPilot a mixture: upload again before it flies one.
    """

    code: str
    reason: str
    changed: bool = False


class _State(Enum):
    NEW = auto()
    ACTIVE = auto()
    SETTLING = auto()
    ENDED = auto()


class Transfer(ABC):
    """Base of the exchanges, one at a time for each vehicle: retries, attempts and the end.

    Args:
        target: The vehicle's autopilot; component 0 stands for all components of its system.
        source: Ourselves.
        timeouts: Timeouts and retries.

    Attributes:
        attempts_left: How often it may still start again.
        deadline: Time at which `tick` is due; None if it is not.
        result: None while the exchange is in progress.
        counts: Messages that had no effect, and other events, by a short key.

    Raises:
        ValueError: If the target is not a single system: a broadcast would reach all vehicles.
    """

    name: ClassVar[str]
    changes_vehicle: ClassVar[bool]

    def __init__(
        self, target: Address, source: Address, *, timeouts: Timeouts = DEFAULT_TIMEOUTS
    ) -> None:
        check_number("target.system", target.system, 1, 255)
        self.target = target
        self.source = source
        self.timeouts = timeouts
        self.attempts_left = self.timeouts.upload_retries
        self.result: Done | Failed | None = None
        self.counts: Counter[str] = Counter()
        self.deadline: float | None = None
        self._state = _State.NEW
        self._pending: MissionMessage | None = None
        self._wait_s = 0.0
        self._retries_left = 0
        self._refused_since: float | None = None
        self._settled_by = 0.0
        self._conclusion: Done | Failed | None = None

    def start(self, now: float) -> list[MissionMessage]:
        """Start; returns the messages to send.

        Raises:
            RuntimeError: If it was started before.
        """
        if self._state is not _State.NEW:
            raise RuntimeError("an exchange can start only once")
        return self._begin(now)

    def receive(self, message: object, sender: Address, now: float) -> list[MissionMessage]:
        """Process a message from any sender, and never raise; returns the messages to send."""
        if self._state in (_State.NEW, _State.ENDED):
            return []
        if not isinstance(message, _MESSAGES):
            return self._ignore("unknown_message")
        expected = Address(*self.target) if self.target.component else (self.target.system,)
        if not isinstance(sender, tuple) or sender[: len(expected)] != expected:
            return self._ignore("wrong_sender")
        system, component = message.target_system, message.target_component
        if system not in (0, self.source.system) or component not in (0, self.source.component):
            return self._ignore("wrong_target")
        if message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
            return self._ignore("wrong_mission_type")
        if self._state is _State.SETTLING:
            return self._take_late(message, now)
        return self._take(message, now)

    def tick(self, now: float) -> list[MissionMessage]:
        """Process the time; returns the messages to send."""
        if self.deadline is None or now < self.deadline:
            return []
        if self._state is _State.SETTLING:
            return self._settled(now)
        if self._retries_left == 0:
            return self._exhausted(now)
        self._retries_left -= 1
        self.deadline = now + self._wait_s
        assert self._pending is not None
        return [self._pending]

    def cancel(self, now: float) -> list[MissionMessage]:
        """Cancel in any state; returns the messages to send. The result may follow later."""
        failed = Failed("cancelled", f"the {self.name} was cancelled", changed=self._may_change())
        if self._state is _State.NEW:
            self._end(failed)
            return []
        settling = self._state is _State.SETTLING
        if self._state is _State.ENDED or settling and isinstance(self._conclusion, Failed):
            return []
        return self._fail(failed, now)

    # What the kinds of exchange define.

    @abstractmethod
    def _begin(self, now: float) -> list[MissionMessage]:
        """Start an attempt."""

    @abstractmethod
    def _take(self, message: MissionMessage, now: float) -> list[MissionMessage]:
        """Process a message from the vehicle to us about the right type of mission."""

    @abstractmethod
    def _exhausted(self, now: float) -> list[MissionMessage]:
        """End the attempt: the pending message was sent as often as allowed."""

    def _take_late(self, message: MissionMessage, now: float) -> list[MissionMessage]:
        """Process a message that arrives while the exchange settles."""
        return self._ignore("late")

    # What they share.

    def _send(
        self,
        message: MissionMessage,
        wait_s: float,
        now: float,
        *,
        retries: int | None = None,
        pause_s: float = 0.0,
    ) -> list[MissionMessage]:
        """Send a message, after a pause, and again until another one takes its place."""
        self._state = _State.ACTIVE
        self._pending = message
        self._wait_s = wait_s
        self._retries_left = self.timeouts.retries if retries is None else retries
        self._refused_since = None
        if pause_s > 0:
            self._retries_left += 1
            self.deadline = now + pause_s
            return []
        self.deadline = now + wait_s
        return [message]

    def _ignore(self, key: str) -> list[MissionMessage]:
        self.counts[key] += 1
        return []

    def _cancellation(self) -> MissionAck:
        return MissionAck(*self.target, mavlink.MAV_MISSION_OPERATION_CANCELLED)

    def _refused(self, ack: MissionAck, now: float) -> list[MissionMessage]:
        """Process a refusal of the first message: the vehicle may only be busy."""
        self.counts["refused"] += 1
        if self._refused_since is None:
            self._refused_since = now
        if ack.type in MISSION_FAULTS or now - self._refused_since >= self.timeouts.stall_s:
            return self._fail(self._refusal(ack), now)
        return []

    def _refusal(self, ack: MissionAck) -> Failed:
        result = enum_name("MAV_MISSION_RESULT", ack.type, "MAV_MISSION_")
        return Failed(
            "refused",
            f"the vehicle refused the {self.name}: {result} ({ack.type})",
            changed=self._may_change(),
        )

    def _no_reply(self, now: float) -> list[MissionMessage]:
        tries = self.timeouts.retries + 1
        reason = f"{self.name}: no reply after {tries} tries"
        return self._fail(Failed("no_reply", reason, changed=self._may_change()), now)

    def _fail_attempt(self, code: str, reason: str, now: float) -> list[MissionMessage]:
        """Start again if attempts are left, else fail."""
        failed = Failed(code, f"{self.name}: {reason}", changed=self._may_change())
        if self.attempts_left == 0:
            return self._fail(failed, now)
        self.attempts_left -= 1
        self.counts[code] += 1
        return self._settle(None, now, [self._cancellation()] if self.changes_vehicle else [])

    def _fail(self, failed: Failed, now: float) -> list[MissionMessage]:
        return self._settle(failed, now, [self._cancellation()])

    def _settle(
        self,
        conclusion: Done | Failed | None,
        now: float,
        final_messages: list[MissionMessage],
    ) -> list[MissionMessage]:
        """End with a conclusion, None to start again, once no earlier message is in transit."""
        self._state = _State.SETTLING
        self._conclusion = conclusion
        if not self.changes_vehicle:
            return final_messages + self._settled(now)
        self._settled_by = now + self.timeouts.stall_s
        self._extend_settling(now)
        return final_messages

    def _extend_settling(self, now: float) -> None:
        """Wait for silence from now on, within the limit."""
        self.deadline = min(now + self._quiet_s(), self._settled_by)

    def _quiet_s(self) -> float:
        """Return how long the vehicle must send nothing before the exchange ends."""
        return self.timeouts.settle_s

    def _settled(self, now: float) -> list[MissionMessage]:
        if self._conclusion is None:
            return self._begin(now)
        self._end(self._conclusion)
        return []

    def _end(self, result: Done | Failed) -> None:
        self._state = _State.ENDED
        self.result = result
        self.deadline = None

    def _may_change(self) -> bool:
        return self.changes_vehicle and self._state is not _State.NEW
