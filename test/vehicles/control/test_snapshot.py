# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Other threads read a vehicle while its own thread goes on, and never see half of a change."""

from __future__ import annotations

import threading
import time
from dataclasses import FrozenInstanceError
from typing import Any

import pytest
from autopilot.running import free_udp_port, running_autopilot
from autopilot.wire import Codec as Speaker
from autopilot.wire import mavlink

from dsse_ros.vehicles.control.orders import Hold, Land, TakeOff
from dsse_ros.vehicles.control.vehicle import Vehicle, VehicleSettings

TIMEOUT_S = 120.0


def vehicle_on(connection: str, **options: Any) -> Vehicle:
    return Vehicle(VehicleSettings(connection=connection, **options))


def test_a_snapshot_is_one_moment_and_nobody_changes_it() -> None:
    vehicle = vehicle_on(f"udpin:127.0.0.1:{free_udp_port()}")
    before = vehicle.snapshot
    with pytest.raises(FrozenInstanceError):
        before.trouble = "none"  # type: ignore[misc]
    with pytest.raises(TypeError):
        before.counts["opened"] = 7  # type: ignore[index]
    assert before.counts["opened"] == 0
    vehicle.start()
    end_s = time.monotonic() + TIMEOUT_S
    while vehicle.snapshot.counts["heartbeats"] < 1:
        assert time.monotonic() < end_s
        time.sleep(0.01)
    assert before.counts["opened"] == 0 and vehicle.counts["opened"] == 1
    vehicle.close()


@pytest.mark.slow
def test_counts_may_be_read_while_new_keys_come_up() -> None:
    """Each message that is refused for a new reason adds one to a counter of the thread's."""
    vehicle = vehicle_on(f"udpin:127.0.0.1:{free_udp_port()}")
    end, broken = threading.Event(), []

    def read() -> None:
        while not end.is_set():
            try:
                sum(vehicle.counts.values())
                dict(vehicle.counts)
            except RuntimeError as error:
                broken.append(error)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    # In place of its thread, and faster than any.
    for turn in range(3000):
        vehicle._codec.counts[f"key {turn}"] += 1
        vehicle._link.counts[f"key {turn}"] += 1
        vehicle._counts[f"key {turn}"] += 1
        vehicle._snapshot = vehicle._take_snapshot() if turn % 10 == 0 else vehicle._snapshot
    end.set()
    for reader in readers:
        reader.join()
    assert broken == []
    vehicle.close()


@pytest.mark.slow
def test_what_became_of_the_order_before_is_not_taken_for_the_new_ones() -> None:
    with (
        running_autopilot(link="udpin", speedup=10, ready_s=5.0) as autopilot,
        vehicle_on(autopilot.connection) as vehicle,
    ):
        vehicle.give(TakeOff(10.0))
        for order in (
            Land(),
            TakeOff(10.0, from_modes=("RTL", "LAND", "AUTO")),
            Hold(),
            Hold(),
            Land(),
        ):
            end_s = time.monotonic() + TIMEOUT_S
            while vehicle.outcome.status != "done":
                assert time.monotonic() < end_s, vehicle.outcome
                time.sleep(0.001)
            number = vehicle.give(order)
            # Its thread may not have taken it yet.
            outcome = vehicle.outcome
            assert (outcome.number, outcome.order) == (number, order)
            assert outcome.status == "under_way" or outcome.order == Hold()


def test_orders_wait_for_a_thread_that_is_busy_and_nobody_waits_for_it() -> None:
    vehicle = vehicle_on(f"udpin:127.0.0.1:{free_udp_port()}")
    busy, turn = threading.Event(), vehicle._turn

    def slow_turn() -> None:
        busy.wait()
        turn()

    vehicle._turn = slow_turn  # type: ignore[method-assign]
    vehicle.start()
    # It is stuck until all have returned.
    assert [vehicle.give(Hold()) for _ in range(1000)] == list(range(1, 1001))
    assert vehicle.outcome.number == 1000 and vehicle.state.mode == ""
    assert vehicle.counts["opened"] == 0
    busy.set()
    end_s = time.monotonic() + TIMEOUT_S
    while vehicle.snapshot.outcome.number < 1000:
        assert time.monotonic() < end_s
        time.sleep(0.001)
    vehicle.close()


def signed_heartbeat(vehicle: Vehicle, key: bytes | None) -> None:
    """Have the vehicle's codec hear a heartbeat."""
    data = bytes(Speaker(1, key).encode(mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3)))
    for message in vehicle._codec.decode(data, 0.0, datagram=True):
        vehicle._controller.receive(message, 0.0)
    vehicle._snapshot = vehicle._take_snapshot()


def test_signatures_that_do_not_fit_are_named(tmp_path: Any) -> None:
    ours, theirs = bytes(range(32)), bytes(range(1, 33))
    key = tmp_path / "key"
    key.write_bytes(ours)
    key.chmod(0o600)
    unsigned, signed = (
        vehicle_on(f"udpin:127.0.0.1:{free_udp_port()}", **options)
        for options in ({}, {"signing_key_file": str(key)})
    )
    signed_heartbeat(unsigned, None)
    assert unsigned.trouble is None
    signed_heartbeat(unsigned, theirs)
    assert unsigned.trouble == "its messages are signed, and no key is given"
    assert unsigned.state.connected
    signed_heartbeat(unsigned, None)
    assert unsigned.trouble is None

    signed_heartbeat(signed, None)
    assert signed.trouble == "its messages are not signed"
    signed_heartbeat(signed, theirs)
    assert signed.trouble.startswith("its messages are not signed with our key")
    assert not signed.state.connected
    signed_heartbeat(signed, ours)
    assert signed.trouble is None and signed.state.connected
    # Others who sign badly, or not at all, do no harm then.
    signed_heartbeat(signed, None)
    assert signed.trouble is None
    for vehicle in (unsigned, signed):
        vehicle.close()


def test_a_vehicle_that_signs_is_connected_and_reports_why_it_does_not_obey(tmp_path: Any) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    with (
        running_autopilot(link="tcp", speedup=10, ready_s=5.0, key_file=key) as autopilot,
        vehicle_on(autopilot.connection) as vehicle,
    ):
        end_s = time.monotonic() + TIMEOUT_S
        while "no key is given" not in (vehicle.trouble or ""):
            assert time.monotonic() < end_s
            time.sleep(0.01)
        assert vehicle.state.connected and not vehicle.state.has_position
