# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""MAVLink 2 as bytes: frames, checksums and signatures, by pymavlink's generated code."""

from __future__ import annotations

import struct
import time
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

__all__ = ["Codec", "Event", "Message", "MissionCurrent", "mavlink"]

Message = Any
"""A message of pymavlink, which has no types."""

# The epoch of signatures, 2015-01-01, in seconds, and their ticks in a second.
_EPOCH_S = 1420070400
_TICKS_PER_S = 100_000


class Event(mavlink.MAVLink_message):
    """EVENT, which PX4 sends where others send a status text; pymavlink does not know it.

    https://mavlink.io/en/services/events.html
    """

    _ID, _CRC_EXTRA = 410, 160

    def __init__(
        self, name: str, time_boot_ms: int, sequence: int, severity: int, arguments: bytes = b""
    ) -> None:
        super().__init__(self._ID, "EVENT")
        number = 0x811C9DC5
        for letter in name.encode():
            number = (number ^ letter) * 0x1000193 % 2**32
        self._payload = struct.pack(
            "<IIHBBB40s", 1 << 24 | number & 0xFFFFFF, time_boot_ms, sequence % 2**16, 0, 0,
            severity << 4 | severity, arguments,
        )  # fmt: skip

    def pack(self, mav: mavlink.MAVLink, force_mavlink1: bool = False) -> bytes:
        data: bytes = self._pack(mav, self._CRC_EXTRA, self._payload, force_mavlink1=force_mavlink1)
        return data


class MissionCurrent(mavlink.MAVLink_mission_current_message):
    """MISSION_CURRENT with its extensions, which pymavlink does not know."""

    def __init__(self, *fields: int, mission_id: int) -> None:
        super().__init__(*fields)
        self.mission_id = mission_id

    def pack(self, mav: mavlink.MAVLink, force_mavlink1: bool = False) -> bytes:
        payload = struct.pack(
            "<HHBBIII", self.seq, self.total, self.mission_state, self.mission_mode,
            self.mission_id, 0, 0,
        )  # fmt: skip
        data: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return data


class Codec(mavlink.MAVLink):
    """Turns messages into bytes and back, for one link.

    Args:
        system: Our system id.
        key: 32 bytes; with it outgoing messages are signed, and unsigned ones are dropped.
    """

    def __init__(self, system: int, key: bytes | None = None) -> None:
        super().__init__(None, srcSystem=system, srcComponent=mavlink.MAV_COMP_ID_AUTOPILOT1)
        self.robust_parsing = True
        if key is not None:
            if len(key) != 32:
                raise ValueError(f"key must have 32 bytes, got {len(key)}")
            self.signing.secret_key = key
            self.signing.sign_outgoing = True
            self._keep_time()

    def encode(self, message: Message) -> bytes:
        """Return the bytes of a message, numbered and signed."""
        if self.signing.sign_outgoing:
            self._keep_time()
        data: bytes = message.pack(self)
        self.seq: int = (self.seq + 1) % 256
        return data

    def decode_all(self, data: bytes, *, datagram: bool) -> list[Message]:
        """Return the messages in the bytes from the link; other bytes are skipped.

        Args:
            data: The bytes.
            datagram: Whether the bytes are whole frames; if not, a frame may continue in the
                next call.
        """
        if datagram:
            self.buf = bytearray()
            self.buf_index = 0
            self.expected_length = mavlink.HEADER_LEN_V1 + 2
        messages = self.parse_buffer(data) or []
        return [message for message in messages if message.get_msgId() in mavlink.mavlink_map]

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:
        """Check a signature; a bad one does not change the stream's timestamp.

        pymavlink stores the stream's timestamp before it verifies the signature, so that one
        forged frame would silence every later genuine one.
        """
        before = dict(self.signing.stream_timestamps)
        good: bool = super().check_signature(msgbuf, srcSystem, srcComponent)
        if not good:
            self.signing.stream_timestamps = before
        return good

    def _keep_time(self) -> None:
        now = int((time.time() - _EPOCH_S) * _TICKS_PER_S)
        self.signing.timestamp = max(self.signing.timestamp, now)
