# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A detector to start from: what a camera would report of a person whom nobody else knows.

Start `sim_node` with `truth:=none`, then this. With your own camera, `look` is your pipeline.
"""

import contextlib
import json
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import rclpy
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from dsse_ros.world.scenario.agents import AgentsInfo, agents_from_json
from dsse_ros.world.scenario.geodesy import geodetic_to_map
from msg_adapters.stamps import to_nanoseconds
from msg_adapters.step_report import step_report_from_message


class Camera(NamedTuple):
    """How well a drone sees, per second of the search.

    Attributes:
        range_m: Distance along the surface up to which it sees a person.
        rate: Detections of a person in sight, 1/s.
        false_alarm_rate: Detections of nobody, somewhere in sight, 1/s.
        error_m: Standard deviation of a position along both axes.
    """

    range_m: float = 150.0
    rate: float = 0.05
    false_alarm_rate: float = 0.0002
    error_m: float = 15.0


def look(
    camera: Camera, drone: NDArray[Any], person: NDArray[Any], seconds: float,
    rng: np.random.Generator,
) -> list[NDArray[np.float64]]:  # fmt: skip
    """Return where a drone reports a person, (x, y) in m, after some seconds at a place."""
    reports = []
    if np.hypot(*(person - drone)) <= camera.range_m:
        for _ in range(rng.poisson(camera.rate * seconds)):
            reports.append(person + rng.normal(0.0, camera.error_m, 2))
    for _ in range(rng.poisson(camera.false_alarm_rate * seconds)):
        angle, away_m = rng.uniform(0, 2 * np.pi), camera.range_m * np.sqrt(rng.uniform())
        reports.append(drone + away_m * np.array([np.cos(angle), np.sin(angle)]))
    return reports


def hidden_track(info: AgentsInfo, seed: int) -> NDArray[np.float64]:
    """Return where a person is after each step (T, 2), m in `map`: a draw of the incident's drift.

    Raises:
        ValueError: If the search has no incident.
    """
    scenario = None if info.definition is None else info.definition.scenario
    incident = getattr(scenario, "incident", None)
    if incident is None or incident.grid_summary is None:
        raise ValueError("the search has no incident: state where the person is as person:=[x, y]")
    times_s = incident.grid_summary.begins_s + info.step_duration_s * np.arange(
        info.timestep_limit + 1
    )
    track = incident.followed.tracks(times_s, 1, np.random.default_rng(seed))
    x_m, y_m, _ = geodetic_to_map(info.frame, track.lats_deg[:, 0], track.lons_deg[:, 0], 0.0)
    return np.stack([x_m, y_m], axis=1)


class Detector(Node):
    """Looks for the person from each position of each drone."""

    def __init__(self) -> None:
        super().__init__("detector")
        get = {name: self.declare_parameter(name, value).value for name, value in {
            **Camera()._asdict(), "seed": 0, "person": [float("nan")] * 2}.items()}  # fmt: skip
        self.seed, self.person = int(get.pop("seed")), np.array(get.pop("person"))
        self.camera, self.rng = Camera(**get), np.random.default_rng(self.seed)
        self.mission: tuple[int, int] | None = None
        self.begin_ns, self.last_ns = 0, dict[str, int]()
        self.reports = self.create_publisher(String, "live/detection", 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, "agents", self.on_agents, latched)
        self.create_subscription(PointCloud2, "step_report", self.on_step, latched)

    def on_agents(self, message: String) -> None:
        """Hide the person of a new mission, and listen to its drones."""
        info = agents_from_json(message.data)
        if self.mission == (info.run_id, info.mission):
            return
        first, self.mission, self.last_ns = self.mission is None, (info.run_id, info.mission), {}
        fixed = not np.isnan(self.person).any()
        self.track = self.person[None] if fixed else hidden_track(info, self.seed)
        self.step_s = info.step_duration_s
        for name in info.agents if first else ():
            self.create_subscription(Odometry, f"{name}/odom", partial(self.on_odom, name), 10)

    def on_step(self, message: PointCloud2) -> None:
        """Note when the search has begun."""
        report = step_report_from_message(message)
        if (int(report["run_id"][0]), int(report["mission"][0])) == self.mission:
            flown_ns = int(report["step"][0] * self.step_s * 1e9)
            self.begin_ns = to_nanoseconds(message.header.stamp) - flown_ns

    def on_odom(self, drone: str, message: Odometry) -> None:
        """Publish what a drone has seen since its last position."""
        now_ns = to_nanoseconds(message.header.stamp)
        since_ns = self.last_ns.get(drone, now_ns)
        self.last_ns[drone] = now_ns
        step = (now_ns - self.begin_ns) / 1e9 / self.step_s
        person = self.track[int(np.clip(step, 0, len(self.track) - 1))]
        at = np.array([message.pose.pose.position.x, message.pose.pose.position.y])
        for k, (x, y) in enumerate(
            look(self.camera, at, person, (now_ns - since_ns) / 1e9, self.rng)
        ):
            report = {"id": f"{drone}-{now_ns}-{k}", "time": now_ns / 1e9, "drone": drone,
                      "x": x, "y": y, "radius": self.camera.error_m}  # fmt: skip
            self.reports.publish(String(data=json.dumps(report)))


if __name__ == "__main__":
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Detector())
