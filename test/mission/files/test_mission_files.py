# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The files of a mission: kept where they are named, and given up with one clear line."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.files.mission_files import MissionFiles, check_files
from dsse_ros.mission.run.mission import Mission
from dsse_ros.results.report.logs import read_csv
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.frames import GridFrame

FRAME = GridFrame(6, 130.0, -24.04, -46.17, 0.0, 120.0)


def new_mission(seed: int = 1) -> Mission:
    return Mission(parallel_env(grid_size=6, num_drones=2, probability_of_detection=0.0), seed)


def files_of(mission: Mission, folder: Path, *, resume: bool = False) -> MissionFiles:
    files = MissionFiles(
        mission,
        record_file=str(folder / "mission.csv"),
        snapshot_file=str(folder / "snapshot"),
        snapshot_every=2,
        resume=resume,
    )
    files.open(FRAME)
    return files


def fly(mission: Mission, files: MissionFiles, steps: int) -> None:
    for _ in range(steps):
        mission.advance("search")
        assert files.record() == files.save() == ""


def test_a_mission_goes_on_from_its_last_snapshot_in_the_same_log(tmp_path: Path) -> None:
    first = new_mission()
    files = files_of(first, tmp_path)
    assert files.record() == files.save() == ""
    fly(first, files, 3)
    files.close()
    again = new_mission(seed=2)
    resumed = files_of(again, tmp_path, resume=True)
    assert (again.seed, again.result.step) == (1, 2)
    assert resumed.record() == ""
    fly(again, resumed, 2)
    resumed.close()
    mission = new_mission()
    alone = files_of(mission, folder_in(tmp_path, "alone"))
    assert alone.record() == ""
    fly(mission, alone, 4)
    alone.close()
    resumed_log, alone_log = (tmp_path / "mission.csv", tmp_path / "alone" / "mission.csv")
    assert resumed_log.read_text() == alone_log.read_text()
    assert read_csv(resumed_log)[0].seed == 1


def folder_in(folder: Path, name: str) -> Path:
    (folder / name).mkdir()
    return folder / name


def test_without_names_nothing_is_kept(tmp_path: Path) -> None:
    mission = new_mission()
    files = MissionFiles(mission, record_file="", snapshot_file="", snapshot_every=1, resume=False)
    files.open(FRAME)
    fly(mission, files, 2)
    files.close()
    assert not list(tmp_path.iterdir())


def test_a_mission_that_cannot_be_resumed_is_refused(tmp_path: Path) -> None:
    (tmp_path / "snapshot").write_bytes(b"no snapshot")
    with pytest.raises(FieldError, match="^snapshot_file: "):
        files_of(new_mission(), tmp_path, resume=True)


def test_what_is_no_regular_file_is_no_snapshot_file(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="^snapshot_file must be a regular file or a new one"):
        check_files(snapshot_file=str(tmp_path))
    with pytest.raises(FieldError, match="^snapshot_file must be .*, got '/dev/null'"):
        check_files(snapshot_file="/dev/null")


def test_a_file_that_grows_may_be_a_device_and_no_folder(tmp_path: Path) -> None:
    check_files(record_file="/dev/null", journal="", snapshot_file="")
    with pytest.raises(FieldError, match="^record_file: .*Is a directory"):
        check_files(record_file=str(tmp_path))


@pytest.mark.parametrize("name", ["snapshot_file", "record_file", "journal"])
def test_where_nothing_can_be_written_no_file_is_taken(tmp_path: Path, name: str) -> None:
    check_files(**{name: str(tmp_path / "new")})
    assert not list(tmp_path.iterdir())
    with pytest.raises(FieldError, match=f"^{name}: .*No such file or directory"):
        check_files(**{name: str(tmp_path / "gone" / "new")})


def test_a_snapshot_that_fails_gets_one_line_and_the_mission_goes_on(tmp_path: Path) -> None:
    mission = new_mission()
    files = files_of(mission, tmp_path)
    fly(mission, files, 1)
    (tmp_path / "snapshot").unlink(missing_ok=True)
    (tmp_path / "snapshot").mkdir()
    mission.advance("search")
    assert files.record() == ""
    assert files.save().startswith(f"snapshot_file: '{tmp_path / 'snapshot'}': ")
    files.close()


def test_a_full_disk_ends_the_log_with_one_line() -> None:
    mission = new_mission()
    files = MissionFiles(
        mission, record_file="/dev/full", snapshot_file="", snapshot_every=1, resume=False
    )
    files.open(FRAME)
    lines = []
    for _ in range(500):
        mission.advance("search")
        lines += [line for line in [files.record()] if line]
        if mission.done:
            break
    files.close()
    assert lines == [
        "record_file: '/dev/full': No space left on device; the rest of the mission is not recorded"
    ]
