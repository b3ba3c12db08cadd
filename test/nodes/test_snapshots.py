# SPDX-License-Identifier: Apache-2.0
"""A mission goes on from its snapshot as if nothing had happened."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.nodes.mission import Mission
from dsse_ros.search import Snapshot, SnapshotError, parallel_env

FIELDS: dict[str, Any] = {
    "grid_size": 12,
    "num_drones": 2,
    "vector": (0.2, 0.3),
    "person_initial_position": (9, 2),
    "timestep_limit": 60,
}


def results_equal(one: Any, other: Any) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in vars(one))


@pytest.mark.parametrize("rules", ["paper", "v2"])
def test_a_restored_mission_has_the_same_steps_times_goals_and_tracks(
    rules: str, tmp_path: Path
) -> None:
    mission = Mission(parallel_env(rules=rules, **FIELDS), seed=3)
    mission.reset(4)
    mission.commands.set_goals(0, [(6, 6), (0, 6)])
    mission.commands.set_goals(1, [(3, 9)])
    for _ in range(5):
        mission.advance("repeat")
    mission.snapshot().save(tmp_path / "mission")
    twin = Mission(parallel_env(rules=rules, **FIELDS), seed=99)
    twin.restore(Snapshot.load(tmp_path / "mission"))
    assert results_equal(twin.result, mission.result)
    while not mission.over:
        assert twin.missing == mission.missing
        assert results_equal(twin.advance("repeat"), mission.advance("repeat"))
        assert twin.tracks == mission.tracks and twin.not_found == mission.not_found
    assert twin.over and (twin.seed, twin.number) == (4, 2)
    assert results_equal(twin.reset(5), mission.reset(5))


def test_the_snapshot_of_a_world_alone_is_refused() -> None:
    mission = Mission(parallel_env(**FIELDS), seed=0)
    mission.advance("search")
    before = mission.snapshot().to_bytes()
    with pytest.raises(SnapshotError, match="not of a mission"):
        mission.restore(mission.env.snapshot())
    assert mission.snapshot().to_bytes() == before
