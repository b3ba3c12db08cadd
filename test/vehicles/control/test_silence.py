# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A vehicle that falls silent gets nothing but heartbeats, and goes on when they come again."""

from __future__ import annotations

from typing import Any, get_args

import pytest
from autopilot.faults import Fault
from virtual_flight import VirtualFlight, mission

from dsse_ros.vehicles.control.orders import FlyMission, GoTo, Hold, Return, SearchPlace, TakeOff
from dsse_ros.vehicles.control.vehicle_controller import Status

AUTOPILOTS = ("ardupilot", "px4")


def test_lost_is_for_who_follows_the_vehicle_to_say() -> None:
    assert "silent" in get_args(Status) and "lost" not in get_args(Status)


@pytest.mark.parametrize("during", ["flight", "hold of a search", "mission", "return", "rest"])
def test_an_order_goes_on_where_it_was(during: str) -> None:
    silence = Fault("link", 12.0, since_airborne=True, duration_s=20.0)
    flight = VirtualFlight("ardupilot", vehicle={"faults": (silence,)})
    assert flight.fly(TakeOff(15.0)).status == "done"
    orders: dict[str, Any] = {
        "flight": GoTo(*flight.place(200.0, 0.0), 15.0, 3.0),
        "hold of a search": SearchPlace(*flight.place(0.0, 0.0), 15.0, 10.0, 40.0, 3.0),
        "mission": FlyMission(mission(flight, (200.0, 0.0, 15.0))),
        "return": Return(),
        "rest": Hold(),
    }
    flight.give(orders[during])
    flight.until(lambda: flight.outcome.status == "silent")
    assert flight.outcome.reason == "no heartbeat for 5 s"
    assert flight.outcome.order == orders[during]
    assert not flight.state.connected and flight.state.mode
    sent, since_s = len(flight.sent), flight.now
    # An order that is given meanwhile waits too.
    if during == "rest":
        flight.give(GoTo(*flight.place(50.0, 0.0), 15.0, 3.0))
    flight.until(lambda: flight.state.connected)
    assert flight.now - since_s > 10.0
    late = [message for at_s, message in flight.sent[sent:] if at_s < flight.now]
    assert late == []
    flight.until(lambda: flight.outcome.status != "under_way")
    assert flight.outcome.status == "done"
    if during in ("mission", "return"):
        assert flight.vehicle.landed
    if during == "rest":
        assert flight.off_m(50.0, 0.0) < 5.0


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_silence_in_between_does_not_count_as_no_progress(autopilot: str) -> None:
    silence = Fault("link", 12.0, since_airborne=True, duration_s=20.0)
    flight = VirtualFlight(autopilot, stall_s=10.0, vehicle={"faults": (silence,)})
    assert flight.fly(TakeOff(15.0)).status == "done"
    order = GoTo(*flight.place(900.0, 0.0), 15.0, 3.0)
    flight.give(order)
    flight.until(lambda: flight.outcome.status == "silent")
    flight.until(lambda: flight.state.connected)
    flight.wait(3.0)
    assert flight.outcome.status == "under_way" and flight.outcome.order == order
