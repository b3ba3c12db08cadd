# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission goes on from its snapshot as if nothing had happened."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rig import Rig, Sim
from std_msgs.msg import String

from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError

FIELDS: dict[str, Any] = {
    "grid_size": 12,
    "num_drones": 2,
    "vector": (0.2, 0.3),
    "person_initial_position": (9, 2),
    "timestep_limit": 60,
}


def results_equal(ours: Any, other: Any) -> bool:
    return all(np.array_equal(getattr(ours, name), getattr(other, name)) for name in vars(ours))


@pytest.mark.parametrize("rules", ["paper", "v2"])
def test_a_restored_mission_has_the_same_steps_times_goals_and_tracks(
    rules: str, tmp_path: Path
) -> None:
    mission = Mission(parallel_env(rules=rules, **FIELDS), seed=3)
    mission.reset(4)
    mission.commands.set_goal(0, (6, 6))
    mission.commands.set_goal(1, (3, 9))
    for _ in range(5):
        mission.advance("repeat")
    mission.snapshot().save(tmp_path / "mission")
    twin = Mission(parallel_env(rules=rules, **FIELDS), seed=99)
    twin.restore(Snapshot.load(tmp_path / "mission"))
    assert results_equal(twin.result, mission.result)
    assert np.array_equal(twin.history, mission.history) and len(twin.history) == 6
    while not mission.done:
        assert twin.missing == mission.missing
        assert results_equal(twin.advance("repeat"), mission.advance("repeat"))
        assert twin.tracks == mission.tracks and twin.pos == mission.pos
    assert np.array_equal(twin.history, mission.history)
    assert twin.done and (twin.seed, twin.number) == (4, 2)
    assert results_equal(twin.reset(5), mission.reset(5))


def test_a_link_to_a_snapshot_stays_a_link(tmp_path: Path) -> None:
    snapshot = Mission(parallel_env(**FIELDS), seed=3).snapshot()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to("elsewhere/mission")
    for _ in range(2):
        snapshot.save(tmp_path / "link")
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "elsewhere" / "mission").read_bytes() == snapshot.to_bytes()


def test_the_snapshot_of_a_world_alone_is_refused() -> None:
    mission = Mission(parallel_env(**FIELDS), seed=0)
    mission.advance("search")
    before = mission.snapshot().to_bytes()
    with pytest.raises(SnapshotError, match="not of a mission"):
        mission.restore(mission.env.snapshot())
    assert mission.snapshot().to_bytes() == before


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("seed", "x"), ("number", 0), ("aborted", 1), ("_stamp_ns", 1e18), ("lost", [2]),
        ("tracks", [[[1, 1]]]), ("tracks", [[], []]), ("tracks", [[[1]], [[1, 2]]]),
        ("commands", []),
        ("commands", {"goals": [], "last": [[0, 9]]}),
        ("commands", {"goals": [[0, [12, 0]]], "last": []}), ("history", np.zeros((1, 2))),
        ("result_actions", np.array([0, 99], np.int8)), ("result_held", np.zeros(3, bool)),
        ("belief_components", np.zeros(3)),
    ],
)  # fmt: skip
def test_a_snapshot_of_no_mission_that_can_be_is_refused_and_nothing_changes(
    part: str, value: Any
) -> None:
    mission = Mission(parallel_env(**FIELDS), seed=3)
    mission.advance("search")
    snapshot = mission.snapshot()
    (snapshot.extra if part in snapshot.extra else snapshot.arrays)[part] = value
    twin = Mission(parallel_env(**FIELDS), seed=9)
    before, other = twin.advance("search"), Mission(parallel_env(**FIELDS), seed=9)
    with pytest.raises(SnapshotError, match="" if part == "belief_components" else part):
        twin.restore(snapshot)
    assert results_equal(twin.result, before)
    other.advance("search")
    for _ in range(5):
        assert results_equal(twin.advance("search"), other.advance("search"))
        assert twin.pos == other.pos and np.array_equal(twin.belief(), other.belief())


def test_parts_that_are_no_arrays_are_refused_on_one_line() -> None:
    snapshot = Mission(parallel_env(**FIELDS), seed=3).snapshot()
    body = snapshot.to_bytes().partition(b"\n")[2]
    for content in (b"", b"\n\n", b"\x93NUMPY\x01\x00v\x00{'descr': (\n", b"no array"):
        stored = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(body)) as old, zipfile.ZipFile(stored, "w") as new:
            for name in old.namelist():
                new.writestr(name, content if name == "history.npy" else old.read(name))
        data = stored.getvalue()
        head = snapshot.to_bytes().split(b" ", 3)[:3]
        line = b" ".join([*head, hashlib.sha256(data).hexdigest().encode()]) + b"\n"
        with pytest.raises(SnapshotError) as error:
            Mission(parallel_env(**FIELDS), seed=3).restore(Snapshot.from_bytes(line + data))
        assert "\n" not in str(error.value)


def fly_to_the_end(sim: Sim) -> None:
    """Actions are those of the step, so that they are the same after a break."""
    while sim.flying:
        step = sim.step_number
        sim.fly(1 + 2 * (step // 2 % 2), 4 if step % 3 else 3)


def test_a_mission_that_was_killed_leaves_the_record_of_one_that_was_not(
    rig: Rig, tmp_path: Path
) -> None:
    fields = {
        "grid_size": 9, "num_drones": 2, "vector": [0.0, 0.0], "timestep_limit": 14,
        "probability_of_detection": 0.0, "seed": 5, "snapshot_every": 5,
    }  # fmt: skip

    def sim(name: str, namespace: str, **more: Any) -> Sim:
        files = {"record_file": f"{tmp_path}/{name}.csv", "snapshot_file": f"{tmp_path}/{name}"}
        return rig.sim(fields | files | more, namespace=namespace)

    fly_to_the_end(sim("whole", "/whole"))
    broken = sim("broken", "/broken")
    while broken.step_number < 8:
        broken.fly(1 + 2 * (broken.step_number // 2 % 2), 4 if broken.step_number % 3 else 3)
    broken.process.kill()
    resumed = sim("broken", "/resumed", resume=True)
    assert resumed.step_number == 5
    fly_to_the_end(resumed)
    assert (tmp_path / "broken.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()


def test_with_auto_reset_a_mission_resumed_at_its_end_is_followed_by_the_next(
    rig: Rig, tmp_path: Path
) -> None:
    fields = {
        "grid_size": 5, "num_drones": 2, "timestep_limit": 3, "probability_of_detection": 0.0,
        "seed": 5, "snapshot_every": 1, "snapshot_file": f"{tmp_path}/last",
    }  # fmt: skip
    fly_to_the_end(rig.sim(fields, namespace="/ended"))
    parameters = fields | {"resume": True, "auto_reset": True}
    qos = {"qos_overrides./next/step_report.publisher.history": "keep_all"}
    sim = rig.sim(parameters | qos, namespace="/next")
    rig.until(lambda: sim.step_number == 0, "the next mission")
    agents = rig.first(String, "/next/agents")
    assert (json.loads(agents.data)["mission"], json.loads(agents.data)["seed"]) == (2, 6)
