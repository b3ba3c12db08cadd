# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros sim_node`: runs the search and takes commands from topics."""

from __future__ import annotations

import dataclasses
import math
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from sensor_msgs.msg import TimeReference

from dsse_ros.base.result import Rejected
from dsse_ros.mission.files.mission_files import MissionFiles
from dsse_ros.mission.run import status
from dsse_ros.mission.run.command_intake import WIND, CommandIntake
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.simulation_state import NEXT, Request, SimulationState, reason_to_refuse
from dsse_ros.mission.run.step_scheduler import Due, StepScheduler
from dsse_ros.mission.vehicles.vehicle_steps import VehicleSteps
from dsse_ros.ros.nodes import live_inputs, sim_services, simulation_interfaces
from dsse_ros.ros.nodes.navigate_to_pose import NavigateToPose
from dsse_ros.ros.nodes.node_diagnostics import PERIOD_S, NodeDiagnostics
from dsse_ros.ros.nodes.publisher_counts import PublisherCounts, consequences
from dsse_ros.ros.nodes.publishers import MissionPublishers
from dsse_ros.ros.nodes.settings import SIM_PARAMETERS, without_effect
from dsse_ros.ros.nodes.sim_parameters import (
    OF_TIMING,
    draw_run_id,
    draw_seed,
    grid_frame,
    read_parameters,
    timing,
)
from dsse_ros.ros.nodes.waiting_log import WaitingLog
from dsse_ros.ros.runtime.parameters import check_changes, check_flat
from dsse_ros.ros.runtime.qos import Endpoints
from dsse_ros.ros.runtime.run_node import AlarmNode, run_node
from dsse_ros.vehicles.fleet.vehicle_time import IGNORED
from msg_adapters.diagnostics import diagnostic_status
from msg_adapters.poses import pose_from_message
from msg_adapters.stamps import to_nanoseconds, to_stamp
from msg_adapters.vehicles import progress_from_message

HISTORY_PERIOD_S = 0.5
EXIT_S = 1.5
"""Wall time from the end of the mission to that of the node: tracks and diagnostics go out once."""
ACKNOWLEDGED_S = 5.0
"""Wall time in which a subscriber must acknowledge the messages."""
IDLE_S = 1.0
"""Wall time without a step after which the node logs what it waits for, and repeats the time."""


