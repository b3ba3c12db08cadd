# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which messages need to be published: those with new content or a new subscriber."""

from __future__ import annotations

from rclpy.publisher import Publisher


class LastPublished:
    """What was last published, by publisher."""

    def __init__(self) -> None:
        self._seen: dict[Publisher, tuple[object, ...]] = {}

    def is_news(self, publisher: Publisher, *state: object) -> bool:
        """Return whether somebody subscribes who lacks the message of this state."""
        listeners = publisher.get_subscription_count()
        news = listeners > 0 and self._seen.get(publisher) != (listeners, *state)
        self._seen[publisher] = (listeners, *state)
        return news
