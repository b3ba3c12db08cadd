# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What people type and click becomes an input or a line that says what is missing."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from std_msgs.msg import String

from dsse_ros.screens.dashboard.live_forms import (
    change_of,
    place_line,
    places_of,
    searched,
    sighting,
    weather,
)
from dsse_ros.screens.dashboard.live_marks import Sketch, contact_at, live_marks, place_at, ranked
from dsse_ros.screens.dashboard.missions import ShownMission
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.live_texts import ShownContact, answer_from_json

FRAME = GridFrame(10, 100.0, -24.0, -46.0, 0.0, 120.0)
NUMBERS = st.none() | st.floats(0, 1e6)
FORMS = st.fixed_dictionaries({
    **{name: st.none() | st.text(max_size=40) for name in ("place", "places", "time", "end", "by")},
    **{name: NUMBERS for name in ("radius", "time_error", "weight", "pod", "sweep_width")},
    **{name: NUMBERS for name in ("wind_speed", "wind_from", "current_speed", "current_toward")},
    "shape": st.sampled_from(["area", "track"]),
})  # fmt: skip


@settings(max_examples=50)
@given(form=FORMS)
def test_whatever_is_typed_is_an_input_or_is_refused_on_one_line(form: dict[str, Any]) -> None:
    for make in (sighting, searched, weather):
        try:
            content = make(form)
        except ValueError as error:
            assert "\n" not in str(error)
        else:
            assert json.loads(json.dumps(content, allow_nan=False)) == content


@given(east=st.floats(0, 1), south=st.floats(0, 1))
def test_a_click_on_the_map_is_where_the_map_shows_it(east: float, south: float) -> None:
    (place,) = places_of(place_line(*place_at(FRAME, east, south)))
    (shown,) = live_marks(FRAME, (), Sketch((place,), closed=False))["sketch"]
    # The line has a tenth of a metre, on a map of a kilometre.
    assert shown == [pytest.approx(east, abs=2e-4), pytest.approx(south, abs=2e-4)]


def test_the_forms_make_the_inputs_of_the_topics() -> None:
    corners = "-24.1, -46.1\n-24.1 -46.2\n\n-24.2; -46.2"
    area = searched({"places": corners, "shape": "area", "pod": 78, "by": "lifeboat"})
    ring = [[-46.1, -24.1], [-46.2, -24.1], [-46.2, -24.2], [-46.1, -24.1]]
    polygon = {"type": "Polygon", "coordinates": [ring]}
    assert area == {"geometry": polygon, "pod": 0.78, "by": "lifeboat"}
    track = searched({"places": corners, "shape": "track", "sweep_width": 50, "time": "T"})
    line = {"type": "LineString", "coordinates": ring[:3]}
    assert track == {"geometry": line, "sweep_width": 50, "time": "T"}
    assert weather({"wind_speed": 0, "wind_from": 0}) == {"wind": {"speed": 0, "from": 0}}
    seen = sighting({"place": "-24, -46", "radius": 0, "weight": None, "time": ""})
    assert seen == {"lat": -24.0, "lon": -46.0, "radius": 0}


ANSWER = {
    "id": "a", "kind": "sighting", "ok": True, "code": "", "reason": "", "contact": None,
    "pos_before": 0.342, "pos_after": 0.31, "poc_moved": 0.12, "run_id": 5, "mission": 2,
}  # fmt: skip


def test_an_input_shows_what_it_has_changed_until_another_search_begins() -> None:
    mission = ShownMission("")

    def answer(**changed: Any) -> None:
        text = String(data=json.dumps(ANSWER | changed))
        mission.receive("live/answers", lambda: text)

    answer()
    # Neither a repetition nor another use of its identity hides what it has changed.
    answer(code="again", pos_before=None, pos_after=None, poc_moved=None)
    answer(ok=False, code="id_used", reason="id must be new")
    answer(id="b", ok=False, reason="time must not be ahead")
    assert [change_of(one) for one in mission.inputs.values()] == [
        "POS 34.2% → 31.0%, 12.0% of the POC moved",
        "refused: time must not be ahead",
    ]
    answer(id="b", contact="c1", pos_before=None, pos_after=None, poc_moved=None)
    assert change_of(mission.inputs["b"]) == "contact c1"
    mission.receive("live/answers", lambda: String(data="[]"))
    assert list(mission.inputs) == ["a", "b"]
    assert mission.trouble["live/answers"].startswith("answer must be an object")
    for i in range(1000):
        answer(id=str(i))
    assert len(mission.inputs) == 200
    answer(id="next", mission=3)
    assert list(mission.inputs) == ["next"]


def test_a_repeated_input_says_so() -> None:
    assert change_of(answer_from_json(json.dumps(ANSWER | {"code": "again"}))) == (
        "has been accepted before"
    )


def test_contacts_are_ranked_labelled_and_chosen_by_a_click_near_them() -> None:
    side_m = FRAME.extent.width
    contacts = tuple(
        ShownContact(name, state, *place_at(FRAME, x, 1 - y), x * side_m, y * side_m, 20.0, time_s,
                     "", 1, probability)
        for name, state, x, y, time_s, probability in (
            ("c1", "open", 0.2, 0.2, 9.0, 0.1), ("c2", "dismissed", 0.5, 0.5, 9.0, None),
            ("c3", "open", 0.5, 0.51, 1.0, 0.834), ("c4", "open", 0.8, 0.8, 1.0, None),
        )
    )  # fmt: skip
    assert [contact.name for contact in ranked(contacts)] == ["c3", "c1", "c4", "c2"]
    shown = live_marks(FRAME, contacts, Sketch((), closed=False))["contacts"]
    assert [label for *_, label in shown] == ["c3 83%", "c1 10%", "c4", "c2"]
    assert contact_at(FRAME, contacts, *place_at(FRAME, 0.5, 0.5)) == "c3"
    assert contact_at(FRAME, contacts, *place_at(FRAME, 0.21, 0.79)) == "c1"
    assert contact_at(FRAME, contacts, *place_at(FRAME, 0.35, 0.35)) is None
