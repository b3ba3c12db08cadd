# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Twenty vehicles in one process are all flown, and each receives our heartbeats."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from typing import Any

import pytest
from autopilot.running import Running, running_autopilot
from pace import Pace

from dsse_ros.vehicles.autopilots import ARDUPILOT, PX4
from dsse_ros.vehicles.control.orders import GoTo, Return, TakeOff
from dsse_ros.vehicles.control.vehicle import VehicleFleet, VehicleSettings

pytestmark = pytest.mark.slow

NUMBER = 20
TIMEOUT_S = 300.0


@contextlib.contextmanager
def flying_fleet(
    number: int, speedup: float = 1.0, **options: Any
) -> Iterator[tuple[VehicleFleet, list[Running]]]:
    with contextlib.ExitStack() as stack:
        autopilots = [
            stack.enter_context(
                running_autopilot(
                    link="udpin",
                    system=index + 1,
                    home=(-24.0 + 0.001 * index, -46.3, 0.0),
                    ready_s=5.0,
                    speedup=speedup,
                )
            )
            for index in range(number)
        ]
        settings = [
            VehicleSettings(connection=autopilot.connection, system_id=index + 1, **options)
            for index, autopilot in enumerate(autopilots)
        ]
        fleet = stack.enter_context(contextlib.closing(VehicleFleet(settings)))
        fleet.start()
        yield fleet, autopilots


def until_all(fleet: VehicleFleet, status: str, leave_out: tuple[int, ...] = ()) -> None:
    end_s = time.monotonic() + TIMEOUT_S
    for index, vehicle in enumerate(fleet):
        while index not in leave_out and vehicle.outcome.status != status:
            assert time.monotonic() < end_s, f"{index}: {vehicle.outcome}, {vehicle.trouble}"
            time.sleep(0.05)


def test_twenty_vehicles_fly_and_each_gets_a_heartbeat_a_second() -> None:
    with flying_fleet(NUMBER, link_timeout_s=30.0) as (fleet, _):
        pace = Pace(*fleet)
        for vehicle in fleet:
            vehicle.give(TakeOff(8.0))
        until_all(fleet, "done")
        for index, vehicle in enumerate(fleet):
            vehicle.give(GoTo(-24.0 + 0.001 * index, -46.2998, 8.0, 3.0))
        until_all(fleet, "done")
        for vehicle, (sent, missed) in zip(fleet, pace.check(), strict=True):
            assert vehicle.state.flying
            assert vehicle.state.lon_deg == pytest.approx(-46.2998, abs=5e-5)
            counts = vehicle.counts
            # Some are missed on a busy machine, but no thread holds up the others for long.
            assert missed < sent
            assert counts["link_lost"] == counts["errors"] == 0


def test_a_vehicle_that_drops_out_does_not_stop_the_others() -> None:
    with flying_fleet(3, speedup=10.0) as (fleet, autopilots):
        for vehicle in fleet:
            vehicle.give(TakeOff(5.0))
        until_all(fleet, "done")
        autopilots[1].kill()
        for index in (0, 2):
            fleet[index].give(Return())
        until_all(fleet, "done", leave_out=(1,))
        until_all(fleet, "silent", leave_out=(0, 2))


def test_connections_are_numbered_as_the_field_does() -> None:
    assert ARDUPILOT.connections(3) == [
        "udpin:127.0.0.1:14550",
        "udpin:127.0.0.1:14560",
        "udpin:127.0.0.1:14570",
    ]
    assert PX4.connections(2) == ["udpin:127.0.0.1:14540", "udpin:127.0.0.1:14541"]


def test_vehicles_do_not_share_a_link() -> None:
    settings = [VehicleSettings(connection="udpin:127.0.0.1:14550", system_id=k) for k in (1, 2)]
    with pytest.raises(ValueError, match="14550"):
        VehicleFleet(settings)


def test_a_fleet_has_its_vehicles_in_order() -> None:
    connections = ARDUPILOT.connections(3)
    fleet = VehicleFleet([VehicleSettings(connection=name) for name in connections])
    assert len(fleet) == 3
    assert [vehicle.settings.connection for vehicle in fleet] == connections
    assert fleet[2].settings.connection == connections[2]
    fleet.close()
