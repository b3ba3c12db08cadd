# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Records the messages of a node per step, so that the ping-pong can send the same."""

from __future__ import annotations

import base64
import json
import sys
import time
from collections import defaultdict, deque
from itertools import islice
from pathlib import Path
from typing import Any

from benchmarks.ros.peer import REPORT, start, turn

WARM_UP_S = 1.0
RECORD_S = 3.0


def main(node_name: str, workload: str, out: str) -> None:
    """Write the topics of a node with their rates and a typical message of each."""
    kept: defaultdict[str, deque[bytes]] = defaultdict(lambda: deque(maxlen=100))
    executor, peer = start(
        node_name, workload, raw=True, on_message=lambda topic, message: kept[topic].append(message)
    )
    turns = turn(executor, peer)
    _for(WARM_UP_S, turns)
    steps, messages = peer.steps, peer.messages.copy()
    kept.clear()
    seconds = _for(RECORD_S, turns)
    steps = peer.steps - steps
    topics: list[dict[str, Any]] = []
    for topic, (kind, reliability, durability) in peer.topics.items():
        if not kept[topic]:
            continue
        count = peer.messages[topic] - messages[topic]
        typical = sorted(kept[topic], key=len)[len(kept[topic]) // 2]
        topics.append(
            {
                "topic": topic,
                "type": kind,
                "reliability": reliability,
                "durability": durability,
                "per_step": topic == REPORT or count > steps / 2,
                "rate": count / seconds,
                "message": base64.b64encode(typical).decode(),
            }
        )
    Path(out).write_text(json.dumps(topics))


def _for(seconds: float, turns: Any) -> float:
    start_s = time.monotonic()
    while (elapsed := time.monotonic() - start_s) < seconds:
        sum(islice(turns, 20))
    return elapsed


if __name__ == "__main__":
    main(*sys.argv[1:])
