# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nanoseconds of simulated time to message stamps and back."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from std_msgs.msg import Header

_SECOND = 1_000_000_000


def to_stamp(nanoseconds: int) -> Time:
    """Return the stamp of a time.

    Raises:
        ValueError: If the time is negative or its seconds do not fit the message's int32.
    """
    seconds, rest = divmod(int(nanoseconds), _SECOND)
    if not 0 <= seconds < 2**31:
        raise ValueError(f"nanoseconds must be 0 to 2**31 s, got {nanoseconds!r}")
    return Time(sec=seconds, nanosec=rest)


def to_nanoseconds(stamp: Time) -> int:
    """Return a stamp in nanoseconds: the inverse of `to_stamp`."""
    return int(stamp.sec) * _SECOND + int(stamp.nanosec)


def header(frame_id: str, stamp: Time) -> Header:
    """Return a message header."""
    return Header(stamp=stamp, frame_id=frame_id)
