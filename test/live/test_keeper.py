# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The belief of a live search follows from its steps and inputs, whenever these came."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from live_searches import AREA, LINE, decide, fly, kept, live_env, put

from dsse_ros.live.beliefs import LiveBeliefs
from dsse_ros.live.keeper import Keeper
from dsse_ros.live.records import from_text, to_text
from dsse_ros.result import Rejected
from dsse_ros.scenario.frames import cell_centre
from dsse_ros.search.world_beliefs import WorldBeliefs

STEPS = 8
REPORTS: dict[str, tuple[str, dict[str, Any]]] = {
    "area": ("searched", {"time": 20.0, "geometry": AREA, "pod": 0.7}),
    "line": ("searched", {"time": 10.0, "end": 40.0, "geometry": LINE, "sweep_width": 200.0}),
    "seen": ("sighting", {"time": "2026-01-17T14:00:20Z", "lat": -24.001, "lon": -46.302}),
    "wind": ("weather", {"wind": {"speed": 8, "from": 180}, "time": 30.0}),
    "alarm": ("detection", {"time": 25.0, "lat": -24.0, "lon": -46.303, "radius": 60.0}),
    "drone": ("detection", {"time": 39.0, "x": 300.0, "y": 300.0, "radius": 60.0, "drone": 1}),
}
"""By id, at most half of the steps after the begin of the search."""


@pytest.fixture(scope="module")
def steps() -> list[Any]:
    return fly(live_env(), STEPS)


def _keeper(env: Any = None) -> Keeper:
    env = live_env() if env is None else env
    return Keeper(env.scenario, env.rules)


