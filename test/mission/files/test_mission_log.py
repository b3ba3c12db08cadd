# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The CSV of a mission, written and read back."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.files.definition_log import definition_file
from dsse_ros.mission.files.mission_log import COLUMNS, MissionLog
from dsse_ros.mission.run.mission import Mission
from dsse_ros.results.report.logs import read_csv
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from dsse_ros.world.scenario.geodesy import geodetic_to_map

FRAME = GridFrame(
    grid_size=6, cell_size_m=130, origin_lat_deg=-24.04, origin_lon_deg=-46.17,
    origin_alt_m=0, alt_m=120,
)  # fmt: skip
SCENARIO = {
    "grid_size": 6, "num_drones": 3, "person_amount": 2, "sigma": 2.0, "timestep_limit": 9,
    "cell_size": 130.0,
}  # fmt: skip
joints = st.lists(st.lists(st.integers(0, 4), min_size=3, max_size=3), max_size=12)


@pytest.mark.slow
@given(st.integers(0, 2**32), joints)
def test_what_is_read_is_what_was_flown(
    tmp_path_factory: pytest.TempPathFactory, seed: int, actions: list[list[int]]
) -> None:
    path = tmp_path_factory.mktemp("log") / "mission.csv"
    mission = Mission(parallel_env(**SCENARIO), seed + 1)
    log = MissionLog(path, FRAME)
    log.write(mission, mission.result)
    results = [mission.reset(seed)]
    log.write(mission, mission.result)
    for joint in actions:
        if not mission.done:
            mission.command_all(joint)
            results.append(mission.advance("hold"))
            log.write(mission, mission.result)
    log.close()

    _, record = read_csv(path)
    action_names = mission.env.rules.actions
    persons = mission.env.world.persons[0]
    assert np.array_equal(record.cells, [r.cells for r in results])
    assert np.array_equal(record.rewards, [r.rewards for r in results])
    assert np.array_equal(record.found, [r.found for r in results])
    assert record.actions.tolist() == [
        [action_names[a] if a >= 0 else "" for a in r.actions] for r in results
    ]
    assert np.array_equal(record.truncated[-1], results[-1].truncated)
    assert record.complete == (not mission.live)
    assert record.persons is not None and record.person_found is not None
    assert record.persons[-1].tolist() == np.stack([persons["x"], persons["y"]], axis=1).tolist()
    assert np.array_equal(record.person_found[-1], persons["found"])
    assert record.times_s.tolist() == [13.0 * k for k in range(len(results))]
    assert record.pos is not None and record.pos[-1] == mission.pos
    assert record.seed == seed


