# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages as bytes and back, by pymavlink's generated code; it never raises on incoming bytes.

Frames: https://mavlink.io/en/guide/serialization.html. MAVLink 2 is imported explicitly, whatever
pymavlink's environment variables select.
"""

from __future__ import annotations

import copy
import re
from collections import Counter
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.mavlink.events import EventMessage
from dsse_ros.vehicles.mavlink.messages import (
    INCOMING,
    Address,
    Incoming,
    MissionCurrent,
    Outgoing,
    SetPositionTarget,
    StatusText,
    is_valid,
)
from dsse_ros.vehicles.mavlink.signing import SigningClock

_MARKER = re.compile(rb"[\xfd\xfe]")
_V2 = mavlink.PROTOCOL_MARKER_V2
_HEADER_V2, _HEADER_V1 = mavlink.HEADER_LEN_V2, mavlink.HEADER_LEN_V1
_CHECKSUM = 2
_SIGNATURE = mavlink.MAVLINK_SIGNATURE_BLOCK_LEN
_SIGNED = mavlink.MAVLINK_IFLAG_SIGNED
_STALE_S = 0.5
mavlink.mavlink_map |= {kind.id: kind for kind in (EventMessage, MissionCurrent)}
_INCOMING_NUMBERS = frozenset(kind.id for kind in INCOMING)

_CHUNK_LENGTH = 50
_CHUNK_WAIT_S = 2.0
"""How long to wait for the chunks of a text before it is returned without them."""
_MISSING_CHUNK = "..."
_MAX_UNFINISHED = 8


class Codec:
    """Turns messages into bytes and back, for one link to one vehicle.

    Args:
        source: Ourselves.
        target: The vehicle's autopilot; messages of other senders are dropped.
        key: 32 bytes; with it outgoing messages are signed, and unsigned ones are dropped.
        clock: The clock of the signatures.

    Attributes:
        counts: `accepted`, and why others were dropped: `bad_data`, `wrong_sender`, `not_needed`,
            `unsigned`, `forged` (or replayed), `invalid` (coordinates out of range).
        trouble: What is wrong with the vehicle's signatures; None if nothing is.
    """

    def __init__(
        self,
        source: Address,
        target: Address,
        *,
        key: bytes | None = None,
        clock: SigningClock | None = None,
    ) -> None:
        self.counts: Counter[str] = Counter()
        self.trouble: str | None = None
        self._target = target
        self._clock = clock or SigningClock()
        self._mav = _Mav(None, srcSystem=source.system, srcComponent=source.component)
        self._signing = key is not None
        if key is not None:
            self._mav.signing.secret_key = key
            self._mav.signing.sign_outgoing = True
            self._mav.signing.timestamp = self._clock.now()
        self._rest = b""
        self._rest_since_s = 0.0
        self._texts = StatusTexts()

    def encode(self, message: Outgoing) -> bytes:
        """Return the bytes of a message, numbered and signed.

        Raises:
            ValueError: If a coordinate is not allowed.
        """
        if isinstance(message, SetPositionTarget):
            generated = message.message()
        else:
            # Packing changes a message, and vehicles in other threads may share it.
            generated = copy.copy(message)
        mav = self._mav
        if self._signing:
            mav.signing.timestamp = self._clock.now()
        data: bytes = generated.pack(mav)
        mav.seq = (mav.seq + 1) % 256
        return bytes(data)

    def decode(self, data: bytes, now: float, *, datagram: bool) -> list[Incoming]:
        """Return the messages of the vehicle in the bytes from the link.

        After bytes that are not a frame, it finds the next one, even inside what looked like a
        frame.

        Args:
            data: The bytes.
            now: Our time in seconds.
            datagram: Whether the bytes are whole frames; if not, a frame may continue in the
                next call.
        """
        if datagram:
            self._rest = b""
        skip = 1 if self._rest and now - self._rest_since_s > _STALE_S else 0
        if skip:
            # A frame would have continued by now.
            self.counts["bad_data"] += 1
        buffer = self._rest[skip:] + data
        messages: list[Incoming] = [*self._texts.overdue(now)]
        at, end = 0, len(buffer)
        while at < end:
            length = _frame_length(buffer, at)
            if length > end - at and not datagram:
                break
            good = 0 < length <= end - at and _is_frame(buffer, at, length)
            if good:
                message = self._take(buffer[at : at + length])
                if isinstance(message, mavlink.MAVLink_statustext_message):
                    messages += self._texts.take(message, now)
                elif message is not None:
                    messages.append(message)
                at += length
                continue
            self.counts["bad_data"] += 1
            marker = _MARKER.search(buffer, at + 1)
            at = marker.start() if marker else end
        rest = b"" if datagram else buffer[at:]
        if not rest or at or skip:
            self._rest_since_s = now
        self._rest = rest
        return messages

    def forget_rest(self) -> None:
        """Drop a frame that has only begun, as on a new connection."""
        self._rest = b""

    def close(self) -> None:
        """Store the time of the last signature."""
        if self._signing:
            self._clock.used(self._mav.signing.timestamp)
            self._clock.close()

    def _take(self, frame: bytes) -> mavlink.MAVLink_message | None:
        """Return the message in a frame with a valid checksum, None if it is dropped."""
        old = frame[0] != _V2
        system, component = (frame[3], frame[4]) if old else (frame[5], frame[6])
        if (system, component) != self._target:
            return self._drop("wrong_sender")
        number = frame[5] if old else int.from_bytes(frame[7:10], "little")
        if number not in _INCOMING_NUMBERS:
            return self._drop("not_needed")
        signed = not old and bool(frame[2] & _SIGNED)
        if self._signing and not signed:
            self.trouble = "its messages are not signed"
            return self._drop("unsigned")
        try:
            message = self._mav.decode(bytearray(frame))
        except mavlink.MAVError:
            if not self._signing:
                return self._drop("bad_data")
            self.trouble = "its messages are not signed with our key, or are replayed"
            return self._drop("forged")
        except Exception:
            # Generated code raises many types on malformed fields.
            return self._drop("bad_data")
        if self._signing:
            self._clock.used(self._mav.signing.timestamp)
        # A vehicle that signs ignores unsigned messages.
        unanswered = signed and not self._signing
        self.trouble = "its messages are signed, and no key is given" if unanswered else None
        if not is_valid(message):
            return self._drop("invalid")
        self.counts["accepted"] += 1
        return message

    def _drop(self, why: str) -> mavlink.MAVLink_message | None:
        self.counts[why] += 1
        return None


class _Mav(mavlink.MAVLink):
    """pymavlink's codec with a defect in its check of signatures corrected."""

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:
        """Check a signature; a bad one does not change the stream's timestamp.

        pymavlink stores the stream's timestamp before it has verified the signature, so that one
        forged frame would silence every later genuine one.
        """
        before = dict(self.signing.stream_timestamps)
        good: bool = super().check_signature(msgbuf, srcSystem, srcComponent)
        if not good:
            self.signing.stream_timestamps = before
        return good


