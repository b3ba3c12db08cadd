# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The step report as a point cloud."""

import array
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sensor_msgs.msg import PointCloud2, PointField

from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import (
    MAX_ACTIONS,
    finds_of,
    make_step_report,
    path_of,
    step_report_dtype,
    step_report_from_message,
    step_report_message,
)

STAMP = to_stamp(13 * 10**9)
LATER = to_stamp(26 * 10**9)

REPORTS = st.integers(1, 9).flatmap(
    lambda actions: hnp.arrays(step_report_dtype(actions), st.integers(0, 6))
)


COLUMNS = {
    "x": [65.0, 975.0, 455.0],
    "y": [65.0, 975.0, 455.0],
    "z": 120.0,
    "run_id": 4_000_000_000,
    "mission": 2,
    "step": 7,
    "col": [0, 7, 3],
    "row": [7, 0, 4],
    "action": [1, 4, -1],
    "reward": [1.0, 10000.1, -100000.0],
    "terminated": np.array([False, True, True]),
    "truncated": [0, 0, 1],
    "found": [False, True, False],
    "held": [True, False, False],
    "all_found": False,
    "action_mask": np.array([[0, 1, 1, 0, 1], [1, 0, 0, 1, 1], [1, 1, 1, 1, 1]], dtype=np.int8),
}


def small_report():
    return make_step_report(COLUMNS)


def test_a_report_has_all_that_it_was_made_of():
    report = small_report()
    assert report["x"].tolist() == [65.0, 975.0, 455.0]
    assert report["y"].tolist() == [65.0, 975.0, 455.0] and report["z"].tolist() == [120.0] * 3
    assert report["step"].tolist() == [7] * 3
    assert report["run_id"].tolist() == [4_000_000_000] * 3
    assert report["mission"].tolist() == [2] * 3
    assert report["col"].tolist() == [0, 7, 3] and report["row"].tolist() == [7, 0, 4]
    assert report["action"].tolist() == [1, 4, -1]
    assert report["reward"].tolist() == [1.0, 10000.1, -100000.0]
    assert report["terminated"].tolist() == [0, 1, 1]
    assert report["truncated"].tolist() == [0, 0, 1]
    assert report["found"].tolist() == [0, 1, 0]
    assert report["held"].tolist() == [1, 0, 0]
    assert report["action_mask"][0].tolist() == [0, 1, 1, 0, 1]


def test_a_report_of_shapes_that_do_not_match_is_refused():
    for field, wrong in (
        ("action", [0, 0]),
        ("reward", [0.0] * 4),
        ("held", [0] * 2),
        ("action_mask", np.ones((4, 5))),
        ("action_mask", np.ones(5)),
    ):
        with pytest.raises(ValueError, match="shape"):
            make_step_report({**COLUMNS, field: wrong})


def test_a_report_of_other_fields_is_refused_by_their_names():
    without = {name: values for name, values in COLUMNS.items() if name != "z"}
    for columns, odd in ((without, "z"), ({**COLUMNS, "colour": 1}, "colour")):
        with pytest.raises(ValueError, match=f"^columns must be x, y, .* unknown: {odd}$"):
            make_step_report(columns)


def test_finds_are_bits_of_looks():
    bits = np.array([0, 1 << 63 | 5, 1 << 32], np.uint64)
    assert finds_of(make_step_report({**COLUMNS, "finds": bits})).tolist() == bits.tolist()


@pytest.mark.slow
@given(REPORTS)
def test_a_report_comes_back_and_is_written_again_with_the_same_bytes(report):
    message = step_report_message(header("map", STAMP), report)
    read = step_report_from_message(message)
    assert read.dtype == report.dtype and read.tobytes() == report.tobytes()
    assert step_report_message(header("map", STAMP), read) == message


@pytest.mark.slow
@given(REPORTS, REPORTS)
def test_a_report_filled_again_equals_a_new_one(old, new):
    filled = step_report_message(header("map", STAMP), old)
    assert step_report_message(header("map", LATER), new, into=filled) is filled
    assert filled == step_report_message(header("map", LATER), new)


def test_the_cloud_is_laid_out_as_point_clouds_are():
    message = step_report_message(header("map", STAMP), small_report())
    assert message.header.frame_id == "map" and message.header.stamp == STAMP
    assert (message.height, message.width) == (1, 3)
    assert message.is_bigendian is False and message.is_dense is True
    assert message.row_step == 3 * message.point_step == len(message.data)
    sizes = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 8: 8}
    end = 0
    for field in message.fields:
        assert field.offset == end
        end += sizes[field.datatype] * field.count
    assert end == message.point_step
    assert [field.name for field in message.fields[:3]] == ["x", "y", "z"]
    assert {field.datatype for field in message.fields[:3]} == {PointField.FLOAT32}
    assert message.fields[-1].name == "action_mask" and message.fields[-1].count == 5


def test_any_reader_of_point_clouds_finds_a_field_by_its_offset():
    message = step_report_message(header("map", STAMP), small_report())
    offsets = {field.name: field.offset for field in message.fields}
    second = bytes(message.data)[message.point_step : 2 * message.point_step]
    assert struct.unpack_from("<fff", second, offsets["x"]) == (975.0, 975.0, 120.0)
    assert struct.unpack_from("<d", second, offsets["reward"]) == (10000.1,)
    assert struct.unpack_from("<hh", second, offsets["col"]) == (7, 0)


