# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The belief of a live search follows from its steps and inputs, whenever these came."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
from live_searches import AREA, LINE, decide, fly, kept, live_env, put

from dsse_ros.base.result import Rejected
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.live_search import LiveSearch
from dsse_ros.mission.live.records import from_text, to_text
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.environments.world_beliefs import WorldBeliefs
from dsse_ros.search.step.cell_tracks import Draw
from dsse_ros.world.scenario.frames import cell_centre

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


def _live_search(env: Any = None) -> LiveSearch:
    env = live_env() if env is None else env
    return LiveSearch(env.scenario, env.rules)


@pytest.fixture
def without_collector() -> Iterator[None]:
    gc.disable()
    yield
    gc.enable()


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


def test_pos_is_of_particles_that_no_searcher_sees(steps: list[Any]) -> None:
    live_search = _live_search()
    for done in steps:
        live_search.step(done)
    put(live_search, REPORTS["area"][0], id="area", **REPORTS["area"][1])
    alone = {}
    for draw in (Draw.BELIEF, Draw.POS):
        forecasts = partial(EnsembleForecast, rules=live_search.rules, draw=draw)
        other = LiveSearch(live_search.scenario, live_search.rules, forecasts)
        other.repeat(live_search.history)
        alone[draw] = other.belief
    assert np.array_equal(live_search.belief.density, alone[Draw.BELIEF].density)
    assert live_search.pos == alone[Draw.POS].pos != alone[Draw.BELIEF].pos


@pytest.mark.slow
@pytest.mark.parametrize("ids", [["area", "line"], ["seen", "wind", "area"], ["alarm", "drone"]])
def test_an_input_counts_at_its_own_time_however_late_it_comes(
    steps: list[Any], ids: list[str]
) -> None:
    early, late = _live_search(), _live_search()
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
    live_search = _live_search()
    for done in steps:
        live_search.step(done)
    before = kept(live_search)
    kind, values = REPORTS[name]
    put(live_search, kind, id=name, **values)
    assert kept(live_search) != before
    put(live_search, "withdraw", id="no", input=name)
    assert kept(live_search) == before
    refused = decide(live_search, "withdraw", id="again", input=name)
    assert isinstance(refused, Rejected) and refused.code == "unknown_input"


def test_a_dismissed_contact_was_a_failed_look(steps: list[Any]) -> None:
    live_search = _live_search()
    for done in steps:
        live_search.step(done)
    before, pos = kept(live_search), live_search.pos
    put(live_search, "detection", id="d", **REPORTS["drone"][1])
    (contact,) = live_search.contacts.by_name.values()
    probability = live_search.probability(contact)
    assert live_search.pos == pos and probability is not None and 0.0 <= probability <= 1.0
    put(live_search, "dismiss", id="no", contact="c1")
    assert kept(live_search) == before and live_search.probability(contact) is None


