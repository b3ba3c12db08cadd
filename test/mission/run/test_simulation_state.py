# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state table of a simulation."""

from __future__ import annotations

import pytest

from dsse_ros.mission.run.simulation_state import NEXT, Request, SimulationState, reason_to_refuse


@pytest.mark.parametrize("state", SimulationState)
@pytest.mark.parametrize("request_", Request)
def test_a_request_is_refused_where_the_table_has_no_next_state(
    request_: Request, state: SimulationState
) -> None:
    assert bool(reason_to_refuse(request_, state)) == (state not in NEXT[request_])


def test_a_stopped_simulation_makes_no_step_and_is_left_by_play_or_pause_only() -> None:
    stopped = SimulationState.STOPPED
    leave = {request for request in Request if NEXT[request].get(stopped, stopped) is not stopped}
    refused = {request for request in Request if reason_to_refuse(request, stopped)}
    assert leave == {Request.PLAY, Request.PAUSE}
    assert refused == {Request.STEP, Request.STEP_PAUSED}


def test_a_refusal_names_the_states_that_are_allowed_and_the_present_one() -> None:
    reason = reason_to_refuse(Request.STEP, SimulationState.STOPPED)
    assert reason == "the simulation must be playing or paused, got stopped"
