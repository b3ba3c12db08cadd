# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A snapshot holds everything: what goes on from it goes on as if nothing had happened."""

from __future__ import annotations

import copy
import hashlib
import io
import os
import pickle
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from play import some_actions, started

from dsse_ros.search.environments.aec import aec_env
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.snapshot import MAGIC, VERSION, Snapshot, SnapshotError

MISSION: dict[str, Any] = {
    "grid_size": 10,
    "num_drones": 3,
    "vector": (0.4, -0.3),
    "person_initial_position": (5, 5),
    "timestep_limit": 60,
}


@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_a_restored_mission_goes_on_bit_for_bit(rules: str, tmp_path: Path) -> None:
    env = started(seed=4, rules=rules, **MISSION)
    generator = np.random.default_rng(0)
    for _ in range(6):
        env.step(some_actions(env, generator, careful=True))
    env.snapshot().save(tmp_path / "mission.snapshot")
    twin = parallel_env(rules=rules, **MISSION)
    twin.restore(Snapshot.load(tmp_path / "mission.snapshot"))
    assert np.array_equal(twin.probability, env.probability)
    assert twin.agents == env.agents
    for _ in range(40):
        actions = some_actions(env, generator)
        results = env.step(actions), twin.step(actions)
        assert results[0][1:4] == results[1][1:4]
        assert env.world.state_bytes() == twin.world.state_bytes()
        assert np.array_equal(twin.probability, env.probability)
        if not env.agents:
            env.reset()
            twin.reset()


def test_the_scenario_of_a_mission_is_restored_with_it() -> None:
    options: dict[str, Any] = {"vector": (0.1, 0.2), "drones_positions": [(0, 0), (3, 1), (2, 2)]}
    env = parallel_env(**MISSION)
    env.reset(seed=1, options=options)
    assert env.mission_scenario.vector == options["vector"]
    assert list(env.mission_scenario.drones_positions) == options["drones_positions"]
    twin = parallel_env(**MISSION)
    twin.reset(seed=2)
    assert twin.mission_scenario == twin.scenario
    twin.restore(env.snapshot())
    assert twin.mission_scenario == env.mission_scenario


def test_a_batch_goes_on_too_and_through_its_automatic_resets() -> None:
    batch = vector_env(4, **MISSION)
    batch.reset(seed=0)
    actions = np.random.default_rng(1).integers(0, 5, (80, 4, 3)).astype(np.int8)
    for joint in actions[:20]:
        batch.step(joint)
    twin = vector_env(4, **MISSION)
    twin.world.restore(batch.world.snapshot())
    for joint in actions[20:]:
        batch.step(joint)
        twin.step(joint)
        assert batch.world.state_bytes() == twin.world.state_bytes()
        assert np.array_equal(batch.world.maps, twin.world.maps)


def pickled(value: Any) -> Any:
    return pickle.loads(pickle.dumps(value))


copies = pytest.mark.parametrize("copied", [copy.deepcopy, pickled])


@copies
@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
def test_a_copied_environment_goes_on_alike_and_alone(
    rules: str, copied: Callable[[Any], Any]
) -> None:
    env = started(seed=4, rules=rules, render_mode="ansi", **MISSION)
    generator = np.random.default_rng(0)
    for _ in range(3):
        env.step(some_actions(env, generator, careful=True))
    env.action_space("drone0").seed(7)
    env.tag = "mine"  # type: ignore[attr-defined]
    twin, before = copied(env), env.world.state_bytes()
    assert twin.tag == "mine"
    drawn = [twin.action_space("drone0").sample() for _ in range(9)]
    assert drawn == [env.action_space("drone0").sample() for _ in range(9)]
    script = [some_actions(env, generator, careful=True) for _ in range(12)]
    outcomes = [twin.step(actions)[1:4] for actions in script]
    assert env.world.state_bytes() == before
    assert outcomes == [env.step(actions)[1:4] for actions in script]
    assert twin.world.state_bytes() == env.world.state_bytes()
    assert np.array_equal(twin.probability, env.probability)
    assert twin.render() == env.render()
    assert np.array_equal(twin.view().tracks, env.view().tracks)


