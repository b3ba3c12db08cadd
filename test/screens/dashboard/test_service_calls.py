# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands between a click and the answer of a service."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.screens.dashboard.service_calls import (
    ANSWER_S,
    MAX_AGE_S,
    Command,
    ServiceCalls,
    clicked_at,
)

CLICK = Command("", "arm", 0.0, "drone0")


@dataclass
class Answer:
    """The future of an answer."""

    response: Any = None

    def done(self) -> bool:
        return self.response is not None

    def result(self) -> Any:
        return self.response


@dataclass
class Service:
    """A service that may be there or not, and its client."""

    ready: bool = False
    requests: list[tuple[float, Command]] = field(default_factory=list)
    pending: list[Answer] = field(default_factory=list)
    now_s: float = 0.0

    def service_is_ready(self) -> bool:
        return self.ready

    def call_async(self, request: Any) -> Answer:
        self.requests.append((self.now_s, request))
        self.pending.append(Answer())
        return self.pending[-1]

    def remove_pending_request(self, future: Any) -> None:
        self.pending = [call for call in self.pending if call is not future]

    def answer(self) -> None:
        if self.pending:
            self.pending.pop(0).response = "done"


class Desk:
    """The calls of one service with a clock, and what they have led to."""

    def __init__(self, service: Service) -> None:
        self.service = service
        self.outcomes: list[tuple[Command, str]] = []
        self.calls = ServiceCalls(
            lambda _: service,
            lambda command: command,
            lambda command, response: self.outcomes.append((command, response)),
            lambda command, reason: self.outcomes.append((command, reason)),
        )

    def turn(self, now_s: float) -> None:
        self.service.now_s = now_s
        self.calls.turn(now_s)


def test_a_service_that_appears_gets_nothing_that_was_given_up() -> None:
    desk = Desk(Service())
    desk.calls.put([CLICK])
    desk.turn(MAX_AGE_S - 0.1)
    # It appears between two turns, the second of which comes too late.
    desk.service.ready = True
    desk.turn(MAX_AGE_S + 0.1)
    assert desk.service.requests == []
    assert desk.outcomes == [
        (CLICK, "not sent within 5 s of the click: nobody served it; click again")
    ]


def test_a_click_that_comes_late_is_not_sent() -> None:
    desk = Desk(Service(ready=True))
    desk.calls.put([CLICK, CLICK._replace(clicked_s=-math.inf)])
    desk.turn(60.0)
    assert desk.service.requests == [] and len(desk.outcomes) == 2
    assert desk.outcomes[0][1] == "not sent within 5 s of the click; click again"


def test_a_request_without_an_answer_is_forgotten() -> None:
    desk = Desk(Service(ready=True))
    desk.calls.put([CLICK])
    desk.turn(1.0)
    assert len(desk.service.pending) == 1
    desk.turn(1.0 + ANSWER_S + 0.1)
    assert desk.service.pending == []
    assert desk.outcomes == [(CLICK, "no answer within 5 s: it may still be obeyed")]


EVENTS = st.lists(
    st.one_of(
        st.tuples(st.just("click"), st.floats(-20.0, 0.0)),
        st.tuples(st.just("wait"), st.floats(0.0, 8.0)),
        st.tuples(st.sampled_from(["appear", "vanish", "answer", "turn"]), st.just(0.0)),
    ),
    max_size=30,
)


@given(EVENTS)
def test_whatever_happens_each_click_has_one_outcome_and_none_is_sent_when_it_is_old(
    events: list[tuple[str, float]],
) -> None:
    service = Service()
    desk, now_s, clicks = Desk(service), 100.0, 0
    for what, amount in events:
        if what == "click":
            clicks += 1
            desk.calls.put([CLICK._replace(clicked_s=now_s + amount, vehicle=str(clicks))])
        elif what == "answer":
            service.answer()
        elif what == "wait":
            now_s += amount
        else:
            service.ready = {"appear": True, "vanish": False}.get(what, service.ready)
        given_up = {command for command, _ in desk.outcomes}
        sent = len(service.requests)
        if what != "wait":
            desk.turn(now_s)
        assert not given_up & {command for _, command in service.requests[sent:]}
    assert all(at_s - command.clicked_s <= MAX_AGE_S for at_s, command in service.requests)
    for later_s in (10.0, 20.0):
        desk.turn(now_s + later_s)
    assert len(desk.outcomes) == len({command for command, _ in desk.outcomes}) == clicks
    assert service.pending == []


@pytest.mark.parametrize("stated", [None, "5", True, math.nan, math.inf, [5.0], {}])
def test_a_click_of_unknown_time_is_as_old_as_can_be(stated: Any) -> None:
    assert clicked_at(stated, 10.0) == -math.inf


@given(st.floats(0.0, 1e9), st.floats(0.0, 1e9))
def test_a_click_is_never_of_the_future(stated: float, now_s: float) -> None:
    assert clicked_at(stated, now_s) == min(stated, now_s)
