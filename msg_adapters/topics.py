# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The topics of all nodes: a row for each.

Publishers, subscriptions, bags and their replay, the live page and docs/topics.md read this table,
and the tests compare the SROS2 policy with it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Qos = Literal["latched", "complete", "reliable", "command", "queued", "sensor"]
"""Quality of service; `dsse_ros.ros.runtime.qos` has the profiles."""

Reading = Literal["followed", "compared", "belief", "after report", "between steps", "once"]
"""How `replay` reads a topic. It follows the messages, or compares them with its own. These may
need a belief. They may come after the report of their step, also between steps, and once a mission
instead of once a step."""

EACH_DRONE = "drone<i>/"
"""Stands for the name of each drone and a slash."""


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A topic.

    Attributes:
        type_name: Type of its messages.
        qos: What its publishers offer.
        publishers: Programs that publish it.
        subscribers: Programs that subscribe to it by name; others record or show every topic.
        subscriber_qos: What a subscriber requests, by program, where it is not what is offered.
        content: What it contains or commands, for docs/topics.md.
        replay: How `replay` reads it; empty if it does not.
    """

    type_name: str
    qos: Qos
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...] = ()
    subscriber_qos: Mapping[str, Qos] = field(default_factory=dict)
    content: str = ""
    replay: tuple[Reading, ...] = ()


_SIM = ("sim_node",)
_OF_BRIDGE = ("mavlink_bridge",)
_PEOPLE = ("operator",)
"""Enclave of the SROS2 policy for ros2 on the command line and RViz."""


def _input(content: str, publishers: tuple[str, ...] = ("dashboard", *_PEOPLE)) -> Topic:
    """Return the topic of a kind of input of a live search."""
    return Topic(
        type_name="std_msgs/msg/String",
        qos="queued",
        publishers=publishers,
        subscribers=_SIM,
        content=f"live search: {content}",
    )


TOPICS = {
    "probability_grid": Topic(
        type_name="nav_msgs/msg/OccupancyGrid",
        qos="latched",
        publishers=_SIM,
        subscribers=("dashboard",),
        content="the map for display, 0 to 100 by `grid_scaling`, at least 1 for any p > 0; -1 for "
        "unknown and [not searched](rules.md#searching-part-of-the-grid)",
        replay=("compared", "between steps"),
    ),
    "probability": Topic(
        type_name="sensor_msgs/msg/Image",
        qos="latched",
        publishers=_SIM,
        subscribers=("planner_node", "dashboard", "cot_gateway", "ros_env", "run_mission"),
        content="the exact map, 32FC1, row 0 in the north; sums to 1. In a live search the "
        "[belief](live.md#planners)",
        replay=("compared",),
    ),
    "belief_grid": Topic(
        type_name="nav_msgs/msg/OccupancyGrid",
        qos="latched",
        publishers=_SIM,
        subscribers=("dashboard",),
        content="with `publish_belief`: the [belief](belief.md) for display, 0 to 100 by "
        "`grid_scaling`",
        replay=("compared", "belief", "between steps"),
    ),
    "belief": Topic(
        type_name="sensor_msgs/msg/Image",
        qos="latched",
        publishers=_SIM,
        subscribers=("dashboard", "cot_gateway", "run_mission"),
        content="with `publish_belief`: the exact belief, 32FC1, row 0 in the north",
        replay=("compared", "belief"),
    ),
    "particles": Topic(
        type_name="sensor_msgs/msg/PointCloud2",
        qos="latched",
        publishers=_SIM,
        content="with `publish_belief`, where persons follow an [ensemble](drift.md): the "
        "particles of the belief after each step, x, y, z in m and `weight`, which sum to 1 "
        "(float32); those off the grid too",
        replay=("compared", "belief"),
    ),
    "drone<i>/pose": Topic(
        type_name="geometry_msgs/msg/PoseStamped",
        qos="latched",
        publishers=_SIM,
        content="centre of the drone's cell, m; in metres its position and heading",
        replay=("compared",),
    ),
    "drone<i>/odom": Topic(
        type_name="nav_msgs/msg/Odometry",
        qos="reliable",
        publishers=_SIM,
        content="pose in m, twist in m/s; once a step, in real time `odom_rate` times a second, "
        "interpolated between cells or, in metres, on the path flown",
    ),
    "drone<i>/fix": Topic(
        type_name="sensor_msgs/msg/NavSatFix",
        qos="sensor",
        publishers=_SIM,
        content="WGS84, degrees, and ellipsoidal height, m; exact, covariance 0",
        replay=("compared",),
    ),
    "drone<i>/battery": Topic(
        type_name="sensor_msgs/msg/BatteryState",
        qos="latched",
        publishers=_SIM,
        content="with [batteries](faults.md): the remaining charge after each step",
        replay=("compared",),
    ),
    "drone<i>/path": Topic(
        type_name="nav_msgs/msg/Path",
        qos="latched",
        publishers=_SIM,
        content="the track flown, m; at most twice a second, only with subscribers",
        replay=("compared", "after report", "between steps"),
    ),
    "drone<i>/remaining_path": Topic(
        type_name="nav_msgs/msg/Path",
        qos="latched",
        publishers=_SIM,
        content="in metres: what is left of the track of a command, m; empty without one",
    ),
    "drone<i>/plan": Topic(
        type_name="nav_msgs/msg/Path",
        qos="latched",
        publishers=("planner_node",),
        content="where the planner will fly the drone, m; at most twice a second, only with "
        "subscribers; empty once the mission is over",
    ),
    "drones": Topic(
        type_name="geometry_msgs/msg/PoseArray",
        qos="latched",
        publishers=_SIM,
        subscribers=("cot_gateway",),
        content="all drones in the order of `agents`, m",
        replay=("compared",),
    ),
    "step_report": Topic(
        type_name="sensor_msgs/msg/PointCloud2",
        qos="complete",
        publishers=_SIM,
        subscribers=(
            "planner_node", "mavlink_bridge", "dashboard", "show", "ros_env", "run_mission",
        ),
        subscriber_qos={"planner_node": "latched", "run_mission": "latched"},
        content="one point per drone: run, mission, step, position, action, reward, flags, action "
        "mask ([layout](ros.md#step-report))",
        replay=("followed",),
    ),
    "vehicle_tasks": Topic(
        type_name="sensor_msgs/msg/PointCloud2",
        qos="latched",
        publishers=_SIM,
        subscribers=_OF_BRIDGE,
        content="not with `vehicle_time` `ignored`: what each drone's vehicle has to do, once its "
        "drone has begun an action ([layout](ros.md#vehicle-tasks))",
    ),
    "mission_report": Topic(
        type_name="sensor_msgs/msg/PointCloud2",
        qos="latched",
        publishers=_SIM,
        subscribers=("mavlink_bridge", "dashboard"),
        content="at the end of a mission, all its steps at once ([layout](ros.md#mission-report))",
        replay=("compared", "after report", "once"),
    ),
    "probability_of_success": Topic(
        type_name="std_msgs/msg/Float64MultiArray",
        qos="complete",
        publishers=_SIM,
        subscribers=("dashboard", "run_mission"),
        subscriber_qos={"run_mission": "latched"},
        content="`[run_id, mission, step, POS]`: the [cumulative probability of "
        "success](belief.md) after each step, if the node computes a belief",
        replay=("compared", "belief"),
    ),
    "agents": Topic(
        type_name="std_msgs/msg/String",
        qos="latched",
        publishers=_SIM,
        subscribers=(
            "planner_node", "mavlink_bridge", "dashboard", "show", "cot_gateway", "ros_env",
        ),
        content="JSON: run and mission, order of the drones, names of the actions, rules, seed, "
        "origin ([keys](ros.md#agents))",
        replay=("followed",),
    ),
    "markers": Topic(
        type_name="visualization_msgs/msg/MarkerArray",
        qos="latched",
        publishers=_SIM,
        content="drones, tracks, datum, circle; for an [incident](drift.md) wind, current, shore "
        "and last known positions; persons with `reveal_person`; at most twice a second, only with "
        "subscribers",
        replay=("compared", "after report", "between steps"),
    ),
    "/clock": Topic(
        type_name="rosgraph_msgs/msg/Clock",
        qos="reliable",
        publishers=_SIM,
        content="mission time, with `publish_clock`; repeated once a second while the node waits",
    ),
    "/tf": Topic(
        type_name="tf2_msgs/msg/TFMessage",
        qos="reliable",
        publishers=_SIM,
        content="`map` to `drone<i>/base_link`, where `tf2_msgs` is installed; repeated like "
        "`/clock`",
    ),
    "/tf_static": Topic(
        type_name="tf2_msgs/msg/TFMessage",
        qos="latched",
        publishers=_SIM,
        content="`earth` (ECEF) to `map`, where `tf2_msgs` is installed: [where the map "
        "lies](frames.md)",
    ),
    "/diagnostics": Topic(
        type_name="diagnostic_msgs/msg/DiagnosticArray",
        qos="reliable",
        publishers=("sim_node", "planner_node", "mavlink_bridge"),
        subscribers=("dashboard",),
        content="once a second, in wall time: step, POS, what the node is waiting for, timeouts, "
        "refused commands by reason; as `dsse_ros: sim_node: drone<i>` the state of each drone",
    ),
    "drone<i>/cmd_action_name": Topic(
        type_name="std_msgs/msg/String",
        qos="command",
        publishers=_PEOPLE,
        subscribers=_SIM,
        content="name of an action",
    ),
    "drone<i>/command_pose": Topic(
        type_name="geometry_msgs/msg/PoseStamped",
        qos="command",
        publishers=_PEOPLE,
        subscribers=_SIM,
        content="go to this position, m in `map`: cell by cell, in metres straight",
    ),
    "drone<i>/command_path": Topic(
        type_name="nav_msgs/msg/Path",
        qos="command",
        publishers=_PEOPLE,
        subscribers=_SIM,
        content="[in metres](rules.md#in-metres): fly this track, m in `map`",
    ),
    "drone<i>/cmd_vel": Topic(
        type_name="geometry_msgs/msg/TwistStamped",
        qos="command",
        publishers=_PEOPLE,
        subscribers=_SIM,
        content="[in metres](rules.md#in-metres): airspeed `linear.x`, m/s, and turn to the left "
        "`angular.z`, rad/s, in the body frame; held for the next step, as far as the drone can",
    ),
    "drone<i>/vehicle_pose": Topic(
        type_name="geometry_msgs/msg/PoseStamped",
        qos="reliable",
        publishers=_OF_BRIDGE,
        subscribers=("sim_node", "dashboard"),
        content="position and attitude of the vehicle, m in `map`; z is the height above the "
        "[datum](flight.md#altitudes)",
    ),
    "drone<i>/vehicle_time": Topic(
        type_name="sensor_msgs/msg/TimeReference",
        qos="reliable",
        publishers=_OF_BRIDGE,
        subscribers=_SIM,
        content="clock of the vehicle: `time_ref` is the time since its autopilot was started",
    ),
    "drone<i>/vehicle_fix": Topic(
        type_name="sensor_msgs/msg/NavSatFix",
        qos="sensor",
        publishers=_OF_BRIDGE,
        subscribers=("cot_gateway",),
        content="WGS84 of the vehicle; its altitude is above the ellipsoid, NaN if the GPS does "
        "not report it, and its covariance is unknown",
    ),
    "drone<i>/vehicle_battery": Topic(
        type_name="sensor_msgs/msg/BatteryState",
        qos="latched",
        publishers=_OF_BRIDGE,
        content="charge of the vehicle as the autopilot reports it; with [batteries]"
        "(faults.md#batteries) the charge of the drone",
    ),
    "drone<i>/vehicle_state": Topic(
        type_name="diagnostic_msgs/msg/DiagnosticArray",
        qos="latched",
        publishers=_OF_BRIDGE,
        subscribers=("sim_node", "dashboard"),
        # A new simulation must not take the last state that was for another one.
        subscriber_qos={"sim_node": "reliable"},
        content="[state](flight.md#vehicle-state) of the vehicle: its task, who controls it, "
        "whether it is lost",
    ),
    "vehicle_wind": Topic(
        type_name="geometry_msgs/msg/Vector3Stamped",
        qos="command",
        publishers=("mavlink_bridge", *_PEOPLE),
        subscribers=_SIM,
        content="[in metres](flight.md#wind), with `vehicle_time` `followed`: velocity of the air "
        "where the vehicles fly, m/s in `map`",
    ),
    "joint_action": Topic(
        type_name="std_msgs/msg/Int32MultiArray",
        qos="command",
        publishers=("planner_node", "ros_env", *_PEOPLE),
        subscribers=_SIM,
        content="`[mission, step, a0, a1, ...]`: all drones at once, only for that step",
    ),
    "joint_command": Topic(
        type_name="std_msgs/msg/Float64MultiArray",
        qos="command",
        publishers=("planner_node", "ros_env", *_PEOPLE),
        subscribers=_SIM,
        content="[in metres](rules.md#in-metres): `[mission, step, turn0, speed0, turn1, ...]`, "
        "-1 to 1: all drones at once, only for that step",
    ),
    "live/detection": _input("somebody was detected", _PEOPLE),
    "live/sighting": _input("the object was seen"),
    "live/searched": _input(
        "others have searched an area or along a line", ("dashboard", "run_mission", *_PEOPLE)
    ),
    "live/weather": _input("wind or current"),
    "live/confirm": _input("a contact is the person"),
    "live/dismiss": _input("a contact is a false alarm"),
    "live/withdraw": _input("an input was wrong"),
    "drone<i>/detection_pose": Topic(
        type_name="geometry_msgs/msg/PoseWithCovarianceStamped",
        qos="queued",
        publishers=_PEOPLE,
        subscribers=_SIM,
        content="live search: the drone has detected somebody here, m in `map`",
    ),
    "drone<i>/detections": Topic(
        type_name="vision_msgs/msg/Detection3DArray",
        qos="queued",
        publishers=_PEOPLE,
        subscribers=_SIM,
        content="the same for several, where `vision_msgs` is installed",
    ),
    "live/history": Topic(
        type_name="std_msgs/msg/String",
        qos="complete",
        publishers=_SIM,
        subscribers=("planner_node",),
        content="live search: the [looks and inputs](live.md#planners) since the last message",
        replay=("followed",),
    ),
    "live/answers": Topic(
        type_name="std_msgs/msg/String",
        qos="complete",
        publishers=_SIM,
        subscribers=("dashboard",),
        content="live search: [answers](live.md#answers) to inputs",
    ),
    "live/contacts": Topic(
        type_name="std_msgs/msg/String",
        qos="latched",
        publishers=_SIM,
        subscribers=("dashboard", "cot_gateway"),
        content="live search: [contacts](live.md#contacts)",
    ),
    "live/contact_markers": Topic(
        type_name="visualization_msgs/msg/MarkerArray",
        qos="latched",
        publishers=_SIM,
        content="live search: the contacts",
    ),
}  # fmt: skip
"""The topics by name, relative to the namespace of the search unless it begins with a slash."""


def of_drones(topic: str) -> str:
    """Return the common name of a topic of all drones."""
    return re.sub(r"\bdrone\d+/", EACH_DRONE, topic)


def topic_of(name: str) -> Topic:
    """Return the row of a topic, such as `agents` or `drone3/pose`."""
    return TOPICS[of_drones(name)]


def published_by(program: str) -> dict[str, Topic]:
    """Return the topics that a program publishes, by name."""
    return {name: topic for name, topic in TOPICS.items() if program in topic.publishers}


def subscribed_by(program: str) -> dict[str, Topic]:
    """Return the topics that a program subscribes to by name."""
    return {name: topic for name, topic in TOPICS.items() if program in topic.subscribers}


def replayed(*how: Reading) -> dict[str, Topic]:
    """Return the topics that `replay` reads in one of these ways, by name."""
    return {name: topic for name, topic in TOPICS.items() if {*how} & {*topic.replay}}
