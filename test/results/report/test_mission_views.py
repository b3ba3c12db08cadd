# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recorded mission is flown again for its pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.run.mission import Mission
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import mission_views
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.scenario import scenario_frame


def recorded(path: Path, *, seed: int) -> tuple[RecordedMission, Mission]:
    """Return the record of a mission, and the mission at its end."""
    env = parallel_env(grid_size=8, num_drones=3, person_amount=2, sigma=2.0, timestep_limit=12)
    assert isinstance(env, SearchEnv)
    mission = Mission(env, seed)
    log = MissionLog(path, scenario_frame(env.scenario))
    log.write(mission, mission.result)
    moves = np.random.default_rng(seed)
    while not mission.done:
        mission.command_all(moves.integers(0, 5, 3).tolist())
        log.write(mission, mission.advance("hold"))
    log.close()
    (record,) = read_csv(path)
    return record, mission


@pytest.mark.parametrize("seed", range(5))
def test_the_last_view_is_the_mission_at_its_end(tmp_path: Path, seed: int) -> None:
    record, mission = recorded(tmp_path / "mission.csv", seed=seed)
    env = mission.env
    views = list(mission_views(record, belief=True))
    assert len(views) == len(record.steps)
    last = views[-1]
    assert np.array_equal(last.tracks, record.cells.swapaxes(0, 1))
    assert record.persons is not None and record.person_found is not None
    assert np.array_equal(last.persons, record.persons[-1])
    assert np.array_equal(last.found, record.person_found[-1])
    assert record.pos is not None and last.pos == record.pos[-1] == mission.pos
    assert [view.step for view in views] == list(range(len(views)))
    *_, of_map = mission_views(record, belief=False)
    assert of_map.pos is None and np.array_equal(of_map.probability, env.probability)


def test_another_mission_is_refused(tmp_path: Path) -> None:
    record, mission = recorded(tmp_path / "mission.csv", seed=1)
    other = mission.env.scenario.override(drones_positions=((7, 7), (6, 7), (5, 7)))
    moved = replace(record, scenario=other.resolve(mission.env.rules))
    with pytest.raises(ValueError, match="seed 1"):
        list(mission_views(moved, belief=False))
