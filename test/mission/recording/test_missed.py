# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recording knows what it lacks by the numbers that publishers give their messages."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.recording.missed import Missed


@given(
    runs=st.lists(st.lists(st.booleans(), min_size=1, max_size=20), min_size=1, max_size=3),
    again=st.booleans(),
)
def test_what_was_not_received_is_counted_publisher_after_publisher(
    runs: list[list[bool]], again: bool
) -> None:
    missed, now, lost, pending = Missed(), 0, 0, 0
    for run in runs:
        pending = 0
        for sequence, received in enumerate(run, start=1):
            now += 1
            if not received:
                pending += 1
                continue
            # What is lost after the last message that was received does not show.
            lost, pending = lost + pending, 0
            missed.note("/drone3/pose", sequence, now)
            if again:
                # A latched message comes again with a new subscription.
                missed.note("/drone3/pose", sequence, now)
    found = int(missed.line.partition(" ")[0] or 0)
    # The numbers of a second publisher may go on where those of the first ended.
    assert found == lost or (len(runs) > 1 and found < lost)
    assert not found or missed.line.endswith(f"or lost: /drone<i>/pose {found}")


def test_topics_whose_numbers_show_nothing_are_left_out() -> None:
    missed = Missed()
    missed.note("/clock", 0, 5)
    missed.note("/tf", 9, 5)
    missed.note("/drone0/pose", 3, 5)
    missed.note("/drone1/pose", 3, 5)
    missed.leave_out("/tf")
    missed.leave_out("/drone1/pose")
    missed.note("/tf", 1, 7)
    assert missed.line.endswith("or lost: /drone<i>/pose 2")


def test_the_topics_that_lack_most_are_named() -> None:
    missed = Missed()
    for number in range(9):
        missed.note(f"/topic{number}", number + 1, 0)
    assert missed.line.startswith("36 messages are not in the bag")
    assert missed.line.endswith("lost: " + ", ".join(
        f"/topic{number} {number}" for number in range(8, 2, -1)
    ) + ", and 2 other topics")  # fmt: skip