@dataclass
class _Text:
    severity: int
    since_s: float
    chunks: dict[int, str] = field(default_factory=dict)

    def joined(self) -> StatusText:
        parts = []
        for seq in range(max(self.chunks) + 1):
            if seq in self.chunks:
                parts.append(self.chunks[seq])
            elif seq - 1 in self.chunks or seq == 0:
                parts.append(_MISSING_CHUNK)
        return StatusText(self.severity, "".join(parts).rstrip())

    @property
    def complete(self) -> bool:
        last = max(self.chunks)
        return len(self.chunks) == last + 1 and len(self.chunks[last]) < _CHUNK_LENGTH


class StatusTexts:
    """Joins the chunks of a vehicle's long status texts, in any order.

    https://mavlink.io/en/messages/common.html#STATUSTEXT: chunks of one text have the same id,
    which is not 0, and are numbered from 0; the last one is shorter than 50 characters. PX4 ends
    texts that it also sends as events with a tab.
    """

    def __init__(self) -> None:
        self._unfinished: dict[int, _Text] = {}

    def take(self, chunk: mavlink.MAVLink_statustext_message, now: float) -> list[StatusText]:
        """Return the texts that this chunk completes, or that make room for its own."""
        if chunk.id == 0:
            return [StatusText(chunk.severity, chunk.text.rstrip())]
        done = self._oldest() if len(self._unfinished) >= _MAX_UNFINISHED else []
        text = self._unfinished.setdefault(chunk.id, _Text(chunk.severity, now))
        text.chunks[chunk.chunk_seq] = chunk.text
        if text.complete:
            done.append(self._unfinished.pop(chunk.id).joined())
        return done

    def overdue(self, now: float) -> list[StatusText]:
        """Return, incomplete, the texts whose missing chunks are overdue."""
        late = [
            number
            for number, text in self._unfinished.items()
            if now - text.since_s > _CHUNK_WAIT_S
        ]
        return [self._unfinished.pop(number).joined() for number in late]

    def _oldest(self) -> list[StatusText]:
        return [self._unfinished.pop(next(iter(self._unfinished))).joined()]


def _frame_length(buffer: bytes, at: int) -> int:
    """Return the length of the frame that begins here, 0 if none does."""
    marker, left = buffer[at], len(buffer) - at
    if marker == _V2:
        # The length is not known before the whole header has come.
        if left < 3:
            return _HEADER_V2
        if buffer[at + 2] & ~_SIGNED:
            return 0
        signature = _SIGNATURE if buffer[at + 2] & _SIGNED else 0
        return _HEADER_V2 + buffer[at + 1] + _CHECKSUM + signature
    if marker == _V2 + 1:
        return _HEADER_V1 + _CHECKSUM + (buffer[at + 1] if left > 1 else 0)
    return 0


def _is_frame(buffer: bytes, at: int, length: int) -> bool:
    """Whether the bytes are a frame: its checksum is valid, or it is of an unknown message."""
    v2 = buffer[at] == _V2
    number = int.from_bytes(buffer[at + 7 : at + 10], "little") if v2 else buffer[at + 5]
    kind = mavlink.mavlink_map.get(number)
    end = at + length
    if kind is None:
        # Its checksum cannot be verified: it counts as a frame if another one follows.
        return end == len(buffer) or buffer[end] in (_V2, _V2 + 1)
    if v2 and buffer[at + 2] & _SIGNED:
        end -= _SIGNATURE
    checked = buffer[at + 1 : end - _CHECKSUM] + bytes((kind.crc_extra,))
    crc: int = mavlink.x25crc(checked).crc
    return crc == int.from_bytes(buffer[end - _CHECKSUM : end], "little")
