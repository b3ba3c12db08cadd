# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The publishers of `sim_node`: one function of `msg_adapters` makes each topic's message."""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import NavSatFix, PointCloud2

from dsse_ros.mission.mission import Mission, StepResult
from dsse_ros.mission.step_messages import battery_of, markers_of
from dsse_ros.mission.step_reports import step_report_of
from dsse_ros.mission.step_scheduler import Timing
from dsse_ros.runtime.qos import Endpoints
from dsse_ros.search import FieldError, SearchDefinition
from msg_adapters.agents import AgentsInfo, agents_message, area_rows
from msg_adapters.frames import GridFrame
from msg_adapters.geodesy import cell_fix
from msg_adapters.images import probability_image
from msg_adapters.message_types import message_class
from msg_adapters.mission_report import make_mission_report, mission_report_message
from msg_adapters.occupancy import occupancy_grid
from msg_adapters.particles import particles_message
from msg_adapters.pos import pos_message
from msg_adapters.poses import (
    earth_transform,
    nav_sat_fix,
    odometry,
    path,
    pose_array,
    pose_stamped,
    transforms,
    yaw_of,
)
from msg_adapters.stamps import to_stamp
from msg_adapters.step_report import step_report_message
from msg_adapters.topics import TOPICS


def tf_type() -> Any:
    """Return tf2_msgs/TFMessage, or None if tf2_msgs is not installed."""
    try:
        return message_class(TOPICS["/tf"].type_name)
    except FieldError:
        return None


