# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros mavlink_bridge`: vehicles fly what the drones of a search do."""

from __future__ import annotations

import re
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from rclpy.clock import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from dsse_ros.flight.autopilots import AUTOPILOTS
from dsse_ros.flight.fence import Fence
from dsse_ros.flight.orders import Hold
from dsse_ros.flight.vehicle import Fleet, Vehicle, VehicleSettings
from dsse_ros.flight.vehicle_controller import Defects, Order, describe
from dsse_ros.flight.vehicle_follower import (
    FlightRecord,
    VehicleFollower,
    leg_task,
    mission_task,
    takes_off_yet,
)
from dsse_ros.mission.followed_search import FollowedSearch, News
from dsse_ros.mission.vehicle_missions import layers, search_mission, write_missions
from dsse_ros.nodes.bridge_publishers import BridgePublishers, shown_order
from dsse_ros.nodes.flight_records import FlightRecords, default_directory
from dsse_ros.nodes.parameters import declare, take_overrides
from dsse_ros.nodes.qos import COMPLETE, LATCHED, Endpoints
from dsse_ros.nodes.runtime import AlarmNode, run_node
from dsse_ros.nodes.settings import BridgeSettings
from dsse_ros.search import FieldError
from dsse_ros.search.fields import specs
from msg_adapters.agents import AgentsInfo, agents_from_message
from msg_adapters.frames import GridFrame
from msg_adapters.mission_items import Home
from msg_adapters.mission_report import mission_report_from_message
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message
from msg_adapters.track_missions import Leg

TURN_S = 0.1
"""Wall time between looks at the vehicles."""
DIAGNOSTICS_S = 1.0
SETTLE_S = 1.0
"""Wall time in which latched messages arrive: the latest report counts."""

T = TypeVar("T")


