# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission read from its CSV, and what is computed again from its scenario."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flights import Flown, Log, environment, fly

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.run.mission import Mission
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import follow_belief, forecast_for, views
from dsse_ros.results.report.record import RecordedMission, Search, check_limit, is_bag
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.scenario import scenario_frame


def recorded(
    path: Path, rules: str = "paper", **scenario: object
) -> tuple[list[Flown], SearchEnv, list[RecordedMission]]:
    """Fly two missions; return them, their environment and what is read of them."""
    env = environment(rules, **scenario)
    # One that is drawn counts searches.
    env.render_mode = "rgb_array"
    return fly(env, Log(path, env), seeds=(3, 4)), env, read_csv(path)


@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_what_is_read_is_what_was_flown(rules: str, tmp_path: Path) -> None:
    flown, env, missions = recorded(tmp_path / "mission.csv", rules, person_amount=2)
    assert [mission.number for mission in missions] == [1, 2]
    for one, record in zip(flown, missions, strict=True):
        assert record.steps.tolist() == list(range(len(one.results)))
        assert record.times_s.tolist() == [13.0 * k for k in range(len(one.results))]
        for name in ("cells", "rewards", "terminated", "truncated", "found", "held"):
            assert np.array_equal(getattr(record, name), [getattr(r, name) for r in one.results])
        names = [*env.rules.actions, ""]
        assert record.actions.tolist() == [[names[a] for a in r.actions] for r in one.results]
        assert record.pos is not None and record.pos.tolist() == one.pos
        assert record.person_found is not None
        assert record.person_found[-1].tolist() == one.found_persons
        assert (record.grid_size, record.scenario.cell_size) == ((9, 9), 130.0)
        assert record.complete and not record.missing_steps


@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_belief_pos_and_maps_come_out_again(rules: str, tmp_path: Path) -> None:
    _, env, missions = recorded(tmp_path / "mission.csv", rules, person_amount=2)
    forecast = None
    for mission in missions:
        record = mission
        forecast = forecast_for(record, forecast)
        assert forecast is not None
        pos, beliefs = follow_belief(record, forecast, {0, 2})
        assert pos == pytest.approx(record.pos, abs=1e-9)
        assert [belief.sum() for belief in beliefs.values()] == pytest.approx([1, 1], abs=1e-5)
        last = len(record.steps) - 1
        # It compares the map with the probability of each search too.
        shown = views(record, {0, last})[last]
        assert shown.step == last and shown.tracks.shape == (3, last + 1, 2)
    assert shown.searches is not None and shown.searches.any()
    assert np.array_equal(shown.searches, env.view().searches)
    assert np.array_equal(shown.waits, env.view().waits)


def test_what_drones_did_is_read_of_where_they_were_whatever_they_observed(tmp_path: Path) -> None:
    env = environment("v2", position_noise=2.0, grid_size=12, probability_of_detection=0.1)
    path = tmp_path / "mission.csv"
    log = MissionLog(path, scenario_frame(env.scenario), faults=True)
    mission, draw, cells = Mission(env, 3), np.random.default_rng(1), []
    while True:
        log.write(mission, mission.result)
        drones = env.world.drones[0]
        cells.append(np.stack([drones["x"], drones["y"]], axis=1))
        if mission.done:
            break
        mission.command_all(draw.integers(4, 9, 3).tolist())
        mission.advance("hold")
    log.close()
    (record,) = read_csv(path)
    assert np.array_equal(record.cells, cells)
    assert (record.grid_size, record.scenario.cell_size) == ((12, 12), 130)
    forecast = forecast_for(record, None)
    assert forecast is not None
    pos, _ = follow_belief(record, forecast)
    assert pos == pytest.approx(record.pos, abs=1e-9)
    # It compares the map with the probability of each search.
    assert views(record, {len(record.steps) - 1})


def test_a_step_that_comes_too_late_is_no_work(tmp_path: Path) -> None:
    for rules in ("paper", "v2"):
        env = environment(rules, probability_of_detection=0.0, drones_positions=[(4, 4)])
        # All actions are searches: none collides or leaves, and nobody is found.
        fly(env, Log(tmp_path / "mission.csv", env), searching=1.0)
        (record,) = read_csv(tmp_path / "mission.csv")
        assert len(record.steps) == 16
        assert record.searched.sum() == 14
        assert not record.lost.any()


