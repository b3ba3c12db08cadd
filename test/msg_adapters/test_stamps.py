# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Stamps."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msg_adapters.stamps import header, to_nanoseconds, to_stamp

TIMES_NS = st.integers(0, 2**31 * 10**9 - 1)


@given(TIMES_NS)
def test_a_time_comes_back_from_its_stamp(nanoseconds):
    stamp = to_stamp(nanoseconds)
    assert 0 <= stamp.nanosec < 10**9
    assert to_nanoseconds(stamp) == nanoseconds


@pytest.mark.parametrize("nanoseconds", [-1, 2**31 * 10**9])
def test_a_time_that_no_stamp_holds_is_refused(nanoseconds):
    with pytest.raises(ValueError, match="^nanoseconds must be "):
        to_stamp(nanoseconds)


def test_a_header_has_the_frame_and_the_stamp():
    head = header("map", to_stamp(13 * 10**9))
    assert (head.frame_id, head.stamp.sec) == ("map", 13)
