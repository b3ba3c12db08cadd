# SPDX-License-Identifier: Apache-2.0
"""Download of the mission on a vehicle."""

from __future__ import annotations

from dsse_ros.flight.mission_messages import (
    MISSION_FAULTS,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionMessage,
    MissionRequestInt,
    MissionRequestList,
    MissionResult,
    WireItem,
)
from dsse_ros.flight.transfer import Done, Transfer


class Download(Transfer):
    """Requests the number of items, then one after the other: see `Transfer`.

    PX4 aborts a download when a request arrives late, after two others. Each attempt after the
    first therefore sends its requests more slowly, until no request can be overtaken like that.
    """

    name = "download"
    changes_vehicle = False

    _count: int | None = None
    _items: tuple[WireItem, ...] = ()

    def _begin(self, now: float) -> list[MissionMessage]:
        self._count, self._items = None, ()
        request = MissionRequestList(self.target, self.mission_type)
        return self._send(request, self.timeouts.reply_s, now)

    def _take(self, message: MissionMessage, now: float) -> list[MissionMessage]:
        if isinstance(message, MissionCount) and self._count is None:
            self._count = message.count
            return self._go_on(now)
        if isinstance(message, MissionItemInt) and self._count is not None:
            if message.item.seq != len(self._items):
                return self._ignore("out_of_sequence")
            self._items += (message.item,)
            return self._go_on(now)
        if isinstance(message, MissionAck) and message.type != MissionResult.ACCEPTED:
            if self._count is None:
                return self._refused(message, now)
            if message.type in MISSION_FAULTS:
                return self._fail(self._refusal(message), now)
            return self._fail_attempt("stalled", "aborted by the vehicle", now)
        return self._ignore("unexpected")

    def _exhausted(self, now: float) -> list[MissionMessage]:
        if self._count is None:
            return self._no_reply(now)
        reason = f"stalled after {len(self._items)} of {self._count} items"
        return self._fail_attempt("stalled", reason, now)

    def _go_on(self, now: float) -> list[MissionMessage]:
        seq = len(self._items)
        if seq == self._count:
            acknowledgement = MissionAck(self.target, MissionResult.ACCEPTED, self.mission_type)
            return self._settle(Done(self._items), now, [acknowledgement])
        request = MissionRequestInt(self.target, seq, self.mission_type)
        return self._send(request, self.timeouts.item_s, now, pause_s=self._pause_s())

    def _pause_s(self) -> float:
        timeouts = self.timeouts
        if self.attempts_left == timeouts.upload_retries:
            return 0.0
        return timeouts.settle_s / 2**self.attempts_left
