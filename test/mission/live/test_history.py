# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The history of a live search gives its belief to others, and planners fly by it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from live_searches import AREA, fly, kept, live_env, put

from dsse_ros.mission.live import history
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.history import FollowedHistory, HistoryTexts
from dsse_ros.mission.live.live_search import LiveSearch
from dsse_ros.planners.planner import OnBelief
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.frames import cell_centre

SEARCH = (7, 1)


def _followed(follower: FollowedHistory, env: SearchEnv) -> LiveSearch:
    return follower.live_search(
        env.scenario, env.rules, LiveSearch(env.scenario, env.rules).forecast_of
    )


def test_a_follower_has_the_same_belief_bit_for_bit_however_late_it_comes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(history, "WHOLE_EVERY", 4)
    env = live_env()
    live_search, texts, sent = LiveSearch(env.scenario, env.rules), HistoryTexts(), []
    first, joins_late = FollowedHistory(), FollowedHistory()
    for number, done in enumerate([None, *fly(env, 5)]):
        if done is not None:
            live_search.step(done)
        sent.append(texts.next(SEARCH, live_search))
        put(live_search, "detection", id=f"d{number}", x=300.0, y=300.0, radius=60.0, drone=0)
        put(live_search, "searched", id=f"a{number}", geometry=AREA, pod=0.1)
        sent.append(texts.next(SEARCH, live_search))
        first.take(sent[-2])
        first.take(sent[-1])
        assert (first.search, first.steps) == (SEARCH, number)
        if number in (2, 5):
            assert kept(_followed(first, env)) == kept(live_search)
    joins_late.take(sent[-1])
    assert joins_late.steps == -1
    for text in sent[-4:]:
        joins_late.take(text)
    assert joins_late.steps == 5 and kept(_followed(joins_late, env)) == kept(live_search)


def test_another_search_of_the_same_number_is_followed_from_its_start() -> None:
    env = live_env()
    follower, live_search = FollowedHistory(), LiveSearch(env.scenario, env.rules)
    for done in fly(env, 3):
        live_search.step(done)
    follower.take(HistoryTexts().next(SEARCH, live_search))
    again, texts = LiveSearch(env.scenario, env.rules), HistoryTexts()
    follower.take(texts.next(SEARCH, again))
    put(again, "searched", id="a", geometry=AREA, pod=0.5)
    follower.take(texts.next(SEARCH, again))
    assert follower.steps == 0 and kept(_followed(follower, env)) == kept(again)
    for bad in ("[]", '{"run_id": 7, "mission": 1, "begin": 1, "records": [3]}'):
        with pytest.raises(ValueError, match=r"^history"):
            follower.take(bad)
    assert kept(_followed(follower, env)) == kept(again)


@pytest.mark.parametrize("rules", ["sea", "flight"])
def test_a_planner_flies_to_what_was_detected(rules: str) -> None:
    env = live_env(rules, num_drones=1)
    likely = LiveSearch(env.scenario, env.rules).belief.poc()
    cells = np.argwhere(likely > 0.1 * likely.max())[:, ::-1]
    one, other = cells[0], cells[np.hypot(*(cells - cells[0]).T).argmax()]
    ends = [_end_after_detection(env, tuple(goal.tolist())) for goal in (one, other)]
    for own, (goal, another) in zip(ends, [(one, other), (other, one)], strict=True):
        assert np.hypot(*(own - goal)) < np.hypot(*(own - another))


def _end_after_detection(env: SearchEnv, cell: tuple[int, int]) -> Any:
    """Return the cell in which the only drone is some steps after a detection in a cell."""
    planner = planner_for(env, "belief", seed=1, samples=256)
    assert isinstance(planner, OnBelief)
    live_search, looks = (
        LiveSearch(env.scenario, env.rules, planner.forecasts),
        LiveBeliefs(env.world),
    )
    x, y = cell_centre(env.scenario.grid_size, env.scenario.cell_size, *cell)
    put(live_search, "detection", id="d", x=x, y=y, radius=50.0, confidence=0.95)
    start = env.scenario.person_initial_position
    observations, infos = env.reset(seed=3, options={"drones_positions": [start]})
    for step in range(5):
        known = {"step": step, "belief": live_search.belief}
        joint: Any = planner(observations, {name: info | known for name, info in infos.items()})
        action = joint["drone0"]
        looks.before_step(np.array([[0 if np.ndim(action) else action]], np.int8))
        observations, _, _, _, infos = env.step(joint)
        live_search.step(looks.looks())
    return env.positions[0]