class MissionPublishers:
    """The publishers of one mission.

    Args:
        endpoints: Makes the publishers.
        mission: The mission to publish.
        frame: The frame of the grid.
        run_id: Identity of the simulation since its start.
        publish_clock: Whether to publish mission time on `/clock`.
        publish_belief: Whether to publish the belief, if the mission has one.

    Attributes:
        run_id: Identity in the messages.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        mission: Mission,
        frame: GridFrame,
        *,
        run_id: int,
        publish_clock: bool,
        publish_belief: bool,
    ) -> None:
        self._mission = mission
        self.run_id = run_id
        self._frame = frame
        self._names = mission.env.possible_agents
        self._frames = [frame.of_drone(i) for i in range(len(self._names))]
        self._publisher = endpoints.publisher
        self._grid = self._publisher("probability_grid")
        self._image = self._publisher("probability")
        self._belief_grid = self._belief_image = None
        if publish_belief:
            self._belief_grid = self._publisher("belief_grid")
            self._belief_image = self._publisher("belief")
        self._particles = None
        if publish_belief and mission.env.world.ensemble is not None:
            self._particles = self._publisher("particles")
        self._drones = self._publisher("drones")
        self._report = self._publisher("step_report")
        self._mission_report = self._publisher("mission_report")
        self._pos = self._publisher("probability_of_success")
        self._agents = self._publisher("agents")
        self._markers = self._publisher("markers")
        self._clock = self._publisher("/clock") if publish_clock else None
        self._poses = self._per_drone("pose")
        self._odoms = self._per_drone("odom")
        self._fixes = self._per_drone("fix")
        self._paths = self._per_drone("path")
        faults, self._batteries = mission.env.world.faults, []
        if faults is not None and faults.has_battery:
            self._batteries = self._per_drone("battery")
        self._tf_type = tf_type()
        self._tf = self._tf_type and self._publisher("/tf")
        self._tf_static = self._tf_type and self._publisher("/tf_static")
        # The last messages of the topics that are not latched, for late joiners.
        self._of_time: dict[Publisher, Any] = {}
        self._before = self._cells = mission.result.cells
        # The state that was last published on each topic of paths and markers.
        self._seen: dict[Publisher, tuple[int, ...]] = {}
        # Reused for each step: making these messages takes as long as publishing them.
        self._pose_array = PoseArray()
        self._pose_of = [PoseStamped() for _ in self._names]
        self._odom_of = [Odometry() for _ in self._names]
        self._fix_of = [NavSatFix() for _ in self._names]
        self._path_of = [Path() for _ in self._names]
        self._report_of_step = PointCloud2()
        self._particles_of_step = PointCloud2()

    def _per_drone(self, topic: str) -> list[Publisher]:
        return [self._publisher(f"{name}/{topic}") for name in self._names]

    def publish_agents(self, timing: Timing) -> None:
        """Publish the agents, their rules and grid, and whether they have been commanded."""
        env = self._mission.env
        begun = self._mission.result.step > 0 or not self._mission.missing
        info = AgentsInfo(
            agents=tuple(self._names),
            actions=env.rules.actions,
            rules=env.rules.profile,
            seed=self._mission.seed,
            frame=self._frame,
            timestep_limit=int(env.scenario.timestep_limit or 0),
            step_duration_s=env.scenario.step_duration_s,
            mission=self._mission.number,
            run_id=self.run_id,
            definition=SearchDefinition(env.rules, env.mission_scenario),
            area=area_rows(env.scenario.area_mask),
            decision_time_s=timing.decision_time_s,
            commanded=begun or timing.mode != "lockstep",
        )
        self._agents.publish(agents_message(info))

    def publish_first_commands(self, timing: Timing) -> None:
        """Publish that the drones have been commanded: vehicles may take off from then on."""
        if self._mission.result.step == 0 and not self._mission.missing:
            self.publish_agents(timing)

    def publish_origin(self, stamp: Time) -> None:
        """Publish where the map lies on the Earth, if tf2_msgs is installed."""
        if self._tf_static is not None:
            origin = earth_transform(self._frame, stamp)
            self._tf_static.publish(self._tf_type(transforms=[origin]))

    def publish_clock(self, nanoseconds: int) -> None:
        """Publish the mission time, if `publish_clock` is set."""
        if self._clock is not None:
            self._publish_time(self._clock, Clock(clock=to_stamp(nanoseconds)))

    def _publish_time(self, publisher: Publisher, message: Any) -> None:
        self._of_time[publisher] = message
        publisher.publish(message)

    def repeat_time(self) -> None:
        """Publish the last `/clock` and `/tf` again, with the same stamp, for late joiners."""
        for publisher, message in self._of_time.items():
            publisher.publish(message)

    def publish_grid(self, stamp: Time, grid_scaling: str) -> None:
        """Publish the map and, if set, the belief as grids for display."""
        env, area = self._mission.env, self._mission.env.scenario.area_mask
        maps = [(self._grid, env.probability)]
        if self._belief_grid is not None:
            maps.append((self._belief_grid, self._mission.belief()))
        for publisher, probability in maps:
            publisher.publish(occupancy_grid(self._frame, probability, stamp, grid_scaling, area))

    def publish_step(self, result: StepResult, stamp: Time, grid_scaling: str) -> None:
        """Publish a step, all messages with the same stamp; the step report goes last."""
        frame, env = self._frame, self._mission.env
        self.publish_grid(stamp, grid_scaling)
        self._image.publish(probability_image(frame, env.probability, stamp))
        if self._belief_image is not None:
            self._belief_image.publish(probability_image(frame, self._mission.belief(), stamp))
        particles = None if self._particles is None else self._mission.particles()
        if self._particles is not None and particles is not None:
            self._particles.publish(
                particles_message(frame, *particles, stamp, self._particles_of_step)
            )
        cells = result.cells.tolist()
        for publisher, of_drone, cell, message in zip(
            self._poses, self._frames, cells, self._pose_of, strict=True
        ):
            publisher.publish(pose_stamped(of_drone, cell, stamp, message))
        self._drones.publish(pose_array(frame, result.cells, stamp, self._pose_array))
        self._publish_fixes(result, stamp)
        self.publish_batteries(stamp)
        self._before = self._cells if result.step else result.cells
        self._cells = result.cells
        pos = self._mission.pos
        if pos is not None:
            number = self._mission.number
            self._pos.publish(pos_message(self.run_id, number, result.step, pos))
        self.publish_report(stamp)

    def publish_report(self, stamp: Time) -> None:
        """Publish the report of the last step."""
        frame = self._frame
        report = step_report_of(self._mission, frame, self.run_id)
        self._report.publish(step_report_message(frame, report, stamp, self._report_of_step))

    def publish_mission_report(self, stamp: Time) -> None:
        """Publish every step of the mission at once."""
        mission = self._mission
        report = make_mission_report(
            self._frame, run_id=self.run_id, mission=mission.number, history=mission.history
        )
        self._mission_report.publish(mission_report_message(self._frame, report, stamp))

    def _publish_fixes(self, result: StepResult, stamp: Time) -> None:
        for i, cell in enumerate(result.cells.tolist()):
            if self._fixes[i].get_subscription_count():
                fix = cell_fix(self._frames[i], *cell)
                message = nav_sat_fix(self._frame, *fix, stamp, self._names[i], self._fix_of[i])
                self._fixes[i].publish(message)

    def publish_batteries(self, stamp: Time) -> None:
        """Publish the charge of the batteries, if they run down."""
        for drone, publisher in enumerate(self._batteries):
            publisher.publish(battery_of(self._mission, self._frame, drone, stamp))

    def publish_odometry(self, stamp: Time, share: float) -> None:
        """Publish odometry and transforms of drones on the way to the cells of the last step.

        Args:
            stamp: Time of the messages.
            share: Share of the way that is done; at 1 they are in their cells.
        """
        subscribed = [i for i, odom in enumerate(self._odoms) if odom.get_subscription_count()]
        if not subscribed and self._tf is None:
            return
        way = self._cells - self._before
        cells = self._before + share * way
        duration = self._mission.env.scenario.step_duration_s
        speed = self._frame.cell_size_m / duration if share < 1 else 0.0
        velocities = [(dx * speed, -dy * speed) for dx, dy in way.tolist()]
        for i in subscribed:
            col, row = cells[i].tolist()
            odom = odometry(
                self._frames[i], self._names[i], col, row, velocities[i], stamp, self._odom_of[i]
            )
            self._odoms[i].publish(odom)
        if self._tf is not None:
            yaws = [yaw_of(velocity) for velocity in velocities]
            of_drones = transforms(self._frame, cells, self._names, stamp, yaws)
            self._publish_time(self._tf, self._tf_type(transforms=of_drones))

    def publish_history(self, result: StepResult, stamp: Time, reveal_person: bool) -> None:
        """Publish tracks and markers if they have changed."""
        tracks = self._mission.tracks
        for i, (publisher, track) in enumerate(zip(self._paths, tracks, strict=True)):
            if self._is_news(publisher, result.stamp_ns):
                publisher.publish(path(self._frames[i], track, stamp, self._path_of[i]))
        # A drone that is lost turns grey without a step.
        lost = len(self._mission.lost)
        if self._is_news(self._markers, result.stamp_ns, lost, reveal_person):
            markers = markers_of(self._mission, self._frame, stamp, reveal_person=reveal_person)
            self._markers.publish(markers)

    def _is_news(self, publisher: Publisher, *state: int) -> bool:
        listeners = publisher.get_subscription_count()
        news = listeners > 0 and self._seen.get(publisher) != (listeners, *state)
        self._seen[publisher] = (listeners, *state)
        return news
