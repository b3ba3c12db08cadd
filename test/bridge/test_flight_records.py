# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a bridge knows of its vehicles outlives it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.bridge.custody import Custody
from dsse_ros.bridge.flight_records import (
    UNREADABLE,
    FlightRecords,
    default_directory,
)
from dsse_ros.bridge.vehicle_custody import FlightRecord
from dsse_ros.scenario.fields import FieldError

IDS = range(1, 6)
NUMBERS = st.integers(0, 2**32 - 1)
RECORDS = st.dictionaries(
    st.sampled_from(IDS),
    st.builds(
        FlightRecord,
        st.sampled_from(Custody),
        st.none() | st.tuples(NUMBERS, NUMBERS),
        st.booleans(),
        st.text(max_size=30),
        st.booleans(),
        st.lists(st.text(max_size=9), max_size=3).map(tuple),
        st.sampled_from(["", "return", "land"]),
    ),
)


# Each example waits for the disk.
@pytest.mark.slow
@settings(max_examples=25)
@given(records=RECORDS, later=RECORDS)
def test_what_was_kept_of_a_vehicle_is_known_again(
    tmp_path_factory: pytest.TempPathFactory,
    records: dict[int, FlightRecord],
    later: dict[int, FlightRecord],
) -> None:
    folder = tmp_path_factory.mktemp("state") / "new"
    known: dict[int, FlightRecord] = dict.fromkeys(IDS, FlightRecord())
    for one in (records, later, {}):
        kept = FlightRecords(folder, IDS)
        assert {system_id: kept[system_id] for system_id in IDS} == known
        kept.update(one)
        known |= one
        kept.close()


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"custody": "flying"}', '{"custody": "free", "search": 1}']
)
def test_a_vehicle_whose_file_makes_no_sense_stays_on_the_ground_until_a_person_looks(
    tmp_path: Path, text: str
) -> None:
    file = tmp_path / "vehicle-1.json"
    file.write_text(text)
    records = FlightRecords(tmp_path, [1, 2])
    assert records[1] == UNREADABLE and UNREADABLE.custody is Custody.TAKEN
    assert records.unreadable == [file]
    assert records[2] == FlightRecord()


def test_two_bridges_do_not_have_one_vehicle(tmp_path: Path) -> None:
    first = FlightRecords(tmp_path, [1, 2])
    with pytest.raises(FieldError, match="system id 2"):
        FlightRecords(tmp_path, [2, 3])
    FlightRecords(tmp_path, [3]).close()
    first.close()
    FlightRecords(tmp_path, [2, 3]).close()


@pytest.mark.slow
def test_a_bridge_that_was_killed_has_no_vehicle_any_more(tmp_path: Path) -> None:
    program = (
        "import os, sys; from pathlib import Path\n"
        "from dsse_ros.bridge.flight_records import FlightRecords\n"
        "kept = FlightRecords(Path(sys.argv[1]), [1]); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False, timeout=60)
    assert done.returncode == -9
    FlightRecords(tmp_path, [1]).close()


def test_a_record_that_cannot_be_written_is_written_the_next_time(tmp_path: Path) -> None:
    if os.geteuid() == 0:
        folder = tmp_path / "state"
        records = FlightRecords(folder, [1])
        folder.rename(tmp_path / "away")
        with pytest.raises(OSError):
            records.update({1: FlightRecord(Custody.TAKEN)})
        (tmp_path / "away").rename(folder)
    else:
        records = FlightRecords(tmp_path, [1])
        tmp_path.chmod(0o500)
        with pytest.raises(OSError):
            records.update({1: FlightRecord(Custody.TAKEN)})
        tmp_path.chmod(0o700)
        folder = tmp_path
    records.update({1: FlightRecord(Custody.TAKEN)})
    records.close()
    assert FlightRecords(folder, [1])[1].custody is Custody.TAKEN


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(OSError) as caught:
        FlightRecords(blocked / "state", [1])
    assert str(blocked) in str(caught.value.filename)


def test_the_files_are_where_ros_programs_keep_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_HOME", "/somewhere")
    assert default_directory() == Path("/somewhere/dsse_ros")
    monkeypatch.delenv("ROS_HOME")
    assert default_directory() == Path.home() / ".ros" / "dsse_ros"
