# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whatever is sent to a live search is answered, and leaves a belief that is one."""

from __future__ import annotations

import itertools
import json
import math
from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_searches import AREA, LINE, fly, kept, live_env

from dsse_ros.base.result import Accepted, Rejected
from dsse_ros.mission.live import admission
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.contacts import MOST_OPEN
from dsse_ros.mission.live.inputs import KINDS, parse
from dsse_ros.mission.live.live_search import LiveSearch
from dsse_ros.mission.live.records import from_text, read_back, to_text
from dsse_ros.mission.run.live_intake import LiveIntake
from dsse_ros.mission.run.mission import Mission
from dsse_ros.world.scenario.frames import cell_centre

DEEP: Any = json.loads("[" * 300 + "]" * 300)
ODD: list[Any] = [
    math.inf, {"select": {"time": math.inf}, "speed": 5, "from": 10}, DEEP, {"select": DEEP},
    {"speed": 5, "from": 10, "axes": "x", "variables": ["u", "v"], "gap_cells": math.inf},
    {"type": "LineString", "coordinates": [[-46.3, -24.0, math.inf], [-46.3, -24.1, DEEP]]},
    None, True, "", "x" * 5000, "\x00", "\ud800", -0.0, 0, -1, 7, 10**400, 1e308, -1e308, 5e-324,
    1e-12, [], {}, [[]], {"speed": 5, "from": 10}, {"speed": 1e308, "from": 0}, {"speed": -1},
    {"speed": 50, "from": 0, "error": 1e6}, {"speed": 5, "from": 10, "correlation_minutes": 0},
    {"times_s": [0], "lats_deg": [-24], "lons_deg": [-46], "east_mps": [1], "north_mps": [None]},
    AREA, LINE, {"type": "Polygon", "coordinates": [[[0, 0]] * 4]}, {"type": "Polygon"},
    {"type": "LineString", "coordinates": [[1e9, 1], ["a", 2]]}, "2026-01-17T14:00:10Z", "c1", "i",
    "0001-01-01T00:00:00Z", "9999-12-31T23:59:59Z", "2026-01-17T13:55Z", "drone0", "drone99", 200.0,
    -24.0, -46.3, 89.0, 30.0,
]  # fmt: skip
FIELDS = sorted({"id", "lat", "lon", "x", "y", "no_such"}.union(
    *({*kind.required, *kind.optional} for kind in KINDS.values())
))  # fmt: skip
PLAUSIBLE: dict[str, dict[str, Any]] = {
    "detection": {"x": 300.0, "y": 300.0, "radius": 30.0},
    "sighting": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:55Z"},
    "searched": {"geometry": AREA, "pod": 0.5},
    "weather": {"wind": {"speed": 5, "from": 10}},
    "confirm": {"contact": "c1"}, "dismiss": {"contact": "c1"}, "withdraw": {"input": "i"},
}  # fmt: skip


def _intake() -> LiveIntake:
    mission = Mission(live_env(particles=60, timestep_limit=10), 1)
    assert isinstance(mission.beliefs, LiveBeliefs)
    mission.beliefs.live_search.repeat(fly(live_env(particles=60, timestep_limit=10), 3))
    intake = LiveIntake(mission, lambda *_: None, Counter())
    intake.clock.set(3, 40.0)
    return intake


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.sampled_from(sorted(KINDS)),
    st.dictionaries(st.sampled_from(FIELDS), st.sampled_from(ODD), max_size=3),
    st.sampled_from(["", "[", "{}", "null", "[1]", '{"id": "i", "x": NaN}', "{" * 100_000]),
)
def test_every_text_is_answered_and_the_belief_stays_one(
    kind: str, odd: dict[str, Any], text: str
) -> None:
    intake = _SHARED[0] if _SHARED else _SHARED.append(_intake()) or _SHARED[0]
    intake.take(kind, text)
    intake.take(kind, json.dumps({"id": f"i{next(_NUMBERS)}", **PLAUSIBLE[kind], **odd}))
    answers = intake.decide(60.0)
    assert len(answers) == 2 and all("\n" not in answer.reason for answer in answers)
    assert all(answer.ok != bool(answer.reason) for answer in answers)
    assert all(math.isfinite(answer.pos_after or 0.0) for answer in answers)
    for answer in answers:
        answer.to_json()
    json.dumps(intake.contacts(), allow_nan=False)
    beliefs = intake._mission.beliefs
    assert isinstance(beliefs, LiveBeliefs)
    density = beliefs.live_search.belief.density
    assert np.isfinite(density).all() and density.sum() == pytest.approx(1.0)
    if intake._mission.done:
        _SHARED.clear()


