# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The wrappers hand out what those of DSSE 1.1.9 do, over 20 scripted episodes each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden import EPISODES, META
from pettingzoo.test import parallel_api_test

from dsse_ros.compat import CoverageDroneSwarmSearch, DroneSwarmSearch, wrappers
from dsse_ros.search.environments import wrappers as native
from dsse_ros.search.environments.factories import parallel_env, vector_env

MAPS = 1e-6
"""Two computations of the same map in float32 differ by less, as test_oracles has it."""

Array = Any


def encodings() -> dict[str, native.Encoding]:
    return {
        "all_positions": native.ALL_POSITIONS,
        "flatten": native.FLATTENED,
        "matrix": native.IN_MATRIX,
        "top": native.top_cells(META["n_positions"]),
    }


def assert_same_cells(ours: Array, theirs: Array, maps: Array, drones: int) -> None:
    """Positions are equal, and cells up to the order of equally probable ones."""
    assert ours.dtype == theirs.dtype and ours.shape == theirs.shape
    np.testing.assert_array_equal(ours[..., : 2 * drones], theirs[..., : 2 * drones])
    for observed, published, probability in zip(ours, theirs, maps, strict=True):
        for own, their in zip(observed[:, 2 * drones :], published[:, 2 * drones :], strict=True):
            (x, y), (their_x, their_y) = own.reshape(-1, 2).T, their.reshape(-1, 2).T
            assert len(set(zip(x.tolist(), y.tolist(), strict=True))) == len(x)
            np.testing.assert_allclose(
                probability[y, x], probability[their_y, their_x], rtol=0, atol=MAPS
            )


def test_there_are_20_episodes_and_some_end() -> None:
    assert len(EPISODES) == 20
    lengths = {len(arrays["retain"]) for _, arrays in EPISODES}
    assert min(lengths) < 10 == max(lengths)


@pytest.mark.parametrize("name", ["all_positions", "flatten", "matrix"])
def test_an_encoding_of_the_packages_map_is_the_packages_bit_for_bit(name: str) -> None:
    for _, arrays in EPISODES:
        ours = encodings()[name].encode(arrays["retain"], arrays["retain_map"])
        if name == "all_positions":
            ours, maps = ours
            np.testing.assert_array_equal(maps, arrays["all_positions_map"])
        assert ours.dtype == arrays[name].dtype
        np.testing.assert_array_equal(ours, arrays[name])


def test_top_cells_of_the_packages_map_are_the_packages_up_to_ties() -> None:
    for script, arrays in EPISODES:
        ours = encodings()["top"].encode(arrays["retain"], arrays["retain_map"])
        drones = script["arguments"]["drone_amount"]
        assert_same_cells(ours, arrays["top"], arrays["retain_map"], drones)


def test_a_discount_of_the_packages_map_is_the_packages_bit_for_bit() -> None:
    for _, arrays in EPISODES:
        seen = native.SeenDiscount(META["n_steps"], all_seen=True)
        for step, (cells, probability) in enumerate(
            zip(arrays["retain"], arrays["retain_map"], strict=True)
        ):
            if step == 0:
                seen.reset(probability)
            seen.see(cells, step)
            ours = seen.discount(probability, step)
            assert ours.dtype == np.float32
            np.testing.assert_array_equal(ours, arrays["communication_map"][step])


def stack(name: str, env: Any, cells: Any) -> Any:
    """Put the wrappers on an environment as the recorder does."""
    env = wrappers.RetainDronePosWrapper(env, cells)
    if name.startswith("communication"):
        env = wrappers.CommunicationWrapper(env, META["n_steps"])
    if name == "top":
        return wrappers.TopNProbsWrapper(env, META["n_positions"])
    return {
        "retain": lambda env: env,
        "communication": lambda env: env,
        "all_positions": wrappers.AllPositionsWrapper,
        "communication_all_positions": wrappers.AllPositionsWrapper,
        "flatten": wrappers.AllFlattenWrapper,
        "matrix": wrappers.MatrixEncodeWrapper,
    }[name](env)


@pytest.mark.parametrize(
    "name",
    [
        "retain",
        "all_positions",
        "flatten",
        "top",
        "communication",
        "matrix",
        "communication_all_positions",
    ],
)
def test_a_script_observes_what_it_did_on_the_package(name: str) -> None:
    for script, arrays in EPISODES:
        cells = [tuple(cell) for cell in script["drones_positions"]]
        env = stack(name, DroneSwarmSearch(**script["arguments"]), cells)
        agents = list(env.possible_agents)
        observed = [env.reset()[0]]
        for joint in script["actions"]:
            if env.agents:
                observed.append(env.step(dict(zip(agents, joint, strict=True)))[0])
        assert all(list(each) == agents for each in observed)
        values = [[each[agent] for agent in agents] for each in observed]
        for agent, value in zip(agents, values[0], strict=True):
            if name not in ("retain", "communication"):
                assert env.observation_space(agent).contains(value)
        if isinstance(values[0][0], tuple):
            maps = np.array([each[0][1] for each in values])
            assert maps.dtype == arrays[f"{name}_map"].dtype
            np.testing.assert_allclose(maps, arrays[f"{name}_map"], rtol=0, atol=MAPS)
            values = [[value[0] for value in each] for each in values]
        ours, theirs = np.array(values), arrays[name]
        if name == "top":
            assert_same_cells(ours, theirs, arrays["retain_map"], len(agents))
        else:
            assert ours.dtype == theirs.dtype and ours.shape == theirs.shape
            tolerance = MAPS if name in ("flatten", "matrix") else 0.0
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance)


