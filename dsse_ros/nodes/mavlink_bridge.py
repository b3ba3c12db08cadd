# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros mavlink_bridge`: vehicles fly what the drones of a search do."""

from __future__ import annotations

import dataclasses
import math
import re
import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from sensor_msgs.msg import NavSatFix, PointCloud2
from std_msgs.msg import String

from dsse_ros.flight.fleet import Fleet, default_connections
from dsse_ros.flight.orders import Hold, Order
from dsse_ros.flight.vehicle import Vehicle, VehicleSettings
from dsse_ros.nodes.escort import Escort, Leg, leg_task, mission_task, takes_off_yet
from dsse_ros.nodes.flight_settings import BridgeSettings
from dsse_ros.nodes.parameters import declare, take_overrides
from dsse_ros.nodes.qos import COMPLETE, LATCHED, RELIABLE, SENSOR, Endpoints
from dsse_ros.nodes.runtime import AlarmNode, run_node
from dsse_ros.nodes.search_record import SearchRecord
from dsse_ros.nodes.track_files import search_mission, write_missions
from dsse_ros.search import FieldError
from dsse_ros.search.fields import specs
from msg_adapters.agents import AgentsInfo, agents_from_message
from msg_adapters.diagnostics import diagnostic_array
from msg_adapters.fence import Fence
from msg_adapters.frames import GridFrame, cell_to_map
from msg_adapters.mission_files import Firmware, Home
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message
from msg_adapters.vehicles import Progress, vehicle_fix, vehicle_pose, vehicle_state_message

TURN_S = 0.1
"""Wall time between looks at the vehicles."""
STATE_S = 1.0
"""Wall time after which the state of a vehicle is told again that has not changed."""
DIAGNOSTICS_S = 1.0


