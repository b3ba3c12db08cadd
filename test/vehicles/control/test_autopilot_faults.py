# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What goes wrong goes wrong when it should, for as long as it should."""

from __future__ import annotations

import pytest
from autopilot.ardupilot import Mode as CopterMode
from autopilot.bench import GUIDED, LOITER, RTL, Bench
from autopilot.faults import Fault
from autopilot.px4 import Mode as Px4Mode


def bench(*faults: str, autopilot: str = "ardupilot") -> Bench:
    return Bench(
        autopilot=autopilot, faults=tuple(Fault.parse(text) for text in faults), ready_s=10.0
    )


def test_a_fault_is_read_from_text() -> None:
    assert Fault.parse("link@60") == Fault("link", 60.0)
    assert Fault.parse("acks@airborne:1.5+10=0.3") == Fault("acks", 1.5, True, 10.0, "0.3")


@pytest.mark.parametrize("text", ["", "link", "link@", "fire@3", "link@-3", "acks@1=2=3", "@3"])
def test_what_is_no_fault_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="^fault must be KIND@.*, got "):
        Fault.parse(text)


def test_while_the_link_is_lost_nothing_is_sent_or_received() -> None:
    vehicle = bench("link@20+15")
    vehicle.wait(20.05)
    before = len(vehicle.received)
    assert vehicle.command(176, 1, GUIDED) is None
    vehicle.wait(14.9)
    assert len(vehicle.received) == before
    assert vehicle.vehicle.custom_mode == CopterMode.STABILIZE
    vehicle.wait(1.1)
    assert len(vehicle.received) > before
    assert vehicle.command(176, 1, GUIDED) == 0


def test_acknowledgements_are_lost_but_commands_are_not() -> None:
    vehicle = bench("acks@0+5", "mission_acks@0+5")
    vehicle.wait(1.5)
    assert vehicle.command(176, 1, GUIDED) is None
    assert vehicle.vehicle.custom_mode == GUIDED
    vehicle.send_count([])
    assert not vehicle.all("MISSION_ACK")
    vehicle.wait(5)
    assert vehicle.command(176, 1, LOITER) == 0


def test_acknowledgements_can_be_lost_now_and_then() -> None:
    vehicle = bench("acks@0=0.5")
    vehicle.wait(1.5)
    got = sum(vehicle.command(520) is not None for _ in range(1000))
    assert 400 < got < 600


@pytest.mark.parametrize(("autopilot", "coming"), [("ardupilot", RTL), ("px4", Px4Mode.LAND)])
def test_a_low_battery_brings_it_down(autopilot: str, coming: int) -> None:
    vehicle = bench("battery@airborne:30", autopilot=autopilot)
    vehicle.fly_to_altitude()
    vehicle.until(lambda: vehicle.vehicle.custom_mode == coming)
    vehicle.wait(1.1)
    assert vehicle.last("HEARTBEAT").system_status == 5
    assert vehicle.command(512, 1) == 0
    assert vehicle.last("SYS_STATUS").battery_remaining <= 12
    # PX4 sends no status texts without a ground station.
    assert any("attery" in text for text in vehicle.texts()) == (autopilot == "ardupilot")
    vehicle.until(lambda: not vehicle.vehicle.armed)


def test_a_copter_shows_a_failsafe_at_once_and_says_later_which() -> None:
    vehicle = bench("battery@airborne:30")
    vehicle.fly_to_altitude()
    vehicle.received.clear()
    vehicle.until(lambda: vehicle.vehicle.custom_mode == RTL)
    vehicle.wait(0.1)
    seen = [
        message.get_type()
        for message in vehicle.received
        if getattr(message, "custom_mode", RTL) == RTL
        and message.get_type() in ("HEARTBEAT", "STATUSTEXT")
    ]
    assert seen == ["HEARTBEAT", "STATUSTEXT", "STATUSTEXT"]
    assert vehicle.last("HEARTBEAT").system_status == 5


def test_a_copter_that_came_down_with_a_low_battery_cannot_be_armed() -> None:
    vehicle = bench("battery@airborne:30")
    vehicle.fly_to_altitude()
    vehicle.until(lambda: not vehicle.vehicle.armed)
    assert vehicle.command(176, 1, GUIDED) == 0
    assert vehicle.command(400, 1) == 4
    assert vehicle.texts()[-1] == "Arm: Battery failsafe"


@pytest.mark.parametrize(
    ("autopilot", "fault", "mode"),
    [
        ("ardupilot", "pilot@airborne:40", LOITER),
        ("ardupilot", "pilot@airborne:40=ALT_HOLD", CopterMode.ALT_HOLD),
        ("px4", "pilot@airborne:40", Px4Mode.POSCTL),
    ],
)
def test_a_pilot_takes_over_and_setpoints_are_ignored(
    autopilot: str, fault: str, mode: int
) -> None:
    vehicle = bench(fault, autopilot=autopilot)
    vehicle.fly_to_altitude()
    taken_s = vehicle.until(lambda: vehicle.vehicle.custom_mode == mode)
    assert taken_s > 1
    vehicle.wait(5)
    here = vehicle.vehicle.craft.point
    vehicle.setpoint(100, 100, 50)
    vehicle.wait(10)
    assert vehicle.vehicle.craft.point == here
