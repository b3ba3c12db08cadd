# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the planners in a search in metres."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.registry import IN_METRES, PLANNER_NAMES, planner_for
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast, PathsFlown
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.step.cell_tracks import Draw

FIELDS: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 30, "particles": 500,
    "num_drones": 2, "vector": (0.03, 0.02), "sigma": 3.0, "timestep_limit": 40,
}  # fmt: skip
OPTIONS: dict[str, dict[str, Any]] = {"belief": {"samples": 200, "horizon": 5, "width": 4}}


def played(env: SearchEnv, planner: Any, seed: int) -> list[Any]:
    """Return the actions of a mission."""
    observations, infos = env.reset(seed=seed)
    joints = []
    while env.agents:
        joints.append(planner({agent: observations[agent] for agent in env.agents}, infos))
        observations, *_, infos = env.step(joints[-1])
    return [{agent: action.tolist() for agent, action in joint.items()} for joint in joints]


def started(**fields: Any) -> SearchEnv:
    env = parallel_env(**{**FIELDS, **fields})
    return env


@pytest.mark.parametrize("name", sorted(IN_METRES))
def test_each_planner_flies_missions_one_after_the_other_as_if_new(name: str) -> None:
    env = started(probability_of_detection=0.1)
    planner = planner_for(env, name, seed=1, **OPTIONS.get(name, {}))
    first, second = played(env, planner, 3), played(env, planner, 4)
    again = planner_for(env, name, seed=1, **OPTIONS.get(name, {}))
    assert first == played(env, again, 3)
    assert second == played(env, planner_for(env, name, seed=1, **OPTIONS.get(name, {})), 4)


@pytest.mark.parametrize("name", sorted(IN_METRES))
def test_a_copy_goes_on_as_the_planner_does(name: str) -> None:
    env = started(probability_of_detection=0.0)
    planner = planner_for(env, name, seed=1, **OPTIONS.get(name, {}))
    observations, infos = env.reset(seed=3)
    for _ in range(10):
        twin = planner.copy()
        actions = planner(observations, infos)
        of_twin = twin(observations, infos)
        assert {agent: action.tolist() for agent, action in of_twin.items()} == {
            agent: action.tolist() for agent, action in actions.items()
        }
        observations, *_, infos = env.step(actions)


def test_the_belief_is_that_of_the_paths_flown() -> None:
    env = started(probability_of_detection=0.0, drones_positions=((12, 15), (18, 15)))
    assumed = started(probability_of_detection=0.9, drones_positions=((12, 15), (18, 15)))
    planner = planner_for(assumed, "belief", seed=1, **OPTIONS["belief"])
    belief = EnsembleForecast(assumed.scenario, assumed.rules, draw=Draw.PLANNING).belief()
    metres, everybody = assumed.world.metres, np.ones(2, np.bool_)
    assert metres is not None
    observations, infos = env.reset(seed=3)
    for step in range(15):
        for info in infos.values():
            info["step"] = step
        actions = planner(observations, infos)
        assert planner.belief.density == pytest.approx(belief.density)
        observations, *_, infos = env.step(actions)
        paths = np.stack([info["path"] for info in infos.values()])
        belief.update_in_passing(
            PathsFlown(metres.detectors, np.zeros(2, np.int64), paths, everybody, ~everybody)
        )
        belief.advance()
    assert belief.pos > 0.2


@pytest.mark.parametrize("name", sorted(set(PLANNER_NAMES) - set(IN_METRES)))
def test_other_planners_are_refused_in_one_line(name: str) -> None:
    with pytest.raises(FieldError, match=r"planner must be one of belief.*, got"):
        planner_for(started(), name)


def test_a_given_pattern_is_flown_about_its_datum() -> None:
    env = started(probability_of_detection=0.0, num_drones=1, vector=(0.0, 0.0))
    planner = planner_for(
        env, "sweep", length=1000, width=390, track_spacing=130, datum=(15, 15), heading=90
    )
    observations, infos = env.reset(seed=3)
    paths = []
    for _ in range(38):
        observations, *_, infos = env.step(planner(observations, infos))
        paths.append(infos["drone0"]["path"])
    away = np.abs(np.concatenate(paths) - 15.5 * 130)
    corners = np.array([(435, 130), (435, 0)])
    # It has been near the ends of the outer and the inner lanes.
    for corner in corners:
        assert np.hypot(*(away - corner).T).min() < 70.0


@pytest.mark.parametrize("name", sorted(IN_METRES))
def test_a_planner_plans_in_the_wind_that_the_infos_state(name: str) -> None:
    fields = {"probability_of_detection": 0.0, "vehicle_timed_actions": True}
    told, known = started(**fields), started(**fields, wind_speed=6.0, wind_toward=90.0)
    assert known.world.metres is not None
    wind_mps = known.world.metres.wind_mps
    assert wind_mps == pytest.approx((6.0, 0.0))
    others = {"wind": (0.0, -3.0)}
    planner, other = (planner_for(told, name, seed=1, **OPTIONS.get(name, {})) for _ in range(2))
    told.world.set_wind(wind_mps)
    of_known = planner_for(known, name, seed=1, **OPTIONS.get(name, {}))
    observations, infos = told.reset(seed=3)
    changed = False
    for step in range(5):
        assert all(info["wind"] == wind_mps for info in infos.values())
        infos = {agent: {**info, "step": step} for agent, info in infos.items()}
        actions = planner(observations, infos)
        same = of_known(observations, infos)
        assert {agent: action.tolist() for agent, action in actions.items()} == {
            agent: action.tolist() for agent, action in same.items()
        }
        moved = other(observations, {agent: {**info, **others} for agent, info in infos.items()})
        changed |= any((moved[agent] != action).any() for agent, action in actions.items())
        observations, *_, infos = told.step(actions)
    assert changed or name == "greedy"
