# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A live search simulates nobody, and is otherwise the search that it would be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.results.campaign.config import Campaign
from dsse_ros.search.environments.factories import parallel_env

SMALL: dict[str, Any] = {"grid_size": 9, "timestep_limit": 12, "num_drones": 2}
INCIDENT = {
    "object": "PIW-1", "search_start": "2026-01-17T14:00Z", "wind": {"speed": 4, "from": 90},
    "seen": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:50Z", "radius": 100},
}  # fmt: skip


def _env(rules: str, truth: str, **fields: Any) -> Any:
    of_rules: dict[str, Any] = {"sea": {"incident": INCIDENT, "particles": 500, "num_drones": 2}}
    of_rules["flight"] = of_rules["sea"]
    given = {
        "timestep_limit": 12,
        "probability_of_detection": 0.9,
        **of_rules.get(rules, SMALL),
        **fields,
    }
    return parallel_env(given, rules=rules, truth=truth, observe="belief")


@pytest.mark.slow
@pytest.mark.parametrize("rules", ["paper", "v1", "v2", "sea", "flight"])
def test_until_somebody_is_found_a_search_without_truth_is_the_same(rules: str) -> None:
    simulated, live = _env(rules, "simulated"), _env(rules, "none")
    chosen = np.random.default_rng(5)
    for env in (simulated, live):
        env.reset(seed=11)
    compared = 0
    while live.agents:
        draw = chosen.integers(0, 2**31, len(live.possible_agents))
        for env in (simulated, live):
            joint = draw % max(len(env.rules.actions), 1)
            if env.rules.in_metres:
                joint = np.stack([np.cos(draw), np.sin(draw)], axis=1)
            if env.agents:
                env.step({a: joint[int(a[5:])] for a in env.agents})
        assert not live.world.found.any() and live.world.persons.size == 0
        if simulated.world.found.any() or not simulated.agents:
            break
        compared += 1
        assert np.array_equal(simulated.probability, live.probability)
        assert np.array_equal(simulated.positions, live.positions)
        assert np.array_equal(simulated.world.rewards, live.world.rewards)
    assert compared


def test_several_persons_without_truth_stay_missing_to_the_end() -> None:
    env = _env("v2", "none", person_amount=3, person_pod_multipliers=[1.0, 0.5, 0.5])
    env.reset(seed=0)
    search = env.rules.action_set.search
    while env.agents:
        _, rewards, _, _, infos = env.step(dict.fromkeys(env.agents, search))
        assert not any(info["Found"] for info in infos.values())
        assert all(reward < env.rules.find for reward in rewards.values())
    assert env.world.worlds["num_missing"][0] == 3
    assert env.state()[2].sum() == 0.0


def test_where_a_truth_is_needed_its_absence_is_refused() -> None:
    with pytest.raises(FieldError, match="truth must be simulated with rules coverage, which have"):
        parallel_env(rules="coverage", truth="none")
    with pytest.raises(FieldError, match="truth must be simulated in a campaign, got 'none'"):
        Campaign.from_dict({"planners": ["sweep"], "scenarios": [{"truth": "none"}]})


@pytest.mark.parametrize("rules", ["paper", "v2", "sea"])
def test_a_live_search_that_states_no_pod_assumes_less_than_certainty(rules: str) -> None:
    pods = {}
    for truth in ("simulated", "none"):
        env = parallel_env(
            {"timestep_limit": 12, "incident": INCIDENT, "particles": 50}
            if rules == "sea" else SMALL, rules=rules, truth=truth,
        )  # fmt: skip
        pods[truth] = env.scenario.probability_of_detection
    assert pods == {"simulated": 1.0, "none": 0.5}
    stated = parallel_env({**SMALL, "probability_of_detection": 1.0}, rules="paper", truth="none")
    assert stated.scenario.probability_of_detection == 1.0
