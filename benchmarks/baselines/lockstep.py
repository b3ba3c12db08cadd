# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A peer in lockstep with a node: `sim_node`, or the ping-pong that sends as many messages."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from benchmarks.ros.peer import start, turn
from benchmarks.worker import serve


def make(config: dict[str, Any]) -> Iterator[int]:
    """Yield the number of steps of the other node."""
    return turn(*start(config["node"], config["workload"]))


if __name__ == "__main__":
    serve(make)
