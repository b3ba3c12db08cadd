# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The coverage task: each cell counts once, and the map stands still.

test/compat holds it to the package, reward by reward.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from areas import random_mask, scenario_of
from hypothesis import given, settings
from hypothesis import strategies as st
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test
from play import cells

from dsse_ros.base.fields import FieldError
from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.aec import aec_env
from dsse_ros.search.environments.coverage_task import METRICS
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.world.scenario.rules import profile

RULES = profile("coverage")
SEARCH = RULES.action_set.search
MOVES = RULES.action_set.moves


def covering(matrix: Any, **fields: Any) -> SearchEnv:
    """An environment with this matrix, begun."""
    env = parallel_env(rules="coverage", probability_matrix=matrix, **fields)
    env.reset(seed=0)
    return env


@st.composite
def tasks(draw: st.DrawFn) -> dict[str, Any]:
    """Keyword arguments of `parallel_env`, some matrices with cells that need no visit."""
    columns, rows = size = draw(st.tuples(st.integers(1, 5), st.integers(1, 5)))
    count = columns * rows
    weights = draw(
        st.lists(st.sampled_from([0, 0, 1, 2, 5]), min_size=count, max_size=count).filter(any)
    )
    starts = draw(st.lists(cells(size), min_size=1, max_size=min(3, count), unique=True))
    return {
        "probability_matrix": np.array(weights, float).reshape(rows, columns),
        "drones_positions": starts,
        "timestep_limit": draw(st.integers(1, 40)),
        "probability_of_detection": draw(st.sampled_from([1.0, 0.9, 0.0])),
    }


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(tasks(), st.integers(0, 2**32))
def test_a_cell_is_rewarded_once_and_it_ends_when_all_is_covered_or_at_the_limit(
    task: dict[str, Any], seed: int
) -> None:
    env = parallel_env(rules="coverage", **task)
    observations, infos = env.reset()
    poc = task["probability_matrix"] / task["probability_matrix"].sum()
    limit, drones = task["timestep_limit"], len(task["drones_positions"])
    total = to_cover = int((poc > 0).sum())
    left, places = poc.copy(), list(task["drones_positions"])
    repeated, pos, step = 0, 0.0, 0
    rng = np.random.default_rng(seed)
    while env.agents:
        agents = list(env.agents)
        joint = rng.integers(0, len(MOVES), drones).tolist()
        observations, rewards, terminated, truncated, infos = env.step(
            dict(zip(agents, joint, strict=True))
        )
        step += 1
        time_left, in_time = 1 - step / limit, step < limit
        expected = []
        for i, (dx, dy) in enumerate(MOVES[number] for number in joint):
            x, y = places[i][0] + dx, places[i][1] + dy
            reward = RULES.move if in_time else 0.0
            if in_time and 0 <= x < poc.shape[1] and 0 <= y < len(poc):
                places[i] = (x, y)
                if left[y, x] > 0:
                    to_cover -= 1
                    pos += left[y, x] * task["probability_of_detection"]
                    reward = 1 + time_left * left[y, x] * total
                    left[y, x] = 0.0
                else:
                    repeated += 1
            expected.append(reward)
        if to_cover == 0:
            expected = [total / drones * (1 + time_left)] * drones
        assert [rewards[agent] for agent in agents] == pytest.approx(expected, rel=1e-12)
        assert set(terminated.values()) == {to_cover == 0}
        assert set(truncated.values()) == {not in_time}
        assert bool(env.agents) == (in_time and to_cover > 0)
        for i, agent in enumerate(agents):
            position, probability = observations[agent]
            assert tuple(position.tolist()) == places[i]
            np.testing.assert_array_equal(probability, left.astype(np.float32))
            info = infos[agent]
            assert info["Found"] is (to_cover == 0)
            assert info["coverage_rate"] == (total - to_cover) / total
            assert info["repeated_coverage"] == repeated / total
            assert info["pos"] == pytest.approx(pos, rel=1e-12)
    assert step <= limit and "found_person" not in infos["drone0"]


def test_every_world_of_a_batch_is_the_single_environment_bit_for_bit() -> None:
    batch, rng = 5, np.random.default_rng(3)
    fields: dict[str, Any] = {
        "rules": "coverage", "probability_matrix": rng.integers(0, 4, (6, 6)),
        "num_drones": 3, "timestep_limit": 25,
    }  # fmt: skip
    dense = vector_env(batch, threads=2, **fields)
    lazy = vector_env(batch, lazy=True, **fields)
    single = [parallel_env(**fields) for _ in range(batch)]
    for env in (dense, lazy):
        env.reset(seed=0)
    for one in single:
        one.reset()
    for _ in range(80):
        actions = rng.integers(0, len(MOVES), (batch, 3)).astype(np.int8)
        observed, rewards, terminated, truncated, infos = dense.step(actions)
        lazily = lazy.step(actions)[0]["probability"]
        assert lazily.dense().tobytes() == observed["probability"].tobytes()
        for b, one in enumerate(single):
            if not one.agents:
                # As the batch has it: the next step is a reset.
                one.reset()
                assert not rewards[b].any() and not (terminated | truncated)[b].any()
            else:
                _, of_one, *_, its_infos = one.step(
                    dict(zip(one.agents, actions[b].tolist(), strict=True))
                )
                assert list(of_one.values()) == rewards[b].tolist()
                assert its_infos["drone0"]["Found"] == infos["Found"][b]
                for name in METRICS:
                    assert its_infos["drone0"][name] == infos[name][b]
            assert observed["probability"][b].tobytes() == one.probability.tobytes()
            assert observed["positions"][b].tolist() == one.positions.tolist()


