# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions to a vehicle and back: upload, download, and an upload verified by a download."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections import Counter
from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.base.checks import check_number
from dsse_ros.vehicles.autopilots import Autopilot
from dsse_ros.vehicles.control.item_messages import INTEGER_FRAMES
from dsse_ros.vehicles.control.transfer import DEFAULT_TIMEOUTS, Done, Failed, Timeouts, Transfer
from dsse_ros.vehicles.mavlink.messages import (
    MISSION_FAULTS,
    Address,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionMessage,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
)
from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, NAV_RETURN_TO_LAUNCH

_FINAL_RESULTS = MISSION_FAULTS | {mavlink.MAV_MISSION_OPERATION_CANCELLED}
"""Results after which a vehicle waits for no more items."""
_RETRIED = ("mismatch", "stalled")
"""Codes of a failed verification after which the mission is uploaded again."""
_CONTENT = (
    "frame", "command", "autocontinue", "param1", "param2", "param3", "param4", "x", "y", "z",
)  # fmt: skip
"""Fields of an item, without those of its transfer."""
_MAX_DEGREES = 1
"""1e-7 degrees, which are lost when they are stored as floating point."""
_MAX_ALTITUDE_M = 0.02
"""ArduPilot stores centimetres."""


class Upload(Transfer):
    """Sends the number of items, then those that the vehicle requests.

    It ends with the acknowledgement, or without one if the vehicle has requested all items: only
    `VerifiedUpload`, which reads them back, knows which mission the vehicle holds.

    Args:
        items: The mission, numbered as the vehicle does; an empty one clears it.
        target: The vehicle's autopilot.
        source: Ourselves.
        autopilot: Which autopilot it is. ArduPilot does not process a cancellation: after a failure
            the exchange waits until its own time-out.
        timeouts: Timeouts and retries.

    Raises:
        ValueError: If items have another target, are not of a mission, are not numbered from 0, or
            would be executed at once instead of stored.
    """

    name = "upload"
    changes_vehicle = True

    def __init__(
        self,
        items: Sequence[MissionItemInt],
        target: Address,
        source: Address,
        *,
        autopilot: Autopilot,
        timeouts: Timeouts = DEFAULT_TIMEOUTS,
    ) -> None:
        super().__init__(target, source, timeouts=timeouts)
        self._items = tuple(items)
        self._autopilot = autopilot
        self._requested: set[int] = set()
        self._vehicle_ended = False
        for index, item in enumerate(self._items):
            for name, least, most in (
                ("target_system", target.system, target.system),
                ("target_component", target.component, target.component),
                ("seq", index, index),
                ("mission_type", 0, 0),
                # ArduPilot takes 2 and 3 for a command to fly there.
                ("current", 0, 1),
            ):
                check_number(f"items[{index}].{name}", getattr(item, name), least, most)

    def _begin(self, now: float) -> list[MissionMessage]:
        self._requested.clear()
        self._vehicle_ended = False
        count = MissionCount(*self.target, len(self._items))
        return self._send(count, self.timeouts.reply_s, now)

    def _take(self, message: MissionMessage, now: float) -> list[MissionMessage]:
        if isinstance(message, MissionRequestInt | MissionRequest):
            return self._serve(message.seq, now)
        if isinstance(message, MissionAck):
            return self._take_ack(message, now)
        return self._ignore("unexpected")

    def _take_ack(self, ack: MissionAck, now: float) -> list[MissionMessage]:
        if ack.type == mavlink.MAV_MISSION_ACCEPTED:
            if self._all_requested:
                return self._settle(Done(self._items), now, [])
            done, total = len(self._requested), len(self._items)
            reason = f"acknowledged after {done} of {total} items were requested"
            return self._fail_attempt("early_ack", reason, now)
        self._vehicle_ended = ack.type in _FINAL_RESULTS
        if ack.type in MISSION_FAULTS:
            return self._fail(self._refusal(ack), now)
        if not self._requested:
            return self._refused(ack, now)
        if ack.type == mavlink.MAV_MISSION_OPERATION_CANCELLED:
            return self._fail_attempt("cancelled_by_vehicle", "cancelled by the vehicle", now)
        # Vehicles send a NACK for an item that arrives twice and continue. But once they have all,
        # a NACK may mean that they no longer wait for any.
        if self._all_requested and ack.type != mavlink.MAV_MISSION_INVALID_SEQUENCE:
            self._retries_left = min(self._retries_left, 1)
        return self._ignore("ignored_nack")

    def _take_late(self, message: MissionMessage, now: float) -> list[MissionMessage]:
        self.counts["late"] += 1
        if isinstance(message, MissionAck):
            if message.type in _FINAL_RESULTS and not self._vehicle_ended:
                self._vehicle_ended = True
                self._extend_settling(now)
            return []
        if not isinstance(message, MissionRequestInt | MissionRequest):
            return []
        self._extend_settling(now)
        if not isinstance(self._conclusion, Done):
            return [self._cancellation()]
        # A late MISSION_COUNT has made it request the items again: send the same ones once more.
        return self._item(message.seq)

    def _exhausted(self, now: float) -> list[MissionMessage]:
        if not self._requested and self._items:
            return self._no_reply(now)
        if not self._all_requested:
            reason = f"stalled after {len(self._requested)} of {len(self._items)} items"
            return self._fail_attempt("stalled", reason, now)
        return self._settle(Done(self._items), now, [])

    def _quiet_s(self) -> float:
        if self._vehicle_ended or not isinstance(self._conclusion, Failed):
            return self.timeouts.settle_s
        # It may still wait for the items of this mission, and take those of the next one instead.
        if not self._autopilot.upload_can_be_cancelled:
            return self.timeouts.stall_s
        return 2 * self.timeouts.settle_s

    @property
    def _all_requested(self) -> bool:
        return len(self._requested) == len(self._items)

    def _serve(self, seq: int, now: float) -> list[MissionMessage]:
        if not self._requested and seq != 0:
            # It has not received this count: it still waits for the items of another upload.
            self.counts["unexpected"] += 1
            return [self._cancellation()]
        reply = self._item(seq)
        if not reply or seq in self._requested:
            return reply
        self._requested.add(seq)
        timeouts = self.timeouts
        if self._all_requested:
            return self._send(reply[0], timeouts.reply_s, now)
        # The vehicle repeats its requests at its own pace, so the number of our retries alone
        # means nothing.
        retries = max(timeouts.retries, round(timeouts.stall_s / timeouts.item_s))
        return self._send(reply[0], timeouts.item_s, now, retries=retries)

    def _item(self, seq: int) -> list[MissionMessage]:
        if not 0 <= seq < len(self._items):
            return self._ignore("unexpected")
        return [self._items[seq]]


