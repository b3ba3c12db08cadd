# SPDX-License-Identifier: Apache-2.0
"""What every exchange of the mission protocol has in common, without a link and without a clock.

An exchange is told the time and what was received; it answers with what to send. It waits for a
reply, asks again, begins anew where that helps, and always comes to an end, with no more delay
than its `Timeouts` allow. Protocol: https://mavlink.io/en/services/mission.html.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import dataclass
from enum import Enum, auto
from typing import ClassVar, Protocol, get_args

from dsse_ros.flight.items import WireItem
from dsse_ros.flight.messages import MISSION_FAULTS, Address, Message, MissionAck, MissionResult

_MESSAGES = get_args(Message)


@dataclass(frozen=True)
class Timeouts:
    """How patient an exchange is.

    The protocol's guide has 5 retries, which is too few for a link that loses 30 % each way.

    Attributes:
        item_s: Time after which a message about an item is sent again.
        reply_s: The same for any other message.
        retries: How often a message is sent again before the attempt counts as failed.
        upload_retries: How often the whole exchange is begun anew; vehicles have limits of their
            own.
        settle_s: Longest time that the link may delay a message and the answer to it. What has
            changed a vehicle, or tried to, waits for as long before it ends: a late message
            would spoil what follows.
        stall_s: Longer than a vehicle keeps up a transfer that has stalled (ArduPilot 8 s, PX4
            5 s); until then it refuses another.

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
            value = getattr(self, name)
            if not 0 < value <= 3600:
                raise ValueError(f"{name}: {value!r} is not allowed; above 0 and up to 3600")
        for name in ("retries", "upload_retries"):
            value = getattr(self, name)
            if not 0 <= value <= 1000:
                raise ValueError(f"{name}: {value!r} is not allowed; 0 to 1000")


@dataclass(frozen=True)
class Done:
    """An exchange that succeeded.

    Attributes:
        items: The mission on the vehicle as it was sent, or read from it.
    """

    items: tuple[WireItem, ...] = ()


@dataclass(frozen=True)
class Failed:
    """An exchange that did not succeed.

    Attributes:
        code: Short snake_case key: `cancelled`, `no_reply`, `refused` and `stalled` for any;
            `early_ack`, `given_up`, `unconfirmed` and `mismatch` for uploads.
        reason: One line for people.
        ack: MAV_MISSION_RESULT that the vehicle gave.
        changed: Whether the vehicle may hold another mission than before, or none, or with
            ArduPilot a mixture: upload again before it flies one.
    """

    code: str
    reason: str
    ack: int | None = None
    changed: bool = False


