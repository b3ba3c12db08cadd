# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner `onnx`, with real models made here."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.belief import BeliefPlanner
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.factories import parallel_env

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

from dsse_ros.planners.onnx import SHIPPED  # noqa: E402

FIELDS: dict[str, Any] = {"rules": "v2", "grid_size": 7, "num_drones": 3}
INPUTS = {"position": 2, "positions": 6, "number": 1, "action_mask": 9}


def model(
    folder: Path, weights: np.ndarray[Any, Any], name: str = "position", **metadata: Any
) -> str:
    """Write a linear layer from an input to the scores of actions; returns the file."""
    helper, real = onnx.helper, onnx.TensorProto.FLOAT
    graph = helper.make_graph(
        [helper.make_node("MatMul", [name, "weights"], ["scores"])],
        "policy",
        [helper.make_tensor_value_info(name, real, ["drones", weights.shape[0]])],
        [helper.make_tensor_value_info("scores", real, ["drones", weights.shape[1]])],
        [onnx.numpy_helper.from_array(weights.astype(np.float32), "weights")],
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    if metadata:
        helper.set_model_props(made, {"dsse_ros": json.dumps(metadata)})
    path = folder / "policy.onnx"
    onnx.save(made, path)
    return str(path)


def actions() -> Sequence[str]:
    """The actions of the search."""
    return parallel_env(**FIELDS).rules.actions


def of_search(**changes: Any) -> dict[str, Any]:
    """Metadata of a model of the search."""
    return {"actions": list(actions()), "rules": "v2", **changes}


@pytest.mark.parametrize("name", INPUTS)
def test_each_drone_does_the_allowed_action_with_the_highest_score(
    tmp_path: Path, name: str
) -> None:
    env = parallel_env(**FIELDS)
    weights = np.random.default_rng(5).normal(size=(INPUTS[name], len(actions())))
    path = model(tmp_path, weights, name, **of_search())
    planner = planner_for(env, "onnx", model=path)
    observations, infos = env.reset(seed=2)
    for _ in range(30):
        if not env.agents:
            break
        joint = planner(observations, infos)
        cells = np.array([observations[agent][0] for agent in env.agents]) / 6
        for i, agent in enumerate(env.agents):
            others = [cells[0] if j == i else cells[j] for j in range(1, len(cells))]
            value = {
                "position": cells[i],
                "positions": np.concatenate([cells[i], *others]),
                "number": np.array([i]),
                "action_mask": infos[agent]["action_mask"],
            }[name]
            scores = np.where(infos[agent]["action_mask"] == 1, value @ weights, -np.inf)
            assert scores[joint[agent]] == pytest.approx(scores.max(), abs=1e-5)
        observations, _, _, _, infos = env.step(joint)


def test_a_drone_that_is_out_of_the_search_stays_among_the_positions_where_it_was(
    tmp_path: Path,
) -> None:
    env = parallel_env(**FIELDS)
    weights = np.random.default_rng(6).normal(size=(6, len(actions())))
    planner = planner_for(env, "onnx", model=model(tmp_path, weights, "positions", **of_search()))
    observations, infos = env.reset(seed=2)
    before = planner(observations, infos)
    del observations["drone1"], infos["drone1"]
    assert planner(observations, infos) == {k: before[k] for k in ("drone0", "drone2")}


def test_a_model_of_another_search_is_refused_with_one_line(tmp_path: Path) -> None:
    env, weights = parallel_env(**FIELDS), np.zeros((2, len(actions())))
    for metadata, line in (
        ({}, "metadata 'dsse_ros' must be a JSON object .*, got none"),
        (of_search(rules="paper"), "model must have rules .*, got 'paper'"),
        (of_search(actions=["left"]), r"model must have actions .*, got \['left'\]"),
        (of_search(grid_size=8), r"model must have grid_size \[7, 7\], .* got \[8, 8\]"),
        (of_search(pod=[0.5, 0.9]), "model is for a POD of 0.5 to 0.9, got 1; "),
        (of_search(pod=1), "model: pod must be the lowest and highest POD, got 1"),
    ):
        with pytest.raises(FieldError, match=line):
            planner_for(env, "onnx", model=model(tmp_path, weights, **metadata))
    with pytest.raises(FieldError, match="inputs among position, positions, .* got 'wind'"):
        planner_for(env, "onnx", model=model(tmp_path, weights, "wind", **of_search()))


def test_what_is_no_model_is_refused_with_one_line(tmp_path: Path) -> None:
    env, broken = parallel_env(**FIELDS), tmp_path / "broken.onnx"
    broken.write_bytes(b"not a model")
    for file, line in (
        (str(tmp_path / "none.onnx"), "no such file"),
        (str(broken), "must be an ONNX file"),
    ):
        with pytest.raises(FieldError, match=line) as caught:
            planner_for(env, "onnx", model=file)
        assert "\n" not in str(caught.value)


PUBLISHED: dict[str, Any] = {
    "rules": "v2", "grid_size": 40, "person_initial_position": (20, 20), "dispersion_inc": 0.05,
    "drones_positions": [(20, 0), (20, 39), (0, 20), (39, 20)],
}  # fmt: skip
"""The published search."""


@pytest.mark.slow
def test_the_model_of_the_package_is_small_and_finds_more_than_the_published_agents() -> None:
    assert SHIPPED.stat().st_size < 6_000_000
    missions = play_missions(600, "onnx", seed=5_000, **PUBLISHED)
    assert missions.found.mean() > 0.98
    assert missions.steps.mean() < 25


def test_the_model_of_the_package_flies_pods_that_it_was_compared_on_and_refuses_lower_ones() -> (
    None
):
    planner_for(parallel_env(probability_of_detection=0.5, **PUBLISHED), "onnx")
    env = parallel_env(probability_of_detection=0.49, **PUBLISHED)
    with pytest.raises(FieldError, match=r"model is for a POD of 0.5 to 1, got 0.49; "):
        planner_for(env, "onnx")


@pytest.mark.slow
def test_the_model_of_the_package_searches_other_grids_with_other_numbers_of_drones() -> None:
    for drones in (1, 7):
        fields = {"rules": "v2", "grid_size": 15, "num_drones": drones}
        missions = play_missions(200, "onnx", seed=5_000, person_initial_position=(8, 9), **fields)
        assert missions.found.mean() > 0.8


def test_a_model_of_the_belief_does_the_same_on_the_map_and_where_the_belief_is_observed() -> None:
    env = parallel_env(**PUBLISHED)
    seeing = parallel_env(observe="belief", **PUBLISHED)
    on_map, on_belief = planner_for(env, "onnx"), planner_for(seeing, "onnx")
    assert isinstance(on_map, BeliefPlanner) and not isinstance(on_belief, BeliefPlanner)
    (observations, infos), (others, other_infos) = env.reset(seed=4), seeing.reset(seed=4)
    while env.agents:
        joint = on_map(observations, infos)
        assert joint == on_belief(others, other_infos)
        observations, _, _, _, infos = env.step(joint)
        others, _, _, _, other_infos = seeing.step(joint)


def test_a_model_that_avoids_collisions_sends_no_drone_into_the_cell_of_another(
    tmp_path: Path,
) -> None:
    # All drones want to go to the right, and down at the edge.
    weights = np.zeros((9, 9))
    weights[actions().index("right"), actions().index("right")] = 2.0
    weights[actions().index("down"), actions().index("down")] = 1.0
    fields = {**FIELDS, "drones_positions": [(0, 0), (0, 1), (0, 2)], "timestep_limit": 40}
    together = {}
    for avoid in (False, True):
        metadata = of_search(avoid_collisions=avoid)
        path = model(tmp_path, weights, "action_mask", **metadata)
        missions = play_missions(50, "onnx", seed=3, options={"model": path}, **fields)
        together[avoid] = missions.collisions.sum()
    assert together[False] > 0 and together[True] == 0


def test_a_model_of_the_map_is_not_flown_on_a_belief(tmp_path: Path) -> None:
    path = model(tmp_path, np.zeros((2, len(actions()))), **of_search(observe="map"))
    with pytest.raises(FieldError, match="observe 'belief', .* got 'map'"):
        planner_for(parallel_env(observe="belief", **FIELDS), "onnx", model=path)
