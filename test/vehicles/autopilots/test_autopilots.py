# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What differs between autopilots is in one object each, and nowhere else."""

from __future__ import annotations

import ast
import math
from dataclasses import replace
from pathlib import Path

import pytest
from virtual_flight import OURSELVES, VEHICLE, VirtualFlight, mission

from dsse_ros.vehicles.autopilots import AUTOPILOTS, PX4, Autopilot
from dsse_ros.vehicles.control.commands import ControllerSettings
from dsse_ros.vehicles.control.orders import FlyMission, GoTo, Hold, Return, TakeOff
from dsse_ros.vehicles.control.vehicle_controller import VehicleController
from dsse_ros.vehicles.mavlink.messages import SetPositionTarget

ROOT = Path(__file__).resolve().parents[3]
SOURCES = [file for top in ("dsse_ros", "msg_adapters") for file in (ROOT / top).rglob("*.py")]


@pytest.mark.parametrize("autopilot", AUTOPILOTS.values(), ids=list(AUTOPILOTS))
def test_all_modes_that_are_set_or_awaited_are_known(autopilot: Autopilot) -> None:
    named = autopilot.take_off_modes | autopilot.disarmed_modes | autopilot.setpoint_loss_modes
    named |= autopilot.descent_modes | autopilot.mission_modes
    assert named <= set(autopilot.modes.values())


MODES = {mode for autopilot in AUTOPILOTS.values() for mode in autopilot.modes.values()}


def test_no_other_module_names_a_mode() -> None:
    names = ("vehicles/fleet", "vehicles/control", "ros", "mission")
    packages = [ROOT / "dsse_ros" / name for name in names]
    files = [file for folder in packages for file in folder.rglob("*.py")]
    found = [
        (file.name, node.value)
        for file in files
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Constant) and node.value in MODES
    ]
    assert found == []


@pytest.mark.parametrize("file", SOURCES, ids=lambda file: str(file.relative_to(ROOT)))
def test_no_module_decides_by_the_name_of_an_autopilot(file: Path) -> None:
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Compare | ast.match_case):
            constants = {
                literal.value for literal in ast.walk(node) if isinstance(literal, ast.Constant)
            }
            assert not constants & set(AUTOPILOTS), f"line {getattr(node, 'lineno', '?')}"


def test_another_autopilot_is_one_object_and_its_registration(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(AUTOPILOTS, "another", replace(PX4, name="another"))  # type: ignore[arg-type]
    flight = VirtualFlight("px4")
    settings = ControllerSettings(autopilot="another")
    flight.controller = VehicleController(VEHICLE, OURSELVES, settings)
    there = GoTo(*flight.place(40.0, 0.0), 15.0, 3.0)
    for order in (TakeOff(10.0), there, Return(), FlyMission(mission(flight, (30.0, 0.0, 15.0)))):
        assert flight.fly(order).status == "done", flight.outcome


@pytest.mark.slow
@pytest.mark.parametrize(("autopilot", "rests"), [("arduplane", "LOITER"), ("px4plane", "HOLD")])
def test_a_fixed_wing_takes_off_in_a_mode_of_its_own_and_circles_where_others_hover(
    autopilot: str, rests: str
) -> None:
    flight = VirtualFlight(autopilot)
    assert flight.fly(TakeOff(100.0)).status == "done"
    assert flight.vehicle.mode.name == "TAKEOFF" and flight.vehicle.craft.up_m >= 30.0
    place = flight.place(400.0, 300.0)
    assert flight.fly(GoTo(*place, 100.0, 10.0)).status == "done"
    for seconds in range(60):
        flight.wait(1.0)
        craft = flight.vehicle.craft
        away_m = math.hypot(craft.north_m - 400.0, craft.east_m - 300.0)
        assert seconds < 20 or 40.0 < away_m < 120.0
        assert craft.up_m == pytest.approx(100.0, abs=3.0)
    assert flight.fly(Hold()).status == "done" and flight.vehicle.mode.name == rests
    flight.give(Return())
    flight.wait(5.0)
    assert flight.vehicle.mode.name == "RTL" and flight.outcome.status == "under_way"


@pytest.mark.slow
def test_a_fixed_wing_that_somebody_else_sends_elsewhere_is_given_up() -> None:
    flight = VirtualFlight("arduplane")
    assert flight.fly(TakeOff(60.0)).status == "done"
    assert flight.fly(GoTo(*flight.place(300.0, 0.0), 60.0, 10.0)).status == "done"
    lat_deg, lon_deg = flight.place(-900.0, 0.0)
    sent = SetPositionTarget(VEHICLE, lat_deg, lon_deg, 60.0, repositions=True).message()
    flight.send_from_station(sent)
    flight.until(lambda: flight.outcome.status == "taken_over")
    assert flight.outcome.reason == "sent elsewhere by somebody else"
