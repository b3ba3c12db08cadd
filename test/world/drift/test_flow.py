# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind and current as constants and tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsse_ros.world.drift.flow import components, read_table, seconds, utc


@pytest.mark.parametrize(
    ("kind", "direction", "wanted"),
    [
        ("wind", 0, (0, -1)), ("wind", 90, (-1, 0)),
        ("current", 0, (0, 1)), ("current", 90, (1, 0)), ("current", 225, (-0.5**0.5, -0.5**0.5)),
    ],
)  # fmt: skip
def test_wind_comes_from_and_a_current_flows_toward(kind, direction, wanted) -> None:
    assert components(kind, 1.0, direction) == pytest.approx(wanted, abs=1e-12)


def test_times_are_utc_unless_they_state_an_offset() -> None:
    assert seconds("2026-01-17T14:00Z") == seconds("2026-01-17T14:00:00")
    assert seconds("2026-01-17T11:00-03:00") == seconds("2026-01-17T14:00Z")
    assert utc(seconds("2026-01-17T14:00Z")) == "2026-01-17T14:00:00Z"


def test_a_table_has_its_velocities_over_time(tmp_path: Path) -> None:
    file = tmp_path / "wind.csv"
    file.write_text("time,speed_mps,from\n2026-01-17T12:00Z,5,0\n2026-01-17T13:00Z,10,90\n")
    flow = read_table("wind", file)
    assert flow.times_s.tolist() == [seconds("2026-01-17T12:00Z"), seconds("2026-01-17T13:00Z")]
    assert np.stack([flow.east_mps, flow.north_mps]).squeeze() == pytest.approx(
        np.array([[0, -10], [-5, 0]]), abs=1e-6
    )
    assert flow == read_table("wind", file) and hash(flow) == hash(read_table("wind", file))
    assert flow.covered() == "2026-01-17T12:00:00Z to 2026-01-17T13:00:00Z"


def test_the_columns_of_a_table_are_in_any_order(tmp_path: Path) -> None:
    (tmp_path / "one").write_text("time,speed_mps,from\n2026-01-17T12Z,5,0\n2026-01-17T13Z,9,90\n")
    (tmp_path / "two").write_text("from,time,speed_mps\n0,2026-01-17T12Z,5\n90,2026-01-17T13Z,9\n")
    assert read_table("wind", tmp_path / "one") == read_table("wind", tmp_path / "two")


def test_a_table_of_a_spreadsheet_is_read(tmp_path: Path) -> None:
    lines = "time,speed_mps,from", "2026-01-17T12:00Z,5,0", "2026-01-17T13:00Z,10,90"
    for name, start, end in (("unix", "", "\n"), ("spreadsheet", "\ufeff", "\r\n")):
        (tmp_path / name).write_bytes((start + end.join(lines)).encode())
    assert read_table("wind", tmp_path / "spreadsheet") == read_table("wind", tmp_path / "unix")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "time,speed,from\n",
            "must have the columns time, speed_mps, from, separated by commas, got the line 'time",
        ),
        ("", "must have the columns time, speed_mps, from, separated by commas, got the line ''"),
        ("time,speed_mps,from\n", "must have two or more rows with increasing times"),
        (
            "time,speed_mps,from\n2026-01-17T00Z,5,0\n",
            "must have two or more rows with increasing times",
        ),
        ("time,speed_mps,from\n2026-01-17,5,0\n", "a time with an hour"),
        ("time,speed_mps,from\nnoon,5,0\n", "line 2 must be time,speed_mps,from: a time"),
        ("time;speed_mps;from\n2026-01-17;5;0\n", "got the line 'time;speed_mps;from'"),
        ("time,speed_mps,from\n2026-01-17T00Z,5,3,140\n", "got '2026-01-17T00Z,5,3,140'"),
        ("time,speed_mps,from\n2026-01-17,nan,0\n", "line 2 must be time,"),
        ("time,speed_mps,from\n2026-01-17T00Z,5\n", "line 2 must be time,"),
        (
            "time,speed_mps,from\n2026-01-17T00Z,5,0\n2026-01-17T00Z,5,0\n",
            "must have two or more rows with increasing times",
        ),
    ],
)
def test_another_table_is_refused_in_a_line(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "wind.csv"
    file.write_text(text)
    with pytest.raises(ValueError) as error:
        read_table("wind", file)
    assert message in str(error.value) and "\n" not in str(error.value)
    assert "wind.csv" in str(error.value)


def test_a_missing_table_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="current .*none.csv': No such file"):
        read_table("current", tmp_path / "none.csv")
