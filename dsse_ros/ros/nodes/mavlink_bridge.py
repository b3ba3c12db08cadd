# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros mavlink_bridge`: makes vehicles follow the drones of a search."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from std_msgs.msg import String

from dsse_ros.base.fields import FieldError
from dsse_ros.ros.nodes import bridge_services
from dsse_ros.ros.nodes.bridge_publishers import BridgePublishers
from dsse_ros.ros.nodes.node_diagnostics import PERIOD_S, NodeDiagnostics
from dsse_ros.ros.runtime.qos import read_settings
from dsse_ros.ros.runtime.run_node import AlarmNode, run_node
from dsse_ros.vehicles.autopilots import AUTOPILOTS
from dsse_ros.vehicles.control.vehicle import Vehicle, VehicleFleet, VehicleSettings
from dsse_ros.vehicles.fleet.fleet_controller import FleetController
from dsse_ros.vehicles.fleet.flight_records import FlightRecords, default_directory
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.world.scenario.agents import agents_from_json
from msg_adapters.mission_report import mission_report_from_message
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message
from msg_adapters.vehicle_tasks import vehicle_tasks_from_message

TURN_S = 0.1
"""Wall time between looks at the vehicles."""
ALT_TOLERANCE_M = 1.0
"""With several vehicles, each must be this close to its layer before it moves horizontally."""
_ALWAYS = (
    "arm:=always: vehicles are armed and take off for EVERY search, with nobody asked. "
    "For simulations only"
)


