# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of `mavlink_bridge`, as checked fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dsse_ros.base.fields import FieldError, check_all, field
from dsse_ros.vehicles.fleet.custody import ENDS
from dsse_ros.vehicles.fleet.vehicle_missions import FlightSettings


@dataclass(frozen=True, kw_only=True)
class BridgeSettings(FlightSettings):
    """Settings of `mavlink_bridge`.

    Raises:
        FieldError: If a value is not allowed.
    """

    mode: str = field(
        "str", "Follow each step with setpoints, or fly the whole search as a mission when it "
        "is over.", "guided", choices=("guided", "mission"),
    )  # fmt: skip
    num_vehicles: int | None = field(
        "int", "Number of vehicles; by default one per connection, else 1.", None,
        low=1, high=250,
    )  # fmt: skip
    connections: tuple[str, ...] = field(
        "names", "Connections to the vehicles, drone0's first, such as udpin:HOST:PORT, "
        "tcp:HOST:PORT or /dev/ttyUSB0,57600; by default udpin:127.0.0.1 at the ports to which the "
        "autopilot's simulator sends.", (),
    )  # fmt: skip
    system_ids: tuple[int, ...] = field(
        "ints", "System ids of the vehicles; by default 1, 2, ...", (), low=1, high=255
    )
    own_system_id: int = field(
        "int", "System id of the bridge; ArduPilot's ground station failsafe reacts only to 255.",
        245, low=1, high=255,
    )  # fmt: skip
    signing_key_file: str = field(
        "str", "File with the key of MAVLink 2 signing, 32 bytes or 64 hexadecimal digits; empty "
        "to leave messages unsigned.", "",
    )  # fmt: skip
    arm: str = field(
        "str", "Searches that clear vehicles to be armed: none, so that somebody else arms them; "
        "the first one that the bridge follows; or, in simulations only, every one.", "false",
        choices=("false", "true", "always"),
    )  # fmt: skip
    speed: float = field(
        "float", "Ground speed to request, 0 for the vehicles' default.", 0.0,
        low=0, high=100, unit="m/s",
    )  # fmt: skip
    datum_altitude: float = field(
        "float", "Altitude above mean sea level from which all altitudes of the fleet are "
        "measured: 0 for the sea; inland, that of the field.", 0.0, low=-500, high=9000, unit="m",
    )  # fmt: skip
    altitudes: tuple[float, ...] = field(
        "floats", "Flight altitudes above the datum, one for each vehicle, or one for the first; "
        "the others then fly altitude_step below each other. By default the search's.", (),
        low=1, high=20000, unit="m",
    )  # fmt: skip
    fence_margin: float = field(
        "float", "Margin around the search area that vehicles, and home, may be in.", 500.0,
        low=0, high=1e6, unit="m",
    )  # fmt: skip
    fence_center: tuple[float, float] | None = field(
        "vector", "Latitude and longitude of the fence's centre; by default the centre of the "
        "first search that the bridge follows, until the bridge exits.", None,
    )  # fmt: skip
    fence_radius: float = field(
        "float", "Radius of the fence; vehicles must stay and take off inside, and searches must "
        "lie inside.", 5000.0, low=1, high=1e6, unit="m",
    )  # fmt: skip
    min_altitude: float = field(
        "float", "Lowest altitude above the datum to send a vehicle to, and above its home to "
        "take off to.", 10.0,
        low=0, high=20000, unit="m",
    )  # fmt: skip
    max_altitude: float = field(
        "float", "Highest altitude above the datum to send a vehicle to, or to let it return "
        "at by itself.", 150.0,
        low=1, high=20000, unit="m",
    )  # fmt: skip
    at_end: str = field(
        "str", "What a vehicle does when its drone's search is over.", "return",
        choices=tuple(ENDS),
    )  # fmt: skip
    planner_timeout: float = field(
        "float", "Wall time after which vehicles hold if all of them wait for a step; 0 for "
        "never.", 30.0, low=0, high=1e6, unit="s",
    )  # fmt: skip
    link_timeout: float = field(
        "float", "Wall time without a heartbeat after which a vehicle is silent: the bridge sends "
        "it only heartbeats until its heartbeats return.", 5.0, low=1, high=3600, unit="s",
    )  # fmt: skip
    lost_timeout: float = field(
        "float", "Wall time without a heartbeat after which a vehicle is lost for the rest of the "
        "mission; at least link_timeout.", 30.0, low=1, high=3600, unit="s",
    )  # fmt: skip
    join_timeout: float = field(
        "float", "Wall time in which a vehicle must be connected, know its position, be in the "
        "fence and be ready to be armed.", 300.0, low=1, high=1e6, unit="s",
    )  # fmt: skip
    setpoint_rate: float = field(
        "float", "PX4: rate of setpoints in wall time; the vehicle needs more than two per second "
        "of its own clock.", 5.0, above=2, high=200, unit="Hz",
    )  # fmt: skip
    pose_rate: float = field(
        "float", "Rate of vehicle_pose and vehicle_fix in wall time.", 5.0,
        above=0, high=50, unit="Hz",
    )  # fmt: skip
    state_directory: str = field(
        "str", "Directory that records who controls each vehicle, across restarts of the bridge; "
        "by default dsse_ros in ROS_HOME, or in ~/.ros.", "",
    )  # fmt: skip
    exit_at_end: bool = field(
        "bool", "Whether the bridge exits once the search is over and its vehicles have carried "
        "out at_end.", False,
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        check_all(self)
        count = self.vehicles
        for name, each in (("connections", True), ("system_ids", True), ("altitudes", False)):
            length = len(getattr(self, name))
            if length not in ({0, count} if each else {0, 1, count}):
                raise FieldError(f"{name} must be one for each of {count} vehicles, got {length}")
        for system_id in self.system_ids:
            # The records of the vehicles are kept by system id.
            if (number := self.system_ids.count(system_id)) > 1:
                raise FieldError(f"system_ids must differ, got {system_id} for {number} vehicles")
        if self.own_system_id in self.vehicle_ids:
            raise FieldError(
                f"own_system_id must not be a vehicle's system id, got {self.own_system_id}"
            )
        if self.fence_center is not None:
            for value, limit in zip(self.fence_center, (90.0, 180.0), strict=True):
                if abs(value) > limit:
                    raise FieldError(
                        f"fence_center must be latitude and longitude, got {self.fence_center}"
                    )
        if self.min_altitude > self.max_altitude:
            raise FieldError(
                f"min_altitude must be at most max_altitude, {self.max_altitude:g} m, got "
                f"{self.min_altitude:g}"
            )
        if self.lost_timeout < self.link_timeout:
            raise FieldError(
                f"lost_timeout must be at least link_timeout, {self.link_timeout:g} s, got "
                f"{self.lost_timeout:g}"
            )

    @property
    def vehicles(self) -> int:
        """Number of vehicles."""
        return self.num_vehicles or len(self.connections) or 1

    @property
    def vehicle_ids(self) -> Sequence[int]:
        """System ids of the vehicles."""
        return self.system_ids or range(1, self.vehicles + 1)
