# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which messages a recording lacks, by the sequence numbers of their publishers."""

from __future__ import annotations

from collections import Counter

from dsse_ros.mission.run.status import counted
from msg_adapters.topics import of_drones

_SHOWN = 6
"""Topics that are named."""


class Missed:
    """Counts the messages of topics with one publisher that were not received.

    These are the ones before its first message, and gaps after it. With several publishers, the
    numbers do not show it.
    """

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, int]] = {}
        self._counts: Counter[str] = Counter()
        self._several: set[str] = set()

    def note(self, topic: str, sequence: int, published_ns: int) -> None:
        """Note a message of a topic.

        Args:
            sequence: Number of the message at its publisher, from 1; 0 if it is unknown.
        """
        if sequence < 1 or topic in self._several:
            return
        last, last_ns = self._last.get(topic, (0, -1))
        if sequence <= last:
            if published_ns <= last_ns:
                # A new subscription receives a latched message again.
                return
            # Another publisher took the place of the last one.
            last = 0
        self._counts[topic] += sequence - last - 1
        self._last[topic] = sequence, published_ns

    def leave_out(self, topic: str) -> None:
        """Leave out a topic that has several publishers."""
        self._several.add(topic)
        self._counts.pop(topic, None)

    @property
    def line(self) -> str:
        """What was missed, in a line; "" for nothing."""
        counts: Counter[str] = Counter()
        for topic, count in (+self._counts).items():
            counts[of_drones(topic)] += count
        if not counts:
            return ""
        shown = [f"{topic} {count}" for topic, count in counts.most_common(_SHOWN)]
        if len(counts) > _SHOWN:
            shown.append(f"and {len(counts) - _SHOWN} other topics")
        number = counts.total()
        return (
            f"{counted(number, 'message')} {'is' if number == 1 else 'are'} not in the bag, "
            f"published before their topics were found, or lost: {', '.join(shown)}"
        )
