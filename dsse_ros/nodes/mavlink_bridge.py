# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros mavlink_bridge`: vehicles fly what the drones of a search do."""

from __future__ import annotations

import math
import re
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.clock import Clock
from sensor_msgs.msg import NavSatFix, PointCloud2
from std_msgs.msg import String

from dsse_ros.flight.defects import Defects, describe
from dsse_ros.flight.fence import Fence
from dsse_ros.flight.fleet import Fleet, default_connections
from dsse_ros.flight.flight_records import FlightRecords, default_directory
from dsse_ros.flight.flight_settings import BridgeSettings
from dsse_ros.flight.orders import Hold, Order
from dsse_ros.flight.track_files import layers, search_mission, write_missions
from dsse_ros.flight.vehicle import Vehicle, VehicleSettings
from dsse_ros.flight.vehicle_follower import (
    FlightRecord,
    Leg,
    VehicleFollower,
    leg_task,
    mission_task,
    takes_off_yet,
)
from dsse_ros.nodes.parameters import declare, take_overrides
from dsse_ros.nodes.qos import COMPLETE, LATCHED, RELIABLE, SENSOR, Endpoints
from dsse_ros.nodes.runtime import AlarmNode, run_node
from dsse_ros.search import FieldError
from dsse_ros.search.fields import specs
from msg_adapters.agents import AgentsInfo, agents_from_message
from msg_adapters.diagnostics import diagnostic_array
from msg_adapters.frames import GridFrame
from msg_adapters.mission_files import Firmware, Home
from msg_adapters.mission_report import mission_report_from_message
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message
from msg_adapters.vehicles import Progress, vehicle_fix, vehicle_pose, vehicle_state_message

TURN_S = 0.1
"""Wall time between looks at the vehicles."""
STATE_S = 1.0
"""Wall time after which the state of a vehicle is told again that has not changed."""
DIAGNOSTICS_S = 1.0
SETTLE_S = 1.0
"""Wall time in which all that was latched for who comes late is heard: the latest report counts."""
MISSION_REPORT_S = 5.0
"""Wall time in which the report of a mission comes that is over."""

T = TypeVar("T")


