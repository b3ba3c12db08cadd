# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A defect of ours ends the order that it is in, with its reason, and nothing else."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator

import pytest
from autopilot.running import running_autopilot
from virtual_flight import VirtualFlight

from dsse_ros.vehicles.control.orders import GoTo, Hold, TakeOff
from dsse_ros.vehicles.control.vehicle import Vehicle, VehicleSettings
from dsse_ros.vehicles.control.vehicle_controller import VehicleController

AUTOPILOTS = ("ardupilot", "px4")


@pytest.fixture
def defective_search(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A program in which holding has a defect that shows after a while."""

    def defective(order: Hold, controller: VehicleController) -> Iterator[str]:
        yield "holding"
        yield {}["no such key"]  # type: ignore[misc]

    monkeypatch.setattr(Hold, "carry_out", defective)
    yield


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_defect_fails_the_order_and_the_next_one_is_flown(
    autopilot: str, defective_search: None, caplog: pytest.LogCaptureFixture
) -> None:
    flight = VirtualFlight(autopilot)
    assert flight.fly(TakeOff(10.0)).status == "done"
    for _ in range(3):
        outcome = flight.fly(Hold())
        assert (outcome.status, outcome.reason) == ("failed", "KeyError: 'no such key'")
        flight.wait(5.0)
        assert flight.outcome == outcome
    assert flight.controller.counts["errors"] == 3
    # A kind is logged once, with its traceback.
    logged = [one for one in caplog.records if one.levelno >= logging.ERROR]
    assert len(logged) == 1 and logged[0].exc_info is not None
    assert flight.fly(GoTo(*flight.place(20.0, 0.0), 10.0, 3.0)).status == "done"


@pytest.mark.slow
def test_after_a_defect_the_thread_goes_on_with_heartbeats(defective_search: None) -> None:
    with (
        running_autopilot(link="udpin", speedup=10, ready_s=5.0) as autopilot,
        Vehicle(VehicleSettings(connection=autopilot.connection)) as vehicle,
    ):
        end_s = time.monotonic() + 180.0
        while vehicle.counts["accepted"] < 20:
            assert time.monotonic() < end_s
            time.sleep(0.01)
        vehicle.give(Hold())
        while vehicle.outcome.status != "failed":
            assert time.monotonic() < end_s, vehicle.outcome
            time.sleep(0.01)
        assert vehicle.outcome.reason == "KeyError: 'no such key'"
        sent = vehicle.counts["heartbeats"]
        while vehicle.counts["heartbeats"] < sent + 3:
            assert time.monotonic() < end_s
            time.sleep(0.01)
        assert vehicle.state.connected
