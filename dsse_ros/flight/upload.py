# SPDX-License-Identifier: Apache-2.0
"""Upload of a mission to a vehicle."""

from __future__ import annotations

from collections.abc import Sequence

from dsse_ros.flight.items import WireItem
from dsse_ros.flight.messages import (
    MISSION_FAULTS,
    Address,
    Message,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestInt,
    MissionResult,
)
from dsse_ros.flight.readback import Dialect
from dsse_ros.flight.transfer import Done, Failed, Timeouts, Transfer

_OVER = MISSION_FAULTS | {MissionResult.OPERATION_CANCELLED}
"""Results after which a vehicle waits for no more items."""


class Upload(Transfer):
    """Says how many items there are and answers what the vehicle asks until it acknowledges.

    An acknowledgement proves little: what arrived is only known from `VerifiedUpload`.

    Args:
        items: The mission, numbered as the vehicle does; an empty one clears it.
        target: The vehicle's autopilot.
        source: Ourselves.
        dialect: Whose autopilot it is. ArduPilot cannot be told to give up: after a failure it
            is waited for.
        must_confirm: Whether an acknowledgement must come; not for one who reads the mission back.
        mission_type: MAV_MISSION_TYPE, which the items must have.
        timeouts: How patient to be.

    Raises:
        ValueError: If items are not numbered from 0, are of another type, or would be obeyed at
            once instead of stored.
    """

    name = "upload"
    changes_vehicle = True

    def __init__(
        self,
        items: Sequence[WireItem],
        target: Address,
        source: Address,
        *,
        dialect: Dialect,
        must_confirm: bool = True,
        mission_type: int = 0,
        timeouts: Timeouts | None = None,
    ) -> None:
        super().__init__(target, source, mission_type=mission_type, timeouts=timeouts)
        self._items = tuple(items)
        self._dialect = dialect
        self._must_confirm = must_confirm
        self._asked: set[int] = set()
        self._told_over = False
        for index, item in enumerate(self._items):
            if item.seq != index:
                raise ValueError(f"items[{index}].seq: {item.seq} is not allowed; {index} is")
            if item.mission_type != mission_type:
                raise ValueError(
                    f"items[{index}].mission_type: {item.mission_type} is not allowed; "
                    f"{mission_type} is"
                )
            # ArduPilot takes 2 and 3 for an order to fly there.
            if item.current not in (0, 1):
                raise ValueError(f"items[{index}].current: {item.current} is not allowed; 0 or 1")

    def _begin(self, now: float) -> list[Message]:
        self._asked.clear()
        self._told_over = False
        count = MissionCount(self.target, len(self._items), self.mission_type)
        return self._ask(count, self.timeouts.reply_s, now)

    def _take(self, message: Message, now: float) -> list[Message]:
        if isinstance(message, MissionRequestInt | MissionRequest):
            return self._serve(message.seq, now)
        if isinstance(message, MissionAck):
            return self._take_ack(message, now)
        return self._ignore("unexpected")

    def _take_ack(self, ack: MissionAck, now: float) -> list[Message]:
        if ack.type == MissionResult.ACCEPTED:
            if self._all_asked:
                return self._settle(Done(self._items), now, [])
            reason = f"acknowledged when {len(self._asked)} of {len(self._items)} were asked for"
            return self._fail_attempt("early_ack", reason, now)
        self._told_over = ack.type in _OVER
        if ack.type in MISSION_FAULTS:
            return self._fail(self._refusal(ack), now)
        if not self._asked:
            return self._refused(ack, now)
        if ack.type == MissionResult.OPERATION_CANCELLED:
            return self._fail_attempt("given_up", "the vehicle gave up", now)
        # Vehicles grumble at an item that comes twice and go on asking. But once they have all,
        # it may be their way to say that they are no longer waiting for any.
        if self._all_asked and ack.type != MissionResult.INVALID_SEQUENCE:
            self._tries_left = min(self._tries_left, 1)
        return self._ignore("grumbled")

    def _take_late(self, message: Message, now: float) -> list[Message]:
        self.counts["late"] += 1
        if isinstance(message, MissionAck):
            if message.type in _OVER and not self._told_over:
                self._told_over = True
                self._stay(now)
            return []
        if not isinstance(message, MissionRequestInt | MissionRequest):
            return []
        self._stay(now)
        if not isinstance(self._conclusion, Done):
            return [self._cancellation()]
        # A late MISSION_COUNT has made it ask anew: let it have the same once more.
        return self._item(message.seq)

    def _exhausted(self, now: float) -> list[Message]:
        if not self._asked and self._items:
            return self._no_reply(now)
        if not self._all_asked:
            reason = f"stalled after {len(self._asked)} of {len(self._items)} items"
            return self._fail_attempt("stalled", reason, now)
        if not self._must_confirm:
            return self._settle(Done(self._items), now, [])
        return self._fail_attempt("unconfirmed", "no acknowledgement", now)

    def _goodbye(self) -> list[Message]:
        return [self._cancellation()]

    def _quiet_s(self) -> float:
        if self._told_over or not isinstance(self._conclusion, Failed):
            return self.timeouts.settle_s
        # It may wait for the items of this mission, and take those of the next one instead.
        if self._dialect == "ardupilot":
            return self.timeouts.stall_s
        return 2 * self.timeouts.settle_s

    @property
    def _all_asked(self) -> bool:
        return len(self._asked) == len(self._items)

    def _serve(self, seq: int, now: float) -> list[Message]:
        if not self._asked and seq != 0:
            # It has not heard of this upload: it still waits for the items of another one.
            self.counts["unexpected"] += 1
            return [self._cancellation()]
        answer = self._item(seq)
        if not answer or seq in self._asked:
            return answer
        self._asked.add(seq)
        timeouts = self.timeouts
        if self._all_asked:
            return self._ask(answer[0], timeouts.reply_s, now)
        # The vehicle asks again in its own time, so it is not enough to count our tries.
        tries = max(timeouts.retries, round(timeouts.stall_s / timeouts.item_s))
        return self._ask(answer[0], timeouts.item_s, now, tries=tries)

    def _item(self, seq: int) -> list[Message]:
        if not 0 <= seq < len(self._items):
            return self._ignore("unexpected")
        return [MissionItemInt(self.target, self._items[seq])]
