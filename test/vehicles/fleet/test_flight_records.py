# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a bridge knows of its vehicles outlives it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.vehicles.fleet.custody import Custody
from dsse_ros.vehicles.fleet.flight_record import FlightRecord, inherited
from dsse_ros.vehicles.fleet.flight_records import (
    UNREADABLE,
    FlightRecords,
    default_directory,
)

UP = f"..{os.sep}"
VEHICLES = [(system_id, f"udpin:127.0.0.1:{14550 + system_id}") for system_id in range(1, 6)]
ONE, TWO, THREE = VEHICLES[:3]
NUMBERS = st.integers(0, 2**32 - 1)
RECORDS = st.dictionaries(
    st.sampled_from(range(5)),
    st.builds(
        FlightRecord,
        custody=st.sampled_from(Custody),
        search=st.none() | st.tuples(NUMBERS, NUMBERS),
        flown=st.booleans(),
        launched=st.booleans(),
        lost=st.none() | st.text(max_size=30),
        arm=st.booleans(),
        from_modes=st.lists(st.text(max_size=9), max_size=3).map(tuple),
        ordered=st.lists(st.text(max_size=9), max_size=3).map(tuple),
        end=st.sampled_from([None, "return", "land"]),
        looked=st.integers(-1, 2**63 - 1),
        home=st.none() | st.tuples(st.floats(-90, 90), st.floats(-180, 180), st.floats(-99, 999)),
        items=st.integers(0, 700),
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
    known: dict[int, FlightRecord] = dict.fromkeys(range(5), FlightRecord())
    for one in (records, later, {}):
        kept = FlightRecords(folder, VEHICLES)
        known = {i: inherited(record, fresh=True) for i, record in known.items()}
        assert {i: kept[i] for i in range(5)} == known
        for i, record in one.items():
            kept.update(i, record)
        known |= one
        kept.close()


TAKEN, GROUNDED = FlightRecord(Custody.TAKEN), FlightRecord(Custody.GROUNDED)


def test_a_record_stays_with_its_airframe_whatever_is_connected_there(tmp_path: Path) -> None:
    first, second = "00000000000000aa", "00000000000000bb"
    kept = FlightRecords(tmp_path, [ONE])
    assert kept.identify(0, first) == FlightRecord()
    kept.update(0, TAKEN)
    # Another airframe is put in its place, while the bridge runs and after that.
    assert kept.identify(0, second) == FlightRecord()
    kept.update(0, GROUNDED)
    kept.close()
    again = FlightRecords(tmp_path, [ONE])
    # Until it is known which one is there, it counts as the last one.
    assert again[0] == GROUNDED
    assert again.identify(0, "") == GROUNDED
    assert again.identify(0, first) == TAKEN
    again.close()
    elsewhere = FlightRecords(tmp_path, [(ONE[0], "/dev/ttyUSB0,57600")])
    assert elsewhere[0] == FlightRecord() and elsewhere.identify(0, second) == GROUNDED
    elsewhere.close()


def test_without_an_id_of_its_own_a_record_is_a_connection_s(tmp_path: Path) -> None:
    kept = FlightRecords(tmp_path, [ONE])
    kept.identify(0, "")
    kept.update(0, TAKEN)
    kept.close()
    for connection, known in ((ONE, TAKEN), ((ONE[0], "tcp:127.0.0.1:5760"), FlightRecord())):
        again = FlightRecords(tmp_path, [connection])
        assert again[0] == known
        again.close()


@pytest.mark.parametrize(
    ("boot_id", "ago_s", "fresh"),
    [(None, 5.0, True), (None, 55.0, True), (None, 70.0, False), ("other", 5.0, False),
     (None, -5.0, False)],
)  # fmt: skip
def test_a_flight_is_gone_on_with_by_a_bridge_of_the_same_boot_within_a_minute(
    tmp_path: Path, boot_id: str | None, ago_s: float, fresh: bool
) -> None:
    kept = FlightRecords(tmp_path, [ONE])
    kept.update(0, FlightRecord(Custody.FOLLOWING))
    kept.close()
    (lock,) = tmp_path.glob("*.lock")
    now_boot, _ = lock.read_text().split()
    lock.write_text(f"{boot_id or now_boot} {time.monotonic() - ago_s:.1f}")
    again = FlightRecords(tmp_path, [ONE])
    assert again[0].custody is (Custody.FOLLOWING if fresh else Custody.RELEASED)
    again.close()


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"custody": "flying"}', '{"custody": "free", "search": 1}']
)
def test_a_vehicle_whose_file_makes_no_sense_stays_on_the_ground_until_a_person_looks(
    tmp_path: Path, text: str
) -> None:
    FlightRecords(tmp_path, [ONE]).close()
    (file,) = tmp_path.glob("vehicle-*.json")
    file.write_text(text)
    records = FlightRecords(tmp_path, [ONE, TWO])
    assert records[0] == UNREADABLE and UNREADABLE.custody is Custody.TAKEN
    assert records.unreadable == [file]
    assert records[1] == FlightRecord()


