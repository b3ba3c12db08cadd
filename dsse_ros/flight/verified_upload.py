# SPDX-License-Identifier: Apache-2.0
"""Upload of a mission that is believed only when it has been read back."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence

from dsse_ros.flight.download import Download
from dsse_ros.flight.items import WireItem
from dsse_ros.flight.messages import Address, Message
from dsse_ros.flight.readback import Dialect, difference
from dsse_ros.flight.transfer import Done, Failed, Timeouts
from dsse_ros.flight.upload import Upload

_BEGUN_ANEW = ("mismatch", "stalled")


class VerifiedUpload:
    """Uploads a mission, downloads it and compares, until they agree: an `Exchange`.

    Its result has the items as the vehicle holds them.

    Args:
        items: The mission, numbered as the vehicle does.
        target: The vehicle's autopilot.
        source: Ourselves.
        dialect: Whose autopilot it is.
        mission_type: MAV_MISSION_TYPE, which the items must have.
        timeouts: How patient to be; the number of uploads is 1 + `upload_retries`.

    Raises:
        ValueError: As `Upload` does.
    """

    def __init__(
        self,
        items: Sequence[WireItem],
        target: Address,
        source: Address,
        *,
        dialect: Dialect,
        mission_type: int = 0,
        timeouts: Timeouts | None = None,
    ) -> None:
        self.result: Done | Failed | None = None
        self.counts: Counter[str] = Counter()
        self._items = tuple(items)
        self._address = target, source
        self._dialect = dialect
        self._mission_type = mission_type
        self._timeouts = timeouts or Timeouts()
        self._attempts_left = self._timeouts.upload_retries
        self._stage: Upload | Download = self._upload()

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` is due; None if it is not."""
        return self._stage.deadline

    def start(self, now: float) -> list[Message]:
        """Begin; returns what to send.

        Raises:
            RuntimeError: If it has begun before.
        """
        return self._stage.start(now)

    def receive(self, message: object, sender: Address, now: float) -> list[Message]:
        """Take what was received from anybody, and never raise; returns what to send."""
        return self._go_on(self._stage.receive(message, sender, now), now)

    def tick(self, now: float) -> list[Message]:
        """Let time pass; returns what to send."""
        return self._go_on(self._stage.tick(now), now)

    def cancel(self, now: float) -> list[Message]:
        """Give up in any state; returns what to send. The result follows when all is quiet."""
        return self._go_on(self._stage.cancel(now), now)

    def _upload(self) -> Upload:
        stage = Upload(
            self._items,
            *self._address,
            dialect=self._dialect,
            must_confirm=False,
            mission_type=self._mission_type,
            timeouts=dataclasses.replace(self._timeouts, upload_retries=self._attempts_left),
        )
        stage.counts = self.counts
        return stage

    def _download(self) -> Download:
        stage = Download(*self._address, mission_type=self._mission_type, timeouts=self._timeouts)
        stage.counts = self.counts
        return stage

    def _go_on(self, sent: list[Message], now: float) -> list[Message]:
        """Turn to the next stage if the present one is over."""
        over = self._stage.result
        if over is None or self.result is not None:
            return sent
        if isinstance(self._stage, Upload):
            if isinstance(over, Failed):
                self.result = over
                return sent
            self._attempts_left = self._stage.attempts_left
            self._stage = self._download()
            return sent + self._stage.start(now)
        return sent + self._judge(over, now)

    def _judge(self, read: Done | Failed, now: float) -> list[Message]:
        """Take what was read back for the result, or upload anew."""
        if isinstance(read, Done):
            differs = difference(self._items, read.items, self._dialect)
            if differs is None:
                self.result = read
                return []
            failed = Failed("mismatch", differs, changed=True)
        else:
            failed = dataclasses.replace(read, changed=True)
        if failed.code not in _BEGUN_ANEW or self._attempts_left == 0:
            self.result = failed
            return []
        self._attempts_left -= 1
        self.counts[failed.code] += 1
        self._stage = self._upload()
        return self._stage.start(now)