@copies
def test_an_environment_that_was_never_reset_can_be_copied(copied: Callable[[Any], Any]) -> None:
    env = parallel_env(**MISSION)
    twin = copied(env)
    assert twin.agents == []
    for each in (env, twin):
        each.reset()
    assert twin.world.state_bytes() == env.world.state_bytes()


@copies
def test_a_copied_batch_goes_on_alike_and_alone(copied: Callable[[Any], Any]) -> None:
    batch = vector_env(5, threads=2, lazy=True, **MISSION)
    batch.reset(seed=0)
    actions = np.random.default_rng(1).integers(0, 5, (30, 5, 3)).astype(np.int8)
    twin = copied(batch)
    before = batch.world.state_bytes()
    maps = [twin.step(joint)[0]["probability"].dense() for joint in actions]
    assert batch.world.state_bytes() == before
    for joint, theirs in zip(actions, maps, strict=True):
        assert np.array_equal(batch.step(joint)[0]["probability"].dense(), theirs)
    assert batch.world.state_bytes() == twin.world.state_bytes()


def test_a_copied_turn_based_environment_goes_on_alone() -> None:
    env = aec_env(**MISSION)
    env.reset(seed=0)
    twin = copy.deepcopy(env)
    position = env.observe(env.agents[0]).tolist()
    for _ in twin.agents:
        twin.step(3)
    assert twin.observe(twin.agents[0]).tolist() != position
    assert env.observe(env.agents[0]).tolist() == position


def test_a_snapshot_does_not_change_with_the_world_it_was_taken_of() -> None:
    env = started(seed=0, **MISSION)
    snapshot = env.snapshot()
    before = snapshot.to_bytes()
    env.step(dict.fromkeys(env.agents, 3))
    assert snapshot.to_bytes() == before


@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
@pytest.mark.parametrize("value", [-1, 10, 10**8, -(2**63), 2**63 - 1])
def test_a_state_that_cannot_be_is_refused_or_survived(rules: str, value: int) -> None:
    env = started(seed=0, rules=rules, **MISSION)
    before = env.world.state_bytes()
    refused = set()
    for kind in ("worlds", "drones", "persons"):
        for name in env.snapshot().arrays[kind].dtype.names or ():
            snapshot = env.snapshot()
            if snapshot.arrays[kind].dtype[name].kind != "i":
                continue
            snapshot.arrays[kind][name] = value
            twin = parallel_env(rules=rules, **MISSION)
            try:
                twin.restore(snapshot)
            except SnapshotError:
                refused.add(name)
                continue
            for _ in range(3):
                twin.advance(np.full(3, twin.rules.actions.index("search"), np.int8))
            twin.reset()
    assert {"datum_x", "circle_y"} <= refused
    assert env.world.state_bytes() == before


@pytest.mark.slow
@settings(max_examples=60)
@given(st.data())
def test_a_damaged_snapshot_is_refused(data: st.DataObject) -> None:
    whole = started(seed=0, **MISSION).snapshot().to_bytes()
    if data.draw(st.booleans()):
        damaged = whole[: data.draw(st.integers(0, len(whole) - 1))]
    else:
        at = data.draw(st.integers(0, len(whole) - 1))
        damaged = bytearray(whole)
        damaged[at] ^= data.draw(st.integers(1, 255))
    with pytest.raises(SnapshotError) as error:
        Snapshot.from_bytes(bytes(damaged))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "change, named",
    [({"grid_size": 11}, "grid_size"), ({"rules": "v1"}, "rules"), ({"sigma": 2}, "sigma")],
)
def test_a_snapshot_of_another_mission_is_refused_and_nothing_changes(
    change: dict[str, Any], named: str
) -> None:
    snapshot = started(seed=0, **MISSION).snapshot()
    other = started(seed=0, **{**MISSION, **change})
    before = other.world.state_bytes()
    with pytest.raises(SnapshotError, match=named):
        other.restore(snapshot)
    assert other.world.state_bytes() == before