def test_every_place_is_given_as_cell_metres_and_degrees(tmp_path: Path) -> None:
    mission = Mission(parallel_env(**SCENARIO), 3)
    log = MissionLog(tmp_path / "mission.csv", FRAME)
    mission.command_all([3, 1, 1])
    log.write(mission, mission.advance("hold"))
    log.close()
    with (tmp_path / "mission.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["agent"] for row in rows] == ["drone0", "drone1", "drone2", "person0", "person1"]
    assert tuple(rows[0]) == COLUMNS
    for row in rows:
        place = cell_to_map(FRAME, int(row["col"]), int(row["row"]))
        assert (float(row["east_m"]), float(row["north_m"])) == pytest.approx(place, abs=1e-3)
        east, north, _ = geodetic_to_map(FRAME, float(row["lat_deg"]), float(row["lon_deg"]), 0.0)
        assert (east, north) == pytest.approx(place, abs=1e-3)


def test_each_step_is_on_disk_when_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    mission = Mission(parallel_env(**SCENARIO), 0)
    log = MissionLog(path, FRAME)
    log.write(mission, mission.result)
    assert read_csv(path)[0].cells.shape == (1, 3, 2)
    log.close()


@pytest.mark.parametrize("resume_at", [None, (1, 0)])
def test_a_step_that_is_written_again_is_there_once(
    resume_at: tuple[int, int] | None, tmp_path: Path
) -> None:
    path = tmp_path / "mission.csv"
    mission = Mission(parallel_env(**SCENARIO), 0)
    log = MissionLog(path, FRAME, resume_at=resume_at)
    log.write(mission, mission.result)
    mission.command_all([3, 1, 1])
    log.write(mission, mission.advance("hold"))
    for drone in range(3):
        mission.lose(drone)
        log.write(mission, mission.result)
    log.close()
    (record,) = read_csv(path)
    assert record.cells.shape == (2, 3, 2) and record.complete


@pytest.mark.slow
@given(
    st.integers(0, 2**32), joints, st.integers(0, 30), st.integers(0, 30), st.binary(max_size=40)
)
def test_a_record_that_goes_on_from_a_snapshot_is_that_of_an_unbroken_mission(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    actions: list[list[int]],
    at: int,
    lost: int,
    garbage: bytes,
) -> None:
    """`lost` bytes of the last rows are lost, or there is `garbage` behind them."""
    folder = tmp_path_factory.mktemp("log")
    mission = Mission(parallel_env(**SCENARIO), seed)
    log = MissionLog(folder / "whole.csv", FRAME)
    log.write(mission, mission.result)
    states = [(mission.snapshot(), (folder / "whole.csv").stat().st_size)]
    for joint in [*actions, None, *actions]:
        if joint is None:
            mission.reset(seed + 1)
        elif mission.done:
            continue
        else:
            mission.command_all(joint)
            mission.advance("hold")
        log.write(mission, mission.result)
        states.append((mission.snapshot(), (folder / "whole.csv").stat().st_size))
    log.close()
    content = (folder / "whole.csv").read_bytes()
    snapshot, size = states[at % len(states)]
    later = content[: max(len(content) - lost, size)]
    (folder / "broken.csv").write_bytes(later + (b"" if lost else garbage))

    twin = Mission(parallel_env(**SCENARIO), 0)
    twin.restore(snapshot)
    log = MissionLog(folder / "broken.csv", FRAME, resume_at=(twin.number, twin.result.step))
    log.write(twin, twin.result)
    log.sync()
    log.close()
    assert (folder / "broken.csv").read_bytes() == content[:size]


@pytest.mark.parametrize("text", ["", "mission,st", ",".join(COLUMNS) + "\n"])
def test_a_record_without_steps_is_gone_on_with(text: str, tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    path.write_text(text)
    mission = Mission(parallel_env(**SCENARIO), 0)
    log = MissionLog(path, FRAME, resume_at=(1, 0))
    log.write(mission, mission.result)
    log.close()
    assert read_csv(path)[0].cells.shape == (1, 3, 2)


def test_a_file_that_is_no_record_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "accounts.csv"
    path.write_text("date,amount\n1,2,3\n")
    with pytest.raises(FieldError, match="is not a record of a mission"):
        MissionLog(path, FRAME, resume_at=(1, 0))
    assert path.read_text() == "date,amount\n1,2,3\n"


def test_a_file_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="record_file: .*: Is a directory"):
        MissionLog(tmp_path, FRAME)


def test_a_mission_without_a_belief_has_no_pos(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    mission = Mission(parallel_env(**SCENARIO), 3, belief=False)
    log = MissionLog(path, FRAME)
    log.write(mission, mission.result)
    log.close()
    assert read_csv(path)[0].pos is None


def test_a_log_without_steps_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    MissionLog(path, FRAME).close()
    with pytest.raises(FieldError, match="no step of a mission"):
        read_csv(path)


def test_the_search_and_the_seed_of_each_mission_are_beside_the_log(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    mission = Mission(parallel_env(**SCENARIO), 3)
    log = MissionLog(path, FRAME)
    log.write(mission, mission.result)
    mission.reset(8)
    log.write(mission, mission.result)
    log.close()
    assert [record.seed for record in read_csv(path)] == [3, 8]
    content = definition_file(path).read_bytes()
    resumed = MissionLog(path, FRAME, resume_at=(2, 0))
    resumed.write(mission, mission.result)
    resumed.close()
    assert definition_file(path).read_bytes() == content
    record = read_csv(path)[0]
    assert (record.rules, record.scenario) == (mission.env.rules, mission.env.scenario)


def test_each_further_mission_adds_one_short_line_beside_the_log(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    mission = Mission(parallel_env(**SCENARIO), 3)
    log, sizes = MissionLog(path, FRAME), []
    for seed in range(40):
        mission.reset(seed)
        log.write(mission, mission.result)
        sizes.append(definition_file(path).stat().st_size)
    log.close()
    assert max(np.diff(sizes)) < 50 < sizes[0]
    assert [record.seed for record in read_csv(path)] == list(range(40))


def test_a_log_that_was_cut_off_anywhere_is_read_and_resumed(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    mission = Mission(parallel_env(**SCENARIO), 3)
    log = MissionLog(path, FRAME)
    log.write(mission, mission.result)
    first = path.read_bytes()
    mission.reset(8)
    log.write(mission, mission.result)
    log.close()
    rows, lines = path.read_bytes(), definition_file(path).read_bytes()
    begin = lines.index(b"\n") + 1
    for end in range(begin, len(lines) + 1):
        # The line of a mission is written before its rows.
        definition_file(path).write_bytes(lines[:end])
        path.write_bytes(first)
        assert [record.seed for record in read_csv(path)] == [3]
        resumed = MissionLog(path, FRAME, resume_at=(2, 0))
        resumed.write(mission, mission.result)
        resumed.close()
        assert (path.read_bytes(), definition_file(path).read_bytes()) == (rows, lines)


def test_each_mission_has_the_search_that_it_was(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    env = parallel_env(**SCENARIO)
    mission = Mission(env, 3)
    log, searches = MissionLog(path, FRAME), []
    for vector in ((0.5, 0.25), None, (-1.0, 0.5)):
        mission.reset(4)
        env.reset(seed=4, options={"vector": vector})
        searches.append(env.mission_scenario.vector)
        log.write(mission, mission.result)
    log.close()
    assert len(set(searches)) == 3
    assert [record.scenario.vector for record in read_csv(path)] == searches


def test_a_log_without_the_file_beside_it_is_refused_on_one_line(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    mission = Mission(parallel_env(**SCENARIO), 3)
    log = MissionLog(path, FRAME)
    log.write(mission, mission.result)
    log.close()
    file = definition_file(path)
    text = file.read_text()
    file.unlink()
    with pytest.raises(FieldError, match="mission.csv.jsonl', which describes .* use --scenario$"):
        read_csv(path)
    for wrong in ("", "[]", "{}", text.replace('"grid_size": [6, 6]', '"grid_size": [7, 7]'), "\0"):
        file.write_text(wrong)
        with pytest.raises(FieldError, match="^file: ") as error:
            read_csv(path)
        assert "\n" not in str(error.value)


def test_a_log_that_is_no_file_has_none_beside_it(tmp_path: Path) -> None:
    mission = Mission(parallel_env(**SCENARIO), 3)
    (tmp_path / "null").symlink_to("/dev/null")
    log = MissionLog(tmp_path / "null", FRAME)
    log.write(mission, mission.result)
    log.close()
    assert [path.name for path in tmp_path.iterdir()] == ["null"]
