# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a whole mission as a point cloud."""

import array

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sensor_msgs.msg import PointCloud2, PointField

from msg_adapters.mission_report import (
    MISSION_REPORT_DTYPE,
    mission_report_from_message,
    mission_report_message,
)
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_dtype

STAMP = to_stamp(13 * 10**9)
SHAPES = st.tuples(st.integers(1, 5), st.integers(1, 4))


def test_its_entries_are_those_of_the_step_reports_up_to_all_found():
    of_step = step_report_dtype(5)
    names = of_step.names[: of_step.names.index("all_found")]
    assert MISSION_REPORT_DTYPE.names == names
    assert [MISSION_REPORT_DTYPE[n] for n in names] == [of_step[n] for n in names]


@pytest.mark.slow
@given(SHAPES.flatmap(lambda shape: hnp.arrays(MISSION_REPORT_DTYPE, shape)))
def test_a_report_comes_back_and_is_written_again_with_the_same_bytes(report):
    message = mission_report_message(header("map", STAMP), report)
    assert (message.height, message.width) == report.shape
    assert message.row_step == message.width * message.point_step
    assert message.header.frame_id == "map" and message.header.stamp == STAMP
    read = mission_report_from_message(message)
    assert read.dtype == report.dtype and read.tobytes() == report.tobytes()
    assert mission_report_message(header("map", STAMP), read) == message


def test_an_array_that_is_no_report_is_refused():
    for report in (np.zeros((2, 3)), np.zeros(3, MISSION_REPORT_DTYPE)):
        with pytest.raises(ValueError, match="^report must be "):
            mission_report_message(header("map", STAMP), report)


UINT32 = st.integers(0, 64) | st.integers(0, 2**32 - 1)
FIELDS = st.builds(
    PointField,
    name=st.sampled_from(MISSION_REPORT_DTYPE.names),
    offset=UINT32,
    datatype=st.integers(0, 9),
    count=UINT32,
)


@given(st.data())
def test_a_hostile_cloud_is_a_report_or_one_clear_line(data):
    report = np.zeros((3, 2), MISSION_REPORT_DTYPE)
    message = mission_report_message(header("map", STAMP), report)
    kind = data.draw(st.sampled_from(["size", "field", "data", "alien"]))
    if kind == "size":
        name = data.draw(st.sampled_from(["height", "width", "point_step", "row_step"]))
        setattr(message, name, data.draw(UINT32))
    elif kind == "field":
        message.fields = [*message.fields, data.draw(FIELDS)][data.draw(st.integers(0, 1)) :]
    elif kind == "data":
        message.data = array.array("B", data.draw(st.binary(max_size=300)))
    else:
        message = PointCloud2(
            height=data.draw(UINT32), width=data.draw(UINT32), point_step=data.draw(UINT32)
        )
    try:
        read = mission_report_from_message(message)
    except ValueError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert read.shape == (message.height, message.width)
