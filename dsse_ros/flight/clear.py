# SPDX-License-Identifier: Apache-2.0
"""Deletion of the mission on a vehicle."""

from __future__ import annotations

from dsse_ros.flight.messages import Message, MissionAck, MissionClearAll, MissionResult
from dsse_ros.flight.transfer import Done, Transfer


class Clear(Transfer):
    """Asks the vehicle to delete all items: see `Transfer`.

    ArduPilot refuses while it flies a mission. The protocol has no way to take this back.
    """

    name = "clearing"
    changes_vehicle = True

    def _begin(self, now: float) -> list[Message]:
        question = MissionClearAll(self.target, self.mission_type)
        return self._ask(question, self.timeouts.reply_s, now)

    def _take(self, message: Message, now: float) -> list[Message]:
        if not isinstance(message, MissionAck):
            return self._ignore("unexpected")
        if message.type == MissionResult.ACCEPTED:
            return self._settle(Done(), now, [])
        return self._refused(message, now)

    def _exhausted(self, now: float) -> list[Message]:
        return self._no_reply(now)
