# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The publishers of `sim_node`, as the table of topics lists them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from dsse_ros.base.fields import FieldError
from dsse_ros.base.message_types import message_class
from dsse_ros.mission.run.mission import Mission, StepResult
from dsse_ros.mission.run.step_messages import DEFAULT, MESSAGES, OF_BELIEF, Display, StepMessages
from dsse_ros.mission.run.step_scheduler import Timing
from dsse_ros.mission.vehicles.flown import Motion, motions
from dsse_ros.mission.vehicles.track_follower import TrackLeft
from dsse_ros.mission.vehicles.vehicle_tasks import VehicleTasks
from dsse_ros.ros.runtime.last_published import LastPublished
from dsse_ros.ros.runtime.qos import Endpoints
from dsse_ros.world.scenario.agents import AgentsInfo, agents_json, area_rows
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.frames import GridFrame, flip_y, map_positions
from dsse_ros.world.scenario.geodesy import map_in_earth
from msg_adapters.poses import earth_transform, odometry, path, transforms, yaw_of
from msg_adapters.stamps import to_stamp
from msg_adapters.topics import EACH_DRONE, TOPICS, published_by
from msg_adapters.vehicle_tasks import vehicle_tasks_message


def tf_type() -> Any:
    """Return tf2_msgs/TFMessage, or None if tf2_msgs is not installed."""
    try:
        return message_class(TOPICS["/tf"].type_name)
    except FieldError:
        return None


_EACH_STEP = tuple(
    name for name in MESSAGES if not {"after report", "followed"} & {*TOPICS[name].replay}
)
"""Topics with a message for each step, before the step report."""
LIVE_OUTPUTS = tuple(name for name in published_by("sim_node") if name.startswith("live/"))
"""Topics of a live search."""