class BridgeNode(AlarmNode):
    """Leads each vehicle along the way of its drone; see the README for its topics.

    Raises:
        FieldError: If a parameter is not allowed.
    """

    # Here, as a node that could not be made is destroyed too.
    fleet: Fleet | None = None

    def __init__(self) -> None:
        super().__init__("dsse_bridge")
        known = specs(BridgeSettings)
        given, qos = take_overrides(self, known)
        self.settings = BridgeSettings(**given)
        declare(self, known, vars(self.settings))
        self._names = [f"drone{i}" for i in range(self.settings.vehicles)]
        self._info: AgentsInfo | None = None
        self._frames: list[GridFrame] = []
        self._followers: list[VehicleFollower] = []
        self._records: FlightRecords | None = None
        # Reports may come before the agents that they belong to.
        self._report: tuple[int, NDArray[Any]] | None = None
        self._mission_report: tuple[int, NDArray[Any]] | None = None
        self._followed: NDArray[Any] | None = None
        self._tracks: NDArray[Any] | None = None
        self._over: list[Leg] = []
        self._exported = False
        self._foreign = ""
        self._unflyable = ""
        self._tracks_late = False
        self._over_since_s: float | None = None
        self._settled_s = 0.0
        self._search_alive = False
        self._idle_s: float | None = None
        self._holding = False
        self._link_troubles: dict[str, str] = {}
        self._defects = [Defects(name) for name in self._names]
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
        # What watches over nodes compares the stamps of diagnostics with the wall clock.
        self._wall_clock = Clock()
        self._diagnostics = endpoints.publisher(DiagnosticArray, "/diagnostics", RELIABLE)
        for kind, topic, read, kept in (
            (String, "agents", self._on_agents, LATCHED),
            (PointCloud2, "step_report", self._on_report, COMPLETE),
            (PointCloud2, "mission_report", self._on_mission_report, LATCHED),
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
        info = agents_from_message(message)
        count, vehicles = len(info.agents), self.settings.vehicles
        if count != vehicles and self.fleet is not None:
            # Those of another simulation; our own goes on if it is heard again.
            self._foreign = f"{vehicles} vehicles for {count} drones: nothing is flown"
            self.get_logger().error(self._foreign)
            return
        self._foreign = ""
        if self._info is None or _identity(info) != _identity(self._info):
            self._begin(info)
        self._follow_reports()

    def _on_report(self, message: PointCloud2) -> None:
        report = step_report_from_message(message)
        if len(report):
            self._report = (to_nanoseconds(message.header.stamp), report)
            self._follow_reports()

    def _on_mission_report(self, message: PointCloud2) -> None:
        report = mission_report_from_message(message)
        if report.size:
            self._mission_report = (to_nanoseconds(message.header.stamp), report)
            self._follow_reports()

    def _follow_reports(self) -> None:
        """Follow what was heard last, if it is of the search that is followed."""
        info = self._info
        if info is None:
            return
        if self._report is not None and _belongs(self._report[1], info):
            stamp_ns, report = self._report
            if self._foreign:
                self._foreign = ""
                self.get_logger().info("the search is heard again and followed")
            self._follow(stamp_ns, report, info)
        if self._mission_report is not None and _belongs(self._mission_report[1], info):
            self._take_tracks(*self._mission_report, info)

    def _begin(self, info: AgentsInfo) -> None:
        """Prepare for a mission, and for where it is."""
        settings = self.settings
        self._info, self._followed, self._tracks = info, None, None
        self._records, self._followers, self._frames = None, [], []
        self._over_since_s, self._exported = None, False
        self._settled_s = time.monotonic() + SETTLE_S
        self._idle_s, self._holding = None, False
        self._unflyable = ""
        try:
            self._frames = _frames(info.frame, settings, len(info.agents))
            if self.fleet is not None:
                directory = Path(settings.state_directory or default_directory())
                self._records = FlightRecords(directory, info.run_id, info.mission)
        except OSError as error:
            self._fail(f"state_directory: {error.filename!r}: {error.strerror}: nothing is flown")
            return
        except ValueError as error:
            self._fail(f"{error}: nothing is flown")
            return
        if self._records is None:
            return
        for name, frame in zip(self._names, self._frames, strict=True):
            follower = VehicleFollower(
                frame.alt_m,
                self._fence(frame),
                settings.at_end,
                settings.join_timeout,
                settings.lost_timeout,
                whole=settings.mode == "mission",
            )
            record = self._records[name]
            follower.begin(record)
            self._followers.append(follower)
            if record != FlightRecord():
                what = f"was lost: {record.lost}" if record.lost else "has taken off"
                self.get_logger().warning(f"{name} {what}, earlier in mission {info.mission}")

    def _fail(self, trouble: str) -> None:
        """Say that the search cannot be flown as long as that is so."""
        if trouble != self._unflyable:
            self.get_logger().error(trouble)
        self._unflyable = trouble

    def _fence(self, frame: GridFrame) -> Fence:
        settings = self.settings
        return Fence(frame, settings.fence_margin, settings.min_altitude, settings.max_altitude)

    def _follow(self, stamp_ns: int, report: NDArray[Any], info: AgentsInfo) -> None:
        """Have the vehicles follow a step."""
        settings = self.settings
        if self._unflyable or len(report) != len(info.agents):
            return
        if self._followed is not None and report["step"][0] < self._followed["step"][0]:
            # A simulation with a fixed run_id was started anew.
            self._mission_report = None
            self._begin(info)
        self._followed = report
        self._idle_s, self._holding = None, False
        legs = _legs(stamp_ns, report, _search_action(info))
        if all(leg.over for leg in legs):
            self._over_since_s = self._over_since_s or time.monotonic()
        if settings.mode == "guided":
            for follower, frame, leg in zip(self._followers, self._frames, legs, strict=False):
                follower.follow(leg, leg_task(leg, frame, settings, self._fence(frame)))
                self._report_refusal(follower)

    def _take_tracks(self, stamp_ns: int, report: NDArray[Any], info: AgentsInfo) -> None:
        """Have the whole search flown, or written, which is over."""
        if self.settings.mode == "guided" or self._tracks is not None:
            return
        if self._unflyable or report.shape[1] != len(info.agents):
            return
        self._tracks = report
        self._over = [replace(leg, over=True) for leg in _legs(stamp_ns, report[-1], -1)]
        if self.settings.mode == "export":
            self._export(info)

    def _track(self, drone: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return the cells (K, 2) of a drone, and flags (K,) of those it has searched."""
        assert self._tracks is not None and self._info is not None
        track = self._tracks[:, drone]
        cells = np.stack([track["col"], track["row"]], axis=1).astype(np.int64)
        return cells, track["action"] == _search_action(self._info)

    def _export(self, info: AgentsInfo) -> None:
        directory = Path(self.settings.export_directory)
        missions = {
            name: search_mission(self._frames[i], *self._track(i), self.settings)
            for i, name in enumerate(info.agents)
        }
        try:
            written = write_missions(directory, missions, self.settings.dialect)
        except OSError as error:
            self._fail(f"export_directory: {str(directory)!r}: {error.strerror}")
            return
        self._exported = True
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
        self._watch_search(now_s)
        if self.fleet is not None:
            for name, vehicle in zip(self._names, self.fleet, strict=True):
                self._watch_link(name, vehicle)
            led = list(enumerate(zip(self._followers, self.fleet, strict=False)))
            orders = [self._isolated(i, self._next_order, *one, now_s) for i, one in led]
            # Before anybody hears of it, a bridge that is started again must know it.
            self._keep_records()
            for (i, (follower, vehicle)), order in zip(led, orders, strict=True):
                if order is not None:
                    self._isolated(i, self._give, vehicle, order)
                self._isolated(i, self._tell, follower, vehicle, now_s)
            if not self._followers:
                for i, vehicle in enumerate(self.fleet):
                    if takes_off_yet(vehicle.state, vehicle.outcome):
                        self._isolated(i, self._give, vehicle, Hold())
                    self._isolated(i, self._tell, None, vehicle, now_s)
            self._watch_planner(now_s)
        done = self._exported or (self._followers and all(one.finished for one in self._followers))
        if self.settings.exit_at_end and done:
            self.finished = True

    def _isolated(self, i: int, act: Callable[..., T], *arguments: object) -> T | None:
        """Do something about one vehicle; where that goes wrong, the others are flown on."""
        try:
            return act(i, *arguments)
        except Exception as error:
            why = f"defect: {describe(error)}"
            if self._defects[i].is_new(error):
                self.get_logger().error(f"{self._names[i]}: {why}")
                self.get_logger().debug(traceback.format_exc())
            for follower in self._followers[i : i + 1]:
                if not follower.lost:
                    follower.record = replace(follower.record, lost=why)
            return None

    def _next_order(
        self, i: int, follower: VehicleFollower, vehicle: Vehicle, now_s: float
    ) -> Order | None:
        """Return the order that is due for a vehicle, and log what is new about it."""
        state, outcome, name = vehicle.state, vehicle.outcome, self._names[i]
        if self._tracks is not None and not follower.has_task:
            self._plan(i, follower, state.home)
        if now_s < self._settled_s:
            return Hold() if takes_off_yet(state, outcome) else None
        lost, refused, blocked = follower.lost, follower.refused, follower.blocked
        alive = self._search_alive and not self._foreign
        order = follower.advance(state, outcome, now_s, vehicle.trouble, search_alive=alive)
        if follower.lost != lost:
            self.get_logger().error(f"{name} is lost: {follower.lost}")
        if follower.refused != refused:
            self._report_refusal(follower)
        if follower.blocked != blocked and follower.blocked:
            self.get_logger().info(f"{name} cannot take off yet: {follower.blocked}")
        for text in vehicle.take_texts():
            self.get_logger().info(f"{name} says: {text.text}")
        return order

    def _keep_records(self) -> None:
        """Keep what is known of the vehicles for a bridge that is started again."""
        if self._records is None:
            return
        now = {name: one.record for name, one in zip(self._names, self._followers, strict=True)}
        try:
            self._records.update(now)
        except OSError as error:
            self.warn(
                "state_directory",
                f"state_directory: {error.filename!r}: {error.strerror}; a bridge that is started "
                "again would not know which vehicles have flown",
            )

    def _watch_search(self, now_s: float) -> None:
        """See whether the search is there, and has said all that is needed."""
        self._search_alive = self.count_publishers(self.resolve_topic_name("step_report")) > 0
        missing = self.settings.mode != "guided" and self._tracks is None
        since_s = self._over_since_s
        self._tracks_late = missing and since_s is not None and now_s - since_s > MISSION_REPORT_S

    @property
    def _trouble(self) -> str:
        """Why the bridge cannot do what it is for, empty if it can."""
        if self._foreign or self._unflyable or not self._tracks_late:
            return self._foreign or self._unflyable
        return "the search is over, and its mission_report has not come"

    def _give(self, drone: int, vehicle: Vehicle, order: Order) -> None:
        number = vehicle.give(order)
        self.get_logger().info(f"{self._names[drone]}: order {number}: {_shown(order)}")

    def _plan(
        self, drone: int, follower: VehicleFollower, home: tuple[float, float, float] | None
    ) -> None:
        """Have a vehicle fly the whole search, once it has said where home is."""
        leg = self._over[drone]
        if home is None:
            follower.follow(leg, None)
            return
        frame, settings = self._frames[drone], self.settings
        mission = search_mission(frame, *self._track(drone), settings, Home(*home))
        firmware = cast(Firmware, settings.dialect)
        follower.follow(leg, mission_task(mission, self._fence(frame), firmware))
        self._report_refusal(follower)

    def _report_refusal(self, follower: VehicleFollower) -> None:
        if follower.refused:
            self.warn(
                "refused", f"{self._names[self._followers.index(follower)]}: {follower.refused}"
            )

    def _watch_planner(self, now_s: float) -> None:
        """Have the vehicles hold if they have waited for the next step for too long."""
        timeout_s = self.settings.planner_timeout
        if self.settings.mode != "guided" or timeout_s <= 0 or self._holding:
            return
        going = [e for e in self._followers if e.leg is not None and not e.leg.over and not e.lost]
        if not going or not all(follower.waiting for follower in going):
            self._idle_s = None
            return
        self._idle_s = now_s if self._idle_s is None else self._idle_s
        if now_s - self._idle_s > timeout_s:
            self._holding = True
            self.get_logger().warning(f"no step within {timeout_s:g} s: the vehicles hold")
            for follower in going:
                follower.hold()

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
            fix = vehicle_fix(self._frames[i], self._names[i], *place, state.alt_amsl_m, stamp)
            self._fixes[i].publish(fix)

    def _tell(
        self, i: int, follower: VehicleFollower | None, vehicle: Vehicle, now_s: float
    ) -> None:
        """Publish the state of a vehicle if it is news."""
        state, outcome = vehicle.state, vehicle.outcome
        leg = follower.leg if follower is not None else None
        progress = Progress()
        if follower is not None and leg is not None:
            progress = Progress(leg.stamp_ns, follower.arrived_stamp_ns, follower.lost)
        refused = self._trouble or (follower.refused if follower is not None else "")
        blocked = follower.blocked if follower is not None else ""
        news = (
            progress, refused, blocked, outcome, state.mode, state.armed, state.connected,
            state.ready, state.flying, state.item_reached, vehicle.trouble,
        )  # fmt: skip
        before, told_s = self._told.get(i, (None, -math.inf))
        if news == before and now_s - told_s < STATE_S:
            return
        self._told[i] = (news, now_s)
        level, message = _summary(vehicle, progress.lost, refused, blocked)
        values: dict[str, object] = {
            "connected": _text(state.connected),
            "ready": _text(state.ready),
            "armed": _text(state.armed),
            "flying": _text(state.flying),
            "mode": state.mode,
            "battery": f"{state.battery:.2f}",
            "failsafe": state.failsafe,
            "cell": "" if leg is None else f"{leg.cell[0]} {leg.cell[1]}",
            "arrived": _text(follower is not None and follower.arrived),
            "order": _shown(outcome.order),
            "status": outcome.status,
            "reason": outcome.reason,
            "refused": refused,
            "blocked": blocked,
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
        lost = [name for name, e in zip(self._names, self._followers, strict=False) if e.lost]
        refused = [name for name, e in zip(self._names, self._followers, strict=False) if e.refused]
        level, message = DiagnosticStatus.OK, "follows" if self._info else "waits for a search"
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
                self._wall_clock.now().to_msg(),
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
    connections = settings.connections or default_connections(settings.vehicles, settings.dialect)
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
                    link_timeout_s=settings.link_timeout,
                    signing_key_file=settings.signing_key_file,
                )
                for connection, system_id in zip(connections, system_ids, strict=True)
            ]
        )
    except (OSError, ValueError) as error:
        # Each vehicle has one connection, the parameter has them all.
        text = re.sub("^connection: ", "connections: ", str(error))
        raise FieldError(text) from None


def _identity(info: AgentsInfo) -> tuple[int, int]:
    return info.run_id, info.mission


def _belongs(report: NDArray[Any], info: AgentsInfo) -> bool:
    """Return whether a report, of a step or of a mission, is of this search."""
    first = report.flat[0]
    return (int(first["run_id"]), int(first["mission"])) == _identity(info)


def _search_action(info: AgentsInfo) -> int:
    return info.actions.index("search") if "search" in info.actions else -1


def _frames(frame: GridFrame, settings: BridgeSettings, vehicles: int) -> list[GridFrame]:
    """Return the grid at the altitude of each vehicle.

    Raises:
        FieldError: If there is not room for all between the altitudes that are allowed.
    """
    if len(settings.altitudes) == vehicles:
        return [replace(frame, alt_m=alt_m) for alt_m in settings.altitudes]
    highest = replace(frame, alt_m=settings.altitudes[0]) if settings.altitudes else frame
    return layers(highest, settings, vehicles, settings.min_altitude)


def _legs(stamp_ns: int, report: NDArray[Any], search: int) -> list[Leg]:
    """Return the legs of a step, one for each drone."""
    over = (report["terminated"] | report["truncated"]).astype(bool)
    cells = list(zip(report["col"].tolist(), report["row"].tolist(), strict=True))
    searched = report["action"] == search
    crashed = [bool(over[i]) and cells.count(cell) > 1 for i, cell in enumerate(cells)]
    return [
        Leg(stamp_ns, cell, bool(searched[i]), bool(over[i]), crashed[i])
        for i, cell in enumerate(cells)
    ]


def _summary(vehicle: Vehicle, lost: str, refused: str, blocked: str) -> tuple[bytes, str]:
    """Return level and line of a vehicle's state."""
    state, outcome = vehicle.state, vehicle.outcome
    if lost:
        return DiagnosticStatus.ERROR, f"lost: {lost}"
    if refused:
        return DiagnosticStatus.ERROR, f"refused: {refused}"
    if not state.connected:
        return DiagnosticStatus.STALE, vehicle.trouble or "not heard"
    if blocked:
        return DiagnosticStatus.WARN, f"cannot take off yet: {blocked}"
    if state.failsafe or outcome.status in ("failed", "taken_over"):
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
