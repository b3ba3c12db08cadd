# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles on real links to simulated autopilots that are processes of their own."""

from __future__ import annotations

import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from autopilot.running import Running, free_udp_port, running_autopilot, running_relay
from autopilot.wire import Codec as Speaker
from autopilot.wire import mavlink
from pace import Pace

from dsse_ros.vehicles.control import vehicle as vehicle_module
from dsse_ros.vehicles.control.orders import (
    FlyMission,
    GoTo,
    Hold,
    Land,
    Order,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.vehicles.control.vehicle import Vehicle, VehicleSettings
from dsse_ros.vehicles.mission_items.items import FRAME_GLOBAL, FRAME_MISSION, MissionItem

pytestmark = pytest.mark.slow

TIMEOUT_S = 180.0
HOME = (-24.0, -46.3)
NEAR = (-24.0, -46.2997)


def until(condition: Callable[[], Any], timeout_s: float = TIMEOUT_S) -> None:
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, "not in time"
        time.sleep(0.01)


def fly(vehicle: Vehicle, order: Order) -> str:
    number = vehicle.give(order)
    until(lambda: vehicle.outcome.status not in ("under_way", "silent"))
    assert vehicle.outcome.number == number
    if vehicle.outcome.reason:
        print(order, vehicle.outcome)
    return vehicle.outcome.status


@contextmanager
def vehicle_of(autopilot: Running, name: Any = "ardupilot", **options: Any) -> Iterator[Vehicle]:
    fields = {"connection": autopilot.connection, "setpoint_hz": 40.0, **options}
    with Vehicle(VehicleSettings(autopilot=name, **fields)) as vehicle:
        yield vehicle
    assert vehicle.counts["errors"] == 0


def a_mission(name: str) -> tuple[MissionItem, ...]:
    def item(command: int, place: tuple[float, float], alt_m: float) -> MissionItem:
        return MissionItem(command, lat_deg=place[0], lon_deg=place[1], alt_m=alt_m)

    home = MissionItem(16, FRAME_GLOBAL, lat_deg=HOME[0], lon_deg=HOME[1])
    return (
        *([home] if name == "ardupilot" else []),
        item(22, NEAR, 5.0),
        item(16, NEAR, 5.0),
        item(16, (NEAR[0] + 1e-4, NEAR[1]), 8.0),
        MissionItem(20, FRAME_MISSION),
    )


@pytest.mark.parametrize(
    ("name", "link"), [("ardupilot", "udp"), ("ardupilot", "tcp"), ("px4", "udp")]
)
def test_it_flies_all_orders_over_a_real_link(name: Any, link: Any) -> None:
    orders: list[Order] = [
        TakeOff(5.0),
        GoTo(*NEAR, 8.0, 4.0),
        SearchPlace(*HOME, 8.0, 5.0, 3.0, 4.0),
        Hold(),
        Return() if link == "udp" else Land(),
        FlyMission(a_mission(name), from_modes=("RTL", "LAND", "AUTO")),
    ]
    # A busy machine may keep the setpoints from being sent for a while.
    patient = ("--param", "COM_OF_LOSS_T=300") if name == "px4" else ()
    with (
        running_autopilot(name, link=link, speedup=20, ready_s=5.0, options=patient) as autopilot,
        vehicle_of(autopilot, name) as vehicle,
    ):
        assert [fly(vehicle, order) for order in orders] == ["done"] * len(orders)
        state = vehicle.state
        assert not state.armed and not state.flying
        assert state.home == pytest.approx((*HOME, 0.0), abs=1e-6)
        assert vehicle.trouble is None
        # PX4 has no words for those who are no ground station.
        texts = [text.text for text in vehicle.take_texts()]
        assert any("rm" in text for text in texts) == (name == "ardupilot")
        assert vehicle.take_texts() == []


def test_it_flies_over_a_bad_link() -> None:
    with (
        # A lost take-off is sent again after 2 s of wall time; by its own clock, the vehicle would
        # soon disarm itself.
        running_autopilot(
            link="udpin", speedup=4, ready_s=5.0, seed=1, options=("--param", "DISARM_DELAY=120")
        ) as autopilot,
        running_relay(
            autopilot.port, loss=0.2, duplicate=0.1, reorder=0.2, jitter_s=0.02, seed=1
        ) as relay,
        vehicle_of(relay) as vehicle,
    ):
        orders = [TakeOff(5.0), GoTo(*NEAR, 8.0, 4.0), FlyMission(a_mission("ardupilot"))]
        assert [fly(vehicle, order) for order in orders] == ["done"] * 3


def test_on_a_signed_link_it_flies_and_others_get_nowhere(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    with (
        running_autopilot(link="tcp", speedup=10, ready_s=5.0, key_file=key) as autopilot,
        vehicle_of(autopilot, signing_key_file=str(key)) as vehicle,
    ):
        assert fly(vehicle, TakeOff(10.0)) == "done"
        assert fly(vehicle, Return()) == "done"
    assert (tmp_path / "key.245-1").exists()
    with (
        running_autopilot(link="udpin", speedup=10, ready_s=5.0) as unsigned,
        vehicle_of(unsigned, signing_key_file=str(key)) as vehicle,
    ):
        until(lambda: vehicle.counts["unsigned"] > 2)
        assert not vehicle.state.connected
        assert vehicle.counts["accepted"] == 0


def test_ten_thousand_messages_of_wrong_senders_have_no_effect() -> None:
    port, draw = free_udp_port(), random.Random(2)
    with running_autopilot(link="udp", port=port, speedup=10, ready_s=5.0) as autopilot:
        # They come first, so that nobody else is the peer yet.
        settings = VehicleSettings(connection=f"udpin:127.0.0.1:{port}")
        vehicle = Vehicle(settings)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as liar:
            vehicle.start()

            def heard_one() -> bool:
                liar.sendto(
                    Speaker(9).encode(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)),
                    ("127.0.0.1", port),
                )
                return refused(vehicle) > 0

            # Its socket opens some time after the start.
            until(heard_one)
            lies = [
                mavlink.MAVLink_heartbeat_message(2, 3, 209, 6, 5, 3),
                mavlink.MAVLink_global_position_int_message(1, 1, 1, 1, 1, 1, 1, 1, 1),
                mavlink.MAVLink_mission_ack_message(245, 191, 0, 0),
                mavlink.MAVLink_command_ack_message(176, 0),
                mavlink.MAVLink_mission_request_message(245, 191, 0, 0),
            ]

            def lied_enough() -> bool:
                for _ in range(10):
                    speaker = Speaker(draw.randrange(2, 256))
                    for lie in lies:
                        liar.sendto(speaker.encode(lie), ("127.0.0.1", port))
                # What the kernel drops has no effect either, but that is too easy.
                return refused(vehicle) >= 10_000

            until(lied_enough)
            until(lambda: vehicle.state.connected)
            assert vehicle.state.mode != "RTL" and vehicle.state.failsafe is None
        assert fly(vehicle, TakeOff(10.0)) == "done"
        vehicle.close()
        assert autopilot.running


def refused(vehicle: Vehicle) -> int:
    return vehicle.counts["wrong_sender"] + vehicle.counts["wrong_address"]


def test_a_flood_of_garbage_holds_up_neither_orders_nor_heartbeats() -> None:
    port, draw, over = free_udp_port(), random.Random(4), threading.Event()
    with (
        running_autopilot(link="udp", port=port, speedup=5, ready_s=5.0) as autopilot,
        vehicle_of(autopilot) as vehicle,
    ):
        until(lambda: vehicle.state.connected)

        def flood() -> None:
            pieces = [draw.randbytes(draw.randrange(1, 300)) for _ in range(500)]
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as liar:
                while not over.wait(0.002):
                    for _ in range(10):
                        liar.sendto(draw.choice(pieces), ("127.0.0.1", port))

        thread = threading.Thread(target=flood)
        thread.start()
        try:
            pace = Pace(vehicle)
            assert fly(vehicle, TakeOff(15.0)) == "done"
            assert fly(vehicle, Land()) == "done"
            [(sent, missed)] = pace.check()
            # Some are missed on a busy machine.
            assert missed < sent
        finally:
            over.set()
            thread.join()
        assert vehicle.counts["wrong_address"] > 100
        assert vehicle.counts["link_lost"] == 0


@pytest.mark.parametrize("link", ["udp", "tcp"])
def test_a_vehicle_that_dies_is_lost_and_found_when_it_is_back(link: Any) -> None:
    with running_autopilot(link=link, speedup=10, ready_s=5.0) as autopilot:
        port = autopilot.port
        with vehicle_of(autopilot) as vehicle:
            assert fly(vehicle, TakeOff(10.0)) == "done"
            vehicle.give(GoTo(-24.1, -46.3, 20.0, 5.0))
            autopilot.kill()
            until(lambda: vehicle.outcome.status == "silent" and not vehicle.state.connected)
            if link == "tcp":
                until(lambda: "tcp:" in (vehicle.trouble or ""))
            with running_autopilot(link=link, port=port, speedup=10, ready_s=5.0):
                until(lambda: vehicle.state.connected)
                # On the ground, and in nobody's hands.
                until(lambda: vehicle.outcome.status in ("failed", "taken_over"))
                until(lambda: vehicle.state.home is not None and vehicle.trouble is None)
                assert not vehicle.state.flying


def test_it_waits_for_a_vehicle_that_is_not_there_yet() -> None:
    port = free_udp_port()
    with Vehicle(VehicleSettings(connection=f"tcp:127.0.0.1:{port}")) as vehicle:
        number = vehicle.give(TakeOff(10.0))
        until(lambda: "tcp:" in (vehicle.trouble or ""))
        assert (vehicle.outcome.number, vehicle.outcome.status) == (number, "under_way")
        with running_autopilot(link="tcp", port=port, speedup=10, ready_s=5.0):
            until(lambda: vehicle.outcome.status == "done")


def test_a_port_that_is_taken_is_reported_and_tried_again() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        vehicle = Vehicle(VehicleSettings(connection=f"udpin:127.0.0.1:{port}"))
        vehicle.start()
        until(lambda: "in use" in (vehicle.trouble or ""))
        taken.close()
        # Nobody is connected, but that is no fault of the link.
        until(lambda: vehicle.trouble is None)
        assert vehicle.counts["opened"] == 1
        vehicle.close()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", port))


def test_heartbeats_say_who_we_are_once_a_second() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(TIMEOUT_S)
        connection = f"udpout:127.0.0.1:{ear.getsockname()[1]}"
        settings = VehicleSettings(connection=connection, own_system_id=200, system_id=9)
        start_s = time.monotonic()
        with Vehicle(settings) as vehicle:
            pace, messages = Pace(vehicle), []
            for _ in range(4):
                messages += Speaker(1).decode_all(ear.recv(300), datagram=True)
            assert time.monotonic() - start_s >= 3.0
            pace.check()
        assert {message.get_type() for message in messages} == {"HEARTBEAT"}
        one = messages[0]
        assert (one.get_srcSystem(), one.get_srcComponent(), one.type, one.autopilot) == (
            *(200, 191),
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
            mavlink.MAV_AUTOPILOT_INVALID,
        )


def test_orders_from_many_threads_are_numbered_and_the_latest_wins() -> None:
    with running_autopilot(speedup=10, ready_s=5.0) as autopilot, vehicle_of(autopilot) as vehicle:
        numbers: list[int] = []

        def give() -> None:
            for _ in range(50):
                numbers.append(vehicle.give(Hold()))

        threads = [threading.Thread(target=give) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sorted(numbers) == list(range(1, 201))
        assert vehicle.outcome.number == 200


def test_closing_ends_the_thread_and_may_be_done_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vehicle_module, "CLOSE_S", TIMEOUT_S)
    vehicle = Vehicle(VehicleSettings(connection=f"udpin:127.0.0.1:{free_udp_port()}"))
    vehicle.start()
    thread = vehicle._thread
    vehicle.close()
    assert thread is not None and not thread.is_alive()
    vehicle.close()
    never_started = Vehicle(VehicleSettings(connection=f"udpin:127.0.0.1:{free_udp_port()}"))
    never_started.close()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("connection", "nowhere"),
        ("signing_key_file", "/no/such/key"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused(name: str, value: Any) -> None:
    options = {"connection": "udpin:127.0.0.1:14550", name: value}
    with pytest.raises(ValueError, match=f"^{name}[: ].*{value}"):
        Vehicle(VehicleSettings(**options))