@pytest.mark.slow
def test_the_records_of_a_search_give_its_belief_bit_for_bit(steps: list[Any]) -> None:
    live_search = _live_search()
    for number, done in enumerate(steps):
        live_search.step(done)
        if number >= STEPS // 2:
            name = list(REPORTS)[number - STEPS // 2]
            put(live_search, REPORTS[name][0], id=name, **REPORTS[name][1])
    again = _live_search()
    for record in from_text(to_text(live_search.history)):
        (again.step if type(record) is type(steps[0]) else again.apply)(record)  # type: ignore[operator]
    assert kept(again) == kept(live_search)


def test_detections_near_each_other_are_one_contact_also_as_it_drifts(steps: list[Any]) -> None:
    live_search = _live_search()
    for done in steps:
        live_search.step(done)
    x, y = (
        live_search.belief.forecast.positions[live_search.belief.forecast.first_step]
        .mean(axis=0)
        .tolist()
    )  # type: ignore[union-attr]
    put(live_search, "detection", id="a", time=0.0, x=x, y=y, radius=10.0)
    last_s = STEPS * live_search.scenario.step_duration_s
    drifted = live_search.moved(x, y, 0.0, last_s)
    put(live_search, "detection", id="b", time=last_s, x=drifted[0], y=drifted[1], radius=10.0)
    put(live_search, "detection", id="c", time=last_s, x=x + 500.0, y=y, radius=10.0)
    assert [len(contact.detections) for contact in live_search.contacts.by_name.values()] == [2, 1]


def test_each_detection_makes_a_contact_more_probable_and_a_failed_look_less() -> None:
    env = live_env(false_alarm_rate=0.2, num_drones=1)
    live_search, beliefs = _live_search(env), LiveBeliefs(env.world)
    search = np.array([env.rules.action_set.search], np.int8)
    col, row = env.positions[0].tolist()
    x, y = cell_centre(env.scenario.grid_size, env.scenario.cell_size, col, row)
    chances = []
    for detects in (True, False, True):
        beliefs.before_step(search[None])
        env.advance(search)
        beliefs.after_step()
        live_search.step(beliefs.live_search.steps[-1])
        if detects:
            name = f"d{len(live_search.steps)}"
            put(live_search, "detection", id=name, x=x, y=y, radius=40.0, drone=0)
        chances.append(live_search.probability(live_search.contacts.by_name["c1"]) or 0.0)
    assert len(live_search.contacts.by_name) == 1
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
    live_search = _live_search(live_env(rules))
    before = kept(live_search)
    refused = decide(live_search, kind, id="bad", **values)
    assert isinstance(refused, Rejected) and refused.code == code, refused
    assert "\n" not in refused.reason and kept(live_search) == before


FAR = {
    "exchanged": {"lat": -46.302, "lon": -24.001},
    "antipode": {"lat": 24.001, "lon": 133.698},
    "metres": {"x": 3e6, "y": 0.0},
}


@pytest.mark.parametrize("place", FAR)
@pytest.mark.parametrize("kind", ["detection", "sighting"])
def test_a_place_far_from_the_search_is_refused(kind: str, place: str) -> None:
    live_search = _live_search()
    at = {"radius": 60.0} if kind == "detection" else {"time": "2026-01-17T13:50Z"}
    refused = decide(live_search, kind, id="far", **at, **FAR[place])
    assert isinstance(refused, Rejected) and refused.code == "bad_value"
    assert refused.reason.startswith(f"{kind} must be at most 500 km from the ")


def test_a_searched_area_with_its_coordinates_exchanged_is_refused() -> None:
    live_search = _live_search()
    ring = [[lat, lon] for lon, lat in AREA["coordinates"][0]]
    of_area = {"type": "Polygon", "coordinates": [ring]}
    refused = decide(live_search, "searched", id="far", geometry=of_area, pod=0.5)
    assert isinstance(refused, Rejected) and refused.code == "bad_value"
    assert "km away" in refused.reason and "longitude, latitude" in refused.reason


def test_an_id_stands_for_one_input(steps: list[Any]) -> None:
    live_search, values = _live_search(), REPORTS["area"][1]
    for done in steps:
        live_search.step(done)
    put(live_search, "searched", id="x", **values)
    assert decide(live_search, "searched", id="x", **values) is None
    other = decide(live_search, "searched", id="x", **{**values, "pod": 0.1})
    assert isinstance(other, Rejected) and other.code == "id_used"


def test_a_confirmed_contact_ends_the_search(steps: list[Any]) -> None:
    live_search = _live_search()
    for done in steps:
        live_search.step(done)
    put(live_search, "detection", id="d", **REPORTS["alarm"][1])
    put(live_search, "confirm", id="yes", contact="c1")
    assert live_search.over
    refused = decide(live_search, "detection", id="e", **REPORTS["drone"][1])
    assert isinstance(refused, Rejected) and refused.code == "mission_over"


@pytest.mark.usefixtures("without_collector")
def test_a_search_frees_its_memory_without_the_garbage_collector(steps: list[Any]) -> None:
    live_search = _live_search()
    forecast = live_search.belief.forecast
    freed = [weakref.ref(live_search), weakref.ref(forecast), weakref.ref(forecast.of_pos)]
    del forecast
    for done in steps:
        live_search.step(done)
    for name in ("area", "drone", "wind"):
        put(live_search, REPORTS[name][0], id=name, **REPORTS[name][1])
        live_search.update()
    # The report of wind has replaced the forecasts.
    assert [alive() is None for alive in freed] == [False, True, True]
    del live_search
    assert freed[0]() is None
