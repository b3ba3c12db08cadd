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
from live_searches import AREA, LINE, fly, live_env

from dsse_ros.live.admission import MOST_INPUTS
from dsse_ros.live.beliefs import LiveBeliefs
from dsse_ros.live.contacts import MOST_OPEN
from dsse_ros.live.inputs import KINDS
from dsse_ros.mission.flight_mission import mission_of
from dsse_ros.mission.live_intake import LiveIntake

ODD: list[Any] = [
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
    mission = mission_of(live_env(particles=60, timestep_limit=10), 1)
    assert isinstance(mission.beliefs, LiveBeliefs)
    mission.beliefs.keeper.repeat(fly(live_env(particles=60, timestep_limit=10), 3))
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
    density = beliefs.keeper.belief.density
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
    assert len(intake.contacts()) == MOST_OPEN < MOST_INPUTS
