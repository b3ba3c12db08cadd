# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Incidents that planners are compared on: what is drawn, the POS of plans, the intervals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from benchmarks.incidents import COUNT, ERRORS, MINUTES, MISSIONS, SEA, Plan, figures, incident
from dsse_ros.planners.batch import play_missions
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.scenario import Scenario

STEPS = 60


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    fields = {**incident(3)["fields"], "particles": 1000, "timestep_limit": STEPS}
    return Scenario(**fields)


def test_the_incidents_differ_in_all_that_is_drawn() -> None:
    drawn = [incident(number) for number in range(COUNT)]
    assert drawn == [incident(number) for number in range(COUNT)]
    incidents = [one["fields"]["incident"] for one in drawn]
    for having in (
        [stated["shore"] is not None for stated in incidents],
        [stated["base"] is not None for stated in incidents],
        [len(stated["seen"]) > 1 for stated in incidents],
    ):
        assert COUNT / 4 < sum(having) < 3 * COUNT / 4
    assert len({incident["object"] for incident in incidents}) > COUNT / 2
    for drawn_incident in drawn:
        assert set(drawn_incident["truths"]) == set(ERRORS) - {"none"}
        assert (
            drawn_incident["truths"]["class"]["object"]
            != drawn_incident["fields"]["incident"]["object"]
        )


def test_missions_that_repeat_a_plan_find_what_the_planner_finds(scenario: Scenario) -> None:
    found = Plan("belief_greedy", scenario, SEA, 0).found(scenario, SEA, 200)
    played = play_missions(200, "belief_greedy", scenario, rules=SEA)
    assert 0.1 < found[-1] < 0.9
    for step in (STEPS // 2, STEPS):
        assert found[step - 1] == (played.found & (played.steps <= step)).mean()


def test_the_pos_of_a_plan_is_that_of_a_mission_with_its_searches(scenario: Scenario) -> None:
    plan = Plan("belief_greedy", scenario, SEA, 0)
    pos = plan.pos(scenario, SEA)
    env = parallel_env(scenario, rules=SEA, observe="belief")
    stated: list[float] = []
    for seed in range(50):
        # Until a mission finds nobody.
        if len(stated) == STEPS:
            break
        env.reset(seed=seed)
        stated = []
        for actions in plan.actions:
            _, _, _, _, infos = env.step(actions)
            if not env.agents:
                break
            stated.append(infos["drone0"]["pos"])
    assert len(stated) == STEPS and 0.1 < stated[-1] < 0.9
    assert pos == pytest.approx(stated)


def test_the_intervals_are_those_of_incidents() -> None:
    rng = np.random.default_rng(0)
    flown = rng.integers(MISSIONS, size=(COUNT, 2, len(MINUTES))) / MISSIONS
    row = figures(flown, flown[:, ::-1])
    more = flown[:, 1] - flown[:, 0]
    for name, values in (("pos", flown[:, 0]), ("found_over_pos", more), ("difference", more)):
        wanted = stats.t.interval(0.99, COUNT - 1, values.mean(axis=0), stats.sem(values))
        assert np.array(row[f"{name}_interval"]) == pytest.approx(np.transpose(wanted))
    # The missions of an incident are no independent values.
    low, high = np.transpose(row["found_interval"])
    reach = 2.861 * stats.sem(flown[:, 1])
    assert high - low == pytest.approx(2 * reach, rel=0.15)
    assert (low > 0).all() and (high < 1).all()
