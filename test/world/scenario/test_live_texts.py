# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Contacts and answers as anybody may have written them."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.world.scenario.live_texts import (
    Answer,
    ShownContact,
    answer_from_json,
    contacts_from_json,
)

CONTACT = {
    "contact": "c1", "state": "open", "lat": -24.0, "lon": -46.0, "x": 1.0, "y": 2.0,
    "radius": 25.0, "time": 60, "utc": None, "detections": 2, "probability": 0.4, "later": [],
}  # fmt: skip
ANSWER = {
    "id": "a", "kind": "weather", "ok": True, "code": "", "reason": "", "contact": None,
    "pos_before": 0.3, "pos_after": 0.2, "poc_moved": 0.6, "run_id": 5, "mission": 2,
}  # fmt: skip


def test_a_contact_and_an_answer_are_read() -> None:
    (contact,) = contacts_from_json(json.dumps([CONTACT]))
    assert contact == ShownContact("c1", "open", -24.0, -46.0, 1.0, 2.0, 25.0, 60.0, "", 2, 0.4)
    answer = answer_from_json(json.dumps(ANSWER))
    assert answer == Answer("a", "weather", True, "", "", "", "", 0.3, 0.2, 0.6, (5, 2))


VALUES = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=4,
)


@settings(max_examples=40)
@given(key=st.sampled_from([*CONTACT, *ANSWER]), value=VALUES)
def test_whatever_stands_there_is_read_or_refused_on_one_line(key: str, value: Any) -> None:
    for read, content in ((contacts_from_json, [CONTACT]), (answer_from_json, ANSWER)):
        changed = json.loads(json.dumps(content))
        (changed[0] if isinstance(changed, list) else changed)[key] = value
        try:
            read(json.dumps(changed))
        except ValueError as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize("text", ["", "{}", "[1]", "[null]", '{"kind": ""}', "NaN", "[" * 10**5])
def test_what_is_no_such_text_is_refused(text: str) -> None:
    for read in (contacts_from_json, answer_from_json):
        with pytest.raises(ValueError, match="contacts|answer"):
            read(text)
