# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Other observations through resets of every kind, of one search and of batches."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.wrappers import (
    ALL_POSITIONS,
    FLATTENED,
    IN_MATRIX,
    DiscountedObservations,
    EncodedObservations,
    Encoding,
    RetainedPositions,
    SeenDiscount,
    top_cells,
)

MISSION: dict[str, Any] = {
    "rules": "v2", "grid_size": 6, "num_drones": 2, "timestep_limit": 40, "sigma": 3,
    "person_initial_position": (3, 3),
}  # fmt: skip
STARTS = [(1, 1), (4, 3)]


def joint(rng: np.random.Generator, batch: Any) -> Any:
    return rng.integers(0, 9, (batch.num_envs, 2))


class Observer:
    """What the worlds of a batch observe, lowered where drones have been, in an encoding."""

    def __init__(self, encoding: Encoding) -> None:
        self._encoding, self._seen = encoding, SeenDiscount(5)

    def reset(self, batch: Any, seed: int) -> list[Any]:
        observed, infos = batch.reset(seed=seed, options={"drones_positions": STARTS})
        self._seen.reset(observed["probability"])
        return self.parts(observed, infos)

    def parts(self, observed: Any, infos: Any) -> list[Any]:
        positions = observed["positions"]
        self._seen.see(positions, infos["step"])
        lowered = self._seen.discount(observed["probability"], infos["step"])
        encoded = self._encoding.encode(positions, lowered)
        return list(encoded) if isinstance(encoded, tuple) else [encoded]


@pytest.mark.parametrize(
    "encoding", [ALL_POSITIONS, FLATTENED, IN_MATRIX, top_cells(4)], ids=lambda e: str(e)[:40]
)
def test_worlds_that_are_reset_by_a_mask_observe_a_start_and_the_others_what_they_did(
    encoding: Encoding,
) -> None:
    batch, observer = vector_env(4, **MISSION), Observer(encoding)
    rng = np.random.default_rng(1)
    observer.reset(batch, 3)
    for _ in range(6):
        observed, *_, infos = batch.step(joint(rng, batch))
        before = observer.parts(observed, infos)
    mask = np.array([True, False, False, True])
    assert not infos["over"].any()
    observed, infos = batch.reset(seed=50, options={"reset_mask": mask})
    after = observer.parts(observed, infos)
    start = Observer(encoding).reset(vector_env(4, **MISSION), 50)
    assert infos["step"].tolist() == [0, 6, 6, 0]
    for now, was, begun in zip(after, before, start, strict=True):
        np.testing.assert_array_equal(now[~mask], was[~mask])
        np.testing.assert_array_equal(now[mask], begun[mask])


def test_options_that_are_no_mapping_are_refused() -> None:
    env: Any = parallel_env(**MISSION)
    for wrapped in (
        env,
        vector_env(2, **MISSION),
        EncodedObservations(env, FLATTENED),
        DiscountedObservations(env, 3),
        RetainedPositions(env, STARTS),
    ):
        for options in (5, [1], ""):
            with pytest.raises(FieldError, match=r"^options must be a mapping, got "):
                wrapped.reset(options=options)


def test_a_grid_of_fewer_cells_than_are_asked_for_has_all_of_them() -> None:
    env = EncodedObservations(parallel_env(grid_size=3, num_drones=2), top_cells(10))
    observations, _ = env.reset(seed=0)
    for agent, observed in observations.items():
        assert env.observation_space(agent).contains(observed)
        best = {tuple(cell) for cell in observed[4:].reshape(-1, 2).tolist()}
        assert best == {(x, y) for x in range(3) for y in range(3)}


@given(
    walk=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=12),
    n_steps=st.integers(1, 6),
)
def test_cells_keep_their_probability_but_those_just_flown_over(
    walk: list[tuple[int, int]], n_steps: int
) -> None:
    seen, probability = SeenDiscount(n_steps), np.full((5, 5), 0.04, np.float32)
    seen.reset(probability)
    for step, cell in enumerate(walk):
        seen.see(np.array([cell]), step)
    kept = seen.discount(probability, len(walk) - 1) / 0.04
    for x in range(5):
        for y in range(5):
            visits = [step for step, cell in enumerate(walk) if cell == (x, y)]
            ago = len(walk) - 1 - visits[-1] if visits else n_steps
            expected = 1.0 if len(walk) == 1 else min(ago / n_steps, 1.0)
            assert kept[y, x] == pytest.approx(expected, abs=1e-6)


def test_what_was_seen_in_a_mission_that_was_left_does_not_count_in_the_one_gone_back_to() -> None:
    search = parallel_env(**MISSION, drones_positions=[(0, 0), (1, 2)])
    env = DiscountedObservations(search, 5)
    env.reset(seed=0)
    early = search.snapshot()
    for action in (1, 1, 3, 3, 1, 3):
        env.step(dict.fromkeys(search.agents, action))
    search.restore(early)
    observations, *_ = env.step(dict.fromkeys(search.agents, 8))
    fresh = DiscountedObservations(parallel_env(**MISSION, drones_positions=[(0, 0), (1, 2)]), 5)
    fresh.reset(seed=0)
    expected, *_ = fresh.step(dict.fromkeys(search.agents, 8))
    for agent, (_, probability) in observations.items():
        np.testing.assert_array_equal(probability, expected[agent][1])