class BridgeNode(AlarmNode):
    """Leads each vehicle along the way of its drone; see the README for its topics.

    Raises:
        FieldError: If a parameter is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("dsse_bridge")
        known = specs(BridgeSettings)
        given, qos = take_overrides(self, known)
        self.settings = BridgeSettings(**given)
        declare(self, known, vars(self.settings))
        self._names = [f"drone{i}" for i in range(self.settings.vehicles)]
        self._info: AgentsInfo | None = None
        self._frames: list[GridFrame] = []
        self._escorts: list[Escort] = []
        self._report: tuple[int, NDArray[Any]] | None = None
        self._record: SearchRecord | None = None
        self._over: list[Leg] = []
        self._trouble = ""
        self._idle_s: float | None = None
        self._holding = False
        self._link_troubles: dict[str, str] = {}
        self._told: dict[int, tuple[object, float]] = {}
        self.fleet = _fleet(self.settings)
        endpoints = Endpoints(self, qos)
        self._poses = [
            endpoints.publisher(PoseStamped, f"{name}/vehicle_pose", RELIABLE)
            for name in self._names
        ]
        self._fixes = [
            endpoints.publisher(NavSatFix, f"{name}/vehicle_fix", SENSOR) for name in self._names
        ]
        self._states = [
            endpoints.publisher(DiagnosticArray, f"{name}/vehicle_state", LATCHED)
            for name in self._names
        ]
        self._diagnostics = endpoints.publisher(DiagnosticArray, "/diagnostics", RELIABLE)
        for kind, topic, read, kept in (
            (String, "agents", self._on_agents, LATCHED),
            (PointCloud2, "step_report", self._on_report, COMPLETE),
        ):
            endpoints.subscription(kind, topic, partial(self._on, topic, read), kept)
        endpoints.check_all_used()
        self.alarms.make(self._turn).repeat(TURN_S)
        self.alarms.make(self._publish_poses).repeat(1.0 / self.settings.pose_rate)
        self.alarms.make(self._publish_diagnostics).repeat(DIAGNOSTICS_S)
        if self.fleet is not None:
            self.fleet.start()
            self._introduce(self.fleet)

    # The search

    def _on(self, topic: str, read: Callable[[Any], None], message: Any) -> None:
        try:
            read(message)
        except ValueError as error:
            self.warn(topic, f"{topic}: {error}")

    def _on_agents(self, message: String) -> None:
        before, self._info = self._info, agents_from_message(message)
        count, vehicles = len(self._info.agents), self.settings.vehicles
        self._trouble = ""
        if count != vehicles and self.fleet is not None:
            self._trouble = f"{vehicles} vehicles for {count} drones: nothing is flown"
            self.get_logger().error(self._trouble)
            self._escorts = []
        elif before is None or before.frame != self._info.frame or not self._escorts:
            self._meet(self._info.frame)
        if self._report is not None:
            self._follow(*self._report)

    def _meet(self, frame: GridFrame) -> None:
        """Make everything that depends on where the search is."""
        settings = self.settings
        self._record, self._over = None, []
        altitudes = settings.altitudes or (frame.alt_m,)
        if len(altitudes) < settings.vehicles:
            altitudes *= settings.vehicles
        self._frames = [dataclasses.replace(frame, alt_m=alt_m) for alt_m in altitudes]
        self._escorts = [
            Escort(one.alt_m, self._fence(one), settings.at_end, settings.join_timeout)
            for one in self._frames
        ]

    def _fence(self, frame: GridFrame) -> Fence:
        settings = self.settings
        return Fence(frame, settings.fence_margin, settings.min_altitude, settings.max_altitude)

    def _on_report(self, message: PointCloud2) -> None:
        report = step_report_from_message(message)
        if len(report):
            stamp_ns = to_nanoseconds(message.header.stamp)
            before, self._report = self._report, (stamp_ns, report)
            if before is None or _search_of(before[1]) != _search_of(report):
                self._begin()
            self._follow(stamp_ns, report)

    def _begin(self) -> None:
        """Prepare for a new search."""
        self._record, self._over = None, []
        for escort in self._escorts:
            escort.begin()

    def _follow(self, stamp_ns: int, report: NDArray[Any]) -> None:
        """Have the vehicles follow a step."""
        info, settings = self._info, self.settings
        if info is None or self._trouble or not _fits(info, report):
            return
        search = info.actions.index("search") if "search" in info.actions else -1
        self._idle_s, self._holding = None, False
        legs = _legs(stamp_ns, report, search)
        if settings.mode == "guided":
            for escort, frame, leg in zip(self._escorts, self._frames, legs, strict=True):
                escort.follow(leg, leg_task(leg, frame, settings, self._fence(frame)))
                self._report_refusal(escort)
            return
        self._record = self._record or SearchRecord(search)
        self._record.add(report)
        if not all(leg.over for leg in legs) or self._over:
            return
        if self._record.missed:
            self.get_logger().error(
                f"{len(self._record.missed)} steps were not heard, the first is "
                f"{self._record.missed[0]}: start the bridge before the search, or lower step_rate"
            )
            return
        self._over = legs
        if settings.mode == "export":
            self._export(self._record, info)

    def _export(self, record: SearchRecord, info: AgentsInfo) -> None:
        directory = Path(self.settings.export_directory)
        missions = {
            name: search_mission(info.frame, *record.track(i), self.settings)
            for i, name in enumerate(info.agents)
        }
        try:
            written = write_missions(directory, missions, self.settings.dialect)
        except OSError as error:
            self._trouble = f"export_directory: {str(directory)!r}: {error.strerror}"
            self.get_logger().error(self._trouble)
            return
        self.get_logger().info(f"{len(written)} files in {directory.resolve()}")

    # The vehicles

    def _introduce(self, fleet: Fleet) -> None:
        for name, vehicle in zip(self._names, fleet, strict=True):
            one = vehicle.settings
            self.get_logger().info(
                f"{name}: waiting for system {one.system_id} on {one.connection}"
            )

    def _watch_link(self, name: str, vehicle: Vehicle) -> None:
        """Tell of each new trouble once; when it is heard in between, it is new again."""
        trouble = vehicle.trouble
        if trouble and trouble != self._link_troubles.get(name):
            self._link_troubles[name] = trouble
            self.get_logger().warning(f"{name}: {trouble}")
        elif not trouble and vehicle.state.connected:
            self._link_troubles.pop(name, None)

    def _turn(self) -> None:
        """Give the vehicles what orders are due."""
        now_s = time.monotonic()
        if self.fleet is None:
            return
        for name, vehicle in zip(self._names, self.fleet, strict=True):
            self._watch_link(name, vehicle)
        for i, (escort, vehicle) in enumerate(zip(self._escorts, self.fleet, strict=False)):
            state = vehicle.state
            if self._over and escort.leg is None and state.home is not None:
                self._plan(i, Home(*state.home))
            lost, refused = escort.lost, escort.refused
            order = escort.advance(state, vehicle.outcome, now_s, vehicle.trouble)
            if order is not None:
                self._give(i, vehicle, order)
            if escort.lost != lost:
                self.get_logger().error(f"{self._names[i]} is lost: {escort.lost}")
            if escort.refused != refused:
                self._report_refusal(escort)
            for text in vehicle.take_texts():
                self.get_logger().info(f"{self._names[i]} says: {text.text}")
            self._tell(i, escort, vehicle, now_s)
        if not self._escorts:
            for i, vehicle in enumerate(self.fleet):
                if takes_off_yet(vehicle.state, vehicle.outcome):
                    self._give(i, vehicle, Hold())
                self._tell(i, None, vehicle, now_s)
        self._watch_planner(now_s)

    def _give(self, drone: int, vehicle: Vehicle, order: Order) -> None:
        number = vehicle.give(order)
        self.get_logger().info(f"{self._names[drone]}: order {number}: {_shown(order)}")

    def _plan(self, drone: int, home: Home) -> None:
        """Have a vehicle fly the whole search."""
        assert self._record is not None
        frame, settings = self._frames[drone], self.settings
        mission = search_mission(frame, *self._record.track(drone), settings, home)
        firmware = cast(Firmware, settings.dialect)
        self._escorts[drone].follow(
            self._over[drone], mission_task(mission, self._fence(frame), firmware)
        )
        self._report_refusal(self._escorts[drone])

    def _report_refusal(self, escort: Escort) -> None:
        if escort.refused:
            self.warn("refused", f"{self._names[self._escorts.index(escort)]}: {escort.refused}")

    def _watch_planner(self, now_s: float) -> None:
        """Have the vehicles hold if they have waited for the next step for too long."""
        timeout_s = self.settings.planner_timeout
        if self.settings.mode != "guided" or timeout_s <= 0 or self._holding:
            return
        going = [e for e in self._escorts if e.leg is not None and not e.leg.over and not e.lost]
        if not going or not all(escort.waiting for escort in going):
            self._idle_s = None
            return
        self._idle_s = now_s if self._idle_s is None else self._idle_s
        if now_s - self._idle_s > timeout_s:
            self._holding = True
            self.get_logger().warning(f"no step within {timeout_s:g} s: the vehicles hold")
            for escort in going:
                escort.hold()

    # What is told

    def _publish_poses(self) -> None:
        if self.fleet is None or not self._frames:
            return
        stamp = self.get_clock().now().to_msg()
        for i, vehicle in enumerate(self.fleet):
            state = vehicle.state
            if not (state.connected and state.has_position and i < len(self._frames)):
                continue
            place = (state.lat_deg, state.lon_deg)
            self._poses[i].publish(
                vehicle_pose(self._frames[i], *place, state.alt_m, state.heading_deg, stamp)
            )
            self._fixes[i].publish(vehicle_fix(self._names[i], *place, state.alt_amsl_m, stamp))

    def _tell(self, i: int, escort: Escort | None, vehicle: Vehicle, now_s: float) -> None:
        """Publish the state of a vehicle if it is news."""
        state, outcome = vehicle.state, vehicle.outcome
        leg = escort.leg if escort is not None else None
        progress = Progress()
        if escort is not None and leg is not None:
            progress = Progress(leg.stamp_ns, escort.arrived_stamp_ns, escort.lost)
        refused = escort.refused if escort is not None else self._trouble
        news = (
            progress, refused, outcome, state.mode, state.armed, state.connected, state.ready,
            state.flying, state.item_reached, vehicle.trouble,
        )  # fmt: skip
        before, told_s = self._told.get(i, (None, -math.inf))
        if news == before and now_s - told_s < STATE_S:
            return
        self._told[i] = (news, now_s)
        level, message = _summary(vehicle, progress.lost, refused)
        values: dict[str, object] = {
            "connected": _text(state.connected),
            "ready": _text(state.ready),
            "armed": _text(state.armed),
            "flying": _text(state.flying),
            "mode": state.mode,
            "battery": f"{state.battery:.2f}",
            "failsafe": state.failsafe,
            "cell": "" if leg is None else f"{leg.cell[0]} {leg.cell[1]}",
            "arrived": _text(escort is not None and escort.arrived),
            "order": _shown(outcome.order),
            "status": outcome.status,
            "reason": outcome.reason,
            "refused": refused,
            "item_current": state.item_current,
            "item_reached": state.item_reached,
        }
        values |= {f"count.{key}": n for key, n in sorted(vehicle.counts.items())}
        settings = vehicle.settings
        self._states[i].publish(
            vehicle_state_message(
                self._names[i],
                f"{settings.connection} system {settings.system_id}",
                self.get_clock().now().to_msg(),
                progress,
                level=level,
                message=message,
                values=values,
            )  # fmt: skip
        )

    def _publish_diagnostics(self) -> None:
        vehicles = [] if self.fleet is None else list(self.fleet)
        lost = [name for name, e in zip(self._names, self._escorts, strict=False) if e.lost]
        refused = [name for name, e in zip(self._names, self._escorts, strict=False) if e.refused]
        level, message = DiagnosticStatus.OK, "follows" if self._report else "waits for a search"
        if self._holding:
            level, message = DiagnosticStatus.WARN, "no steps: the vehicles hold"
        if lost or refused:
            level = DiagnosticStatus.WARN
        if self._trouble:
            level, message = DiagnosticStatus.ERROR, self._trouble
        counts: Counter[str] = Counter()
        for vehicle in vehicles:
            counts += vehicle.counts
        values: dict[str, object] = {
            "mode": self.settings.mode,
            "vehicles": len(vehicles),
            "connected": sum(vehicle.state.connected for vehicle in vehicles),
            "flying": sum(vehicle.state.flying for vehicle in vehicles),
            "lost": ", ".join(lost),
            "refused": ", ".join(refused),
        }
        values |= {f"count.{key}": n for key, n in sorted(counts.items())}
        self._diagnostics.publish(
            diagnostic_array(
                self.get_clock().now().to_msg(),
                name=self.get_fully_qualified_name().lstrip("/"),
                hardware_id="dsse_ros",
                level=level,
                message=message,
                values=values,
            )  # fmt: skip
        )

    def destroy_node(self) -> None:
        """Leave the vehicles to their autopilots, and close the node."""
        if self.fleet is not None:
            self.fleet.close()
        super().destroy_node()


def _fleet(settings: BridgeSettings) -> Fleet | None:
    """Return the vehicles, None where none is to be flown.

    Raises:
        FieldError: If a setting is not allowed.
    """
    if settings.mode == "export":
        return None
    connections = settings.connections or default_connections(settings.vehicles)
    system_ids = settings.system_ids or range(1, settings.vehicles + 1)
    try:
        return Fleet(
            [
                VehicleSettings(
                    connection=connection,
                    system_id=system_id,
                    own_system_id=settings.own_system_id,
                    dialect=settings.dialect,  # type: ignore[arg-type]
                    arm=settings.arm,
                    speed_mps=settings.speed,
                    set_point_hz=settings.set_point_rate,
                    link_lost_s=settings.link_timeout,
                    ready_timeout_s=settings.join_timeout,
                    signing_key_file=settings.signing_key_file,
                )
                for connection, system_id in zip(connections, system_ids, strict=True)
            ]
        )
    except (OSError, ValueError) as error:
        # Each vehicle has one connection, the parameter has them all.
        text = re.sub("^connection: ", "connections: ", str(error))
        raise FieldError(text) from None


def _fits(info: AgentsInfo, report: NDArray[Any]) -> bool:
    """Return whether both can be of the same search."""
    if len(report) != len(info.agents) or _search_of(report) != (info.run_id, info.mission):
        return False
    centres = np.stack(cell_to_map(info.frame, report["col"] * 1.0, report["row"] * 1.0))
    return np.allclose(centres, [report["x"], report["y"]], rtol=1e-5, atol=0.1)


def _search_of(report: NDArray[Any]) -> tuple[int, int]:
    """Return run_id and mission of a report."""
    return int(report["run_id"][0]), int(report["mission"][0])


def _legs(stamp_ns: int, report: NDArray[Any], search: int) -> list[Leg]:
    """Return the legs of a step, one for each drone."""
    over = (report["terminated"] | report["truncated"]).astype(bool)
    cells = list(zip(report["col"].tolist(), report["row"].tolist(), strict=True))
    searched = (report["action"] == search) & (np.asarray(report["step"]) > 0)
    crashed = [bool(over[i]) and cells.count(cell) > 1 for i, cell in enumerate(cells)]
    return [
        Leg(stamp_ns, cell, bool(searched[i]), bool(over[i]), crashed[i])
        for i, cell in enumerate(cells)
    ]


def _summary(vehicle: Vehicle, lost: str, refused: str) -> tuple[bytes, str]:
    """Return level and line of a vehicle's state."""
    state, outcome = vehicle.state, vehicle.outcome
    if lost:
        return DiagnosticStatus.ERROR, f"lost: {lost}"
    if refused:
        return DiagnosticStatus.ERROR, f"refused: {refused}"
    if not state.connected:
        return DiagnosticStatus.STALE, vehicle.trouble or "not heard"
    if state.failsafe or outcome.status in ("failed", "taken_over", "lost"):
        return DiagnosticStatus.WARN, f"{outcome.status}: {outcome.reason} {state.failsafe}".strip()
    return DiagnosticStatus.OK, f"{state.mode}: {outcome.reason or outcome.status}"


def _text(flag: bool) -> str:
    return "true" if flag else "false"


def _shown(order: Any) -> str:
    """Return an order on one line; a mission by its length."""
    if order is None:
        return ""
    items = getattr(order, "items", None)
    return repr(order) if items is None else f"FlyMission of {len(items)} items"


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""
    return run_node("mavlink_bridge", BridgeNode, argv)


if __name__ == "__main__":
    sys.exit(main())