class Download(Transfer):
    """Requests the number of items, then one after the other: see `Transfer`.

    PX4 aborts a download when a request arrives late, after two others. Each attempt after the
    first therefore sends its requests more slowly, until no request can be overtaken like that.
    """

    name = "download"
    changes_vehicle = False

    _count: int | None = None
    _items: tuple[MissionItemInt, ...] = ()

    def _begin(self, now: float) -> list[MissionMessage]:
        self._count, self._items = None, ()
        return self._send(MissionRequestList(*self.target), self.timeouts.reply_s, now)

    def _take(self, message: MissionMessage, now: float) -> list[MissionMessage]:
        if isinstance(message, MissionCount) and self._count is None:
            self._count = message.count
            return self._go_on(now)
        if isinstance(message, MissionItemInt) and self._count is not None:
            if message.seq != len(self._items):
                return self._ignore("out_of_sequence")
            self._items += (message,)
            return self._go_on(now)
        if isinstance(message, MissionAck) and message.type != mavlink.MAV_MISSION_ACCEPTED:
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
            acknowledgement = MissionAck(*self.target, mavlink.MAV_MISSION_ACCEPTED)
            return self._settle(Done(self._items), now, [acknowledgement])
        timeouts, request = self.timeouts, MissionRequestInt(*self.target, seq)
        first = self.attempts_left == timeouts.upload_retries
        pause_s = 0.0 if first else timeouts.settle_s / 2**self.attempts_left
        return self._send(request, timeouts.item_s, now, pause_s=pause_s)


