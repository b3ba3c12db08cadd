# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The publishers of `mavlink_bridge`; a function of `msg_adapters` makes each message."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from dsse_ros.bridge.fleet_vehicle import shown_order
from dsse_ros.bridge.health import fleet_health, vehicle_health
from dsse_ros.bridge.vehicle_follower import VehicleFollower
from dsse_ros.flight.vehicle import Vehicle
from dsse_ros.nodes.node_diagnostics import NodeDiagnostics
from dsse_ros.runtime.qos import Endpoints
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import geodetic_to_map
from msg_adapters.battery import battery_state
from msg_adapters.poses import base_link
from msg_adapters.stamps import header
from msg_adapters.vehicles import (
    Progress,
    vehicle_fix,
    vehicle_pose,
    vehicle_state_message,
    vehicle_time,
)

STATE_S = 1.0
"""Wall time after which an unchanged state of a vehicle is published again."""


class BridgePublishers:
    """The publishers of the vehicles.

    Args:
        endpoints: Makes the publishers.
        diagnostics: Publishes the health of the node.
        names: Names of the vehicles' drones.
    """

    def __init__(
        self, endpoints: Endpoints, diagnostics: NodeDiagnostics, names: Sequence[str]
    ) -> None:
        publisher = endpoints.publisher
        self._names = names
        self._poses = [publisher(f"{name}/vehicle_pose") for name in names]
        self._fixes = [publisher(f"{name}/vehicle_fix") for name in names]
        self._times = [publisher(f"{name}/vehicle_time") for name in names]
        self._states = [publisher(f"{name}/vehicle_state") for name in names]
        self._batteries = [publisher(f"{name}/vehicle_battery") for name in names]
        self._diagnostics = diagnostics
        # For each vehicle, the last published state, and when; and when its position was received.
        self._last: dict[int, tuple[object, float]] = {}
        self._statuses: dict[int, DiagnosticStatus] = {}
        self._placed_s = [-math.inf] * len(names)
        self._frame_prefix = ""

    def publish_place(
        self, i: int, vehicle: Vehicle, frame: GridFrame, datum_m: float, stamp: Time
    ) -> None:
        """Publish position and clock of a vehicle, if it has reported them since the last call."""
        state = vehicle.state
        self._frame_prefix = frame.frame_prefix
        if not state.has_position or state.position_s <= self._placed_s[i]:
            return
        self._placed_s[i] = state.position_s
        place = (state.lat_deg, state.lon_deg)
        # The datum is as high as the grid's origin.
        alt_m = frame.origin_alt_m + (state.alt_amsl_m - datum_m)
        position = geodetic_to_map(frame, *place, alt_m)
        head = header(frame.map_frame, stamp)
        self._poses[i].publish(
            vehicle_pose(head, position, (state.roll_rad, state.pitch_rad, state.heading_deg))
        )
        fix = (*place, state.alt_amsl_m + state.geoid_m)
        body = base_link(self._names[i], frame.frame_prefix)
        self._fixes[i].publish(vehicle_fix(header(body, stamp), fix))
        name = f"{vehicle.connection} system {vehicle.system_id}"
        self._times[i].publish(vehicle_time(header(body, stamp), name, state.boot_s))

    def publish_state(
        self,
        i: int,
        follower: VehicleFollower,
        vehicle: Vehicle,
        trouble: str,
        stamp: Time,
        now_s: float,
    ) -> None:
        """Publish the state of a vehicle, if it has changed or is due again.

        Args:
            i: Number of the vehicle.
            follower: Its follower.
            vehicle: The vehicle.
            trouble: Why no vehicle can fly; empty if they can.
            stamp: Time of the message.
            now_s: Time on a steady clock.
        """
        state, outcome = vehicle.state, vehicle.outcome
        leg, custody = follower.progress.leg, follower.custody.state.value
        progress = Progress(battery=state.battery)
        if leg is not None:
            looked, arrived = follower.looked_number, follower.arrived_number
            run_id, _ = follower.custody.search or (0, 0)
            progress = Progress(leg.number, looked, arrived, follower.lost, state.battery, run_id)
        refused, blocked = trouble or follower.refused, follower.blocked
        news = (
            progress, refused, blocked, follower.leaves_layer, custody, outcome, state.mode,
            state.armed, state.connected, state.ready, state.flying, state.item_reached,
            vehicle.trouble,
        )  # fmt: skip
        before, published_s = self._last.get(i, (None, -math.inf))
        if news == before and now_s - published_s < STATE_S:
            return
        self._last[i] = (news, now_s)
        # As the autopilot reports it; NaN until it does.
        percent = 100.0 * state.battery
        head = header(base_link(self._names[i], self._frame_prefix), stamp)
        self._batteries[i].publish(battery_state(head, percent, flying=state.flying))
        level, message = vehicle_health(
            vehicle, progress.lost, refused, blocked, follower.leaves_layer
        )
        state_message = vehicle_state_message(
            self._names[i],
            f"{vehicle.connection} system {vehicle.system_id}",
            stamp,
            progress,
            level=level,
            message=message,
            values=_state_values(follower, vehicle, refused),
        )
        self._states[i].publish(state_message)
        self._statuses[i] = state_message.status[0]

    def publish_diagnostics(
        self,
        mode: str,
        vehicles: Sequence[Vehicle],
        followers: Sequence[VehicleFollower],
        *,
        following: bool,
        alive: bool,
        holding: bool,
        trouble: str,
    ) -> None:
        """Publish the health of the node, and the last state of each vehicle.

        Args:
            mode: What the node does with the steps of a search.
            vehicles: All vehicles.
            followers: Their followers.
            following: Whether the node follows a search.
            alive: Whether a simulation is running.
            holding: Whether the vehicles hold because no steps come.
            trouble: Why no vehicle can fly; empty if they can.
        """
        named = self._named(vehicles, followers)
        own = fleet_health(
            len(vehicles),
            named=named,
            following=following,
            alive=alive,
            holding=holding,
            trouble=trouble,
        )
        counts: Counter[str] = Counter()
        for vehicle in vehicles:
            counts += vehicle.counts
        values: dict[str, object] = {
            "mode": mode,
            "vehicles": len(vehicles),
            "connected": sum(vehicle.state.connected for vehicle in vehicles),
            "flying": sum(vehicle.state.flying for vehicle in vehicles),
        }
        values |= {what: ", ".join(drones) for what, drones in named.items()}
        values |= {f"count.{key}": n for key, n in sorted(counts.items())}
        of_vehicles = [
            DiagnosticStatus(
                level=status.level, name=self._diagnostics.name_of(self._names[i]),
                message=status.message, hardware_id=status.hardware_id, values=status.values,
            )
            for i, status in sorted(self._statuses.items())
        ]  # fmt: skip
        self._diagnostics.publish(own, values, of_vehicles)

    def _named(
        self, vehicles: Sequence[Vehicle], followers: Sequence[VehicleFollower]
    ) -> dict[str, list[str]]:
        """Return the names of the drones whose vehicles have a trouble, by the trouble."""
        each = list(zip(self._names, vehicles, followers, strict=True))
        return {
            "lost": [name for name, _, follower in each if follower.lost],
            "refused": [name for name, _, follower in each if follower.refused],
            "blocked": [name for name, _, follower in each if follower.blocked],
            "leaves_layer": [name for name, _, follower in each if follower.leaves_layer],
            "unreachable": [name for name, vehicle, _ in each if vehicle.trouble],
        }


def _state_values(follower: VehicleFollower, vehicle: Vehicle, refused: str) -> dict[str, object]:
    """Return the values of a `vehicle_state` by key, but for those of its `Progress`."""
    state, outcome, leg = vehicle.state, vehicle.outcome, follower.progress.leg
    values: dict[str, object] = {
        "custody": follower.custody.state.value,
        "connected": _text(state.connected),
        "ready": _text(state.ready),
        "armed": _text(state.armed),
        "flying": _text(state.flying),
        "mode": state.mode,
        "failsafe": state.failsafe,
        "cell": "" if leg is None else f"{leg.cell[0]} {leg.cell[1]}",
        "arrived": _text(follower.progress.arrived),
        "order": shown_order(outcome.order),
        "status": outcome.status,
        "reason": outcome.reason,
        "refused": refused,
        "blocked": follower.blocked,
        "leaves_layer": follower.leaves_layer,
        "return_altitude": f"{state.return_alt_m:g}",
        "item_current": state.item_current,
        "item_reached": state.item_reached,
    }
    return values | {f"count.{key}": n for key, n in sorted(vehicle.counts.items())}


def _text(flag: bool) -> str:
    return "true" if flag else "false"
