# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The states of a simulation, the requests that each allows, and the states after them.

The services of `sim_node` and those of simulation_interfaces both use `NEXT`.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, IntEnum


class SimulationState(IntEnum):
    """State of a simulation, with the numbers of simulation_interfaces/msg/SimulationState."""

    STOPPED = 0
    """It is held at the start of a run."""
    PLAYING = 1
    """It makes steps as `step_mode` decides."""
    PAUSED = 2
    """It is held; single steps are made on request."""


class Request(Enum):
    """Requests to a simulation; the value lists the services that make them."""

    STOP = "`~/set_simulation_state` stopped"
    PLAY = "`~/set_simulation_state` playing, `~/pause` with `false`"
    PAUSE = "`~/set_simulation_state` paused, `~/pause` with `true`"
    STEP = "`~/step`"
    STEP_PAUSED = "`~/step_simulation`"
    RESET = "`~/reset`, `~/reset_simulation`"


_ALL = tuple(SimulationState)
_STOPPED, _PLAYING, _PAUSED = _ALL

NEXT: Mapping[Request, Mapping[SimulationState, SimulationState]] = {
    Request.STOP: dict.fromkeys(_ALL, _STOPPED),
    Request.PLAY: dict.fromkeys(_ALL, _PLAYING),
    Request.PAUSE: dict.fromkeys(_ALL, _PAUSED),
    Request.STEP: {_PLAYING: _PLAYING, _PAUSED: _PAUSED},
    Request.STEP_PAUSED: {_PAUSED: _PAUSED},
    Request.RESET: {state: state for state in _ALL},
}
"""The next state, by request and state; a request is refused in a state that is not listed."""


def reason_to_refuse(request: Request, state: SimulationState) -> str:
    """Return why a request is refused in a state, "" if it is not."""
    allowed = NEXT[request]
    if state in allowed:
        return ""
    states = " or ".join(state.name.lower() for state in allowed)
    return f"the simulation must be {states}, got {state.name.lower()}"