class VerifiedUpload:
    """Uploads a mission, downloads it and compares, until they agree, like a `Transfer`.

    Its result has the items as the vehicle holds them.

    Args:
        items: The mission, numbered as the vehicle does.
        target: The vehicle's autopilot.
        source: Ourselves.
        autopilot: Which autopilot it is.
        timeouts: Timeouts and retries; the number of uploads is 1 + `upload_retries`.

    Raises:
        ValueError: As `Upload` does.
    """

    def __init__(
        self,
        items: Sequence[MissionItemInt],
        target: Address,
        source: Address,
        *,
        autopilot: Autopilot,
        timeouts: Timeouts = DEFAULT_TIMEOUTS,
    ) -> None:
        self.result: Done | Failed | None = None
        self.counts: Counter[str] = Counter()
        self._items = tuple(items)
        self._address = target, source
        self._autopilot = autopilot
        self._timeouts = timeouts
        self._attempts_left = timeouts.upload_retries
        self._stage: Upload | Download = self._upload()

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` is due; None if it is not."""
        return self._stage.deadline

    @property
    def writing(self) -> bool:
        """Whether the vehicle's mission changes because it is uploaded."""
        return self.result is None and isinstance(self._stage, Upload)

    def start(self, now: float) -> list[MissionMessage]:
        """Start; returns the messages to send.

        Raises:
            RuntimeError: If it was started before.
        """
        return self._stage.start(now)

    def receive(self, message: object, sender: Address, now: float) -> list[MissionMessage]:
        """Process a message from any sender, and never raise; returns the messages to send."""
        return self._go_on(self._stage.receive(message, sender, now), now)

    def tick(self, now: float) -> list[MissionMessage]:
        """Process the time; returns the messages to send."""
        return self._go_on(self._stage.tick(now), now)

    def cancel(self, now: float) -> list[MissionMessage]:
        """Cancel in any state; returns the messages to send. The result may follow later."""
        return self._go_on(self._stage.cancel(now), now)

    def _upload(self) -> Upload:
        stage = Upload(
            self._items,
            *self._address,
            autopilot=self._autopilot,
            timeouts=dataclasses.replace(self._timeouts, upload_retries=self._attempts_left),
        )
        stage.counts = self.counts
        return stage

    def _download(self) -> Download:
        stage = Download(*self._address, timeouts=self._timeouts)
        stage.counts = self.counts
        return stage

    def _go_on(self, outgoing: list[MissionMessage], now: float) -> list[MissionMessage]:
        """Start the next stage if the current one has ended."""
        ended = self._stage.result
        if ended is None or self.result is not None:
            return outgoing
        if isinstance(self._stage, Upload):
            if isinstance(ended, Failed):
                self.result = ended
                return outgoing
            self._attempts_left = self._stage.attempts_left
            self._stage = self._download()
            return outgoing + self._stage.start(now)
        return outgoing + self._verify(ended, now)

    def _verify(self, read: Done | Failed, now: float) -> list[MissionMessage]:
        """End with the mission that was read back, or upload again."""
        if isinstance(read, Done):
            differs = difference(self._items, read.items, self._autopilot)
            if differs is None:
                self.result = read
                return []
            failed = Failed("mismatch", differs, changed=True)
        else:
            failed = dataclasses.replace(read, changed=True)
        if failed.code not in _RETRIED or self._attempts_left == 0:
            self.result = failed
            return []
        self._attempts_left -= 1
        self.counts[failed.code] += 1
        self._stage = self._upload()
        return self._stage.start(now)


def difference(
    sent: Sequence[MissionItemInt], read: Sequence[MissionItemInt], autopilot: Autopilot
) -> str | None:
    """Return what differs between two missions in one line, or None if they agree.

    Autopilots store less than the messages hold, so a mission that was stored correctly comes back
    changed. Item 0 of ArduPilot is home, which it overwrites. A return has no position. Where NaN
    was sent the autopilot has chosen the value.

    Args:
        sent: The mission that was uploaded.
        read: The mission that was downloaded.
        autopilot: Which autopilot it is.
    """
    if len(sent) != len(read):
        return f"{len(sent)} items were sent, {len(read)} read back"
    for wanted, item in list(zip(sent, read, strict=True))[autopilot.first_item :]:
        for name, most in _tolerances(wanted, autopilot).items():
            value, other = getattr(wanted, name), getattr(item, name)
            if name == "frame":
                # Autopilots return either of two equivalent frames.
                value, other = (INTEGER_FRAMES.get(frame, frame) for frame in (value, other))
            # A NaN that comes back instead of a number is a difference.
            if not abs(value - other) <= most:
                return f"item {wanted.seq}: {name} {value} was sent, {other} read back"
    return None


def mission_digest(read: Sequence[MissionItemInt], autopilot: Autopilot) -> str:
    """Return a digest of a mission that was read back: an unchanged one is read back the same.

    Args:
        read: The mission that was downloaded.
        autopilot: Which autopilot has it. A home that is item 0 does not count.
    """
    values = [[getattr(item, name) for name in _CONTENT] for item in read[autopilot.first_item :]]
    return hashlib.sha256(repr(values).encode()).hexdigest()[:32]


def _tolerances(sent: MissionItemInt, autopilot: Autopilot) -> dict[str, float]:
    """Return the fields of an item to compare, and how far what is read back may differ."""
    tolerances: dict[str, float] = {"seq": 0, "command": 0}
    for name in ("param1", "param2", "param3", "param4"):
        if not math.isnan(getattr(sent, name)):
            tolerances[name] = autopilot.parameter_tolerance
    if sent.frame != FRAME_MISSION and sent.command != NAV_RETURN_TO_LAUNCH:
        tolerances |= {"frame": 0, "x": _MAX_DEGREES, "y": _MAX_DEGREES, "z": _MAX_ALTITUDE_M}
    return tolerances