@pytest.mark.slow
@pytest.mark.parametrize("rules", ["paper", "v2", "sea", "flight"])
def test_without_inputs_the_belief_is_that_of_a_search_with_a_truth(rules: str) -> None:
    env = live_env(rules)
    world, rng = env.world, np.random.default_rng(2)
    simulated, live = WorldBeliefs(world), LiveBeliefs(world)
    for _ in range(6):
        joint = rng.integers(0, max(len(env.rules.actions), 1), (1, 2)).astype(np.int8)
        for belief in (simulated, live):
            belief.before_step(joint)
        env.advance(joint[0])
        for belief in (simulated, live):
            belief.after_step()
        assert live.pos[0] == pytest.approx(simulated.pos[0], abs=1e-12)
        assert np.allclose(live.write(), simulated.write(), atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("ids", [["area", "line"], ["seen", "wind", "area"], ["alarm", "drone"]])
def test_an_input_counts_at_its_own_time_however_late_it_comes(
    steps: list[Any], ids: list[str]
) -> None:
    early, late = _keeper(), _keeper()
    for done in steps[: STEPS // 2]:
        early.step(done)
    for name in ids:
        put(early, REPORTS[name][0], id=name, **REPORTS[name][1])
    for done in steps[STEPS // 2 :]:
        early.step(done)
    for done in steps:
        late.step(done)
    before = kept(late)
    for name in reversed(ids):
        put(late, REPORTS[name][0], id=name, **REPORTS[name][1])
    assert kept(late) == kept(early) != before


@pytest.mark.parametrize("name", REPORTS)
def test_a_withdrawn_input_leaves_no_trace_in_the_belief(steps: list[Any], name: str) -> None:
    keeper = _keeper()
    for done in steps:
        keeper.step(done)
    before = kept(keeper)
    kind, values = REPORTS[name]
    put(keeper, kind, id=name, **values)
    assert kept(keeper) != before
    put(keeper, "withdraw", id="no", input=name)
    assert kept(keeper) == before
    refused = decide(keeper, "withdraw", id="again", input=name)
    assert isinstance(refused, Rejected) and refused.code == "unknown_input"


def test_a_dismissed_contact_was_a_failed_look(steps: list[Any]) -> None:
    keeper = _keeper()
    for done in steps:
        keeper.step(done)
    before, pos = kept(keeper), keeper.pos
    put(keeper, "detection", id="d", **REPORTS["drone"][1])
    (contact,) = keeper.contacts.by_name.values()
    probability = keeper.probability(contact)
    assert keeper.pos == pos and probability is not None and 0.0 <= probability <= 1.0
    put(keeper, "dismiss", id="no", contact="c1")
    assert kept(keeper) == before and keeper.probability(contact) is None


@pytest.mark.slow
def test_the_records_of_a_search_give_its_belief_bit_for_bit(steps: list[Any]) -> None:
    keeper = _keeper()
    for number, done in enumerate(steps):
        keeper.step(done)
        if number >= STEPS // 2:
            name = list(REPORTS)[number - STEPS // 2]
            put(keeper, REPORTS[name][0], id=name, **REPORTS[name][1])
    again = _keeper()
    for record in from_text(to_text(keeper.history)):
        (again.step if type(record) is type(steps[0]) else again.apply)(record)  # type: ignore[operator]
    assert kept(again) == kept(keeper)


def test_detections_near_each_other_are_one_contact_also_as_it_drifts(steps: list[Any]) -> None:
    keeper = _keeper()
    for done in steps:
        keeper.step(done)
    x, y = keeper.belief.forecast.positions[keeper.belief.forecast.first_step].mean(axis=0).tolist()  # type: ignore[union-attr]
    put(keeper, "detection", id="a", time=0.0, x=x, y=y, radius=10.0)
    last_s = STEPS * keeper.scenario.step_duration_s
    drifted = keeper.moved(x, y, 0.0, last_s)
    put(keeper, "detection", id="b", time=last_s, x=drifted[0], y=drifted[1], radius=10.0)
    put(keeper, "detection", id="c", time=last_s, x=x + 500.0, y=y, radius=10.0)
    assert [len(contact.detections) for contact in keeper.contacts.by_name.values()] == [2, 1]


def test_each_detection_makes_a_contact_more_probable_and_a_failed_look_less() -> None:
    env = live_env(false_alarm_rate=0.2, num_drones=1)
    keeper, beliefs = _keeper(env), LiveBeliefs(env.world)
    search = np.array([env.rules.action_set.search], np.int8)
    col, row = env.positions[0].tolist()
    x, y = cell_centre(env.scenario.grid_size, env.scenario.cell_size, col, row)
    chances = []
    for detects in (True, False, True):
        beliefs.before_step(search[None])
        env.advance(search)
        beliefs.after_step()
        keeper.step(beliefs.keeper.steps[-1])
        if detects:
            name = f"d{len(keeper.steps)}"
            put(keeper, "detection", id=name, x=x, y=y, radius=40.0, drone=0)
        chances.append(keeper.probability(keeper.contacts.by_name["c1"]) or 0.0)
    assert len(keeper.contacts.by_name) == 1
    assert 0.0 < chances[1] < min(chances[0], chances[2]) and max(chances) < 1.0


REFUSALS: list[tuple[str, str, str, dict[str, Any]]] = [
    ("v2", "no_incident", "sighting", {"time": 0.0, "x": 1.0, "y": 1.0}),
    ("v2", "no_utc", "detection", {"time": "2026-01-17T14:00Z", "x": 1.0, "y": 1.0, "radius": 5.0}),
    ("sea", "time_ahead", "detection", {"time": 1e6, "x": 1.0, "y": 1.0, "radius": 5.0}),
    ("sea", "time_ahead", "sighting", {"time": "2999-01-01T00:00Z", "x": 1.0, "y": 1.0}),
    ("sea", "bad_value", "sighting", {"time": "2001-01-01T00:00Z", "x": 1.0, "y": 1.0}),
    ("sea", "bad_value", "detection", {"x": 1.0, "y": 1.0, "radius": 5.0, "drone": 7}),
    ("sea", "bad_value", "weather", {"wind": {"speed": 3}}),
    ("sea", "bad_value", "weather", {"wind": {"file": "/etc/passwd"}}),
    ("sea", "unknown_contact", "confirm", {"contact": "c9"}),
    ("sea", "unknown_field", "confirm", {"contact": "c9", "why": 1}),
    ("sea", "missing_field", "searched", {"geometry": LINE}),
    ("sea", "missing_field", "detection", {"radius": 5.0, "lat": 1.0, "x": 3.0}),
]


@pytest.mark.parametrize(("rules", "code", "kind", "values"), REFUSALS)
def test_an_input_that_does_not_fit_is_refused_in_one_line(
    rules: str, code: str, kind: str, values: dict[str, Any]
) -> None:
    keeper = _keeper(live_env(rules))
    before = kept(keeper)
    refused = decide(keeper, kind, id="bad", **values)
    assert isinstance(refused, Rejected) and refused.code == code, refused
    assert "\n" not in refused.reason and kept(keeper) == before


def test_an_id_stands_for_one_input(steps: list[Any]) -> None:
    keeper, values = _keeper(), REPORTS["area"][1]
    for done in steps:
        keeper.step(done)
    put(keeper, "searched", id="x", **values)
    assert decide(keeper, "searched", id="x", **values) is None
    other = decide(keeper, "searched", id="x", **{**values, "pod": 0.1})
    assert isinstance(other, Rejected) and other.code == "id_used"


def test_a_confirmed_contact_ends_the_search(steps: list[Any]) -> None:
    keeper = _keeper()
    for done in steps:
        keeper.step(done)
    put(keeper, "detection", id="d", **REPORTS["alarm"][1])
    put(keeper, "confirm", id="yes", contact="c1")
    assert keeper.over
    refused = decide(keeper, "detection", id="e", **REPORTS["drone"][1])
    assert isinstance(refused, Rejected) and refused.code == "mission_over"
