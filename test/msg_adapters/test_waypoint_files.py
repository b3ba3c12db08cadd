# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files of waypoints."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_strategies import ITEMS

from msg_adapters.frames import GridFrame
from msg_adapters.mission_items import FRAME_MISSION, MissionItem
from msg_adapters.track_missions import track_mission
from msg_adapters.waypoint_files import parse_qgc_wpl, qgc_wpl

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 0.0, 120.0)


@given(st.lists(ITEMS, max_size=6))
def test_items_come_back_from_a_file_to_eight_decimals(items):
    read = parse_qgc_wpl(qgc_wpl(items))
    assert len(read) == len(items)
    for item, again in zip(items, read, strict=True):
        assert dataclasses.astuple(again) == pytest.approx(
            dataclasses.astuple(item), rel=0, abs=0.51e-8, nan_ok=True
        )


@given(st.lists(ITEMS, max_size=6))
def test_a_file_that_was_read_is_written_again_with_the_same_bytes(items):
    text = qgc_wpl(items)
    assert qgc_wpl(parse_qgc_wpl(text)) == text


def test_a_file_is_laid_out_as_the_format_says():
    text = qgc_wpl(track_mission(FRAME, [(0, 0)]).numbered("ardupilot"))
    header, *lines = text.removesuffix("\n").split("\n")
    assert header == "QGC WPL 110"
    rows = [line.split("\t") for line in lines]
    assert [len(row) for row in rows] == [12] * 4
    assert [row[0] for row in rows] == ["0", "1", "2", "3"]
    assert [row[1] for row in rows] == ["1", "0", "0", "0"]
    assert [row[3] for row in rows] == ["16", "22", "16", "20"]
    assert {row[11] for row in rows} == {"1"}
    assert all(len(row[column].split(".")[1]) == 8 for row in rows for column in (8, 9))


@pytest.mark.parametrize(
    ("field", "value"), [("lat_deg", 100.0), ("lon_deg", math.nan), ("alt_m", math.inf)]
)
def test_an_item_off_the_earth_is_not_written(field, value):
    with pytest.raises(ValueError, match="^item 1: .* is not allowed"):
        qgc_wpl([MissionItem(16), MissionItem(16, **{field: value})])


@pytest.mark.parametrize("field", ["param1", "param4", "lon_deg"])
def test_an_infinite_number_is_not_written(field):
    with pytest.raises(ValueError, match="^item 0: .* is not allowed; a number$"):
        qgc_wpl([MissionItem(20, FRAME_MISSION, **{field: math.inf})])


def test_numbers_that_are_no_place_are_kept():
    item = MissionItem(178, FRAME_MISSION, param2=8.0, lat_deg=1000.0, lon_deg=-2000.5)
    assert parse_qgc_wpl(qgc_wpl([item])) == [item]


def test_other_writers_files_are_read():
    text = (
        "QGC WPL 110\r\n# a comment\r\n"
        "0\t1\t0\t16\t0\t0\t0\t0\t-24.04\t-46.17\t0\t1\r\n\r\n"
        "1 0 3 16 0.000000 0 0 nan -24.0388 -46.1687 1.2e2 1\r\n"
    )
    home, waypoint = parse_qgc_wpl(text)
    assert (home.frame, home.lat_deg, home.lon_deg) == (0, -24.04, -46.17)
    assert waypoint.alt_m == 120.0 and math.isnan(waypoint.param4)


GOOD = "0\t1\t0\t16\t0\t0\t0\t0\t-24.04\t-46.17\t0\t1"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("0\t1\t0", "3 fields"),
        (GOOD + "\t1", "13 fields"),
        (GOOD.replace("0\t1", "1\t1", 1), "index '1'"),
        (GOOD.replace("\t16\t", "\tfly\t"), "command 'fly'"),
        (GOOD.replace("\t16\t", "\t-1\t"), "command '-1'"),
        (GOOD.replace("\t16\t", "\t" + "9" * 5000 + "\t"), "command '999"),
        (GOOD.replace("-24.04", "-90.1"), "latitude -90.1"),
        (GOOD.replace("-24.04", "nan"), "latitude nan"),
        (GOOD.replace("-46.17", "1e400"), "longitude '1e400'"),
        (GOOD.replace("-46.17", "W46"), "longitude 'W46'"),
    ],
)
def test_a_bad_line_is_refused_by_its_number_and_its_field(line, words):
    with pytest.raises(ValueError, match=f"^line 2: {words}.* not allowed") as error:
        parse_qgc_wpl(f"QGC WPL 110\n{line}\n")
    assert len(str(error.value)) < 200


@pytest.mark.parametrize("text", ["", "QGC WPL 120\n", GOOD, "\x00"])
def test_a_file_of_another_kind_is_refused(text):
    with pytest.raises(ValueError, match="^line 1: .* is not allowed; 'QGC WPL 110' is$"):
        parse_qgc_wpl(text)


FIELD = st.sampled_from(["0", "1", "3", "16", "-24.04", "nan", "1e999", "x"]) | st.text(max_size=4)


@given(st.text() | st.lists(FIELD, min_size=10, max_size=13).map("\t".join))
def test_a_hostile_file_is_items_or_one_clear_line(body):
    try:
        items = parse_qgc_wpl(f"QGC WPL 110\n{body}")
    except ValueError as error:
        assert str(error).startswith("line ") and str(error).isprintable()
    else:
        assert parse_qgc_wpl(qgc_wpl(items)) is not None