@pytest.mark.parametrize("text", [f'"{UP}{UP}etc"', "[]", "7", f'"1-uid-{UP}x"', "{"])
def test_a_file_that_names_no_record_names_none(tmp_path: Path, text: str) -> None:
    kept = FlightRecords(tmp_path, [ONE])
    kept.identify(0, "00aa")
    kept.close()
    (seen,) = tmp_path.glob("at-*.json")
    seen.write_text(text)
    assert FlightRecords(tmp_path, [ONE])[0] == FlightRecord()


def test_two_bridges_do_not_have_one_vehicle(tmp_path: Path) -> None:
    first = FlightRecords(tmp_path, [ONE, TWO])
    with pytest.raises(FieldError, match="system id 2"):
        FlightRecords(tmp_path, [TWO, THREE])
    FlightRecords(tmp_path, [THREE]).close()
    first.close()
    FlightRecords(tmp_path, [TWO, THREE]).close()


@pytest.mark.slow
def test_a_bridge_that_was_killed_has_no_vehicle_any_more(tmp_path: Path) -> None:
    program = (
        "import os, sys; from pathlib import Path\n"
        "from dsse_ros.vehicles.fleet.flight_records import FlightRecords\n"
        "kept = FlightRecords(Path(sys.argv[1]), [(1, 'tcp:127.0.0.1:5760')])\n"
        "os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False, timeout=60)
    assert done.returncode == -9
    FlightRecords(tmp_path, [ONE]).close()


def test_a_record_that_cannot_be_written_is_written_the_next_time(tmp_path: Path) -> None:
    if os.geteuid() == 0:
        folder = tmp_path / "state"
        records = FlightRecords(folder, [ONE])
        folder.rename(tmp_path / "away")
        with pytest.raises(OSError):
            records.update(0, FlightRecord(Custody.TAKEN))
        (tmp_path / "away").rename(folder)
    else:
        records = FlightRecords(tmp_path, [ONE])
        tmp_path.chmod(0o500)
        with pytest.raises(OSError):
            records.update(0, FlightRecord(Custody.TAKEN))
        tmp_path.chmod(0o700)
        folder = tmp_path
    records.update(0, FlightRecord(Custody.TAKEN))
    records.close()
    assert FlightRecords(folder, [ONE])[0].custody is Custody.TAKEN


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(OSError) as caught:
        FlightRecords(blocked / "state", [ONE])
    assert str(blocked) in str(caught.value.filename)


def test_the_files_are_where_ros_programs_keep_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_HOME", "/somewhere")
    assert default_directory() == Path("/somewhere/dsse_ros")
    monkeypatch.delenv("ROS_HOME")
    assert default_directory() == Path.home() / ".ros" / "dsse_ros"
