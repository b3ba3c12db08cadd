# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a bridge knows of its vehicles outlives it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.flight.vehicle_follower import FlightRecord
from dsse_ros.nodes.flight_records import FlightRecords, default_directory

RECORDS = st.dictionaries(
    st.from_regex(r"drone[0-9]{1,3}", fullmatch=True),
    st.builds(FlightRecord, st.booleans(), st.text(max_size=30), st.booleans()),
    max_size=5,
)


@given(records=RECORDS, later=RECORDS)
def test_what_was_kept_is_known_again(
    tmp_path_factory: pytest.TempPathFactory,
    records: dict[str, FlightRecord],
    later: dict[str, FlightRecord],
) -> None:
    folder = tmp_path_factory.mktemp("state") / "new"
    FlightRecords(folder, 7, 1).update(records)
    again = FlightRecords(folder, 7, 1)
    assert {name: again[name] for name in records} == records
    again.update(later)
    third = FlightRecords(folder, 7, 1)
    assert {name: third[name] for name in records | later} == records | later


@pytest.mark.parametrize("other", [(8, 1), (7, 2)])
def test_another_run_or_mission_begins_with_nothing_known(
    tmp_path: Path, other: tuple[int, int]
) -> None:
    FlightRecords(tmp_path, 7, 1).update({"drone0": FlightRecord(took_off=True)})
    assert FlightRecords(tmp_path, *other)["drone0"] == FlightRecord()


@pytest.mark.parametrize("text", ["", "[]", "{", '{"drone0": {}}', '{"drone0": {"took_off": 1}}'])
def test_a_file_of_something_else_is_refused_and_stays(tmp_path: Path, text: str) -> None:
    FlightRecords(tmp_path, 7, 1)
    (file,) = tmp_path.iterdir()
    file.write_text(text)
    with pytest.raises(ValueError, match=file.name):
        FlightRecords(tmp_path, 7, 1)
    assert file.read_text() == text


def test_only_the_latest_hundred_missions_are_kept(tmp_path: Path) -> None:
    for mission in range(105):
        FlightRecords(tmp_path, 7, mission)
        newest = tmp_path / f"flight-{7:010d}-{mission:010d}.json"
        os.utime(newest, (mission, mission))
    missions = sorted(int(file.stem.split("-")[2]) for file in tmp_path.iterdir())
    assert missions == list(range(5, 105))


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(OSError) as caught:
        FlightRecords(blocked / "state", 7, 1)
    assert str(blocked) in str(caught.value.filename)


def test_the_files_are_where_ros_programs_keep_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_HOME", "/somewhere")
    assert default_directory() == Path("/somewhere/dsse_ros")
    monkeypatch.delenv("ROS_HOME")
    assert default_directory() == Path.home() / ".ros" / "dsse_ros"
