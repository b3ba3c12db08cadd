# SPDX-License-Identifier: Apache-2.0
"""Long status texts, which come in chunks.

https://mavlink.io/en/messages/common.html#STATUSTEXT: chunks of one text have the same id, which
is not 0, and are numbered from 0; the last one is not full. PX4 sends none unless it hears a
ground station on the link, and marks those that it also sends as events by a tab at their end.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dsse_ros.flight.telegrams import StatusText

_CHUNK = 50
_WAIT_S = 2.0
"""How long to wait for a chunk before the others are taken without it."""
_MISSING = "..."
_MAX_OPEN = 8


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
                parts.append(_MISSING)
        return StatusText(self.severity, "".join(parts).rstrip())

    @property
    def whole(self) -> bool:
        last = max(self.chunks)
        return len(self.chunks) == last + 1 and len(self.chunks[last]) < _CHUNK


class StatusTexts:
    """Joins the chunks of one vehicle's texts, in whatever order they come."""

    def __init__(self) -> None:
        self._open: dict[int, _Text] = {}

    def take(self, chunk: StatusText, now: float) -> list[StatusText]:
        """Return the texts that are whole with this chunk, at most one of its own."""
        if chunk.id == 0:
            return [StatusText(chunk.severity, chunk.text.rstrip())]
        done = self._oldest() if len(self._open) >= _MAX_OPEN else []
        text = self._open.setdefault(chunk.id, _Text(chunk.severity, now))
        text.chunks[chunk.chunk_seq] = chunk.text
        if text.whole:
            done.append(self._open.pop(chunk.id).joined())
        return done

    def overdue(self, now: float) -> list[StatusText]:
        """Return the texts for the rest of which nobody waits any longer."""
        late = [number for number, text in self._open.items() if now - text.since_s > _WAIT_S]
        return [self._open.pop(number).joined() for number in late]

    def _oldest(self) -> list[StatusText]:
        return [self._open.pop(next(iter(self._open))).joined()]
