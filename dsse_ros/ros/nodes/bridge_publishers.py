# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The publishers of `mavlink_bridge`; a function of `msg_adapters` makes each message."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from dsse_ros.ros.nodes.node_diagnostics import NodeDiagnostics
from dsse_ros.ros.runtime.qos import Endpoints
from dsse_ros.vehicles.control.vehicle import Vehicle
from dsse_ros.vehicles.fleet.fleet_vehicle import shown_order
from dsse_ros.vehicles.fleet.health import fleet_health, vehicle_health
from dsse_ros.vehicles.fleet.pace_watch import wind_of
from dsse_ros.vehicles.fleet.vehicle_dispatcher import VehicleDispatcher
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import geodetic_to_map
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
from msg_adapters.winds import wind_message

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
        self._wind = publisher("vehicle_wind")
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
        if state.settled and not state.crashed:
            # What looks ends with its flight.
            self._poses[i].publish(
                vehicle_pose(head, position, (state.roll_rad, state.pitch_rad, state.heading_deg))
            )
        fix = (*place, state.alt_amsl_m + state.geoid_m)
        body = base_link(self._names[i], frame.frame_prefix)
        self._fixes[i].publish(vehicle_fix(header(body, stamp), fix))
        name = f"{vehicle.connection} system {vehicle.system_id}"
        self._times[i].publish(vehicle_time(header(body, stamp), name, state.boot_s))

    def publish_wind(self, wind_mps: tuple[float, float], map_frame: str, stamp: Time) -> None:
        """Publish the wind in which the vehicles fly, to the east and to the north, m/s."""
        self._wind.publish(wind_message(header(map_frame, stamp), wind_mps))

    def publish_state(
        self,
        i: int,
        dispatcher: VehicleDispatcher,
        vehicle: Vehicle,
        trouble: str | None,
        stamp: Time,
        now_s: float,
    ) -> None:
        """Publish the state of a vehicle, if it has changed or is due again.

        Args:
            i: Number of the vehicle.
            dispatcher: Its dispatcher.
            vehicle: The vehicle.
            trouble: Why no vehicle can fly.
            stamp: Time of the message.
            now_s: Time on a steady clock.
        """
        state, outcome = vehicle.state, vehicle.outcome
        leg, custody = dispatcher.progress.leg, dispatcher.custody.state.value
        progress = Progress(battery=state.battery)
        if leg is not None:
            looked, arrived = dispatcher.looked_number, dispatcher.arrived_number
            run_id, _ = dispatcher.custody.search or (0, 0)
            lost = dispatcher.lost or ""
            progress = Progress(leg.number, looked, arrived, lost, state.battery, run_id)
        refused, blocked = trouble or dispatcher.refused, dispatcher.blocked
        news = (
            progress, refused, blocked, dispatcher.leaves_layer, custody, outcome, state.mode,
            state.armed, state.connected, state.ready, state.flying, state.item_reached,
            vehicle.trouble, bool(dispatcher.off_plan),
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
            vehicle, progress.lost, refused, blocked, dispatcher.leaves_layer,
            dispatcher.off_plan,
        )  # fmt: skip
        state_message = vehicle_state_message(
            self._names[i],
            f"{vehicle.connection} system {vehicle.system_id}",
            stamp,
            progress,
            level=level,
            message=message,
            values=_state_values(dispatcher, vehicle, refused),
        )
        self._states[i].publish(state_message)
        self._statuses[i] = state_message.status[0]

    def publish_diagnostics(
        self,
        mode: str,
        vehicles: Sequence[Vehicle],
        dispatchers: Sequence[VehicleDispatcher],
        *,
        following: bool,
        alive: bool,
        holding: bool,
        trouble: str | None,
    ) -> None:
        """Publish the health of the node, and the last state of each vehicle.

        Args:
            mode: What the node does with the steps of a search.
            vehicles: All vehicles.
            dispatchers: Their dispatchers.
            following: Whether the node follows a search.
            alive: Whether a simulation is running.
            holding: Whether the vehicles hold because no steps come.
            trouble: Why no vehicle can fly.
        """
        named = self._named(vehicles, dispatchers)
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
        self, vehicles: Sequence[Vehicle], dispatchers: Sequence[VehicleDispatcher]
    ) -> dict[str, list[str]]:
        """Return the names of the drones whose vehicles have a trouble, by the trouble."""
        each = list(zip(self._names, vehicles, dispatchers, strict=True))
        return {
            "lost": [name for name, _, dispatcher in each if dispatcher.lost],
            "refused": [name for name, _, dispatcher in each if dispatcher.refused],
            "blocked": [name for name, _, dispatcher in each if dispatcher.blocked],
            "unplaced": [name for name, _, dispatcher in each if dispatcher.unplaced],
            "strays": [name for name, _, dispatcher in each if dispatcher.strays],
            "slow": [name for name, _, dispatcher in each if dispatcher.pace_watch.slow],
            "leaves_layer": [name for name, _, dispatcher in each if dispatcher.leaves_layer],
            "unreachable": [name for name, vehicle, _ in each if vehicle.trouble],
        }


def _state_values(
    dispatcher: VehicleDispatcher, vehicle: Vehicle, refused: str | None
) -> dict[str, object]:
    """Return the values of a `vehicle_state` by key, but for those of its `Progress`."""
    state, outcome, leg = vehicle.state, vehicle.outcome, dispatcher.progress.leg
    planned, flown = dispatcher.pace_watch.pace or (math.nan, math.nan)
    wind_speed, wind_from = wind_of(state)
    values: dict[str, object] = {
        "custody": dispatcher.custody.state.value,
        "cleared_by": dispatcher.custody.record.cleared_by or "",
        "connected": _text(state.connected),
        "ready": _text(state.ready),
        "armed": _text(state.armed),
        "flying": _text(state.flying),
        "mode": state.mode,
        "failsafe": state.failsafe.value if state.failsafe else "",
        "cell": "" if leg is None else f"{leg.cell[0]} {leg.cell[1]}",
        "arrived": _text(dispatcher.progress.arrived),
        "order": shown_order(outcome.order),
        "status": outcome.status,
        "reason": outcome.reason or "",
        "refused": refused or "",
        "blocked": dispatcher.blocked or "",
        "leaves_layer": dispatcher.leaves_layer or "",
        "return_altitude": f"{state.return_alt_m:g}",
        "planned_speed": f"{planned:.1f}",
        "flown_speed": f"{flown:.1f}",
        "wind_speed": f"{wind_speed:.1f}",
        "wind_from": f"{wind_from:.0f}",
        "item_current": state.item_current,
        "item_reached": state.item_reached,
    }
    return values | {f"count.{key}": n for key, n in sorted(vehicle.counts.items())}


def _text(flag: bool) -> str:
    return "true" if flag else "false"
