# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions in metres that share a planner are what single ones are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.planner import Planner
from dsse_ros.planners.play import play
from dsse_ros.search.environments.factories import parallel_env

FIELDS: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 14, "particles": 300,
    "drones_positions": ((6, 6), (8, 8)), "sigma": 2.0, "timestep_limit": 25, "wind_speed": 3.0,
}  # fmt: skip


class Weaving:
    """Turns by what it observes: its position, its path, the step and its seed."""

    def __init__(self, search: Any, *, seed: int = 0, speed: float = 1.0) -> None:
        self._seed, self._speed = seed, speed

    def __call__(self, observations: Any, infos: Any) -> dict[str, Any]:
        found = {}
        for agent, (state, probability) in observations.items():
            here = float(state[0] + 3 * state[1] + probability.max())
            flown = float(infos[agent]["path"].sum())
            turn = np.sin(50 * here + flown + infos[agent].get("step", 0) + self._seed)
            found[agent] = np.array([turn, self._speed], np.float32)
        return found


@pytest.mark.parametrize("more", [{}, {"person_amount": 3}])
def test_missions_are_those_of_the_environment(more: dict[str, Any]) -> None:
    fields = {**FIELDS, **more}
    env, seeds = parallel_env(**fields), list(range(30, 42))
    missions = play_missions(len(seeds), Weaving, seed=seeds, planner_seeds=[5], **fields)
    for m, seed in enumerate(seeds):
        far = 0.0
        for step in play(env, numbered(env, Weaving(None, seed=5)), seed=seed):
            far += sum(
                float(np.hypot(*np.diff(step.infos[agent]["path"], axis=0).T).sum())
                for agent in step.actions
            )
        found = bool(env.world.worlds["num_missing"][0] == 0)
        assert missions.found[m] == found
        assert missions.steps[m] == (env.steps_done if found else 25)
        assert missions.path_length_m[m] == pytest.approx(far)
        assert (missions.lost[m], missions.collisions[m]) == (0, 0)
    assert missions.found.any()


def numbered(env: Any, planner: Planner) -> Planner:
    """Return a planner that gets the number of the step, as in a batch."""

    def decide(observations: Any, infos: Any) -> Any:
        return planner(
            observations, {agent: {**info, "step": env.steps_done} for agent, info in infos.items()}
        )

    return decide


def test_an_action_that_is_none_is_refused() -> None:
    with pytest.raises(FieldError, match="action of drone0 must be two numbers from -1 to 1"):
        play_missions(2, Weaving, options={"speed": 1.5}, **FIELDS)
