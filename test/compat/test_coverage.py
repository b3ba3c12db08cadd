# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The coverage task does what DSSE 1.1.9's does (test/oracles)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.compat import CoverageDroneSwarmSearch

DATA = Path(__file__).parent.parent / "oracles" / "data" / "v2_coverage.json"
EPISODES: list[dict[str, Any]] = json.loads(DATA.read_text(encoding="utf-8"))["episodes"]


def saved(folder: Path, matrix: Any) -> str:
    np.save(folder / "matrix.npy", np.array(matrix))
    return str(folder / "matrix.npy")


def test_some_episodes_cover_all_and_some_do_not() -> None:
    ends = {episode["steps"][-1]["info"]["is_completed"] for episode in EPISODES}
    assert ends == {True, False}


@pytest.mark.parametrize("number", range(len(EPISODES)))
def test_every_reward_flag_and_metric_is_the_packages(number: int, tmp_path: Path) -> None:
    episode = EPISODES[number]
    env = CoverageDroneSwarmSearch(
        drone_amount=episode["drone_amount"],
        timestep_limit=episode["timestep_limit"],
        prob_matrix_path=saved(tmp_path, episode["matrix"]),
    )
    # Twice: the second mission starts as the first one did.
    for _ in range(2):
        observations, infos = env.reset(options={"drones_positions": episode["drones_positions"]})
        agents = list(env.agents)
        first, *steps = episode["steps"]
        np.testing.assert_array_equal(observations["drone0"][1], first["map"])
        assert infos == dict.fromkeys(agents, first["info"])
        for joint, expected in zip(episode["actions"], steps, strict=False):
            observations, rewards, terminated, truncated, infos = env.step(
                dict(zip(agents, joint, strict=True))
            )
            assert [list(observations[agent][0]) for agent in agents] == expected["positions"]
            # Once all is covered the package divides 0 by 0.
            left = np.zeros_like(first["map"]) if expected["map"] is None else expected["map"]
            for agent in agents:
                np.testing.assert_array_equal(observations[agent][1], left)
            assert list(rewards.values()) == expected["rewards"]
            assert list(terminated.values()) == expected["terminated"]
            assert list(truncated.values()) == expected["truncated"]
            assert infos == dict.fromkeys(agents, expected["info"])
        assert env.agents == []
        assert env.step({}) == ({}, {}, {}, {}, {})


def test_a_csv_file_gives_the_same_task_as_npy(tmp_path: Path) -> None:
    matrix = EPISODES[0]["matrix"]
    path = tmp_path / "matrix.csv"
    path.write_text("\n".join(",".join(map(repr, row)) for row in matrix), encoding="utf-8")
    env = CoverageDroneSwarmSearch(prob_matrix_path=str(path))
    np.testing.assert_array_equal(env.probability_matrix.get_matrix(), matrix)
    env.save_matrix(str(tmp_path / "copy.npy"))
    np.testing.assert_array_equal(np.load(tmp_path / "copy.npy"), matrix)


def test_a_matrix_that_cannot_be_written_whole_leaves_the_file_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def disk_full(file: Any, values: Any) -> None:
        file.write(b"part")
        raise OSError(28, "No space left on device")

    env = CoverageDroneSwarmSearch(prob_matrix_path=saved(tmp_path, EPISODES[0]["matrix"]))
    before = (tmp_path / "matrix.npy").read_bytes()
    monkeypatch.setattr(np, "save", disk_full)
    with pytest.raises(OSError, match="No space left"):
        env.save_matrix(str(tmp_path / "matrix.npy"))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before]


@pytest.mark.parametrize(
    "matrix", [[[1.0, 2.0]], [[0.0]], [[-1.0, 2.0], [0.0, 0.0]], [[np.nan]], [1.0]]
)
def test_a_matrix_that_cannot_be_covered_is_refused(matrix: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^prob_matrix_path must be .*, got "):
        CoverageDroneSwarmSearch(prob_matrix_path=saved(tmp_path, matrix))


def test_without_a_file_one_line_says_what_is_missing() -> None:
    with pytest.raises(ValueError, match=r"^prob_matrix_path must be .*, got None"):
        CoverageDroneSwarmSearch()


def test_the_drones_are_shown(tmp_path: Path) -> None:
    env = CoverageDroneSwarmSearch(prob_matrix_path=saved(tmp_path, np.ones((3, 3))))
    env.reset()
    assert isinstance(env.render(), str)
