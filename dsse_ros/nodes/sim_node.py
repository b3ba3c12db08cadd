# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros sim_node`: runs the search and obeys commands over topics."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import secrets
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from nav_msgs.srv import GetMap
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.duration import Duration
from rclpy.logging import LoggingSeverity
from rclpy.parameter import Parameter
from std_msgs.msg import Int8, Int32MultiArray, String
from std_srvs.srv import SetBool, Trigger

from dsse_ros.flight.track_files import (
    acceptance_radius_m,
    layers,
    search_mission,
    write_missions,
)
from dsse_ros.mission.mission import Mission
from dsse_ros.mission.mission_log import MissionLog
from dsse_ros.mission.pace import Pace
from dsse_ros.mission.scenario_files import find_scenario
from dsse_ros.nodes import simulation_interfaces
from dsse_ros.nodes.parameters import (
    check_changes,
    check_flat,
    declare,
    from_ros,
    take_overrides,
)
from dsse_ros.nodes.publishers import MissionPublishers
from dsse_ros.nodes.qos import RELIABLE, Endpoints
from dsse_ros.nodes.runtime import AlarmNode, run_node
from dsse_ros.nodes.settings import RUN_TIME_SETTINGS, SimSettings
from dsse_ros.search import FieldError, Scenario, SearchEnv, Snapshot, SnapshotError, profile
from dsse_ros.search.compiler import prepare
from dsse_ros.search.fields import specs
from dsse_ros.search.rules import Rules
from dsse_ros.search.scenario import ResolvedScenario
from msg_adapters.agents import MAX_ID
from msg_adapters.commands import (
    parse_action,
    parse_action_name,
    parse_goal,
    parse_joint_action,
    parse_path,
)
from msg_adapters.frames import GridFrame, cell_to_map
from msg_adapters.occupancy import occupancy_grid
from msg_adapters.result import Rejected
from msg_adapters.stamps import to_nanoseconds, to_stamp
from msg_adapters.tracks import steps
from msg_adapters.vehicles import Progress, place_from_pose, progress_from_message

SCENARIO_SPECS = specs(Scenario)
RULES_SPECS = {
    name: spec
    for name, spec in specs(Rules).items()
    # The scenario's own value counts where both have the field.
    if name not in SCENARIO_SPECS and name != "profile"
}
SETTINGS_SPECS = specs(SimSettings)

# Settings that the alarms depend on.
_OF_PACE = {"step_mode", "step_rate", "real_time_factor", "odom_rate", "command_timeout"}

HISTORY_PERIOD_S = 0.5
DIAGNOSTICS_PERIOD_S = 1.0
EXIT_S = 1.5
"""Wall time from the end of the mission to that of the node: tracks and diagnostics go out once."""
ACKNOWLEDGED_S = 5.0
"""Wall time that a listener has to acknowledge what it was sent."""
IDLE_S = 1.0
"""Wall time without a step after which the node says what it waits for, and repeats the time."""
_MOST_NAMES = 8
"""Drones that a line of the log names."""