class MissionPublishers:
    """The publishers of one mission.

    Args:
        endpoints: Makes the publishers.
        mission: The mission to publish.
        frame: The frame of the grid.
        run_id: Identity of the simulation since its start.
        publish_clock: Whether to publish mission time on `/clock`.
        publish_belief: Whether to publish the belief, if the mission has one.
        has_vehicles: Whether to publish the tasks of vehicles.

    Attributes:
        run_id: Identity in the messages.
        after_step: Called after each step has been published.
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
        has_vehicles: bool,
    ) -> None:
        self._mission = mission
        self._frame = frame
        self._names = mission.env.possible_agents
        self._messages = StepMessages(mission, frame, run_id)
        self._tf_type = tf_type()
        faults, ensemble = mission.env.world.faults, mission.env.world.ensemble
        is_there = {
            "belief": publish_belief,
            "belief_grid": publish_belief,
            "particles": publish_belief and ensemble is not None,
            "drone<i>/battery": faults is not None and faults.has_battery,
            "vehicle_tasks": has_vehicles,
            "/clock": publish_clock,
            "/tf": self._tf_type is not None,
            "/tf_static": self._tf_type is not None,
            "drone<i>/remaining_path": mission.env.rules.in_metres,
            # See `NodeDiagnostics` and `LiveInputs`.
            "/diagnostics": False,
            **dict.fromkeys(LIVE_OUTPUTS, False),
        }
        self._publishers = {
            topic: [endpoints.publisher(name) for name in self._of_all(topic)]
            for topic in published_by("sim_node")
            if is_there.get(topic, True)
        }
        # The last messages of the topics that are not latched, for late joiners.
        self._of_time: dict[Publisher, Any] = {}
        self._before = self._cells = mission.result.cells
        # Of the last step.
        self._stamp = Time()
        # Of paths and markers.
        self._published = LastPublished()
        self.after_step: list[Callable[[], None]] = []
        # The track that was last published for each drone.
        self._tracks: dict[int, TrackLeft | None] = {}

    @property
    def run_id(self) -> int:
        """Identity in the messages."""
        return self._messages.run_id

    @run_id.setter
    def run_id(self, run_id: int) -> None:
        self._messages.run_id = run_id

    def _of_all(self, topic: str) -> list[str]:
        """Return the names of a topic: one, or one for each drone."""
        if not topic.startswith(EACH_DRONE):
            return [topic]
        return [topic.replace(EACH_DRONE, f"{name}/") for name in self._names]

    def _publish(self, topic: str, stamp: Time, display: Display = DEFAULT) -> None:
        """Publish the messages of the last step on a topic, if there are any.

        Those that nobody keeps for late joiners are only made for present subscribers.
        """
        kept = TOPICS[topic].qos in ("latched", "complete")
        for drone, publisher in enumerate(self._publishers.get(topic, ())):
            if kept or publisher.get_subscription_count():
                message = self._messages.make(topic, stamp, drone, display)
                if message is not None:
                    publisher.publish(message)

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
            speeds_mps=self._mission.space.speeds_mps,
        )
        self._publishers["agents"][0].publish(String(data=agents_json(info)))

    def publish_first_commands(self, timing: Timing) -> None:
        """Publish that the drones have been commanded: vehicles may take off from then on."""
        if self._mission.result.step == 0 and not self._mission.missing:
            self.publish_agents(timing)

    def publish_origin(self, stamp: Time) -> None:
        """Publish where the map lies on the Earth, if tf2_msgs is installed."""
        for publisher in self._publishers.get("/tf_static", ()):
            origin = earth_transform(stamp, self._frame.map_frame, *map_in_earth(self._frame))
            publisher.publish(self._tf_type(transforms=[origin]))

    def publish_clock(self, nanoseconds: int) -> None:
        """Publish the mission time, if `publish_clock` is set."""
        self._publish_time("/clock", Clock(clock=to_stamp(nanoseconds)))

    def _publish_time(self, topic: str, message: Any) -> None:
        for publisher in self._publishers.get(topic, ()):
            self._of_time[publisher] = message
            publisher.publish(message)

    def repeat_time(self) -> None:
        """Publish the last `/clock` and `/tf` again, with the same stamp, for late joiners."""
        for publisher, message in self._of_time.items():
            publisher.publish(message)

    def publish_belief(self, grid_scaling: str) -> None:
        """Publish the belief and the POS of the last step again, after inputs have changed them."""
        for topic in OF_BELIEF:
            self._publish(topic, self._stamp, Display(grid_scaling=grid_scaling))

    def publish_grid(self, stamp: Time, grid_scaling: str) -> None:
        """Publish the map and, if set, the belief as grids for display."""
        for topic in ("probability_grid", "belief_grid"):
            self._publish(topic, stamp, Display(grid_scaling=grid_scaling))

    def publish_step(self, result: StepResult, stamp: Time, grid_scaling: str) -> None:
        """Publish a step, all messages with the same stamp; the step report goes last."""
        self._stamp = stamp
        self._before = self._cells if result.step else result.cells
        self._cells, display = result.cells, Display(grid_scaling=grid_scaling)
        for topic in _EACH_STEP:
            self._publish(topic, stamp, display)
        self.publish_remaining_paths(stamp)
        self.publish_report(stamp)
        for follow in self.after_step:
            follow()

    def publish_remaining_paths(self, stamp: Time) -> None:
        """Publish what is left of the tracks of drones in metres, if that has changed."""
        for drone, publisher in enumerate(self._publishers.get("drone<i>/remaining_path", ())):
            goal = self._mission.commands.goal_of(drone)
            track = None if goal is None else goal.where
            if drone in self._tracks and track is self._tracks[drone]:
                continue
            self._tracks[drone] = track
            points = [] if track is None else track.points.tolist()
            altitude_m = self._frame.alt_of(drone)
            positions = [(x, flip_y(self._frame.extent.height, y), altitude_m) for x, y in points]
            publisher.publish(path(self._messages.header(stamp), positions))

    def publish_report(self, stamp: Time) -> None:
        """Publish the report of the last step."""
        self._publish("step_report", stamp)

    def publish_tasks(self, stamp: Time, tasks: VehicleTasks) -> None:
        """Publish what the vehicles have to do, if there are any."""
        for publisher in self._publishers.get("vehicle_tasks", ()):
            points = tasks.points(self._frame, self.run_id)
            publisher.publish(vehicle_tasks_message(self._messages.header(stamp), points))

    def publish_mission_report(self, stamp: Time) -> None:
        """Publish every step of the mission at once."""
        self._publish("mission_report", stamp)

    def publish_odometry(self, stamp: Time, share: float) -> None:
        """Publish odometry and transforms of drones on the way to the cells of the last step.

        Args:
            stamp: Time of the messages.
            share: Share of the way that is done; at 1 they are in their cells.
        """
        odoms, has_tf = self._publishers["drone<i>/odom"], "/tf" in self._publishers
        subscribed = [i for i, odom in enumerate(odoms) if odom.get_subscription_count()]
        if not subscribed and not has_tf:
            return
        moving = self._motions(share)
        head, bodies = self._messages.header(stamp), self._messages.bodies
        for i in subscribed:
            into = self._messages.reused("drone<i>/odom", i)
            odoms[i].publish(odometry(head, bodies[i], *moving[i], into))
        if has_tf:
            positions, yaws = (
                [motion.position for motion in moving],
                [motion.yaw for motion in moving],
            )
            of_drones = transforms(head, bodies, positions, yaws)
            self._publish_time("/tf", self._tf_type(transforms=of_drones))

    def _motions(self, share: float) -> list[Motion]:
        """Return how the drones move when a share of the way is done."""
        env, flown = self._mission.env, self._mission.result.flown
        duration = env.scenario.step_duration_s
        if flown is not None:
            assert env.world.metres is not None
            return motions(self._frame, flown, env.world.metres.wind, share)
        way = self._cells - self._before
        speed = self._frame.cell_size_m / duration if share < 1 else 0.0
        velocities = [(dx * speed, -dy * speed) for dx, dy in way.tolist()]
        positions = map_positions(self._frame, self._before + share * way)
        return [
            Motion(position, velocity, yaw_of(velocity))
            for position, velocity in zip(positions, velocities, strict=True)
        ]

    def publish_history(self, result: StepResult, stamp: Time, reveal_person: bool) -> None:
        """Publish tracks and markers if they have changed."""
        # A drone that is lost turns grey without a step.
        state = {"drone<i>/path": (), "markers": (len(self._mission.lost), reveal_person)}
        for topic, further in state.items():
            for drone, publisher in enumerate(self._publishers[topic]):
                if self._published.is_news(publisher, result.stamp_ns, *further):
                    display = Display(reveal_person=reveal_person)
                    publisher.publish(self._messages.make(topic, stamp, drone, display))