def test_a_mission_that_was_cut_off_is_read_to_its_last_whole_step(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "mission.csv"
    env = environment()
    fly(env, Log(path, env), steps=3)
    content = path.read_bytes()
    (before,) = read_csv(path)
    rows = content.splitlines(keepends=True)
    per_step = 4
    for kept in range(len(content) - len(rows[-1]) - 1, len(content), 7):
        path.write_bytes(content[:kept])
        caplog.clear()
        (record,) = read_csv(path)
        assert caplog.messages[-1].endswith("step 3 lacks lines; it is left out")
        assert record.steps.tolist() == [0, 1, 2] and not record.complete
        assert np.array_equal(record.cells, before.cells[:3])
    path.write_bytes(b"".join(rows[:1]))
    with pytest.raises(FieldError, match="no step of a mission"):
        read_csv(path)
    path.write_bytes(b"".join([*rows[: 1 + per_step], *rows[2 + per_step :]]))
    with pytest.raises(FieldError, match="mission 1: step 1 has different drones or persons"):
        read_csv(path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ((",drone0,3,4,", ",drone0,3,x,"), "mission 1: invalid literal"),
        (
            (",drone0,3,4,", ",drone0,7,4,"),
            "9 cells of 130 m do not have the",
        ),
        (("drone", "plane"), "mission 1: no drone"),
        (("mission,step", "mission,stop"), "is neither the CSV of a mission nor a bag"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused(
    change: tuple[str, str], says: str, tmp_path: Path
) -> None:
    path = tmp_path / "mission.csv"
    env = environment()
    fly(env, Log(path, env), steps=2)
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(FieldError, match=says) as error:
        read_csv(path)
    assert "\n" not in str(error.value)


def test_another_scenario_than_that_of_the_record_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mission.csv"
    recorded(path)

    def other(**fields: Any) -> Search:
        env = environment(**fields)
        return lambda _: SearchDefinition(env.rules, env.scenario)

    for fields, says in (
        ({"grid_size": 12}, "scenario: 12 x 12 cells of 130 m do not have the recorded pos"),
        (
            {"cell_size": 10.0},
            "scenario: 9 x 9 cells of 10 m do not have the",
        ),
        ({"timestep_limit": 2}, "scenario: timestep_limit must allow the recorded"),
    ):
        with pytest.raises(FieldError, match=says):
            read_csv(path, other(**fields))
    record = read_csv(path, other(sigma=5.0))[0]
    with pytest.raises(FieldError, match="scenario: it does not match the record: in step"):
        views(record, {0})
    assert views(replace(record, probabilities=None), {0})


def test_a_bag_is_known_by_its_first_bytes(tmp_path: Path) -> None:
    (tmp_path / "bag").write_bytes(b"\x89MCAP0\r\n...")
    (tmp_path / "log").write_bytes(b"\x89MCAP")
    paths = ("bag", "log", "nothing", ".")
    assert [is_bag(tmp_path / path) for path in paths] == [True, False, False, True]


def changed(path: Path, cells: dict[str, str]) -> Path:
    """Change these columns of the first row of a log."""
    head, first, *rest = path.read_text().splitlines()
    row = dict(zip(head.split(","), first.split(","), strict=True)) | cells
    path.write_text("\n".join([head, ",".join(row.values()), *rest, ""]))
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cells", "says"),
    [
        ({"action": "x" * 100_000}, "at most 1000 characters, got 100000"),
        ({"agent": "drone" + "1" * 996}, "at most 1000 characters, got 1001"),
        ({"action": "x" * 200_000}, "is neither the CSV of a mission nor a bag"),
    ],
)
def test_a_field_takes_no_room_in_all_others(
    cells: dict[str, str], says: str, tmp_path: Path, little_memory: Any
) -> None:
    env = environment(probability_of_detection=0.0)
    fly(env, Log(tmp_path / "mission.csv", env), seeds=tuple(range(1, 30)))
    path = changed(tmp_path / "mission.csv", cells)
    with little_memory(), pytest.raises(FieldError, match=says):
        read_csv(path)


def test_a_grid_that_is_larger_than_it_may_be_is_refused(tmp_path: Path) -> None:
    recorded(tmp_path / "mission.csv")
    says = "mission 1: grid_size must have at most 80 cells, see max_cells, got 9 x 9"
    with pytest.raises(FieldError, match=says):
        read_csv(tmp_path / "mission.csv", max_cells=80)
    assert read_csv(tmp_path / "mission.csv", max_cells=81)


def test_a_step_that_no_mission_of_the_scenario_has_is_refused(tmp_path: Path) -> None:
    _, _, (record, _) = recorded(tmp_path / "mission.csv")
    late = replace(record, steps=np.array([*record.steps[:-1], 10**15]))
    with pytest.raises(FieldError, match=f"must allow the recorded {10**15}, got 14"):
        check_limit(late)


@pytest.mark.parametrize(
    ("cells", "says"),
    [
        ({"pos": "nan"}, "mission 1: pos must be from 0 to 1, got 'nan'"),
        ({"pos": "-0.1"}, "pos must be from 0 to 1, got '-0.1'"),
        ({"action": "jump"}, "action must be empty or one of .*search.*, got 'jump'"),
        ({"action": "search\0"}, r"action must be empty or one of .*, got 'search\\x00'"),
    ],
)
def test_a_value_that_no_step_has_is_refused_with_its_name(
    cells: dict[str, str], says: str, tmp_path: Path
) -> None:
    path = tmp_path / "mission.csv"
    env = environment()
    fly(env, Log(path, env), steps=2)
    lines = path.read_text().splitlines()
    rows = [dict(zip(lines[0].split(","), line.split(","), strict=True)) for line in lines[1:]]
    with_pos = [",".join((row | {"pos": row["pos"] or "0.5"} | cells).values()) for row in rows]
    path.write_text("\n".join([lines[0], *with_pos, ""]))
    with pytest.raises(FieldError, match=says):
        read_csv(path)
