# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""No vehicle moves against a person or a failsafe, for events in any order."""

from __future__ import annotations

from collections import Counter

from soak import rigs  # noqa: F401, the paths of the tests' rigs
from soak.row import Figures, Row, Run, zero

# isort: split
from interleavings import Interleaving

EVENTS = 14
"""Events of each run: searches, restarts, persons, failsafes, cuts of links."""


def interleavings(run: Run) -> Figures:
    """Fly random interleavings with the simulated autopilots, and check each message sent."""
    number = run.size(10_000, 20)
    events: Counter[str] = Counter()
    forbidden = 0
    for seed in run.each(range(number), "interleavings"):
        try:
            events += Interleaving(seed).run(EVENTS).counts
        except AssertionError as error:
            forbidden += 1
            print(error, flush=True)
    return {"interleavings": number, "events": events.total(), "forbidden": forbidden}


ROWS = (
    Row(
        "custody",
        "Searches, restarts, persons, failsafes and cuts of links in random order: in 10^4 "
        "interleavings nothing is sent that the table of states forbids",
        interleavings,
        "{interleavings} interleavings of {events} events, {forbidden} with a forbidden message",
        zero("forbidden"),
    ),
)