_NUMBERS = itertools.count()
_SHARED: list[LiveIntake] = []
"""The intake of the examples so far, in any order."""


def test_a_flood_of_detections_opens_and_keeps_a_bounded_number() -> None:
    intake, rng = _intake(), np.random.default_rng(4)
    places = rng.uniform(0.0, 3000.0, (400, 2)).tolist()
    for number, (x, y) in enumerate(places):
        values = {"id": str(number), "x": x, "y": y, "radius": 5.0, "drone": number % 2}
        intake.take("detection", json.dumps(values))
    answers = intake.decide(60.0)
    codes = Counter(answer.code for answer in answers)
    assert codes["too_many"] > 200 and {*codes} == {"", "too_many"}
    assert len(intake.contacts()) == MOST_OPEN


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("searched", '"sweep_width": 9, "geometry": {"type": "LineString", "coordinates": '
         '[[-46.3, -24.0, %s], [-46.3, -24.1]]}'),
        ("searched", '"sweep_width": 9, "geometry": {"type": "LineString", "bbox": %s, '
         '"coordinates": [[-46.3, -24.0], [-46.3, -24.1]]}'),
        ("weather", '"wind": {"speed": 5, "from": 10, "select": {"time": %s}}'),
        ("weather", '"wind": {"speed": 5, "from": 10, "axes": %s}'),
        ("weather", '"wind": {"speed": 5, "from": 10, "variables": %s}'),
        ("weather", '"wind": {"speed": 5, "from": 10, "gap_cells": %s}'),
    ],
)  # fmt: skip
@pytest.mark.parametrize(
    "value", ["1e999", "-1e999", "NaN", "1" + "0" * 400, *("[" * n + "]" * n for n in (975, 980))]
)
def test_a_value_that_cannot_be_written_is_refused(kind: str, fields: str, value: str) -> None:
    intake = _intake()
    intake.take(kind, '{"id": "i", ' + fields % value + "}")
    (answer,) = intake.decide(60.0)
    assert not answer.ok and answer.code == "bad_json" and len(answer.reason) < 200


@pytest.mark.parametrize(
    ("kind", "values", "kept"),
    [
        (
            "searched",
            {"pod": 0.5, "geometry": {
                "type": "Polygon", "bbox": [1], "properties": {"a": []},
                "coordinates": [[[*point, 7] for point in AREA["coordinates"][0]]],
            }},
            {"pod": 0.5, "geometry": AREA},
        ),
        (
            "weather",
            {"wind": {"times_s": [0], "lats_deg": [0], "lons_deg": [0], "east_mps": [1],
                      "north_mps": [2], "source": "model"}},
            {"wind": {"times_s": [0.0], "lats_deg": [0.0], "lons_deg": [0.0], "east_mps": [1.0],
                      "north_mps": [2.0], "source": "model", "gap_cells": 0, "error": 0.0}},
        ),
    ],
)  # fmt: skip
def test_an_input_keeps_the_fields_of_its_kind_in_their_canonical_form(
    kind: str, values: dict[str, Any], kept: dict[str, Any]
) -> None:
    parsed = parse(kind, json.dumps({"id": "i", **values}))
    assert isinstance(parsed, Accepted) and parsed.value.values == kept


def test_a_ring_that_is_open_is_refused_with_its_ends() -> None:
    ring = AREA["coordinates"][0][:-1]
    geometry = {"type": "Polygon", "coordinates": [ring]}
    parsed = parse("searched", json.dumps({"id": "i", "pod": 0.5, "geometry": geometry}))
    assert isinstance(parsed, Rejected)
    assert "must end where it begins, at [-46.31, -24.01]" in parsed.reason


