# SPDX-License-Identifier: Apache-2.0
"""Messages as bytes and back, by pymavlink's generated code; nothing that comes in makes it raise.

Frames: https://mavlink.io/en/guide/serialization.html. The dialect is imported as MAVLink 2, so
that it does not matter what the environment says.
"""

from __future__ import annotations

import re
from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.messages import Address
from dsse_ros.flight.signing import SigningClock
from dsse_ros.flight.status_texts import StatusTexts
from dsse_ros.flight.telegrams import HEARD_NAMES, Heard, Said, StatusText, read, write
from dsse_ros.flight.validation import is_valid

_MARKER = re.compile(rb"[\xfd\xfe]")
_V2 = mavlink.PROTOCOL_MARKER_V2
_HEADER_V2, _HEADER_V1 = mavlink.HEADER_LEN_V2, mavlink.HEADER_LEN_V1
_CHECKSUM = 2
_SIGNATURE = mavlink.MAVLINK_SIGNATURE_BLOCK_LEN
_SIGNED = mavlink.MAVLINK_IFLAG_SIGNED
_STALE_S = 0.5
_HEARD_NUMBERS = frozenset(
    number for number, kind in mavlink.mavlink_map.items() if kind.msgname in HEARD_NAMES
)


class Codec:
    """Turns messages into bytes and back, for one link to one vehicle.

    Args:
        source: Ourselves.
        target: The vehicle's autopilot; nobody else is heard.
        key: 32 bytes; with it everything sent is signed, and nothing else is heard.
        clock: Of the signatures.

    Attributes:
        counts: `accepted`, and why others were not: `bad_data`, `wrong_sender`, `not_needed`,
            `unsigned`, `forged` (or replayed), `invalid` (a place that is none).
        trouble: What is wrong with the vehicle's signatures; empty if nothing is.
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
        self.trouble = ""
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

    def encode(self, said: Said) -> bytes:
        """Return the bytes of a message, numbered and signed."""
        name, fields = write(said)
        message = getattr(mavlink, f"MAVLink_{name.lower()}_message")(**fields)
        mav = self._mav
        if self._signing:
            mav.signing.timestamp = self._clock.now()
        data: bytes = message.pack(mav)
        mav.seq = (mav.seq + 1) % 256
        return bytes(data)

    def decode(self, data: bytes, now: float, *, datagram: bool) -> list[Heard]:
        """Return the messages of the vehicle in what came over the link.

        After bytes that are none, the next frame is found, even one within what looked like
        another.

        Args:
            data: The bytes.
            now: Our time in seconds.
            datagram: Whether a frame cannot go on in what comes next.
        """
        if datagram:
            self._rest = b""
        skip = 1 if self._rest and now - self._rest_since_s > _STALE_S else 0
        if skip:
            # What has not gone on for so long was no frame.
            self.counts["bad_data"] += 1
        buffer = self._rest[skip:] + data
        heard: list[Heard] = [*self._texts.overdue(now)]
        at, end = 0, len(buffer)
        while at < end:
            length = _frame_length(buffer, at)
            if length > end - at and not datagram:
                break
            good = 0 < length <= end - at and _is_frame(buffer, at, length)
            if good:
                message = self._take(buffer[at : at + length])
                if isinstance(message, StatusText):
                    heard += self._texts.take(message, now)
                elif message is not None:
                    heard.append(message)
                at += length
                continue
            self.counts["bad_data"] += 1
            marker = _MARKER.search(buffer, at + 1)
            at = marker.start() if marker else end
        rest = b"" if datagram else buffer[at:]
        if not rest or at or skip:
            self._rest_since_s = now
        self._rest = rest
        return heard

    def forget_rest(self) -> None:
        """Begin anew, as on a new connection."""
        self._rest = b""

    def close(self) -> None:
        """Keep the time of the last signature."""
        if self._signing:
            self._clock.used(self._mav.signing.timestamp)
            self._clock.close()

    def _take(self, frame: bytes) -> Heard | None:
        """Return the message in a frame whose checksum is right."""
        old = frame[0] != _V2
        system, component = (frame[3], frame[4]) if old else (frame[5], frame[6])
        if (system, component) != self._target:
            return self._refuse("wrong_sender")
        number = frame[5] if old else int.from_bytes(frame[7:10], "little")
        if number not in _HEARD_NUMBERS:
            return self._refuse("not_needed")
        signed = not old and bool(frame[2] & _SIGNED)
        if self._signing and not signed:
            self.trouble = "its messages are not signed"
            return self._refuse("unsigned")
        try:
            message = self._mav.decode(bytearray(frame))
            heard = read(message.get_type(), vars(message))
        except mavlink.MAVError:
            if not self._signing:
                return self._refuse("bad_data")
            self.trouble = "its messages are not signed with our key, or are of the past"
            return self._refuse("forged")
        except Exception:
            # Whatever it is that generated code cannot cope with.
            return self._refuse("bad_data")
        if heard is None:
            return self._refuse("bad_data")
        if self._signing:
            self._clock.used(self._mav.signing.timestamp)
        # Whoever signs obeys nobody who does not.
        unanswered = signed and not self._signing
        self.trouble = "its messages are signed, and no key is given" if unanswered else ""
        if not is_valid(heard):
            return self._refuse("invalid")
        self.counts["accepted"] += 1
        return heard

    def _refuse(self, why: str) -> Heard | None:
        self.counts[why] += 1
        return None


class _Mav(mavlink.MAVLink):
    """pymavlink's codec, but for a mistake in its check of signatures."""

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:
        """Check a signature; a bad one leaves no trace.

        pymavlink stores the stream's timestamp before it has verified the signature, so that one
        forged frame would silence every later genuine one.
        """
        before = dict(self.signing.stream_timestamps)
        good: bool = super().check_signature(msgbuf, srcSystem, srcComponent)
        if not good:
            self.signing.stream_timestamps = before
        return good


def _frame_length(buffer: bytes, at: int) -> int:
    """Return how long the frame would be that begins here; 0 for none."""
    marker, left = buffer[at], len(buffer) - at
    if marker == _V2:
        # Of a frame that has only begun, at least the header is to come.
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
    """Whether the bytes are a frame: its checksum is right, or it is of a kind we do not know."""
    v2 = buffer[at] == _V2
    number = int.from_bytes(buffer[at + 7 : at + 10], "little") if v2 else buffer[at + 5]
    kind = mavlink.mavlink_map.get(number)
    end = at + length
    if kind is None:
        # Its checksum cannot be known: it is believed if another frame follows.
        return end == len(buffer) or buffer[end] in (_V2, _V2 + 1)
    if v2 and buffer[at + 2] & _SIGNED:
        end -= _SIGNATURE
    checked = buffer[at + 1 : end - _CHECKSUM] + bytes((kind.crc_extra,))
    crc: int = mavlink.x25crc(checked).crc
    return crc == int.from_bytes(buffer[end - _CHECKSUM : end], "little")
