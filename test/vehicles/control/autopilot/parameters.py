# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the vehicle, and the parameter protocol: https://mavlink.io/en/services/parameter.html."""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Callable, Mapping

from .channel import Sender
from .wire import Message, mavlink

Number = int | float

# Values sent per tick of the vehicle while a list goes out.
_BURST = 5


class Parameters:
    """Named numbers; whole ones stay whole.

    Args:
        defaults: Their names, types and first values.
        bytewise: Whether a whole number travels as its bits, as PX4 has it, or as its value.
        broadcast: Sends a message over all links.
    """

    def __init__(
        self,
        defaults: Mapping[str, Number],
        *,
        bytewise: bool,
        broadcast: Callable[[Message], None],
    ) -> None:
        self._values = dict(defaults)
        self._names = list(defaults)
        self._bytewise = bytewise
        self._broadcast = broadcast
        self._queue: deque[tuple[Sender, str]] = deque()
        self.changed: Callable[[str], None] = lambda name: None
        self.handlers: dict[str, Callable[[Message, Sender], None]] = {
            "PARAM_REQUEST_LIST": self._list,
            "PARAM_REQUEST_READ": self._read,
            "PARAM_SET": self._set,
        }

    def __getitem__(self, name: str) -> Number:
        return self._values[name]

    def __setitem__(self, name: str, value: Number) -> None:
        self._values[name] = type(self._values[name])(value)
        self.changed(name)

    def tick(self) -> None:
        """Send some more of the requested lists."""
        for _ in range(min(_BURST, len(self._queue))):
            sender, name = self._queue.popleft()
            sender.channel.send(self.message(name))

    def message(self, name: str) -> Message:
        """Return the PARAM_VALUE of a parameter."""
        value = self._values[name]
        whole = isinstance(value, int)
        if whole and self._bytewise:
            (value,) = struct.unpack("<f", struct.pack("<i", value))
        return mavlink.MAVLink_param_value_message(
            name.encode(),
            value,
            mavlink.MAV_PARAM_TYPE_INT32 if whole else mavlink.MAV_PARAM_TYPE_REAL32,
            len(self._names),
            self._names.index(name),
        )

    def _list(self, message: Message, sender: Sender) -> None:
        self._queue.extend((sender, name) for name in self._names)

    def _read(self, message: Message, sender: Sender) -> None:
        name = message.param_id
        if 0 <= message.param_index < len(self._names):
            name = self._names[message.param_index]
        if name in self._values:
            sender.channel.send(self.message(name))

    def _set(self, message: Message, sender: Sender) -> None:
        name = message.param_id
        if name not in self._values:
            return
        value = message.param_value
        if isinstance(self._values[name], int):
            if self._bytewise:
                (value,) = struct.unpack("<i", struct.pack("<f", value))
            if not abs(value) < 2**31:
                return
            self[name] = value
        elif math.isfinite(value):
            self[name] = value
        self._broadcast(self.message(name))
