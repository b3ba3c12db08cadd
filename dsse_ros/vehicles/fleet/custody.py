# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Custody of a vehicle: who controls it, and which orders the bridge may send to it.

`NEXT` maps each state and event to the next state; an event that is not listed changes nothing.
`MAY_ORDER` lists the orders that a state allows; without such an order the bridge does not arm a
vehicle, move it or change its mode. A take-off also needs a vehicle that is ready
(`VehicleDispatcher`) and its turn (`FleetAirspace`), and `FlightRecord.arm` says whether the bridge
arms it. docs/flight.md prints both tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from dsse_ros.vehicles.control.orders import (
    FlyMission,
    FlyTrack,
    GoTo,
    Hold,
    Land,
    MakeReady,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.vehicles.control.vehicle_controller import Order


class Custody(Enum):
    """Who controls a vehicle; the value is the name of the state on topics and in files."""

    FREE = "free"
    """Nobody has cleared it to fly."""
    CLEARED = "cleared"
    """It is cleared to fly in one search, and on the ground."""
    FOLLOWING = "following"
    """It follows its drone."""
    HELD = "held"
    """An operator holds it in the air."""
    RECALLED = "recalled"
    """An operator has ordered it to return or land."""
    ENDING = "ending"
    """Its search is over: it carries out `at_end`."""
    TAKEN = "taken over"
    """A person controls it, in the air or on the ground."""
    RELEASED = "released"
    """It is armed, and nobody controls it: a person has released it, or no bridge was there."""
    FAILSAFE = "failsafe"
    """A failsafe of its autopilot controls it."""
    GROUNDED = "grounded"
    """It has flown or dropped out, and stays on the ground."""
    CRASHED = "crashed"
    """Its motors have stopped in the air; `drone<i>/arm` alone clears it again."""


class Event(Enum):
    """Events that change who controls a vehicle; the value describes when each happens."""

    CLEAR = "it is cleared: `~/arm`, or by the parameter `arm`"
    LIFT_OFF = "its motors turn for the take-off"
    SEARCH_OVER = "its drone's search is over"
    DROP_OUT = "it drops out: link lost, order failed, fence left, failsafe that keeps its mode"
    FALL = "it falls below `min_altitude` without an order"
    HOLD = "an operator calls `~/hold` for it in the air"
    COME_DOWN = "an operator calls `~/return` or `~/land` for it in the air"
    GROUND = "an operator calls `~/arm` with `false`, or another service for it on the ground"
    DOWN = "it is disarmed on the ground, after it was armed"
    CRASH = "its motors stop in the air"
    TAKE_OVER = "a person changes its mode, target, mission or home, restarts or disarms it"
    FAILSAFE = "a failsafe changes its mode"
    EXPLAIN = "the autopilot reports a failsafe, up to 3 s after its mode changed"
    DOUBLE = "two vehicles turn out to have its id, up to 10 s after that, and it is in its mode"
    RELEASE = "a person sets GUIDED (PX4: OFFBOARD) while it is armed"


_FLOWN: Mapping[Event, Custody] = {
    Event.FALL: Custody.RECALLED,
    Event.TAKE_OVER: Custody.TAKEN,
    Event.FAILSAFE: Custody.FAILSAFE,
}
"""Events that take away any vehicle that the bridge flies, or change what it does."""

_TABLE: Mapping[Custody, Mapping[Event, Custody]] = {
    Custody.FREE: {
        Event.CLEAR: Custody.CLEARED,
        Event.GROUND: Custody.TAKEN,
        Event.DOWN: Custody.TAKEN,
        Event.TAKE_OVER: Custody.TAKEN,
    },
    Custody.CLEARED: {
        Event.LIFT_OFF: Custody.FOLLOWING,
        Event.SEARCH_OVER: Custody.FREE,
        Event.DROP_OUT: Custody.GROUNDED,
        Event.GROUND: Custody.TAKEN,
        Event.TAKE_OVER: Custody.TAKEN,
        Event.FAILSAFE: Custody.FAILSAFE,
    },
    Custody.FOLLOWING: {
        Event.SEARCH_OVER: Custody.ENDING,
        Event.DROP_OUT: Custody.ENDING,
        Event.DOWN: Custody.GROUNDED,
        **_FLOWN,
    },
    Custody.HELD: {Event.CLEAR: Custody.FOLLOWING, Event.DOWN: Custody.TAKEN, **_FLOWN},
    Custody.RECALLED: {Event.CLEAR: Custody.FOLLOWING, Event.DOWN: Custody.TAKEN, **_FLOWN},
    Custody.ENDING: {Event.CLEAR: Custody.FOLLOWING, Event.DOWN: Custody.GROUNDED, **_FLOWN},
    Custody.TAKEN: {
        Event.CLEAR: Custody.CLEARED,
        Event.EXPLAIN: Custody.FAILSAFE,
        Event.DOUBLE: Custody.RECALLED,
        Event.RELEASE: Custody.RELEASED,
    },
    Custody.RELEASED: {
        Event.CLEAR: Custody.FOLLOWING,
        Event.DOWN: Custody.GROUNDED,
        Event.TAKE_OVER: Custody.TAKEN,
        Event.FAILSAFE: Custody.FAILSAFE,
    },
    Custody.FAILSAFE: {
        Event.CLEAR: Custody.CLEARED,
        Event.DOUBLE: Custody.RECALLED,
        Event.RELEASE: Custody.RELEASED,
        Event.DOWN: Custody.GROUNDED,
    },
    Custody.GROUNDED: {
        Event.CLEAR: Custody.CLEARED,
        Event.GROUND: Custody.TAKEN,
        Event.DOWN: Custody.TAKEN,
        Event.TAKE_OVER: Custody.TAKEN,
    },
    Custody.CRASHED: {Event.CLEAR: Custody.CLEARED, Event.TAKE_OVER: Custody.TAKEN},
}
_IN_EVERY_STATE: Mapping[Event, Custody] = {
    Event.HOLD: Custody.HELD,
    Event.COME_DOWN: Custody.RECALLED,
    Event.CRASH: Custody.CRASHED,
}
NEXT: Mapping[Custody, Mapping[Event, Custody]] = {
    custody: {**after, **_IN_EVERY_STATE} for custody, after in _TABLE.items()
}
"""The next state, by state and event."""

MAY_ORDER: Mapping[Custody, tuple[type[Order], ...]] = {
    Custody.FREE: (),
    Custody.CLEARED: (MakeReady, TakeOff, FlyMission),
    Custody.FOLLOWING: (TakeOff, GoTo, SearchPlace, FlyTrack, Hold, FlyMission),
    Custody.HELD: (Hold,),
    Custody.RECALLED: (Return, Land),
    Custody.ENDING: (GoTo, Hold, Return, Land),
    Custody.TAKEN: (),
    Custody.RELEASED: (),
    Custody.FAILSAFE: (),
    Custody.GROUNDED: (),
    Custody.CRASHED: (),
}
"""The orders that a state allows. If there are none, the bridge sends heartbeats and requests
only."""

ENDS: Mapping[str, Order] = {"return": Return(), "land": Land(), "hold": Hold()}
"""What the parameter `at_end` and the services of an operator order."""

AIRBORNE = frozenset({Custody.FOLLOWING, Custody.HELD, Custody.RECALLED, Custody.ENDING})
"""States in which the bridge flies the vehicle."""


def next_custody(custody: Custody, event: Event) -> Custody:
    """Return who controls a vehicle after an event."""
    return NEXT[custody].get(event, custody)
