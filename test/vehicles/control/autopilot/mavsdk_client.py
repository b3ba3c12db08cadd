# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Flies an autopilot with MAVSDK, as a program of its own: `mavsdk_client.py SCENE CONNECTION`.

It prints, as JSON, what it has seen.
"""

from __future__ import annotations

import contextlib
import json
import math
import sys
import time
from collections.abc import Callable
from typing import Any, TypeVar

from mavsdk import ComponentType, Configuration, Mavsdk, System
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionItem as RawItem
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.offboard import Offboard, OffboardError, PositionNedYaw
from mavsdk.plugins.telemetry import FlightMode, Telemetry

T = TypeVar("T")

TIMEOUT_S = 100.0
HOME = (-24.0, -46.3)
_FRAME_GLOBAL, _FRAME_RELATIVE_INT = 0, 6
_WAYPOINT, _RETURN, _TAKEOFF = 16, 20, 22


def until(condition: Callable[[], T], what: str) -> T:
    """Return what the condition returns as soon as that is true."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while not (value := condition()):
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"{what} within {TIMEOUT_S} s")
        time.sleep(0.01)
    return value


def places(count: int) -> list[tuple[float, float, float]]:
    """Return a zigzag near home: latitudes, longitudes and heights in metres."""
    lat, lon = HOME
    return [(lat + 3e-4 * (i + 1), lon + 4e-4 * (i % 2), 20.0 + 5 * i) for i in range(count)]


class Client:
    """A system, and what can be done with it."""

    def __init__(self, system: System) -> None:
        self.action = Action(system)
        self.mission = Mission(system)
        self.mission_raw = MissionRaw(system)
        self.offboard = Offboard(system)
        self.telemetry = Telemetry(system)
        self.modes: list[str] = []
        self.highest_m = 0.0
        self.telemetry.subscribe_flight_mode(lambda mode, _: self._note(mode.name))
        self.telemetry.subscribe_position(lambda position, _: self._measure(position))

    def _note(self, mode: str) -> None:
        if self.modes[-1:] != [mode]:
            self.modes.append(mode)

    def _measure(self, position: Any) -> None:
        self.highest_m = max(self.highest_m, position.relative_altitude_m)

    def arm(self) -> None:
        """Arm as soon as it may."""
        until(lambda: self.telemetry.health().is_armable, "armable")
        self.action.arm()
        until(lambda: self.telemetry.armed(), "armed")

    def seen(self) -> dict[str, Any]:
        """Return where it is and where it has been."""
        position = self.telemetry.position()
        return {
            "modes": self.modes,
            "highest_m": self.highest_m,
            "position": (position.latitude_deg, position.longitude_deg),
            "height_m": position.relative_altitude_m,
        }

    def be_down(self, mode: str = "") -> None:
        """Wait until it has landed and is disarmed, and until that mode, if any, is seen."""
        until(lambda: not self.telemetry.armed(), "disarmed")
        until(lambda: self.modes[-1].endswith(mode), mode)


def px4_mission(pilot: Client) -> dict[str, Any]:
    """Upload a mission with a return at its end, read it back, fly it."""
    items = [
        MissionItem(*place, speed_m_s=8.0, is_fly_through=i % 2 == 0, acceptance_radius_m=1.0)
        for i, place in enumerate(places(4))
    ]
    pilot.mission.set_return_to_launch_after_mission(True)
    pilot.mission.upload_mission(MissionPlan(items))
    downloaded = pilot.mission.download_mission().mission_items
    pilot.arm()
    pilot.mission.start_mission()
    pilot.be_down("HOLD")
    return {
        "uploaded": [vars(item) for item in items],
        "downloaded": [vars(item) for item in downloaded],
        "finished": pilot.mission.is_mission_finished(),
    }


def px4_setpoints(pilot: Client) -> dict[str, Any]:
    """Take off, go somewhere, fly setpoints, land."""
    pilot.action.set_takeoff_altitude(5.0)
    pilot.arm()
    pilot.action.takeoff()
    until(lambda: pilot.telemetry.position().relative_altitude_m > 4.5, "altitude")
    home_amsl_m = pilot.telemetry.home().absolute_altitude_m
    pilot.action.goto_location(HOME[0] + 1e-4, HOME[1], home_amsl_m + 8.0, math.nan)
    until(lambda: pilot.telemetry.position().relative_altitude_m > 7.5, "place")
    until(lambda: abs(pilot.telemetry.position().latitude_deg - HOME[0] - 1e-4) < 1e-5, "place")
    went_to = pilot.seen()
    pilot.offboard.set_position_ned(PositionNedYaw(0.0, 10.0, -10.0, 0.0))

    def there() -> bool:
        if pilot.telemetry.flight_mode() is not FlightMode.OFFBOARD:
            # What MAVSDK sends again and again has not come for long enough, or not often enough.
            time.sleep(0.3)
            with contextlib.suppress(OffboardError):
                pilot.offboard.start()
        return bool(pilot.telemetry.position_velocity_ned().position.east_m > 9.0)

    until(there, "setpoint")
    pilot.offboard.stop()
    pilot.action.land()
    # Disarmed, it is in the mode of before the landing.
    pilot.be_down("HOLD")
    return {"went_to": went_to}


def ardupilot_mission(pilot: Client) -> dict[str, Any]:
    """Upload a mission as it is on the wire, read it back, take off, fly it."""
    home = (*HOME, 0.0)
    items = [_raw(0, _FRAME_GLOBAL, _WAYPOINT, home), _raw(1, 6, _TAKEOFF, (*HOME, 20.0))]
    for place in places(3):
        items.append(_raw(len(items), _FRAME_RELATIVE_INT, _WAYPOINT, place))
    items.append(_raw(len(items), _FRAME_RELATIVE_INT, _RETURN, (0.0, 0.0, 0.0)))
    pilot.mission_raw.upload_mission(items)
    downloaded = pilot.mission_raw.download_mission()
    # Nothing of this comes unasked.
    pilot.telemetry.set_rate_health(2.0)
    pilot.telemetry.set_rate_position(5.0)
    pilot.telemetry.set_rate_landed_state(5.0)
    pilot.action.set_takeoff_altitude(15.0)
    pilot.arm()
    pilot.action.takeoff()
    until(lambda: pilot.telemetry.position().relative_altitude_m > 14.0, "altitude")
    pilot.mission_raw.start_mission()
    pilot.be_down()
    return {
        "uploaded": [_fields(item) for item in items],
        "downloaded": [_fields(item) for item in downloaded],
        "finished": pilot.mission_raw.is_mission_finished(),
    }


def _raw(seq: int, frame: int, command: int, place: tuple[float, float, float]) -> RawItem:
    x, y = (round(value * 1e7) for value in place[:2])
    return RawItem(seq, frame, command, int(seq == 0), 1, 0.0, 0.0, 0.0, 0.0, x, y, place[2], 0)


def _fields(item: RawItem) -> dict[str, Any]:
    return {name: getattr(item, name) for name in ("seq", "frame", "command", "x", "y", "z")}


SCENES = {scene.__name__: scene for scene in (px4_mission, px4_setpoints, ardupilot_mission)}


def main(scene: str, connection: str) -> int:
    """Fly a scene."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        mavsdk.add_any_connection(connection)
        system = mavsdk.first_autopilot(TIMEOUT_S)
        if system is None:
            raise TimeoutError(f"no autopilot within {TIMEOUT_S} s")
        pilot = Client(system)
        result = SCENES[scene](pilot)
        print(json.dumps(result | pilot.seen() | {"autopilot": system.autopilot_type().name}))
    finally:
        mavsdk.destroy()
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
