# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detections make their contact more probable, each of them, however many and in any order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from live_searches import fly, kept, live_env, put

from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.live_search import LiveSearch
from dsse_ros.mission.live.step_looks import StepLooks
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.frames import cell_centre

ROUNDING = 1e-9


def _hovering(env: SearchEnv, steps: int) -> tuple[list[StepLooks], tuple[float, float]]:
    """Return the looks of drones that search where they are, and the place of the first one."""
    beliefs, scenario = LiveBeliefs(env.world), env.scenario
    joint = np.full(env.world.num_drones, env.rules.action_set.search, np.int8)
    col, row = env.positions[0].tolist()
    for _ in range(steps):
        beliefs.before_step(joint[None])
        env.advance(joint)
        beliefs.after_step()
    return beliefs.live_search.steps, cell_centre(scenario.grid_size, scenario.cell_size, col, row)


def _probability(live_search: LiveSearch, name: str = "c1") -> float:
    probability = live_search.probability(live_search.contacts.by_name[name])
    assert probability is not None
    return probability


@pytest.mark.parametrize(("rules", "steps"), [("paper", 100), ("sea", 100), ("v2", 20)])
@pytest.mark.parametrize("pod", [0.2, 0.6, 0.9, 1.0])
def test_a_person_who_is_detected_in_every_step_is_ever_more_certain(
    rules: str, steps: int, pod: float
) -> None:
    env = live_env(
        rules, probability_of_detection=pod, false_alarm_rate=0.1, num_drones=1,
        timestep_limit=2 * steps,
    )  # fmt: skip
    looks, (x, y) = _hovering(env, steps)
    live_search = LiveSearch(env.scenario, env.rules)
    before = 0.0
    for number, done in enumerate(looks):
        live_search.step(done)
        put(live_search, "detection", id=f"d{number}", x=x, y=y, radius=80.0, drone=0)
        after = _probability(live_search)
        assert after >= before - ROUNDING
        before = after
    assert before > 0.9


@settings(max_examples=25)
@example([(0, None, 0.0, 0.0, 5.0, None), (0, None, 0.0, 74.0, 5.0, 2.3e-308)], "paper")
@given(
    st.lists(
        st.tuples(
            st.integers(0, 11), st.integers(0, 1) | st.none(), st.floats(-200.0, 200.0),
            st.floats(-200.0, 200.0), st.floats(5.0, 200.0), st.floats(0.0, 1.0) | st.none(),
        ),
        min_size=1, max_size=12,
    ),
    st.sampled_from(["paper", "sea", "flight"]),
)  # fmt: skip
def test_no_detection_makes_its_contact_less_probable(
    reports: list[tuple[Any, ...]], rules: str
) -> None:
    env, looks = _SEARCHES.setdefault(rules, _search(rules))
    live_search = LiveSearch(env.scenario, env.rules)
    for done in looks:
        live_search.step(done)
    col, row = env.scenario.person_initial_position
    x, y = cell_centre(env.scenario.grid_size, env.scenario.cell_size, col, row)
    before: dict[str, float] = {}
    for number, (step, drone, east, north, radius, confidence) in enumerate(reports):
        entry = put(
            live_search, "detection", id=f"d{number}", x=x + east, y=y + north, radius=radius,
            drone=drone, confidence=confidence, time=(step + 0.5) * env.scenario.step_duration_s,
        )  # fmt: skip
        name = entry.derived["contact"]
        assert _probability(live_search, name) >= before.get(name, 0.0) - ROUNDING
        assert (
            sum(_probability(live_search, each) for each in live_search.contacts.by_name)
            < 1.0 + ROUNDING
        )
        before = {
            contact: _probability(live_search, contact) for contact in live_search.contacts.by_name
        }


def test_a_detection_beside_a_cell_in_which_nobody_can_be_is_a_false_alarm() -> None:
    env = live_env("sea", false_alarm_rate=0.2, num_drones=1)
    live_search = LiveSearch(env.scenario, env.rules)
    forecast, size = EnsembleForecast(env.scenario, env.rules), env.scenario.grid_size
    cells = forecast.cells[forecast.row(forecast.first_step)].tolist()
    col, row = max(cells)
    (done,) = fly(env, 1)
    seen = done._replace(
        drones=np.zeros(1, np.int64),
        numbers=np.zeros(1, np.int64),
        cells=np.array([[col + 1, row]]),
    )
    live_search.step(seen)
    # On the edge of the cell beside it, where somebody may be: half of the reports fall there.
    x, y = cell_centre(size, env.scenario.cell_size, col + 0.5, row)
    put(live_search, "detection", id="d", x=x, y=y, radius=40.0, drone=0)
    assert _probability(live_search) == 0.0