class SimNode(AlarmNode):
    """The search as a ROS 2 node; see the README for its topics, services and parameters.

    Raises:
        FieldError: If a parameter or the scenario is not allowed.
    """

    # Here, as a node that could not be made is destroyed too.
    log: MissionLog | None = None

    def __init__(self) -> None:
        super().__init__("dsse_sim")
        self.settings, env, endpoints = self._read_parameters()
        scenario = env.scenario
        assert scenario.grid_size and scenario.cell_size
        self.frame = GridFrame(
            grid_size=scenario.grid_size,
            cell_size_m=scenario.cell_size,
            origin_lat_deg=scenario.origin_lat,
            origin_lon_deg=scenario.origin_lon,
            origin_alt_m=scenario.origin_alt,
            alt_m=scenario.altitude,
            map_frame=self.settings.frame_prefix + self.settings.map_frame,
            frame_prefix=self.settings.frame_prefix,
        )
        self.mission = Mission(env, self._seed())
        if self.settings.snapshot_file:
            _check_snapshot_file(self.settings.snapshot_file)
        if self.settings.resume:
            self._resume()
        self.publishers_ = MissionPublishers(
            endpoints,
            self.mission,
            self.frame,
            run_id=self._run_id(),
            publish_clock=self.settings.publish_clock,
        )
        self.paused = False
        self.stopped = False
        self.rejected: Counter[str] = Counter()
        self.duplicates = 0
        self.timeouts = 0
        self._last_joint_action: tuple[int, Any] = (0, None)
        self._refused_after: int | None = None
        self._waits = False
        self._wall_clock = Clock()
        self._crowd_seen: Counter[str] = Counter()
        self._pace = Pace()
        self._pace.set_period(time.monotonic(), self._period_s())
        self._places: dict[int, tuple[float, float]] = {}
        self._progress: dict[int, Progress] = {}
        self._lost: dict[int, str] = {}
        self._first_stamp = self._report_stamp = Time()
        self._subscribe(endpoints)
        endpoints.check_all_used()
        self.log = self._open_log()
        self._serve()
        self._step_alarm = self.alarms.make(self._on_step_alarm)
        self._timeout_alarm = self.alarms.make(self._on_timeout)
        self._odom_alarm = self.alarms.make(self._publish_odometry)
        self._exit_alarm = self.alarms.make(self._exit)
        self._idle_alarm = self.alarms.make(self._on_idle)
        self.alarms.make(self._publish_history).repeat(HISTORY_PERIOD_S)
        self.alarms.make(self._publish_diagnostics).repeat(DIAGNOSTICS_PERIOD_S)
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(self._on_changed)
        self._publish_start()
        if self.mission.over:
            # It was resumed from a snapshot of its end.
            self._end()

    # Parameters

    def _read_parameters(self) -> tuple[SimSettings, SearchEnv, Endpoints]:
        known = {**SETTINGS_SPECS, **SCENARIO_SPECS, **RULES_SPECS}
        given, qos = take_overrides(self, known)
        given = {name: from_ros(known[name], value) for name, value in given.items()}

        def of(part: dict[str, Any]) -> dict[str, Any]:
            return {name: value for name, value in given.items() if name in part}

        settings = SimSettings(**of(SETTINGS_SPECS))
        rules = profile(settings.rules, **of(RULES_SPECS))
        path = find_scenario(settings.scenario) if settings.scenario else None
        scenario = Scenario.of(path).override(**of(SCENARIO_SPECS))
        prepare(self.get_logger().info)
        env = SearchEnv(scenario, rules)
        declare(self, SETTINGS_SPECS, vars(settings), RUN_TIME_SETTINGS)
        declare(self, SCENARIO_SPECS, _in_force(env.scenario))
        declare(self, RULES_SPECS, vars(rules))
        return settings, env, Endpoints(self, qos)

    def _check_change(self, parameters: list[Parameter]) -> SetParametersResult:
        return check_changes(SETTINGS_SPECS, parameters)[0]

    def _on_changed(self, parameters: list[Parameter]) -> None:
        _, changes = check_changes(SETTINGS_SPECS, parameters)
        was_in_flight = self._in_flight
        self.settings = dataclasses.replace(self.settings, **changes)
        if changes.keys() & _OF_PACE:
            self._pace.set_period(time.monotonic(), self._period_s())
            self._arm()
        if was_in_flight and not self._in_flight:
            self._publish_odometry()
        if "grid_scaling" in changes:
            self.publishers_.publish_grid(self.stamp(), self.settings.grid_scaling)
        if changes.keys() & {"auto_reset", "exit_at_end"}:
            self._follow_on()

    # Wiring

    def _subscribe(self, endpoints: Endpoints) -> None:
        def subscribe(kind: Any, topic: str, callback: Callable[[Any], None]) -> None:
            endpoints.subscription(kind, topic, callback, RELIABLE)

        subscribe(Int32MultiArray, "joint_action", self._on_joint_action)
        for i, name in enumerate(self.mission.env.possible_agents):
            subscribe(Int8, f"{name}/cmd_action", partial(self._on_action, i))
            subscribe(String, f"{name}/cmd_action_name", partial(self._on_action_name, i))
            subscribe(PoseStamped, f"{name}/command_pose", partial(self._on_goal, i))
            subscribe(Path, f"{name}/command_path", partial(self._on_path, i))
            if self.settings.wait_for_vehicles:
                subscribe(PoseStamped, f"{name}/vehicle_pose", partial(self._on_vehicle, i))
                subscribe(DiagnosticArray, f"{name}/vehicle_state", partial(self._on_state, i))

    def _serve(self) -> None:
        for name, kind, callback in (
            ("reset", Trigger, self._on_reset),
            ("step", Trigger, self._on_step),
            ("export_mission", Trigger, self._on_export),
            ("pause", SetBool, self._on_pause),
            ("get_map", GetMap, self._on_get_map),
        ):
            self.create_service(kind, f"~/{name}", callback)
        simulation_interfaces.serve(self)

    # Mission

    def stamp(self) -> Time:
        """Return the time of the last step, for every message about it."""
        if self.settings.publish_clock:
            return to_stamp(self.mission.result.stamp_ns)
        return self.get_clock().now().to_msg()

    def _seed(self) -> int:
        """Return the seed that the parameter asks for."""
        seed = self.settings.seed
        return seed if seed >= 0 else int(np.random.SeedSequence().generate_state(1)[0])

    def _run_id(self) -> int:
        """Return the run_id that the parameter asks for."""
        # From outside the mission's random numbers: the same seed stays the same mission.
        run_id = self.settings.run_id
        return run_id if run_id > 0 else 1 + secrets.randbelow(MAX_ID)

    def restart(self) -> None:
        """Start a new mission and mission time anew, as if the node was started again."""
        self.publishers_.run_id = self._run_id()
        self.mission.reset(self._seed())
        self._restart_time()
        self._publish_start()

    def restart_time(self) -> None:
        """Start mission time anew, with the step that the mission is in."""
        self._restart_time()
        self._publish()
        self._first_stamp = self._report_stamp

    def _restart_time(self) -> None:
        self.mission.restart_time()
        # Stamps come again: what vehicles have said of them was about others.
        self._progress = dict.fromkeys(self._progress, Progress())

    def stop(self) -> None:
        """Restart, and hold the mission there."""
        self.restart()
        self.set_paused(True)
        self.stopped = True

    def reset(self, seed: int | None = None) -> None:
        """Start a new mission with this seed, by default the parameter's."""
        self.mission.reset(self._seed() if seed is None else seed)
        self._publish_start()

    def _publish_start(self) -> None:
        mission = self.mission
        self.get_logger().info(
            f"mission {mission.number}: {_counted(len(mission.tracks), 'drone')} on "
            f"{self.frame.grid_size} x {self.frame.grid_size} cells, "
            f"rules {mission.env.rules.profile}, seed {mission.seed}"
        )
        self._places.clear()
        self._lost.clear()
        self._exit_alarm.cancel()
        self.publishers_.publish_agents()
        self._publish()
        self._first_stamp = self._report_stamp

    def step(self) -> None:
        """Do one step now; drones without a command follow `missing_action`."""
        self.stopped = False
        result = self.mission.advance(self.settings.missing_action)
        self._debug(lambda: f"step {result.step}: {self._shown_actions(result.actions)}")
        self._publish()
        self._save_snapshot()
        if self.mission.over:
            self._end()

    def _end(self) -> None:
        mission = self.mission
        self.get_logger().info(
            f"mission {mission.number} over after {_counted(mission.steps, 'step')}: "
            f"{mission.outcome}"
        )
        self.publishers_.publish_mission_report(self._report_stamp)
        self._follow_on()

    def _follow_on(self) -> None:
        """With `auto_reset`, start the next mission if this one is over in its own way."""
        mission = self.mission
        given_up = mission.aborted or mission.all_lost
        if self.settings.auto_reset and mission.over and not given_up:
            self.reset(mission.seed + 1)
        elif self.settings.exit_at_end and mission.over:
            self._exit_alarm.set(EXIT_S)

    def _exit(self) -> None:
        """End the node when every listener has all that was published."""
        deadline_s = time.monotonic() + ACKNOWLEDGED_S
        for publisher in self.publishers:
            left_s = max(deadline_s - time.monotonic(), 0.0)
            publisher.wait_for_all_acked(Duration(seconds=left_s))
        self.get_logger().info("exit_at_end: the node ends with its mission")
        self.finished = True

    def try_step(self) -> str:
        """Do one step if nothing speaks against it; returns what does, or nothing."""
        refused = self.mission.refuse()
        if refused is not None:
            return refused.reason
        if self.settings.missing_action == "abort" and (missing := self.mission.missing):
            return f"no command from {self._names(missing)}"
        self.step()
        return ""

    def _publish(self) -> None:
        result, stamp, settings = self.mission.result, self.stamp(), self.settings
        self._report_stamp = stamp
        self._record()
        self._waits = False
        self.publishers_.publish_clock(result.stamp_ns)
        self._pace.begin(time.monotonic(), on_schedule=self._in_flight)
        self.publishers_.publish_step(result, stamp, settings.grid_scaling)
        self.publishers_.publish_odometry(stamp, 0.0 if self._in_flight else 1.0)
        self._arm()

    def _open_log(self) -> MissionLog | None:
        path, mission = self.settings.record_file, self.mission
        # The step that a mission resumes from is published, and recorded, once more.
        resume_at = (mission.number, mission.result.step) if self.settings.resume else None
        return MissionLog(path, self.frame, resume_at=resume_at) if path else None

    def _record(self) -> None:
        if self.log is None:
            return
        try:
            self.log.write(self.mission, self.mission.result)
        except OSError as error:
            self.get_logger().error(
                f"record_file: {self.settings.record_file!r}: {error.strerror}; "
                "the rest of the mission is not recorded"
            )
            self.log = None

    def _resume(self) -> None:
        try:
            self.mission.restore(Snapshot.load(self.settings.snapshot_file))
        except SnapshotError as error:
            raise FieldError(f"snapshot_file: {error}") from None

    def _save_snapshot(self) -> None:
        settings = self.settings
        if settings.snapshot_file and self.mission.result.step % settings.snapshot_every == 0:
            if self.log is not None:
                self.log.sync()
            try:
                self.mission.snapshot().save(settings.snapshot_file)
            except OSError as error:
                self.get_logger().error(
                    f"snapshot_file: {settings.snapshot_file!r}: {error.strerror}",
                    throttle_duration_sec=1.0,
                )

    # Barrier

    @property
    def _in_flight(self) -> bool:
        """Whether drones are on their way between two cells."""
        return self.settings.step_mode == "realtime" and not self.mission.over

    def _period_s(self) -> float:
        """Return the wall time between steps: exact in real time, the least in lockstep."""
        settings = self.settings
        if settings.step_mode == "manual":
            return 0.0
        if settings.step_rate > 0:
            return 1.0 / settings.step_rate
        if settings.step_mode == "realtime":
            return self.mission.env.scenario.step_duration_s / settings.real_time_factor
        return 0.0

    def _arm(self) -> None:
        """Set the alarms for the next step."""
        settings = self.settings
        mode = settings.step_mode if not self.paused and not self.mission.over else "manual"
        self._step_alarm.cancel()
        self._timeout_alarm.cancel()
        self._idle_alarm.repeat(IDLE_S)
        if mode == "realtime":
            self._idle_alarm.cancel()
            self._step_alarm.set(self._pace.left_s(time.monotonic()))
            # It goes on from step to step, or it would never ring at a high step_rate.
            self._odom_alarm.repeat(1.0 / settings.odom_rate)
            return
        self._odom_alarm.cancel()
        if mode == "lockstep":
            if settings.command_timeout > 0:
                self._timeout_alarm.set(settings.command_timeout)
            if self._ready():
                self._step_alarm.set(self._pace.left_s(time.monotonic()))

    def _ready(self) -> bool:
        """Return whether every live drone has commanded and every vehicle has arrived."""
        mission = self.mission
        return (
            self.settings.step_mode == "lockstep"
            and not self.paused
            and not mission.over
            and not mission.missing
            and not self._late()
        )

    def _has_arrived(self, drone: int) -> bool:
        """Return whether a vehicle is in its drone's cell and, if it tells, done there."""
        progress = self._progress.get(drone)
        if progress and progress.arrived_stamp_ns != to_nanoseconds(self._report_stamp):
            return False
        col, row = self.mission.result.cells[drone].tolist()
        away_m = math.dist(
            self._places.get(drone, (math.inf, math.inf)), cell_to_map(self.frame, col, row)
        )
        return away_m <= acceptance_radius_m(self.frame, self.settings)

    def _step_when_ready(self) -> None:
        if not self._ready():
            return
        left_s = self._pace.left_s(time.monotonic())
        if left_s > 0:
            self._step_alarm.set(left_s)
        else:
            self.step()

    def _on_step_alarm(self) -> None:
        if self.settings.step_mode == "realtime":
            self._step_without_waiting()
        else:
            self._step_when_ready()

    def _on_idle(self) -> None:
        """Do what helps who has come while nothing happens."""
        self.publishers_.repeat_time()
        if not self._waits and self.settings.step_mode == "lockstep" and self._awaited():
            self.get_logger().info(f"step {self.mission.result.step}: {self._awaited()}")
        self._waits = True

    def _awaited(self) -> str:
        """Return what the next step waits for, "" for nothing."""
        if self.paused or self.mission.over or self.settings.step_mode == "realtime":
            return ""
        if self.settings.step_mode == "manual":
            return "waiting for a call of ~/step"
        awaited = (("commands", self.mission.missing), ("vehicles", self._late()))
        shown = [f"{what} of {self._some_names(drones)}" for what, drones in awaited if drones]
        return f"waiting for {' and '.join(shown)}" if shown else ""

    def _late(self) -> list[int]:
        """Return the drones whose vehicles have to arrive before the next step."""
        if not self.settings.wait_for_vehicles or self.mission.over:
            return []
        return [drone for drone in self.mission.live if not self._has_arrived(drone)]

    def _on_timeout(self) -> None:
        if self._ready():
            # It is step_rate that the step waits for.
            return
        left_s = self._pace.left_s(time.monotonic())
        if left_s > 0:
            self._timeout_alarm.set(left_s)
            return
        self.timeouts += 1
        missing = self.mission.missing
        waited_for = f"no command from {self._names(missing)}" if missing else "vehicles are late"
        self.warn(
            "timeout",
            f"{waited_for} within {self.settings.command_timeout:g} s; "
            f"missing_action {self.settings.missing_action}",
        )
        self._step_without_waiting()

    def _step_without_waiting(self) -> None:
        missing = self.mission.missing
        if missing and self.settings.missing_action == "abort":
            self.get_logger().error(f"mission aborted: no command from {self._names(missing)}")
            self.mission.abort()
            self._arm()
            self._end()
        else:
            self.step()

    def _names(self, drones: list[int]) -> str:
        return ", ".join(self.mission.env.possible_agents[i] for i in drones)

    def _some_names(self, drones: list[int]) -> str:
        more = len(drones) - _MOST_NAMES
        return self._names(drones[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")

    def _shown_actions(self, actions: NDArray[np.int8]) -> str:
        legend = self.mission.env.rules.actions
        return ", ".join(legend[action] if action >= 0 else "none" for action in actions.tolist())

    def _debug(self, text: Callable[[], str]) -> None:
        """Log what is worth making only if somebody wants to read it."""
        if self.get_logger().is_enabled_for(LoggingSeverity.DEBUG):
            self.get_logger().debug(text())

    # Commands

    def _take(self, topic: str, drone: int | None, parsed: Any) -> Any:
        """Return the value of a command that can be taken; count and log any other."""
        if not isinstance(parsed, Rejected):
            refused = self.mission.refuse(drone)
            if refused is None:
                self._debug(lambda: f"{topic}: {parsed.value}")
                return parsed.value
            parsed = refused
        self.rejected[parsed.code] += 1
        if parsed.code != "mission_over" or self._refused_after != self.mission.number:
            self.warn(parsed.code, f"{topic}: {parsed.reason}")
        if parsed.code == "mission_over":
            # It stays over: who goes on is told once.
            self._refused_after = self.mission.number
        return None

    def _on_action(self, drone: int, message: Int8) -> None:
        parsed = parse_action(message, self.mission.env.rules.actions)
        self._command(drone, "cmd_action", parsed)

    def _on_action_name(self, drone: int, message: String) -> None:
        parsed = parse_action_name(message, self.mission.env.rules.actions)
        self._command(drone, "cmd_action_name", parsed)

    def _command(self, drone: int, topic: str, parsed: Any) -> None:
        action = self._take(f"drone{drone}/{topic}", drone, parsed)
        if action is not None:
            self.mission.commands.set_action(drone, action)
            self._step_when_ready()

    def _on_goal(self, drone: int, message: PoseStamped) -> None:
        goal = self._take(f"drone{drone}/command_pose", drone, parse_goal(message, self.frame))
        if goal is not None:
            self.mission.commands.set_goals(drone, [goal])
            self._step_when_ready()

    def _on_path(self, drone: int, message: Path) -> None:
        goals = self._take(f"drone{drone}/command_path", drone, parse_path(message, self.frame))
        if goals is not None:
            self.mission.commands.set_goals(drone, goals)
            self._step_when_ready()

    def _on_joint_action(self, message: Int32MultiArray) -> None:
        mission = self.mission
        live = mission.env.world.drones["alive"][0].tolist()
        parsed = parse_joint_action(
            message,
            mission.number,
            mission.result.step,
            len(live),
            mission.env.rules.actions,
            live,
        )
        last_mission, last = self._last_joint_action
        if message.data == last and (isinstance(parsed, Rejected) or mission.refuse()):
            # A resend that has crossed the step it was for.
            self.duplicates += 1
            return
        actions = self._take("joint_action", None, parsed)
        if actions is not None:
            self.duplicates += message.data == last and mission.number == last_mission
            self._last_joint_action = (mission.number, message.data)
            mission.command_all(actions)
            self._step_when_ready()

    # Vehicles

    def _of_vehicle(self, topic: str, parsed: Any) -> Any:
        """Return what a vehicle says; count and log what it says wrongly."""
        if not isinstance(parsed, Rejected):
            return parsed.value
        self.rejected[parsed.code] += 1
        self.warn(parsed.code, f"{topic}: {parsed.reason}")
        return None

    def _on_vehicle(self, drone: int, message: PoseStamped) -> None:
        parsed = place_from_pose(message, self.frame)
        place = self._of_vehicle(f"drone{drone}/vehicle_pose", parsed)
        self._places.pop(drone, None)
        if place is not None:
            self._places[drone] = place
            self._step_when_ready()

    def _on_state(self, drone: int, message: DiagnosticArray) -> None:
        parsed = progress_from_message(message, f"drone{drone}")
        progress = self._of_vehicle(f"drone{drone}/vehicle_state", parsed)
        if progress is None:
            return
        self._progress[drone] = progress
        # What it has said of an earlier mission does not count.
        first_ns, last_ns = map(to_nanoseconds, (self._first_stamp, self._report_stamp))
        if progress.lost and first_ns <= progress.report_stamp_ns <= last_ns:
            self._lose(drone, progress.lost)
        self._step_when_ready()

    def _lose(self, drone: int, reason: str) -> None:
        """Go on without a drone, whose vehicle has dropped out."""
        if not self.mission.lose(drone):
            return
        self._lost[drone] = reason
        self.get_logger().warning(f"drone{drone} is lost: {' '.join(reason.split())[:200]}")
        if self.mission.over:
            self._record()
        self.publishers_.publish_report(self.mission.result, self._report_stamp)
        if self.mission.over:
            self._arm()
            self._end()

    # Services

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.reset()
        response.success = True
        response.message = f"mission {self.mission.number}, seed {self.mission.seed}"
        return response

    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        refusal = self.try_step()
        response.success = not refusal
        response.message = refusal or f"step {self.mission.result.step}"
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.set_paused(bool(request.data))
        response.success, response.message = True, "paused" if self.paused else "running"
        return response

    def set_paused(self, paused: bool) -> None:
        """Hold the mission, or let it go on from where it was."""
        self.paused, self.stopped = paused, False
        self._pace.hold(time.monotonic(), paused)
        self._arm()

    def _on_get_map(self, _: GetMap.Request, response: GetMap.Response) -> GetMap.Response:
        probability, scaling = self.mission.env.probability, self.settings.grid_scaling
        response.map = occupancy_grid(self.frame, probability, self.stamp(), scaling)
        return response

    def _on_export(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        settings, mission = self.settings, self.mission
        directory = FilePath(settings.export_directory)
        tracks = {
            name: self._track(i, settings.export_tracks)
            for i, name in enumerate(mission.env.possible_agents)
        }
        try:
            frames = layers(self.frame, settings, len(tracks))
        except FieldError as error:
            response.success, response.message = False, str(error)
            return response
        missions = {
            name: search_mission(frame, cells, searched, settings)
            for frame, (name, (cells, searched)) in zip(frames, tracks.items(), strict=True)
        }
        try:
            write_missions(directory, missions, settings.dialect)
        except OSError as error:
            response.success = False
            response.message = f"export_directory: {str(directory)!r}: {error.strerror}"
            return response
        response.success = True
        response.message = f"{len(missions)} tracks in {directory.resolve()}"
        return response

    def _track(self, drone: int, which: str) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return cells (K, 2) and flags of those searched, flown or planned."""
        mission = self.mission
        if which == "flown":
            return steps(mission.tracks[drone], mission.searches[drone])
        col, row = mission.result.cells[drone].tolist()
        cells = np.array(mission.commands.route(drone, (col, row)))
        return cells, np.zeros(len(cells), bool)

    # Now and then

    def _publish_odometry(self) -> None:
        share = self._pace.share(time.monotonic())
        stamp = self.stamp()
        if self.settings.publish_clock:
            step_ns = self.mission.env.scenario.step_duration_s * 1e9
            stamp_ns = self.mission.result.stamp_ns + int(share * step_ns)
            stamp = to_stamp(stamp_ns)
            self.publishers_.publish_clock(stamp_ns)
        self.publishers_.publish_odometry(stamp, share if self._in_flight else 1.0)

    def _publish_history(self) -> None:
        self.publishers_.publish_history(
            self.mission.result, self.stamp(), self.settings.reveal_person
        )

    def _publish_diagnostics(self) -> None:
        mission = self.mission
        level, message = DiagnosticStatus.OK, "running"
        if mission.aborted:
            level, message = DiagnosticStatus.ERROR, "mission aborted"
        elif mission.over:
            message = "mission over"
        elif self.paused:
            message = "stopped" if self.stopped else "paused"
        crowd = self._crowd()
        causes = self._causes(crowd)
        awaited = self._awaited() if self._waits else ""
        if causes and level == DiagnosticStatus.OK:
            level = DiagnosticStatus.WARN
        message = "; ".join([message, *([awaited] if awaited else []), *causes])
        missing = [] if mission.over else mission.missing
        values: dict[str, object] = {
            "step": mission.result.step,
            "mission": mission.number,
            "run_id": self.publishers_.run_id,
            "seed": mission.seed,
            "step_mode": self.settings.step_mode,
            "drones_in_flight": len(mission.live),
            "missing_drones": self._names(missing),
            "lost_drones": self._names(mission.lost),
            "timeouts": self.timeouts,
            "search_effort": f"{mission.search_effort:.6f}",
            **{f"publishers.{topic}": count for topic, count in crowd.items()},
            "duplicates": self.duplicates,
            "rejected": sum(self.rejected.values()),
        }
        if self.settings.wait_for_vehicles:
            values["awaited_vehicles"] = self._names(self._late())
        values |= {f"lost.drone{i}": reason for i, reason in sorted(self._lost.items())}
        values |= {f"rejected.{code}": n for code, n in sorted(self.rejected.items())}
        name = self.get_fully_qualified_name().lstrip("/")
        # What watches over nodes compares it with the wall clock.
        stamp = self._wall_clock.now().to_msg()
        self.publishers_.publish_diagnostics(stamp, name, level, message, values)

    def _causes(self, crowd: dict[str, int]) -> list[str]:
        """Return what a person should look at."""
        causes = [f"{count} nodes publish {topic}" for topic, count in crowd.items() if count > 1]
        if self._lost:
            causes.append(f"{self._names(sorted(self._lost))} lost")
        if self.rejected:
            causes.append(f"{_counted(sum(self.rejected.values()), 'message')} refused")
        return causes

    def _crowd(self) -> dict[str, int]:
        """Return how many nodes publish what one should; warn when there are more."""
        says = {
            "step_report": "listeners hear all missions mixed; give each its own namespace",
            "joint_action": "the last command of a drone before a step wins",
        }
        if self.settings.publish_clock:
            says["/clock"] = "time jumps to and fro; only one may have publish_clock"
        if self.settings.wait_for_vehicles:
            says["drone0/vehicle_state"] = "two bridges would fly the same vehicles; stop one"
        crowd = Counter({t: self.count_publishers(self.resolve_topic_name(t)) for t in says})
        for topic, count in crowd.items():
            if count > max(self._crowd_seen[topic], 1):
                self.get_logger().warning(f"{count} nodes publish {topic}: {says[topic]}")
        self._crowd_seen = crowd
        return crowd

    def destroy_node(self) -> None:
        """Close the log and the node."""
        if self.log is not None:
            self.log.close()
        super().destroy_node()


def _in_force(scenario: ResolvedScenario) -> dict[str, Any]:
    """Return the values of all fields, also of those that state another's in another way."""
    values = dict(vars(scenario))
    for name, value in scenario.other_ways.items():
        # Where drones are faster than any current, there is no such current.
        with contextlib.suppress(FieldError):
            values[name] = SCENARIO_SPECS[name].check(name, value)
    return values


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _check_snapshot_file(path: str) -> None:
    """Raise if no snapshot can be written there.

    Raises:
        FieldError: If its folder cannot be written to, or it is there and no regular file.
    """
    target = FilePath(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise FieldError(f"snapshot_file: {path!r} is not allowed; a regular file or a new one")
    try:
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise FieldError(f"snapshot_file: {path!r}: {error.strerror}") from None


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""

    def make() -> SimNode:
        check_flat(sys.argv[1:] if argv is None else argv)
        return SimNode()

    return run_node("sim_node", make, argv)


if __name__ == "__main__":
    sys.exit(main())