@pytest.mark.slow
def test_pettingzoo_accepts_it() -> None:
    fields: dict[str, Any] = {"rules": "coverage", "grid_size": 8, "num_drones": 3}
    parallel_api_test(parallel_env(**fields), num_cycles=200)
    parallel_seed_test(partial(parallel_env, **fields))
    api_test(aec_env(**fields), num_cycles=200)


@pytest.mark.slow
def test_without_a_file_it_is_where_the_persons_are_by_then() -> None:
    env = parallel_env(rules="coverage", vector=(0.1, 0.05), pre_search_minutes=5)
    belief = Belief(Forecast(env.scenario, RULES)).poc()
    # Cells that a particle of 50000 would not be in are left out.
    expected = np.where(belief < 2e-5, 0.0, belief)
    observed = env.reset(seed=1)[0]["drone0"][1]
    np.testing.assert_allclose(observed, expected / expected.sum(), rtol=1e-6)
    assert np.count_nonzero(observed) > 50
    earlier = parallel_env(rules="coverage", vector=(0.1, 0.05)).reset(seed=1)[0]["drone0"][1]
    # Mean column: it has drifted to the east since.
    assert observed.sum(axis=0) @ np.arange(20) > earlier.sum(axis=0) @ np.arange(20) + 1


def test_the_map_stands_still_until_it_is_visited() -> None:
    env = parallel_env(rules="coverage", vector=(1.0, 0.5), num_drones=2)
    before = env.reset(seed=1)[0]["drone0"][1].copy()
    seen = np.zeros(before.shape, bool)
    for _ in range(30):
        env.step(dict.fromkeys(env.agents, RULES.actions.index("down_right")))
        seen[tuple(env.positions.T[::-1])] = True
    np.testing.assert_array_equal(env.probability, np.where(seen, 0, before))


@pytest.mark.parametrize("seed", range(4))
def test_nothing_outside_the_area_is_to_be_covered(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = random_mask(rng, 9)
    fields = scenario_of(mask, rng, 2)
    env = covering(rng.random((9, 9)), **fields)
    assert not env.probability[~mask].any()
    assert env.probability[mask].all()
    assert env.probability.sum(dtype=float) == pytest.approx(1.0, abs=1e-6)
    env = parallel_env(fields, rules="coverage")
    env.reset(seed=1)
    assert not env.probability[~mask].any()


def test_cells_below_the_least_probability_need_no_visit() -> None:
    matrix = np.array([[0.0, 0.0995], [5e-4, 0.9]])
    env = covering(matrix, cover_min_probability=1e-3, drones_positions=[(0, 0)])
    assert np.count_nonzero(env.probability) == 2
    env.step({"drone0": RULES.actions.index("right")})
    *_, terminated, _, infos = env.step({"drone0": RULES.actions.index("down")})
    assert terminated["drone0"] and infos["drone0"]["pos"] == pytest.approx(0.9995)


def test_a_mission_goes_on_from_its_snapshot() -> None:
    rng = np.random.default_rng(0)
    matrix = rng.random((5, 5))
    env, other = (covering(matrix, num_drones=2) for _ in range(2))
    joint = [dict.fromkeys(["drone0", "drone1"], int(a)) for a in rng.integers(0, 9, 20)]
    for actions in joint[:10]:
        env.step(actions)
    stored = Snapshot.from_bytes(env.snapshot().to_bytes())
    other.restore(stored)
    for actions in joint[10:]:
        one, two = env.step(actions), other.step(actions)
        assert one[1:4] == two[1:4]
        assert env.world.state_bytes() == other.world.state_bytes()
    with pytest.raises(SnapshotError, match="probability_matrix"):
        covering(matrix[::-1], num_drones=2).restore(stored)


@pytest.mark.parametrize(
    "options",
    [
        {"vector": (1, 0)},
        {"person_initial_position": (1, 1)},
        {"person_pod_multipliers": [0.5]},
    ],
)
def test_options_about_persons_are_refused_where_there_are_none(options: dict[str, Any]) -> None:
    env = covering(np.ones((4, 4)))
    before = env.world.state_bytes()
    (name,) = options
    with pytest.raises(FieldError, match=f"^{name} must not be an option of a reset"):
        env.reset(options=options)
    assert env.world.state_bytes() == before
    env.reset(options={"drones_positions": [(3, 2)]})
    assert env.positions.tolist() == [[3, 2]]


@pytest.mark.slow
def test_a_belief_of_persons_is_refused_in_one_line() -> None:
    for make in (parallel_env, partial(vector_env, 2)):
        with pytest.raises(FieldError, match="^observe must be map with rules cov.* got 'belief'$"):
            make(rules="coverage", observe="belief")


def test_the_picture_shows_how_much_is_covered() -> None:
    env = parallel_env(
        rules="coverage", probability_matrix=np.ones((4, 4)), num_drones=2, render_mode="ansi"
    )
    env.reset()
    env.step({"drone0": RULES.actions.index("down"), "drone1": SEARCH})
    view = env.view()
    assert view.coverage_rate == 2 / 16 and view.datum is None and len(view.persons) == 0
    assert view.searches is not None and view.searches.sum() == 2
    assert "12.5% covered" in str(env.render())
    assert "found" not in str(env.render())