class BridgeNode(AlarmNode):
    """Makes each vehicle follow its drone; see docs/flight.md for topics and services.

    Raises:
        FieldError: If a parameter is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("mavlink_bridge")
        self.settings, endpoints = read_settings(self, BridgeSettings)
        self._simulations = 0
        self.fleet = _fleet(self.settings)
        self._records = self._open_records(self.fleet)
        self.at_end(self._records.close)
        self.controller = FleetController(self.settings, self.fleet, self._records, self._log)
        self.at_end(self.hand_over)
        names = self.controller.names
        diagnostics = NodeDiagnostics(self, endpoints)
        self.publishers_ = BridgePublishers(endpoints, diagnostics, names)
        self._agents, *_ = [
            endpoints.subscription(topic, partial(self._take, take))
            for topic, take in self._takers().items()
        ]
        endpoints.check_all_used()
        bridge_services.serve(self, self.controller)
        for what, callback, period_s in (
            ("turn", self._turn, TURN_S),
            ("vehicle_pose", self._publish_poses, 1.0 / self.settings.pose_rate),
            ("/diagnostics", self._publish_diagnostics, PERIOD_S),
        ):
            self.alarms.make(self.isolated(what, callback)).repeat(period_s)
        if self.settings.arm == "always":
            self.get_logger().warning(_ALWAYS)
        self.fleet.start()
        for name, vehicle in zip(names, self.fleet, strict=True):
            waiting = f"waiting for system {vehicle.system_id} on {vehicle.connection}"
            self.get_logger().info(f"{name}: {waiting}")

    def _log(self, level: str, text: str) -> None:
        # One call per level: rclpy raises if a call in the source logs at a second level.
        logger = self.get_logger()
        match level:
            case "debug":
                logger.debug(text)
            case "info":
                logger.info(text)
            case "warning":
                logger.warning(text)
            case _:
                logger.error(text)

    def _open_records(self, vehicles: Sequence[Vehicle]) -> FlightRecords:
        """Return the records of who controlled the vehicles before.

        Raises:
            FieldError: If the records cannot be kept, or another bridge uses the vehicles.
        """
        directory = Path(self.settings.state_directory or default_directory())
        try:
            connections = [(vehicle.system_id, vehicle.connection) for vehicle in vehicles]
            records = FlightRecords(directory, connections)
        except OSError as error:
            raise FieldError(
                f"state_directory must be writable, got {str(error.filename)!r}: {error.strerror}"
            ) from None
        for path in records.unreadable:
            self.get_logger().error(
                f"{str(path)!r} cannot be read: its vehicle stays on the ground until ~/arm"
            )
        return records

    # The search

    def _takers(self) -> dict[str, Callable[[Any], None]]:
        """Return what the followed search does with a message, by its topic."""
        search = self.controller.search
        return {
            "agents": lambda message: search.take_agents(
                agents_from_json(message.data, with_definition=False)
            ),
            "step_report": lambda message: search.take_report(
                to_nanoseconds(message.header.stamp),
                step_report_from_message(message),
                time.monotonic(),
            ),
            "vehicle_tasks": lambda message: search.take_tasks(vehicle_tasks_from_message(message)),
            "mission_report": lambda message: search.take_mission_report(
                to_nanoseconds(message.header.stamp), mission_report_from_message(message)
            ),
        }

    def _take(self, take: Callable[[Any], None], message: Any) -> None:
        take(message)
        self.controller.handle_news(time.monotonic())

    def _look_for_simulations(self) -> None:
        count = self.count_publishers(self.resolve_topic_name("step_report"))
        self._simulations = count
        if self.controller.set_publishers(count) and count:
            # Every remaining simulation sends its latest agents to a new subscription.
            old = self._agents
            self._agents = self.create_subscription(String, "agents", old.callback, old.qos_profile)
            self.destroy_subscription(old)

    # The vehicles

    def _turn(self) -> None:
        """Give the vehicles the orders that are due."""
        now_s = time.monotonic()
        self._look_for_simulations()
        self.controller.turn(now_s)
        trouble, stamp = self.controller.trouble(now_s), self.get_clock().now().to_msg()
        plan, wind_mps = self.controller.plan, self.controller.take_wind(now_s)
        if plan is not None and wind_mps is not None:
            self.publishers_.publish_wind(wind_mps, plan.layers[0].frame.map_frame, stamp)
        for i, vehicle in enumerate(self.fleet):
            dispatcher = self.controller.dispatchers[i]
            self.publishers_.publish_state(i, dispatcher, vehicle, trouble, stamp, now_s)
        if self.settings.exit_at_end and self.controller.finished:
            self.finished = True

    # Topics

    def _publish_poses(self) -> None:
        plan = self.controller.plan
        for i, vehicle in enumerate(self.fleet if plan is not None else ()):
            assert plan is not None
            stamp = self.get_clock().now().to_msg()
            self.publishers_.publish_place(i, vehicle, plan.layers[i].frame, plan.datum_m, stamp)

    def _publish_diagnostics(self) -> None:
        controller = self.controller
        self.publishers_.publish_diagnostics(
            self.settings.mode,
            self.fleet,
            controller.dispatchers,
            following=controller.search.info is not None,
            alive=self._simulations > 0,
            holding=controller.holding,
            trouble=controller.trouble(time.monotonic()),
        )

    def hand_over(self) -> None:
        """Leave the vehicles to their autopilots."""
        self.controller.close()
        self.fleet.close()


def _fleet(settings: BridgeSettings) -> VehicleFleet:
    """Return the vehicles."""
    connections = settings.connections or AUTOPILOTS[settings.autopilot].connections(
        settings.vehicles
    )
    try:
        return VehicleFleet(
            [
                VehicleSettings(
                    connection=connection,
                    system_id=system_id,
                    own_system_id=settings.own_system_id,
                    autopilot=settings.autopilot,
                    speed_mps=settings.speed,
                    alt_tolerance_m=ALT_TOLERANCE_M if settings.vehicles > 1 else 3.0,
                    setpoint_hz=settings.setpoint_rate,
                    link_timeout_s=settings.link_timeout,
                    recovery_alt_m=settings.min_altitude,
                    signing_key_file=settings.signing_key_file,
                )
                for connection, system_id in zip(connections, settings.vehicle_ids, strict=True)
            ]
        )
    except (OSError, ValueError) as error:
        # A vehicle has one connection, but the parameter has those of all vehicles.
        text = re.sub("^connection ", "connections ", str(error))
        raise FieldError(text) from None


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""
    return run_node("mavlink_bridge", BridgeNode, argv)


if __name__ == "__main__":
    sys.exit(main())