@pytest.mark.parametrize("name", ["all_positions", "flatten", "matrix", "top"])
def test_a_batch_observes_what_single_environments_do(name: str) -> None:
    fields = {"rules": "v2", "grid_size": 6, "num_drones": 2, "timestep_limit": 5}
    cells, count = [(1, 1), (4, 3)], 3
    encoding = encodings()[name]
    batch, seen = vector_env(count, **fields), native.SeenDiscount(4)
    singles = []
    for _ in range(count):
        env: Any = native.RetainedPositions(parallel_env(**fields), cells)
        singles.append(native.EncodedObservations(native.DiscountedObservations(env, 4), encoding))
    rng = np.random.default_rng(1)
    arrays, infos = batch.reset(seed=7, options={"drones_positions": cells})
    seen.reset(arrays["probability"])
    expected = [env.reset(seed=7 + i)[0] for i, env in enumerate(singles)]
    for _ in range(14):
        seen.see(arrays["positions"], infos["step"])
        lowered = seen.discount(arrays["probability"], infos["step"])
        observed = encoding.encode(arrays["positions"], lowered)
        for b, single in enumerate(expected):
            for i, value in enumerate(single.values()):
                if isinstance(observed, tuple):
                    np.testing.assert_array_equal(observed[0][b, i], value[0])
                    np.testing.assert_array_equal(observed[1][b], value[1])
                else:
                    np.testing.assert_array_equal(observed[b, i], value)
        joint = rng.integers(0, 9, (count, 2)).astype(np.int8)
        arrays, *_, infos = batch.step(joint)
        expected = [
            env.step(dict(zip(env.agents, row.tolist(), strict=True)))[0]
            if env.agents
            else env.reset()[0]
            for env, row in zip(singles, joint, strict=True)
        ]
    batch.close()


def test_wrappers_pass_the_api_test_of_pettingzoo() -> None:
    for name, encoding in encodings().items():
        env: Any = parallel_env(rules="v2", grid_size=6, num_drones=2, timestep_limit=20)
        parallel_api_test(native.EncodedObservations(env, encoding), num_cycles=50)
        assert name


@pytest.mark.parametrize("name", ["all_positions", "flatten", "matrix", "top"])
def test_what_the_coverage_task_observes_through_wrappers_lies_in_its_spaces(
    name: str, tmp_path: Path
) -> None:
    np.save(tmp_path / "poc.npy", np.arange(9.0).reshape(3, 3))
    search = CoverageDroneSwarmSearch(prob_matrix_path=str(tmp_path / "poc.npy"), drone_amount=2)
    env = native.EncodedObservations(search, encodings()[name])
    observations, _ = env.reset()
    while env.agents:
        for agent, observed in observations.items():
            assert env.observation_space(agent).contains(observed)
        observations, *_ = env.step(dict.fromkeys(env.agents, 1))


def test_wrappers_have_the_published_attributes() -> None:
    fields = {"vector": (0, 0), "person_initial_position": (5, 5), "dispersion_start": 9}
    env = DroneSwarmSearch(grid_size=6, drone_amount=2, **fields)
    top = wrappers.TopNProbsWrapper(env, 7)
    assert top.n_positions == 7
    top.n_positions = 2
    assert top.reset()[0]["drone0"].shape == (8,)
    seen = wrappers.CommunicationWrapper(env, 9)
    assert seen.n_steps == 9
    seen.reset()
    seen.n_steps = 4
    actions = {"drone0": 8, "drone1": 8}
    seen.step(actions)
    seen.passed_map[1, 1] = 1
    for step, share in ((2, 0.25), (3, 0.5)):
        lowered = seen.step(actions)[0]["drone0"][1] / env.probability
        assert lowered[1, 1] == pytest.approx(share, abs=1e-6)
        assert lowered[3, 3] == pytest.approx(step / 4, abs=1e-6) and lowered[0, 0] == 0
    retained = wrappers.RetainDronePosWrapper(env, [(1, 1), (2, 2)])
    assert retained.drone_positions == [(1, 1), (2, 2)]
    retained.drone_positions = [(3, 3), (4, 4)]
    retained.reset()
    assert env.agents_positions == [(3, 3), (4, 4)]