@pytest.mark.parametrize("bigendian", [False, True])
def test_a_cloud_that_a_relay_laid_out_anew_is_read_the_same(bigendian):
    report = small_report()
    message = step_report_message(header("map", STAMP), report)
    names = report.dtype.names
    order = ">" if bigendian else "<"
    layout = np.dtype(
        {
            "names": names,
            "formats": [report.dtype[name].newbyteorder(order) for name in names],
            "offsets": [8 + 16 * index for index in reversed(range(len(names)))],
            "itemsize": 256,
        }
    )
    moved = np.zeros(len(report), dtype=layout)
    for name in names:
        moved[name] = report[name]
    for field in message.fields:
        field.offset = layout.fields[field.name][1]
    extra = PointField(name="intensity", offset=0, datatype=PointField.FLOAT32, count=1)
    message.fields = [extra, *reversed(message.fields)]
    message.is_bigendian = bigendian
    message.point_step = 256
    message.row_step = 256 * len(report)
    message.data = array.array("B", moved.tobytes())
    assert step_report_from_message(message).tobytes() == report.tobytes()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m: setattr(m, "height", 2), "^height must be 1, got 2"),
        (lambda m: setattr(m, "width", 4), "^data must be "),
        (lambda m: setattr(m, "row_step", 1), "^data must be "),
        (lambda m: m.data.pop(), "^data must be "),
        (lambda m: setattr(m, "fields", []), "^fields: x is missing"),
        (lambda m: setattr(m.fields[3], "name", "stop"), "^fields: step is missing"),
        (lambda m: setattr(m.fields[3], "name", "x"), "^fields must be .* two of x"),
        (lambda m: setattr(m.fields[0], "datatype", 8), "^fields: datatype of x must be 7, got 8"),
        (lambda m: setattr(m.fields[0], "count", 0), "^fields: count of x must be 1, got 0"),
        (lambda m: setattr(m.fields[0], "offset", 2**32 - 1), "^fields: x .* offset 4294967295"),
        (lambda m: setattr(m.fields[-1], "count", 0), "^num_actions must be .* got 0"),
        (lambda m: setattr(m.fields[-1], "count", 2**32 - 1), "^num_actions .* got 4294967295"),
        (lambda m: setattr(m.fields[-1], "count", 6), "^fields: action_mask must .* got offset"),
        (lambda m: m.fields.append(m.fields[-1]), "^fields must be .* two of action_mask"),
    ],
)
def test_a_malformed_cloud_is_refused_by_its_fault(change, words):
    message = step_report_message(header("map", STAMP), small_report())
    change(message)
    with pytest.raises(ValueError, match=words):
        step_report_from_message(message)


UINT32 = st.integers(0, 64) | st.integers(0, 2**32 - 1)
FIELDS = st.builds(
    PointField,
    name=st.sampled_from([*step_report_dtype(1).names, "intensity"]) | st.text(max_size=5),
    offset=UINT32,
    datatype=st.integers(0, 9),
    count=UINT32,
)


@pytest.mark.slow
@given(st.data())
def test_a_hostile_cloud_is_a_report_or_one_clear_line(data):
    message = step_report_message(header("map", STAMP), small_report())
    for _ in range(data.draw(st.integers(1, 3))):
        kind = data.draw(st.sampled_from(["size", "field", "data", "alien"]))
        if kind == "size":
            name = data.draw(st.sampled_from(["height", "width", "point_step", "row_step"]))
            setattr(message, name, data.draw(UINT32))
        elif kind == "field":
            index = data.draw(st.integers(0, len(message.fields)))
            message.fields = [
                *message.fields[:index],
                data.draw(FIELDS),
                *message.fields[index + 1 :],
            ]
        elif kind == "data":
            message.data = array.array("B", data.draw(st.binary(max_size=120)))
        else:
            message = data.draw(
                st.builds(
                    PointCloud2,
                    width=UINT32,
                    height=UINT32,
                    point_step=UINT32,
                    row_step=UINT32,
                    fields=st.lists(FIELDS, max_size=15),
                )
            )
    try:
        report = step_report_from_message(message)
    except ValueError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert len(report) == message.width
        assert report.dtype == step_report_dtype(report["action_mask"].shape[1])


def test_an_array_that_is_no_report_is_refused():
    for array_ in (
        np.zeros(3),
        np.zeros(3, dtype=[("action_mask", "u1")]),
        np.zeros(3, dtype=[("x", "f4"), ("action_mask", "u1", (5,))]),
    ):
        with pytest.raises(ValueError, match="^report must be "):
            step_report_message(header("map", STAMP), array_)
    for number in (0, MAX_ACTIONS + 1):
        with pytest.raises(ValueError, match="^num_actions must be "):
            step_report_dtype(number)


@given(
    st.integers(2, 17).flatmap(
        lambda points: hnp.arrays(step_report_dtype(0, path_points=points), st.integers(1, 4))
    )
)
def test_a_report_in_metres_comes_back(report):
    back = step_report_from_message(step_report_message(header("map", STAMP), report))
    assert back.dtype == report.dtype and back.tobytes() == report.tobytes()
    assert path_of(back).tobytes() == report["path"].tobytes()


@pytest.mark.parametrize("points", [1, 65, 2**20])
def test_a_report_in_metres_with_a_path_that_is_none_is_refused(points):
    with pytest.raises(ValueError, match="^path must be 2 to 64 points, got "):
        step_report_dtype(0, path_points=points)
    report = np.zeros(2, step_report_dtype(0, path_points=3))
    message = step_report_message(header("map", STAMP), report)
    message.fields[-1].count = 2 * points
    with pytest.raises(ValueError, match="^path must be 2 to 64 points, got "):
        step_report_from_message(message)
