# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle refuses is asked for as often as that may help, and the reason names its words."""

from __future__ import annotations

import math
from typing import Any

import pytest
from autopilot.commands import ACCEPTED, DENIED, FAILED, TEMPORARILY_REJECTED, UNSUPPORTED
from virtual_flight import VirtualFlight

from dsse_ros.vehicles.control.orders import GoTo, TakeOff
from dsse_ros.vehicles.mavlink.messages import SetPositionTarget

TAKEOFF, CHANGE_SPEED = 22, 178
AUTOPILOTS = ("ardupilot", "px4")
IN_PROGRESS = 5
FENCE = (("FENCE_ENABLE", 1), ("FENCE_RADIUS", 150.0))


PATIENT = {"ardupilot": (("DISARM_DELAY", 60),), "px4": (("COM_DISARM_PRFLT", 60.0),)}
"""Parameters with which it stays armed on the ground for a minute."""


def refusing(autopilot: str, number: int, *results: int, **settings: Any) -> VirtualFlight:
    """Return a vehicle that answers a command with these, the last one forever."""
    flight = VirtualFlight(autopilot, vehicle={"parameters": PATIENT[autopilot]}, **settings)
    obey, answers = flight.vehicle._commands[number], list(results)

    def answer(command: Any) -> int:
        result = answers.pop(0) if len(answers) > 1 else answers[0]
        return obey(command) if result == ACCEPTED else result

    flight.vehicle.add_commands({number: answer})
    return flight


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_command_that_is_not_supported_is_sent_once(autopilot: str) -> None:
    flight = refusing(autopilot, TAKEOFF, UNSUPPORTED)
    outcome = flight.fly(TakeOff(10.0))
    assert (outcome.status, outcome.final) == ("failed", True)
    assert "UNSUPPORTED" in outcome.reason
    assert len(flight.commands(TAKEOFF)) == 1


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_command_that_is_denied_is_sent_a_few_times(autopilot: str) -> None:
    flight = refusing(autopilot, TAKEOFF, DENIED)
    outcome = flight.fly(TakeOff(10.0))
    assert (outcome.status, outcome.final) == ("failed", False)
    assert "no effect after 3 tries: DENIED" in outcome.reason
    assert len(flight.commands(TAKEOFF)) == 3


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
@pytest.mark.parametrize("result", [TEMPORARILY_REJECTED, IN_PROGRESS, FAILED])
def test_a_command_that_may_succeed_later_is_sent_again(autopilot: str, result: int) -> None:
    flight = refusing(autopilot, TAKEOFF, *[result] * 6, ACCEPTED)
    assert flight.fly(TakeOff(10.0)).status == "done"
    assert len(flight.commands(TAKEOFF)) == 7


def test_a_speed_that_is_not_supported_is_asked_for_once() -> None:
    flight = refusing("ardupilot", CHANGE_SPEED, UNSUPPORTED, speed_mps=5.0)
    assert flight.fly(TakeOff(20.0)).status == "done"
    assert flight.fly(GoTo(*flight.place(60.0, 0.0), 20.0, 3.0)).status == "done"
    assert len(flight.commands(CHANGE_SPEED)) == 1


def setpoints_since(flight: VirtualFlight, since_s: float) -> list[SetPositionTarget]:
    return [m for at_s, m in flight.sent if at_s >= since_s and isinstance(m, SetPositionTarget)]


def test_each_try_of_a_target_beyond_the_vehicles_own_fence_is_sent_and_names_it() -> None:
    flight = VirtualFlight("ardupilot", vehicle={"parameters": FENCE})
    assert flight.fly(TakeOff(20.0)).status == "done"
    assert flight.state.fenced
    beyond = GoTo(*flight.place(400.0, 0.0), 20.0, 3.0)
    for _ in range(3):
        before_s = flight.now
        outcome = flight.fly(beyond)
        assert outcome.status == "failed"
        assert "does not accept its target" in outcome.reason and "geofence" in outcome.reason
        assert len(setpoints_since(flight, before_s)) == 15
        assert flight.now - before_s > 14.0
    assert math.hypot(flight.vehicle.craft.north_m, flight.vehicle.craft.east_m) < 5.0
    # Within it, it flies.
    assert flight.fly(GoTo(*flight.place(100.0, 0.0), 20.0, 3.0)).status == "done"


def test_a_target_that_is_taken_up_late_is_flown_by_a_later_try() -> None:
    flight = VirtualFlight("ardupilot", vehicle={"parameters": FENCE}, command_tries=3)
    assert flight.fly(TakeOff(20.0)).status == "done"
    order = GoTo(*flight.place(200.0, 0.0), 20.0, 3.0)
    assert flight.fly(order).status == "failed"
    flight.vehicle.parameters["FENCE_RADIUS"] = 300.0
    assert flight.fly(order).status == "done"


def test_a_vehicle_that_breaches_its_own_fence_is_left_to_it_and_why_is_reported() -> None:
    flight = VirtualFlight("ardupilot", vehicle={"parameters": FENCE})
    assert flight.fly(TakeOff(20.0)).status == "done"
    flight.give(GoTo(*flight.place(140.0, 0.0), 20.0, 3.0))
    flight.wait(8.0)
    flight.vehicle.parameters["FENCE_RADIUS"] = 30.0
    flight.until(lambda: flight.outcome.status == "failsafe")
    assert flight.outcome.reason.startswith("in RTL, fence failsafe")
    assert "Fence Breached" in flight.outcome.reason