def test_what_is_not_the_same_when_it_is_read_again_is_refused() -> None:
    mission = Mission(live_env(particles=60, timestep_limit=10), 1)
    intake = LiveIntake(mission, lambda *_: None, Counter())
    assert isinstance(mission.beliefs, LiveBeliefs)
    # A caller without JSON: the poses of a detector.
    intake.take_values("detection", {"id": "i", "x": 1.0, "y": 2.0, "radius": np.float32(3.0)})
    intake.take_values("withdraw", {"id": "\ud800", "input": "i"})
    answers = intake.decide(0.0)
    assert [answer.ok for answer in answers] == [True, False]
    assert mission.beliefs.live_search.entries["i"] == read_back(
        mission.beliefs.live_search.entries["i"]
    )


@pytest.mark.parametrize("rules", ["paper", "sea"])
@pytest.mark.parametrize("early", [True, False])
def test_a_look_that_detected_is_no_miss_though_its_detection_is_one_too_many(
    rules: str, early: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(admission.MOST_OF_KIND, "detection", 0)
    reported, silent, unseen = (_flown(rules, reports, early) for reports in (3, 0, None))
    assert np.array_equal(reported.belief.density, unseen.belief.density)
    assert not np.array_equal(reported.belief.density, silent.belief.density)
    # What was searched was searched, whatever was seen; and one record of it is enough.
    assert reported.pos == silent.pos > unseen.pos == 0.0
    assert len(reported.history) == len(silent.history) + 1 and not reported.contacts.by_name
    again = LiveSearch(reported.scenario, reported.rules)
    again.repeat(from_text(to_text(reported.history)))
    assert kept(again) == kept(reported)


def _flown(rules: str, reports: int | None, early: bool) -> LiveSearch:
    """Return a live search with one look, and with reports of it that are too many.

    Args:
        rules: Of the search.
        reports: Their number; None for a search without the look.
        early: Whether they come before the look is made.
    """
    datum = live_env(rules, num_drones=1).scenario.person_initial_position
    fields: dict[str, Any] = {"num_drones": None, "drones_positions": [datum]}
    if reports is None:
        fields["probability_of_detection"] = 0.0
    if rules == "paper":
        # At first the person is in one cell.
        fields["pre_search_minutes"] = 5.0
    mission = Mission(live_env(rules, **fields), 1)
    intake, scenario = LiveIntake(mission, lambda *_: None, Counter()), mission.env.scenario
    x, y = cell_centre(scenario.grid_size, scenario.cell_size, *scenario.drones_positions[0])
    step_s = scenario.step_duration_s
    for turn in range(2):
        if turn == (0 if early else 1):
            intake.clock.set(turn, step_s * turn)
            for number in range(reports or 0):
                values = {"id": f"d{number}", "x": x, "y": y, "radius": 50.0, "drone": 0}
                intake.take("detection", json.dumps(values))
            assert {answer.code for answer in intake.decide(step_s * turn)} <= {"too_many"}
        if not turn:
            mission.command_all([mission.env.rules.action_set.search if rules == "paper" else 0])
            mission.advance("hold")
    assert isinstance(mission.beliefs, LiveBeliefs)
    return mission.beliefs.live_search


def test_after_the_last_detection_that_is_taken_contacts_can_still_be_decided(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(admission.MOST_OF_KIND, "detection", 3)
    intake = _intake()
    for number in range(4):
        values = {"id": f"d{number}", "x": 300.0 + 500.0 * number, "y": 300.0, "radius": 5.0}
        intake.take("detection", json.dumps(values))
    intake.take("dismiss", '{"id": "no", "contact": "c1"}')
    intake.take("withdraw", '{"id": "not", "input": "d1"}')
    intake.take("confirm", '{"id": "yes", "contact": "c3"}')
    answers = intake.decide(60.0)
    assert [answer.code for answer in answers] == ["", "", "", "too_many", "", "", ""]
    assert answers[3].reason == "detection must come at most 3 times in a mission"
