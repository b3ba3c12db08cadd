# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The policies behind the published tables, and the verdict on the figures."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from benchmarks.greedy_batch import GreedyBatch, quicksort_tail, stable_tail
from benchmarks.reference_values import Source
from benchmarks.reproduce import (
    Episodes,
    compare,
    greedy_episodes,
    main,
    summary,
    sweep_actions,
)
from dsse_ros.planners.registry import make_planner
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.entities import DRONES
from dsse_ros.world.scenario.probable_cells import most_probable
from dsse_ros.world.scenario.rules import ACTION_VECTORS, profile

# Few different values, so that there are ties.
VALUES = hnp.arrays(
    np.float32, st.integers(4, 400), elements=st.integers(0, 9).map(lambda n: np.float32(n) / 9)
)
ACTIONS = profile("v2").actions

# Prints the tail of every argsort of the rows of the file given.
SCALAR_ARGSORT = """
import sys
import numpy as np
rows, count = np.load(sys.argv[1]), int(sys.argv[2])
np.save(sys.argv[3], np.argsort(rows, axis=1)[:, -count:])
"""


def tail(sort: Any, values: np.ndarray, count: int) -> list[int]:
    """Indices of the greatest values by a sort, ascending."""
    order = np.empty(len(values), np.int64)
    sort(values, order, count)
    return order[len(values) - count :].tolist()


@given(VALUES, st.integers(1, 4))
@settings(deadline=None)
def test_the_stable_tail_is_that_of_a_stable_sort(values: np.ndarray, count: int) -> None:
    want = np.argsort(values, kind="stable")[len(values) - count :]
    assert tail(stable_tail, values, count) == want.tolist()


@given(VALUES, st.integers(1, 4))
@settings(deadline=None)
def test_the_quicksort_tail_has_the_greatest_values(values: np.ndarray, count: int) -> None:
    found = tail(quicksort_tail, values, count)
    assert len(set(found)) == count
    assert values[found].tolist() == np.sort(values)[len(values) - count :].tolist()


def test_ties_come_as_numpys_own_quicksort_leaves_them(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = rng.integers(0, 30, (300, 1600)).astype(np.float32)
    np.save(tmp_path / "rows.npy", rows)
    # Vector instructions would sort in another order.
    core = np._core if hasattr(np, "_core") else np.core
    disabled = " ".join(core._multiarray_umath.__cpu_dispatch__)
    subprocess.run(
        [sys.executable, "-c", SCALAR_ARGSORT, tmp_path / "rows.npy", "4", tmp_path / "tails.npy"],
        env={**os.environ, "NPY_DISABLE_CPU_FEATURES": disabled},
        check=True,
        timeout=180,
    )
    want = np.load(tmp_path / "tails.npy").tolist()
    assert [tail(quicksort_tail, row, 4) for row in rows] == want


@given(st.integers(0, 2**32), st.integers(0, 60))
@settings(max_examples=10, deadline=None)
def test_with_stable_ties_the_goals_are_those_of_the_planner_of_that_name(
    seed: int, calls: int
) -> None:
    env = parallel_env(
        rules="v2", grid_size=12, drones_positions=[(6, 0), (6, 11), (0, 6), (11, 6)],
        person_initial_position=(6, 6), probability_of_detection=0.0,
    )  # fmt: skip
    observations, infos = env.reset(seed=seed)
    planner = make_planner("greedy", env.rules.actions, seed=0)
    for _ in range(calls):
        observations, _, _, _, infos = env.step(planner(observations, infos))
    goals = [(i % 12, i // 12) for i in tail(stable_tail, env.probability.ravel(), 4)]
    assert goals == most_probable(env.probability, 4)


def test_a_drone_waits_where_another_stands_or_goes() -> None:
    maps = np.zeros((1, 5, 5), np.float32)
    maps[0, 2, 4], maps[0, 2, 3] = 1.0, 0.5
    drones = np.zeros((1, 2), DRONES)
    drones["x"], drones["y"] = [2, 1], [2, 2]
    greedy = GreedyBatch(ACTIONS, "stable")
    names = [ACTIONS[a] for a in greedy(maps, drones, np.ones(1, bool))[0]]
    # The second one may have the cell that the first one leaves, but not the other way round.
    assert names == ["right", "right"]
    names = [ACTIONS[a] for a in greedy(maps, drones[:, ::-1], np.ones(1, bool))[0]]
    assert names == ["search", "right"]


def test_the_sweep_goes_along_the_rows_and_down_at_their_ends_without_a_search() -> None:
    names_by_number = profile("v1").actions
    actions = [names_by_number[a] for a in sweep_actions(names_by_number, 3)]
    row = ["search", "right", "search", "right", "down"]
    back = ["search", "left", "search", "left", "down"]
    assert actions == row + back + row
    names = [names_by_number[a] for a in islice(sweep_actions(names_by_number, 20), 202)]
    cells = np.cumsum([ACTION_VECTORS[name] for name in names], axis=0)
    assert ((cells >= 0) & (cells < 20)).all()
    assert cells[-1].tolist() == [16, 5]


def test_episodes_end_with_a_find_or_after_the_last_step() -> None:
    episodes = greedy_episodes(200, 5, dispersion_inc=0.05, ties="quicksort")
    assert 0 < episodes.found.sum() < 200
    assert (episodes.steps[~episodes.found] == 101).all()
    assert (episodes.rewards[~episodes.found] == 0).all()
    steps = episodes.steps[episodes.found]
    assert episodes.rewards[episodes.found] == pytest.approx(2 - (steps - 1) / 100)


def test_equal_seeds_play_equal_episodes() -> None:
    first, again = (greedy_episodes(50, 7, dispersion_inc=0.1, ties="stable") for _ in range(2))
    assert first.steps.tolist() == again.steps.tolist()


@pytest.mark.parametrize(
    ("found", "steps", "reproduced"),
    [(0.50, 65.0, True), (0.40, 65.0, False), (0.50, 75.0, False)],
)
def test_finds_and_steps_must_both_lie_in_an_interval(
    found: float, steps: float, reproduced: bool
) -> None:
    count = 10_000
    episodes = Episodes(
        np.arange(count) < found * count,
        np.where(np.arange(count) % 2, steps - 35, steps + 35),
        np.zeros(count),
    )
    source = Source("published", 5_000, 0.5018, 65.07)
    assert compare(summary(episodes, when_found=False), (source,)) is reproduced


def test_a_clone_of_mpso_that_is_missing_is_refused_before_anything_is_played(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["--mpso", str(tmp_path), "--out", str(tmp_path)])
    assert "mpso: [Errno 2] No such file or directory" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