def _search(rules: str) -> tuple[SearchEnv, list[StepLooks]]:
    return live_env(rules, false_alarm_rate=0.1), fly(live_env(rules, false_alarm_rate=0.1), 12)


_SEARCHES: dict[str, tuple[SearchEnv, list[StepLooks]]] = {}


def test_one_contact_at_most_is_the_person_however_sparse_the_particles() -> None:
    env = live_env(particles=60, false_alarm_rate=0.01)
    looks = fly(env, 6)
    live_search = LiveSearch(env.scenario, env.rules)
    for done in looks:
        live_search.step(done)
    col, row = env.scenario.person_initial_position
    x, y = cell_centre(env.scenario.grid_size, env.scenario.cell_size, col, row)
    for number, east in enumerate((-130.0, 130.0)):
        for report in range(3):
            put(live_search, "detection", id=f"d{number}-{report}", x=x + east, y=y, radius=20.0,
                confidence=0.9, time=30.0)  # fmt: skip
    assert list(live_search.contacts.by_name) == ["c1", "c2"]
    first, second = (_probability(live_search, name) for name in ("c1", "c2"))
    assert 0.2 < first < 0.8 and 0.99 < first + second < 1.0 + ROUNDING


@pytest.mark.slow
def test_a_thousand_detections_give_the_same_certainty_in_any_order() -> None:
    env = live_env(num_drones=1, false_alarm_rate=0.1, timestep_limit=1000)
    looks, _ = _hovering(env, 100)
    step_s = env.scenario.step_duration_s
    searches = []
    for seed in (None, 1, 2):
        live_search = LiveSearch(env.scenario, env.rules)
        for done in looks:
            live_search.step(done)
        col, row = env.scenario.person_initial_position
        place = cell_centre(env.scenario.grid_size, env.scenario.cell_size, col, row)
        order = np.arange(1000) if seed is None else np.random.default_rng(seed).permutation(1000)
        for number in order.tolist():
            time_s = (number + 0.5) * step_s / 10
            x, y = live_search.moved(*place, 0.0, time_s)
            put(live_search, "detection", id=f"d{number}", x=x + number % 7, y=y, radius=60.0,
                drone=0, time=time_s)  # fmt: skip
        assert list(live_search.contacts.by_name) == ["c1"] and _probability(live_search) > 0.99
        searches.append(live_search)
    assert kept(searches[0]) == kept(searches[1]) == kept(searches[2])


def test_reports_of_several_people_in_one_step_all_count() -> None:
    env = live_env()
    looks = fly(env, 4)
    chances = []
    for reports in ([(20.0, 0.9)], [(20.0, 0.9), (150.0, 0.3)]):
        live_search = LiveSearch(env.scenario, env.rules)
        for done in looks:
            live_search.step(done)
        for number, (radius, confidence) in enumerate(reports):
            put(live_search, "detection", id=f"d{number}", lat=-24.0, lon=-46.303, radius=radius,
                confidence=confidence, time=30.0)  # fmt: skip
        chances.append(_probability(live_search))
    assert chances[1] >= chances[0] > 0.5


@pytest.mark.parametrize("rules", ["paper", "v2"])
def test_of_several_persons_a_look_that_detected_is_left_out_and_no_probability_is_stated(
    rules: str,
) -> None:
    env = live_env(rules, person_amount=2, num_drones=1)
    looks, (x, y) = _hovering(env, 5)
    live_search, idle = LiveSearch(env.scenario, env.rules), LiveSearch(env.scenario, env.rules)
    for number, done in enumerate(looks):
        live_search.step(done)
        idle.step(done.of_drones(np.zeros(1, np.bool_)))
        put(live_search, "detection", id=f"d{number}", x=x, y=y, radius=30.0, drone=0)
    assert np.array_equal(live_search.belief.density, idle.belief.density)
    assert live_search.probability(live_search.contacts.by_name["c1"]) is None
    # The POS is that of searches like these.
    assert live_search.pos > idle.pos