class SimNode(AlarmNode):
    """The search as a ROS 2 node; see docs/topics.md for its topics and services.

    Raises:
        FieldError: If a parameter or the scenario is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("sim_node")
        self.settings, env, endpoints = read_parameters(self)
        settings = self.settings
        self.frame = grid_frame(env.scenario, settings)
        live = not env.scenario.has_persons
        has_belief = settings.has_belief(env.world.grid_size, live=live)
        self.mission = Mission(env, draw_seed(self.settings), belief=has_belief)
        self.mission.prepare_belief()
        self.files = MissionFiles(
            self.mission, record_file=settings.record_file, snapshot_file=settings.snapshot_file,
            snapshot_every=settings.snapshot_every, resume=settings.resume,
            journal=settings.journal, note=self.get_logger().warning,
        )  # fmt: skip
        self.publishers_ = MissionPublishers(
            endpoints, self.mission, self.frame,
            run_id=draw_run_id(self.settings), publish_clock=settings.publish_clock,
            publish_belief=settings.publish_belief, has_vehicles=settings.vehicle_time != IGNORED,
        )  # fmt: skip
        self._diagnostics = NodeDiagnostics(self, endpoints)
        self.state = SimulationState.PLAYING
        self.timeouts = 0
        self._idle = False
        self._waiting_log = WaitingLog(self, self.mission)
        self._scheduler = StepScheduler(
            timing(settings, env.scenario.step_duration_s), time.monotonic()
        )
        self._commands = CommandIntake(self.mission, self.frame, self.warn, self.debug)
        self._fleet = VehicleSteps(self.mission, self.frame, self._scheduler, settings)
        self._publisher_counts = PublisherCounts(self, consequences(settings, self._commands.joint))
        self._report_stamp = Time()
        self._subscribe(endpoints)
        live_inputs.serve(self, endpoints, self._commands.rejected)
        endpoints.check_all_used()
        self.at_end(self.files.close)
        self.files.open(self.frame)
        self._navigation = NavigateToPose(self, self._commands, self._fleet.late, self._on_accepted)
        self.at_end(self._navigation.destroy)
        sim_services.serve(self)
        simulation_interfaces.serve(self)
        self._step_alarm = self.alarms.make(self._advance)
        self._odom_alarm = self.alarms.make(self._publish_odometry)
        self._exit_alarm = self.alarms.make(self._exit)
        self._idle_alarm = self.alarms.make(self._on_idle)
        self.alarms.make(self._publish_history).repeat(HISTORY_PERIOD_S)
        self.alarms.make(self._publish_diagnostics).repeat(PERIOD_S)
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(self._on_changed)
        self.publishers_.publish_origin(self.stamp())
        self._publish_start()
        if self.mission.done:
            # The snapshot was taken at the end of the mission.
            self._end()

    # Parameters

    def _check_change(self, parameters: list[Parameter]) -> SetParametersResult:
        return check_changes(SIM_PARAMETERS, parameters)[0]

    def _on_changed(self, parameters: list[Parameter]) -> None:
        _, changes = check_changes(SIM_PARAMETERS, parameters)
        was_moving = self._scheduler.moving
        self.settings = dataclasses.replace(self.settings, **changes)
        if changes.keys() & OF_TIMING:
            for line in without_effect(self.settings):
                self.get_logger().warning(line)
            step_duration_s = self.mission.env.scenario.step_duration_s
            self._scheduler.set_timing(timing(self.settings, step_duration_s), time.monotonic())
            self._arm()
            self.publishers_.publish_agents(self._scheduler.timing)
        if was_moving and not self._scheduler.moving:
            self._publish_odometry()
        self._fleet.settings = self.settings
        if "grid_scaling" in changes:
            self.publishers_.publish_grid(self._report_stamp, self.settings.grid_scaling)
        if changes.keys() & {"auto_reset", "exit_at_end"}:
            self._follow_on()

    # Wiring

    def _subscribe(self, endpoints: Endpoints) -> None:
        commands = self._commands.topics()
        for i, name in enumerate(self.mission.env.possible_agents):
            if self._fleet.exist:
                endpoints.subscription(f"{name}/vehicle_pose", partial(self._on_vehicle, i))
                endpoints.subscription(f"{name}/vehicle_state", partial(self._on_state, i))
            if self._fleet.follows:
                endpoints.subscription(f"{name}/vehicle_time", partial(self._on_time, i))
        if self._fleet.follows and self.mission.env.rules.in_metres:
            endpoints.subscription(WIND, self._on_wind)
        for topic, take in commands.items():
            endpoints.subscription(topic, partial(self._on_command, take))
        self._waiting_log.topics = list(commands)

    # Mission

    def stamp(self) -> Time:
        """Return the time of the last step, for every message about it."""
        if self.settings.publish_clock:
            return to_stamp(self.mission.result.stamp_ns)
        return self.get_clock().now().to_msg()

    def restart(self) -> None:
        """Start a new mission and restart mission time, as if the node had restarted."""
        self.publishers_.run_id = draw_run_id(self.settings)
        self.mission.reset(draw_seed(self.settings))
        self.mission.restart_time()
        self._publish_start()

    def restart_time(self) -> None:
        """Restart mission time at the current step."""
        self.mission.restart_time()
        self._publish()

    def reset(self, seed: int | None = None) -> None:
        """Start a new mission with this seed, by default the parameter's."""
        self.mission.reset(draw_seed(self.settings) if seed is None else seed)
        self._publish_start()

    def _publish_start(self) -> None:
        self.get_logger().info(status.begun(self.mission, self.frame.grid_size))
        self._fleet.restart()
        self._exit_alarm.cancel()
        self.publishers_.publish_agents(self._scheduler.timing)
        self.publishers_.publish_tasks(self.stamp(), self._fleet.tasks)
        self._publish()

    def step(self) -> None:
        """Do one step now; drones without a command follow `missing_action`."""
        if self._fleet.exist and not self.mission.begun:
            self._begin_step()
        self._fleet.end()
        result = self.mission.advance(self.settings.missing_action)
        self.debug(lambda: f"step {result.step}: {status.actions(self.mission, result.actions)}")
        self._publish()
        self._save_snapshot()
        if self.mission.done:
            self._end()

    def _begin_step(self) -> None:
        """Take the commands of the next step, and have the vehicles begin with it."""
        self._fleet.begin(self.settings.missing_action)
        self.publishers_.publish_tasks(self._report_stamp, self._fleet.tasks)

    def _end(self) -> None:
        self.get_logger().info(status.ended(self.mission))
        self.publishers_.publish_mission_report(self._report_stamp)
        self._follow_on()

    def _follow_on(self) -> None:
        """With `auto_reset`, start the next mission if this one ended by itself."""
        mission = self.mission
        failed = mission.aborted or mission.all_lost
        if self.settings.auto_reset and mission.done and not failed:
            self.reset(mission.seed + 1)
        elif self.settings.exit_at_end and mission.done:
            self._exit_alarm.set(EXIT_S)

    def _exit(self) -> None:
        """End the node once every subscriber has received everything."""
        deadline_s = time.monotonic() + ACKNOWLEDGED_S
        for publisher in self.publishers:
            left_s = max(deadline_s - time.monotonic(), 0.0)
            publisher.wait_for_all_acked(Duration(seconds=left_s))
        self.get_logger().info("exit_at_end: the node ends with its mission")
        self.finished = True

    def try_step(self, request: Request = Request.STEP) -> str:
        """Do one step if it is allowed; return why it is not, "" if it was done."""
        if reason := reason_to_refuse(request, self.state):
            return reason
        refused = self.mission.refuse()
        if refused is not None:
            return refused.reason
        if self.settings.missing_action == "abort" and (missing := self.mission.missing):
            return f"no command from {status.names(self.mission, missing)}"
        self.step()
        return ""

    def _publish(self) -> None:
        """Publish the last step."""
        result, stamp, settings = self.mission.result, self.stamp(), self.settings
        self._report_stamp = stamp
        self._record()
        self._idle = False
        self.publishers_.publish_clock(result.stamp_ns)
        self._scheduler.begin(time.monotonic(), done=self.mission.done)
        self.publishers_.publish_step(result, stamp, settings.grid_scaling)
        self.publishers_.publish_odometry(stamp, 0.0 if self._scheduler.moving else 1.0)
        self._navigation.publish_feedback()
        self._arm()

    def _record(self) -> None:
        if failed := self.files.record():
            self.get_logger().error(failed)

    def _save_snapshot(self) -> None:
        if failed := self.files.save():
            self.get_logger().error(failed, throttle_duration_sec=1.0)

    # The time of the steps

    def _arm(self) -> None:
        """Set the alarms for the next events."""
        scheduler = self._scheduler
        if scheduler.moving and not scheduler.paused:
            self._idle_alarm.cancel()
            # The alarm continues across steps, else it would never ring at a high step_rate.
            self._odom_alarm.repeat(1.0 / self.settings.odom_rate)
        else:
            self._idle_alarm.set(IDLE_S)
            self._odom_alarm.cancel()
        self._step_alarm.set(scheduler.wait_s(time.monotonic(), ready=self._ready()))

    def _ready(self) -> bool:
        """Return whether the step waits for nothing; computed only if the scheduler would wait."""
        return self._scheduler.running and not (self.mission.missing or self._fleet.awaited())

    def _advance(self) -> None:
        """Begin the step, and do it if it is due, else set the alarm for when it will be."""
        self._navigation.check()
        if self._fleet.exist and not self.mission.begun and self._ready():
            self._begin_step()
        now_s, ready = time.monotonic(), self._ready()
        match self._scheduler.due(now_s, ready=ready):
            case Due.STEP:
                self.step()
            case Due.TICK:
                self._step_without_waiting()
            case Due.TIMEOUT:
                self._warn_of_timeout()
                self._step_without_waiting()
            case Due.NOTHING:
                self._step_alarm.set(self._scheduler.wait_s(now_s, ready=ready))

    def _warn_of_timeout(self) -> None:
        self.timeouts += 1
        missing = status.names(self.mission, self.mission.missing)
        waited_for = f"no command from {missing}" if missing else "vehicles are late"
        self.warn(
            "timeout",
            f"{waited_for} within {self.settings.command_timeout:g} s; "
            f"missing_action {self.settings.missing_action}",
        )

    def _step_without_waiting(self) -> None:
        missing = self.mission.missing
        if missing and self.settings.missing_action == "abort":
            names = status.names(self.mission, missing)
            self.get_logger().error(f"mission aborted: no command from {names}")
            self.mission.abort()
            self._end_between_steps()
        else:
            self.step()

    def _end_between_steps(self) -> None:
        self._scheduler.end()
        self._navigation.check()
        self._arm()
        self._end()

    def change_state(self, request: Request) -> None:
        """Stop, play or pause the simulation; stopping restarts the mission."""
        if request is Request.STOP:
            self.restart()
        self.state = NEXT[request][self.state]
        self._scheduler.pause(self.state is not SimulationState.PLAYING, time.monotonic())
        self._arm()

    def _on_idle(self) -> None:
        """Repeat the time for late joiners, and log what the step waits for."""
        self.publishers_.repeat_time()
        if self.settings.step_mode == "lockstep":
            self._waiting_log.log(self._fleet.waiting(), first=not self._idle)
        self._idle = True
        self._fleet.watch()
        self._idle_alarm.set(IDLE_S)

    # Commands and vehicles

    def _on_command(self, take: Callable[[Any], bool], message: Any) -> None:
        if take(message):
            self._on_accepted()

    def _on_accepted(self) -> None:
        """Go on after a new command."""
        self.publishers_.publish_first_commands(self._scheduler.timing)
        self.publishers_.publish_remaining_paths(self._report_stamp)
        self._advance()

    def _on_vehicle(self, drone: int, message: PoseStamped) -> None:
        stamp_ns, pose = to_nanoseconds(message.header.stamp), pose_from_message(message)
        if rejected := self._fleet.set_pose(drone, stamp_ns, pose):
            self._commands.reject(f"drone{drone}/vehicle_pose", rejected)
        else:
            self._advance()

    def _on_state(self, drone: int, message: DiagnosticArray) -> None:
        try:
            progress = progress_from_message(message, f"drone{drone}")
        except ValueError as error:
            rejected = Rejected("bad_state", str(error))
            self._commands.reject(f"drone{drone}/vehicle_state", rejected)
            return
        if lost := self._fleet.vehicles.set_progress(drone, progress, self.publishers_.run_id):
            self._lose(drone, lost)
        self._advance()

    def _on_time(self, drone: int, message: TimeReference) -> None:
        stamp_ns, boot_ns = (
            to_nanoseconds(stamp) for stamp in (message.header.stamp, message.time_ref)
        )
        self._fleet.set_time(drone, stamp_ns, boot_ns // 10**6)
        self._advance()

    def _on_wind(self, message: Vector3Stamped) -> None:
        if not self._commands.wind(message):
            return
        east, north = message.vector.x, message.vector.y
        from_deg = math.degrees(math.atan2(-east, -north)) % 360.0
        self.get_logger().info(
            f"{WIND}: {math.hypot(east, north):.1f} m/s from {from_deg:.0f} degrees"
        )
        if not self.mission.begun:
            self._record()
            self.publishers_.publish_report(self._report_stamp)

    def _lose(self, drone: int, reason: str) -> None:
        """Continue without a drone whose vehicle has dropped out."""
        if not self.mission.lose(drone):
            return
        self._fleet.vehicles.lost[drone] = reason
        self.get_logger().warning(f"drone{drone} is lost: {' '.join(reason.split())[:200]}")
        self.publish_change()

    def publish_change(self) -> None:
        """Publish what has changed since the last step; it may have ended the mission."""
        if self.mission.done:
            self._record()
        self.publishers_.publish_report(self._report_stamp)
        if self.mission.done:
            self._end_between_steps()

    # Now and then

    def _publish_odometry(self) -> None:
        share = self._scheduler.share(time.monotonic())
        stamp = self.stamp()
        if self.settings.publish_clock:
            step_ns = self.mission.env.scenario.step_duration_s * 1e9
            stamp_ns = self.mission.result.stamp_ns + int(share * step_ns)
            stamp = to_stamp(stamp_ns)
            self.publishers_.publish_clock(stamp_ns)
        self.publishers_.publish_odometry(stamp, share if self._scheduler.moving else 1.0)

    def _publish_history(self) -> None:
        self.publishers_.publish_history(
            self.mission.result, self.stamp(), self.settings.reveal_person
        )

    def _publish_diagnostics(self) -> None:
        lost, rejected = self._fleet.vehicles.lost, self._commands.rejected
        health = status.health(
            self.mission, self._scheduler, stopped=self.state is SimulationState.STOPPED,
            awaited=self._fleet.waiting() if self._idle else "",
            publishers=self._publisher_counts.update(), lost=lost, rejected=rejected,
        )  # fmt: skip
        run = {
            "run_id": self.publishers_.run_id, "step_mode": self.settings.step_mode,
            "timeouts": self.timeouts, "duplicates": self._commands.duplicates,
        }  # fmt: skip
        values = status.values(
            self.mission, run, publishers=self._publisher_counts.last, lost=lost, rejected=rejected,
            late=self._fleet.awaited() if self._fleet.exist else None,
        )  # fmt: skip
        drones = status.of_drones(self.mission, lost, waits=self._idle, blind=self._fleet.blind)
        self._diagnostics.publish(
            health,
            values,
            (
                diagnostic_status(self._diagnostics.name_of(name), level, line, found, name)
                for name, level, line, found in drones
            ),
        )


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""

    def make() -> SimNode:
        check_flat(sys.argv[1:] if argv is None else argv)
        return SimNode()

    return run_node("sim_node", make, argv)


if __name__ == "__main__":
    sys.exit(main())
