# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The conformance test of kinds of drones takes good ones and names what is wrong with bad ones."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.conformance.searcher import searcher_test
from dsse_ros.search.environments import faults
from dsse_ros.search.step.fault_kernels import restrict_masks
from dsse_ros.world.scenario import action_times
from dsse_ros.world.scenario.action_times import whole_steps
from dsse_ros.world.scenario.searcher_fields import endurance_steps
from dsse_ros.world.searchers.registry import SEARCHERS
from dsse_ros.world.searchers.searcher import Searcher

STRAIGHT = ("left", "right", "up", "down")
SLOW = Searcher(doc="flies slowly", speed=4.0)


@pytest.mark.parametrize("rules", ["paper", "v1", "v2"])
@pytest.mark.parametrize("name", sorted(SEARCHERS))
def test_the_kinds_of_this_package_conform(name: str, rules: str) -> None:
    searcher_test(SEARCHERS[name], rules=rules)


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(
    st.none() | st.floats(0.3, 40.0),
    st.none() | st.floats(0.01, 30.0),
    st.none() | st.lists(st.sampled_from(STRAIGHT), unique=True).map(tuple),
    st.sampled_from(["paper", "v2"]),
    st.integers(0, 2**16),
)
def test_a_kind_of_any_speed_endurance_and_moves_conforms(
    speed: float | None,
    endurance_min: float | None,
    moves: tuple[str, ...] | None,
    rules: str,
    seed: int,
) -> None:
    kind = Searcher(doc="any", speed=speed, endurance_min=endurance_min, moves=moves)
    before = dict(SEARCHERS)
    searcher_test(kind, rules=rules, seed=seed)
    assert before == SEARCHERS


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"speed": 0.0}, ["speed", "0.0", "> 0"]),
        ({"speed": float("nan")}, ["speed", "nan"]),
        ({"altitude": -5.0}, ["altitude", "-5"]),
        ({"endurance_min": -1.0}, ["endurance_min", "-1"]),
        ({"moves": ("hop",)}, ["hop", "left"]),
        ({"sensor": "sonar"}, ["sensor", "sonar"]),
        ({"doc": ""}, ["doc", "empty"]),
    ],
)
def test_a_kind_that_no_scenario_can_have_is_named_on_one_line(
    fields: dict[str, Any], words: list[str]
) -> None:
    before = dict(SEARCHERS)
    with pytest.raises(AssertionError) as caught:
        searcher_test(Searcher(**{"doc": "bad", **fields}))
    assert "\n" not in str(caught.value)
    assert [word for word in words if word not in str(caught.value)] == []
    assert before == SEARCHERS


def test_what_is_no_kind_is_refused() -> None:
    with pytest.raises(AssertionError, match="not a Searcher"):
        searcher_test("slow")  # type: ignore[arg-type]


def masks_of_all(*arguments: Any) -> None:
    """Take nothing off the masks."""


def restrict_all_but_moves(*arguments: Any) -> None:
    """Take off the masks what drones cannot do, but for moves in which they are under way."""
    batch, fleet, *others = arguments
    conditions = fleet.conditions.copy()
    conditions["heading"] = -1
    restrict_masks(batch, fleet._replace(conditions=conditions), *others)


@pytest.mark.parametrize(
    ("kind", "name", "broken", "words"),
    [
        (SLOW, "whole_steps", lambda *speeds: whole_steps(*speeds) + 1, "step 3 of the 3"),
        (SLOW, "whole_steps", lambda *speeds: 2, "step 2 of the 3"),
        (
            Searcher(doc="", endurance_min=3.0), "endurance_steps",
            lambda *given: endurance_steps(*given) and endurance_steps(*given) + 1, "status",
        ),
        (Searcher(doc="", endurance_min=30.0), "endurance_steps", lambda *given: 0, "endurance"),
    ],
    ids=["late", "early", "over its endurance", "without an end"],
)  # fmt: skip
def test_a_search_that_does_not_fly_a_kind_as_it_is_fails(
    kind: Searcher, name: str, broken: Any, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(action_times if name == "whole_steps" else faults, name, broken)
    with pytest.raises(AssertionError, match=words) as caught:
        searcher_test(Searcher(**{**vars(kind), "doc": "flies in a broken search"}))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "restrict", "words"),
    [
        (SLOW, restrict_all_but_moves, "under way with"),
        (Searcher(doc="flies straight", moves=STRAIGHT), masks_of_all, "no moves of its"),
    ],
    ids=["under way", "moves"],
)
def test_masks_that_allow_too_much_fail(
    kind: Searcher, restrict: Any, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(faults.fault_kernels, "restrict_masks", restrict)
    with pytest.raises(AssertionError, match=words):
        searcher_test(kind)