class BridgeNode(AlarmNode):
    """Has each vehicle follow its drone; see docs/flight.md for its topics.

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
        self._frames: list[GridFrame] = []
        self._followers: list[VehicleFollower] = []
        self._records: FlightRecords | None = None
        self._exported = False
        self._settled_s = 0.0
        self._search_alive = False
        self._idle_s: float | None = None
        self._holding = False
        self._link_troubles: dict[str, str] = {}
        self._defects = [Defects(name) for name in self._names]
        self.fleet = _fleet(self.settings)
        self._search = FollowedSearch(
            None if self.fleet is None else self.settings.vehicles,
            whole=self.settings.mode != "guided",
        )
        endpoints = Endpoints(self, qos)
        self.publishers_ = BridgePublishers(endpoints, self._names)
        # What watches over nodes compares the stamps of diagnostics with the wall clock.
        self._wall_clock = Clock()
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
            self._log_connections(self.fleet)

    # The search

    def _on(self, topic: str, read: Callable[[Any], None], message: Any) -> None:
        try:
            read(message)
        except ValueError as error:
            self.warn(topic, f"{topic}: {error}")

    def _on_agents(self, message: String) -> None:
        self._search.take_agents(agents_from_message(message))
        if self._search.foreign:
            self.get_logger().error(self._search.foreign)
        self._follow_search()

    def _on_report(self, message: PointCloud2) -> None:
        report = step_report_from_message(message)
        self._search.take_report(to_nanoseconds(message.header.stamp), report)
        self._follow_search()

    def _on_mission_report(self, message: PointCloud2) -> None:
        report = mission_report_from_message(message)
        self._search.take_mission_report(to_nanoseconds(message.header.stamp), report)
        self._follow_search()

    def _follow_search(self) -> None:
        """Do what follows from what is new of the search."""
        search = self._search
        while (news := search.next_news(time.monotonic())) is not None:
            assert search.info is not None
            match news:
                case News.BEGUN:
                    self._begin(search.info)
                case News.HEARD_AGAIN:
                    self.get_logger().info("the search is received again and followed")
                case News.STEP:
                    self._follow(search.legs)
                case News.TRACKS if self.settings.mode == "export":
                    self._export(search.info)

    def _begin(self, info: AgentsInfo) -> None:
        """Prepare for a mission, and for where it is."""
        settings = self.settings
        self._records, self._followers, self._frames = None, [], []
        self._exported = False
        self._settled_s = time.monotonic() + SETTLE_S
        self._idle_s, self._holding = None, False
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
        """Report that the search cannot be flown as long as that is so."""
        if self._search.fail(trouble):
            self.get_logger().error(trouble)

    def _fence(self, frame: GridFrame) -> Fence:
        settings, info = self.settings, self._search.info
        return Fence(
            frame,
            settings.fence_margin,
            settings.min_altitude,
            settings.max_altitude,
            area=info.area if info is not None else None,
        )

    def _follow(self, legs: list[Leg]) -> None:
        """Have the vehicles follow a step."""
        settings = self.settings
        self._idle_s, self._holding = None, False
        if settings.mode == "guided":
            for follower, frame, leg in zip(self._followers, self._frames, legs, strict=False):
                follower.follow(leg, leg_task(leg, frame, settings, self._fence(frame)))
                self._report_refusal(follower)

    def _export(self, info: AgentsInfo) -> None:
        directory = Path(self.settings.export_directory)
        missions = {
            name: search_mission(self._frames[i], *self._search.track(i), self.settings)
            for i, name in enumerate(info.agents)
        }
        try:
            written = write_missions(directory, missions, self.settings.autopilot)
        except OSError as error:
            self._fail(f"export_directory: {str(directory)!r}: {error.strerror}")
            return
        self._exported = True
        self.get_logger().info(f"{len(written)} files in {directory.resolve()}")

    # The vehicles

    def _log_connections(self, fleet: Fleet) -> None:
        for name, vehicle in zip(self._names, fleet, strict=True):
            one = vehicle.settings
            self.get_logger().info(
                f"{name}: waiting for system {one.system_id} on {one.connection}"
            )

    def _watch_link(self, name: str, vehicle: Vehicle) -> None:
        """Log each new problem of a link once; after a heartbeat it is new again."""
        trouble = vehicle.trouble
        if trouble and trouble != self._link_troubles.get(name):
            self._link_troubles[name] = trouble
            self.get_logger().warning(f"{name}: {trouble}")
        elif not trouble and vehicle.state.connected:
            self._link_troubles.pop(name, None)

    def _turn(self) -> None:
        """Give the vehicles what orders are due."""
        now_s = time.monotonic()
        self._search_alive = self.count_publishers(self.resolve_topic_name("step_report")) > 0
        if self.fleet is not None:
            for name, vehicle in zip(self._names, self.fleet, strict=True):
                self._watch_link(name, vehicle)
            pairs = list(enumerate(zip(self._followers, self.fleet, strict=False)))
            orders = [self._isolated(i, self._next_order, *pair, now_s) for i, pair in pairs]
            # Known to a bridge that is started again before it shows in any message.
            self._keep_records()
            for (i, (follower, vehicle)), order in zip(pairs, orders, strict=True):
                if order is not None:
                    self._isolated(i, self._give, vehicle, order)
                self._isolated(i, self._publish_state, follower, vehicle, now_s)
            if not self._followers:
                for i, vehicle in enumerate(self.fleet):
                    if takes_off_yet(vehicle.state, vehicle.outcome):
                        self._isolated(i, self._give, vehicle, Hold())
                    self._isolated(i, self._publish_state, None, vehicle, now_s)
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
        if self._search.tracks is not None and not follower.has_task:
            self._plan(i, follower, state.home)
        if now_s < self._settled_s:
            return Hold() if takes_off_yet(state, outcome) else None
        lost, refused, blocked = follower.lost, follower.refused, follower.blocked
        alive = self._search_alive and not self._search.foreign
        order = follower.advance(state, outcome, now_s, vehicle.trouble, search_alive=alive)
        if follower.lost != lost:
            self.get_logger().error(f"{name} is lost: {follower.lost}")
        if follower.refused != refused:
            self._report_refusal(follower)
        if follower.blocked != blocked and follower.blocked:
            self.get_logger().info(f"{name} cannot take off yet: {follower.blocked}")
        for text in vehicle.take_texts():
            self.get_logger().info(f"{name}: STATUSTEXT {text.text}")
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

    def _give(self, drone: int, vehicle: Vehicle, order: Order) -> None:
        number = vehicle.give(order)
        self.get_logger().info(f"{self._names[drone]}: order {number}: {shown_order(order)}")

    def _plan(
        self, drone: int, follower: VehicleFollower, home: tuple[float, float, float] | None
    ) -> None:
        """Have a vehicle fly the whole search, once it has reported its home."""
        leg = self._search.final_legs[drone]
        if home is None:
            follower.follow(leg, None)
            return
        frame, settings = self._frames[drone], self.settings
        mission = search_mission(frame, *self._search.track(drone), settings, Home(*home))
        autopilot = AUTOPILOTS[settings.autopilot]
        follower.follow(leg, mission_task(mission, self._fence(frame), autopilot))
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

    # Topics

    def _publish_poses(self) -> None:
        if self.fleet is None:
            return
        stamp = self.get_clock().now().to_msg()
        for i, (vehicle, frame) in enumerate(zip(self.fleet, self._frames, strict=False)):
            self.publishers_.publish_place(i, vehicle, frame, stamp)

    def _publish_state(
        self, i: int, follower: VehicleFollower | None, vehicle: Vehicle, now_s: float
    ) -> None:
        trouble, stamp = self._search.trouble(now_s), self.get_clock().now().to_msg()
        self.publishers_.publish_state(i, follower, vehicle, trouble, stamp, now_s)

    def _publish_diagnostics(self) -> None:
        self.publishers_.publish_diagnostics(
            self._wall_clock.now().to_msg(),
            self.get_fully_qualified_name().lstrip("/"),
            self.settings.mode,
            [] if self.fleet is None else list(self.fleet),
            self._followers,
            following=self._search.info is not None,
            holding=self._holding,
            trouble=self._search.trouble(time.monotonic()),
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
    connections = settings.connections or AUTOPILOTS[settings.autopilot].connections(
        settings.vehicles
    )
    system_ids = settings.system_ids or range(1, settings.vehicles + 1)
    try:
        return Fleet(
            [
                VehicleSettings(
                    connection=connection,
                    system_id=system_id,
                    own_system_id=settings.own_system_id,
                    autopilot=settings.autopilot,
                    arm=settings.arm,
                    speed_mps=settings.speed,
                    setpoint_hz=settings.setpoint_rate,
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


def _frames(frame: GridFrame, settings: BridgeSettings, vehicles: int) -> list[GridFrame]:
    """Return the grid at the altitude of each vehicle.

    Raises:
        FieldError: If there is not room for all between the altitudes that are allowed.
    """
    if len(settings.altitudes) == vehicles:
        return [replace(frame, alt_m=alt_m) for alt_m in settings.altitudes]
    highest = replace(frame, alt_m=settings.altitudes[0]) if settings.altitudes else frame
    return layers(highest, settings, vehicles, settings.min_altitude)


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""
    return run_node("mavlink_bridge", BridgeNode, argv)


if __name__ == "__main__":
    sys.exit(main())
