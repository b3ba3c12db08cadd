# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The side of a measurement that runs in a separate process and environment.

It needs only the standard library and does not use this package, so it also runs in the
environments of the published ones. Its requests and answers are one line of JSON each.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import cycle, islice
from typing import Any

MakeWork = Callable[[dict[str, Any]], Iterator[int]]
"""Makes an endless iterator from the set-up that works at each `next` and returns the number of
environment steps."""

LOOK_S = 0.002
"""Time between looks at the clock."""
WARM_UP_S = 0.1


def present_bytes() -> int:
    """Return the memory of this process now, 0 where the system does not state it."""
    try:
        with open("/proc/self/statm") as statm:
            return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


class _Runner:
    def __init__(self, make: MakeWork) -> None:
        self._make = make
        self._work: Iterator[int] = iter(())
        self._between_looks = 1

    def set_up(self, config: dict[str, Any]) -> dict[str, Any]:
        """Make the iterator and let it warm up."""
        self._work = iter(())
        self._work = self._make(config)
        next(self._work)
        self._between_looks = 1
        done, seconds = 0, 0.0
        start = time.perf_counter()
        while seconds < WARM_UP_S:
            next(self._work)
            done += 1
            seconds = time.perf_counter() - start
        self._between_looks = max(1, int(done * LOOK_S / seconds))
        return {}

    def run(self, seconds: float) -> dict[str, Any]:
        """Work for this long; the world continues where the last run ended."""
        steps, elapsed = 0, 0.0
        start = time.perf_counter()
        while elapsed < seconds:
            steps += sum(islice(self._work, self._between_looks))
            elapsed = time.perf_counter() - start
        return {"steps": steps, "seconds": elapsed}

    def memory(self, steps: int) -> dict[str, Any]:
        """Do this many steps; return the memory of the process afterwards."""
        done = 0
        while done < steps:
            done += sum(islice(self._work, self._between_looks))
        return {"steps": done, "present": present_bytes()}


def play_walks(
    env: Any, walks: Iterable[Sequence[dict[str, int]]], reset: Callable[[], object]
) -> Iterator[int]:
    """Yield 1 for every call of `step`; each walk is an episode to its time limit, over and over.

    Args:
        env: An environment after a reset.
        walks: The joint actions of each episode.
        reset: Resets the environment.
    """
    for walk in cycle(walks):
        for call, joint in enumerate(walk, start=1):
            env.step(joint)
            yield 1
            if not env.agents and call < len(walk):
                raise RuntimeError(f"the episode ended after {call} calls of {len(walk)}")
        if env.agents:
            raise RuntimeError(f"the episode goes on after {len(walk)} calls")
        reset()


def serve(make: MakeWork) -> None:
    """Obey the lines on standard input until it ends."""
    # Output of the work must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    runner = _Runner(make)
    for line in sys.stdin:
        request = json.loads(line)
        answer = getattr(runner, request["do"])(*request["with"])
        print(json.dumps(answer), file=answers, flush=True)