def test_a_missing_file_and_a_foreign_one_are_named(tmp_path: Path) -> None:
    (tmp_path / "foreign").write_bytes(b"PK\x03\x04")
    for name, reason in (("none", "No such file"), ("foreign", "not a snapshot")):
        with pytest.raises(SnapshotError, match=f"{name}.*{reason}"):
            Snapshot.load(tmp_path / name)


@pytest.mark.slow
def test_a_writer_killed_at_any_moment_leaves_a_whole_snapshot(tmp_path: Path) -> None:
    path = tmp_path / "mission.snapshot"
    started(seed=0, **MISSION).snapshot().save(path)
    program = (
        "import sys; from dsse_ros import Snapshot\n"
        "snapshot = Snapshot.load(sys.argv[1]); print('ready', flush=True)\n"
        "while True: snapshot.save(sys.argv[1])"
    )
    for pause in (0.0, 0.003, 0.01):
        with subprocess.Popen(
            [sys.executable, "-c", program, str(path)],
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        ) as child:
            assert child.stdout is not None and child.stdout.readline() == b"ready\n"
            with pytest.raises(subprocess.TimeoutExpired):
                child.wait(pause)
            child.kill()
        Snapshot.load(path)


def test_a_snapshot_that_cannot_be_written_leaves_no_file_behind(tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    with pytest.raises(OSError):
        started(seed=0, **MISSION).snapshot().save(tmp_path / "taken")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def signed(parts: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    """A snapshot of these files, with the checksum that belongs to them."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", compression) as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    return headed(content.getvalue())


def headed(body: bytes) -> bytes:
    digest = hashlib.sha256(body).hexdigest()
    return MAGIC + f" {VERSION} {digest}\n".encode() + body


def array_file(array: Any, stated: tuple[int, ...] | None = None) -> bytes:
    """An array as a file, whose header states this shape."""
    file = io.BytesIO()
    header = np.lib.format.header_data_from_array_1_0(array)
    np.lib.format.write_array_header_1_0(file, header | {"shape": stated or array.shape})
    return file.getvalue() + array.tobytes()


def overlapping(count: int) -> bytes:
    """An archive in which many names stand for the same bytes."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("a.npy", array_file(np.zeros(100_000)))
        first = archive.infolist()[0]
        for number in range(count):
            again = copy.copy(first)
            again.filename = f"a{number}.npy"
            archive.filelist.append(again)
    return content.getvalue()


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (
            signed({"a.npy": array_file(np.zeros(10**7))}, zipfile.ZIP_DEFLATED),
            "arrays must be uncompressed",
        ),
        (
            signed({"a.npy": array_file(np.zeros(10), (10**10,))}),
            "a.npy must be 80 bytes, got 80000000000",
        ),
        (
            signed({"a.npy": array_file(np.zeros(10), (3,))}),
            "a.npy must be 80 bytes, got 24",
        ),
        (headed(overlapping(1000)), "arrays must not be larger than the file"),
        (signed({"a.npy": b"no array at all"}), "the magic string is not correct"),
        (signed({"a": b""}), "EOF"),
        (signed({"a.npy": b"\x93NUMPY\x03\x00" + bytes(100)}), "must be 1 or 2, got (3, 0)"),
        (signed({}), "'meta"),
        (headed(b"no archive"), "File is not a zip file"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_archive_that_states_more_than_it_has_is_refused_before_there_is_memory_for_it(
    data: bytes, line: str, tmp_path: Path, little_memory: Any
) -> None:
    path = tmp_path / "mission.snapshot"
    path.write_bytes(data)
    assert len(data) < 2_000_000
    with little_memory(), pytest.raises(SnapshotError) as refusal:
        Snapshot.load(path)
    assert line in str(refusal.value) and "\n" not in str(refusal.value)


def test_a_file_that_does_not_end_is_no_snapshot() -> None:
    with pytest.raises(SnapshotError, match="'/dev/zero': not a snapshot of dsse_ros"):
        Snapshot.load("/dev/zero")