class Exchange(Protocol):
    """What the owner of a link drives: one exchange at a time for each vehicle.

    Attributes:
        result: None while the exchange goes on.
        counts: Messages that had no effect, and other events, by a short key.
    """

    result: Done | Failed | None
    counts: Counter[str]

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` is due; None if it is not."""

    def start(self, now: float) -> list[Message]:
        """Begin; returns what to send."""

    def receive(self, message: object, sender: Address, now: float) -> list[Message]:
        """Take what was received from anybody, and never raise; returns what to send."""

    def tick(self, now: float) -> list[Message]:
        """Let time pass; returns what to send."""

    def cancel(self, now: float) -> list[Message]:
        """Give up in any state; returns what to send. The result follows when all is quiet."""


class _State(Enum):
    NEW = auto()
    ASKING = auto()
    SETTLING = auto()
    OVER = auto()


class Transfer(ABC):
    """Base of the exchanges: addresses, retries, attempts and the end; see `Exchange`.

    Attributes:
        attempts_left: How often it may still begin anew.

    Args:
        target: The vehicle's autopilot; component 0 hears all components of its system.
        source: Ourselves.
        mission_type: MAV_MISSION_TYPE; messages about others are ignored.
        timeouts: How patient to be.

    Raises:
        ValueError: If the target is everybody, who would all obey.
    """

    name: ClassVar[str]
    changes_vehicle: ClassVar[bool]

    def __init__(
        self,
        target: Address,
        source: Address,
        *,
        mission_type: int = 0,
        timeouts: Timeouts | None = None,
    ) -> None:
        if not 1 <= target.system <= 255:
            raise ValueError(f"target: system {target.system!r} is not allowed; 1 to 255")
        self.target = target
        self.source = source
        self.mission_type = mission_type
        self.timeouts = timeouts or Timeouts()
        self.attempts_left = self.timeouts.upload_retries
        self.result: Done | Failed | None = None
        self.counts: Counter[str] = Counter()
        self._deadline: float | None = None
        self._state = _State.NEW
        self._question: Message | None = None
        self._wait_s = 0.0
        self._tries_left = 0
        self._refused_since: float | None = None
        self._settled_by = 0.0
        self._conclusion: Done | Failed | None = None

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` is due; None if it is not."""
        return self._deadline

    def start(self, now: float) -> list[Message]:
        """Begin; returns what to send.

        Raises:
            RuntimeError: If it has begun before.
        """
        if self._state is not _State.NEW:
            raise RuntimeError("an exchange starts once")
        return self._begin(now)

    def receive(self, message: object, sender: Address, now: float) -> list[Message]:
        """Take what was received from anybody, and never raise; returns what to send."""
        if self._state in (_State.NEW, _State.OVER):
            return []
        if not isinstance(message, _MESSAGES):
            return self._ignore("junk")
        heard = Address(*self.target) if self.target.component else (self.target.system,)
        if not isinstance(sender, tuple) or sender[: len(heard)] != heard:
            return self._ignore("foreign_sender")
        system, component = message.target
        if system not in (0, self.source.system) or component not in (0, self.source.component):
            return self._ignore("foreign_target")
        if message.mission_type != self.mission_type:
            return self._ignore("foreign_mission_type")
        if self._state is _State.SETTLING:
            return self._take_late(message, now)
        return self._take(message, now)

    def tick(self, now: float) -> list[Message]:
        """Let time pass; returns what to send."""
        if self._deadline is None or now < self._deadline:
            return []
        if self._state is _State.SETTLING:
            return self._settled(now)
        if self._tries_left == 0:
            return self._exhausted(now)
        self._tries_left -= 1
        self._deadline = now + self._wait_s
        assert self._question is not None
        return [self._question]

    def cancel(self, now: float) -> list[Message]:
        """Give up in any state; returns what to send. The result follows when all is quiet."""
        failed = Failed("cancelled", f"the {self.name} was cancelled", changed=self._may_change())
        if self._state is _State.NEW:
            self._end(failed)
            return []
        settling = self._state is _State.SETTLING
        if self._state is _State.OVER or settling and isinstance(self._conclusion, Failed):
            return []
        return self._settle(failed, now, self._goodbye())

    # What the kinds of exchange do.

    @abstractmethod
    def _begin(self, now: float) -> list[Message]:
        """Begin, or begin anew."""

    @abstractmethod
    def _take(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle to us about the right kind of mission."""

    @abstractmethod
    def _exhausted(self, now: float) -> list[Message]:
        """Give the attempt up: the question was asked as often as allowed."""

    def _take_late(self, message: Message, now: float) -> list[Message]:
        """Take a message when all was said."""
        return self._ignore("late")

    def _goodbye(self) -> list[Message]:
        """Return what tells the vehicle that we give up."""
        return []

    # What they do it with.

    def _ask(
        self,
        question: Message,
        wait_s: float,
        now: float,
        *,
        tries: int | None = None,
        pause_s: float = 0.0,
    ) -> list[Message]:
        """Send a message, after a pause, and send it again until the next question."""
        self._state = _State.ASKING
        self._question = question
        self._wait_s = wait_s
        self._tries_left = self.timeouts.retries if tries is None else tries
        self._refused_since = None
        if pause_s > 0:
            self._tries_left += 1
            self._deadline = now + pause_s
            return []
        self._deadline = now + wait_s
        return [question]

    def _ignore(self, key: str) -> list[Message]:
        self.counts[key] += 1
        return []

    def _cancellation(self) -> MissionAck:
        return MissionAck(self.target, MissionResult.OPERATION_CANCELLED, self.mission_type)

    def _refused(self, ack: MissionAck, now: float) -> list[Message]:
        """Take a refusal of the opening question: it may be that the vehicle is still busy."""
        self.counts["refused"] += 1
        if self._refused_since is None:
            self._refused_since = now
        if ack.type in MISSION_FAULTS or now - self._refused_since >= self.timeouts.stall_s:
            return self._fail(self._refusal(ack), now)
        return []

    def _refusal(self, ack: MissionAck) -> Failed:
        try:
            result = MissionResult(ack.type).name
        except ValueError:
            result = "unknown"
        return Failed(
            "refused",
            f"the vehicle refused the {self.name}: {result} ({ack.type})",
            ack=ack.type,
            changed=self._may_change(),
        )

    def _no_reply(self, now: float) -> list[Message]:
        asked = self.timeouts.retries + 1
        reason = f"no reply to the {self.name}, asked for {asked} times"
        return self._fail(Failed("no_reply", reason, changed=self._may_change()), now)

    def _fail_attempt(self, code: str, reason: str, now: float) -> list[Message]:
        """Begin anew if that is still allowed, else fail."""
        failed = Failed(code, f"{self.name}: {reason}", changed=self._may_change())
        if self.attempts_left == 0:
            return self._fail(failed, now)
        self.attempts_left -= 1
        self.counts[code] += 1
        return self._settle(None, now, self._goodbye() if self.changes_vehicle else [])

    def _fail(self, failed: Failed, now: float) -> list[Message]:
        return self._settle(failed, now, self._goodbye())

    def _settle(
        self, conclusion: Done | Failed | None, now: float, last_words: list[Message]
    ) -> list[Message]:
        """Come to a conclusion, None to begin anew, once nothing said before is under way."""
        self._state = _State.SETTLING
        self._conclusion = conclusion
        if not self.changes_vehicle:
            return last_words + self._settled(now)
        self._settled_by = now + self.timeouts.stall_s
        self._stay(now)
        return last_words

    def _stay(self, now: float) -> None:
        """Wait for quiet from now on, but not for ever."""
        self._deadline = min(now + self._quiet_s(), self._settled_by)

    def _quiet_s(self) -> float:
        """Return for how long nothing must be heard before all is over."""
        return self.timeouts.settle_s

    def _settled(self, now: float) -> list[Message]:
        if self._conclusion is None:
            return self._begin(now)
        self._end(self._conclusion)
        return []

    def _end(self, result: Done | Failed) -> None:
        self._state = _State.OVER
        self.result = result
        self._deadline = None

    def _may_change(self) -> bool:
        return self.changes_vehicle and self._state is not _State.NEW
