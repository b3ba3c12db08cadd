# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Prints the interface of the nodes as JSON, with names and words as the pages have them."""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable, Iterable
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from dsse_ros.ros.nodes.cot_gateway import CotNode
from dsse_ros.ros.nodes.dashboard import OF_VEHICLE, TOPICS, DashboardNode
from dsse_ros.ros.nodes.foxglove_viewer import ViewerNode
from dsse_ros.ros.nodes.mavlink_bridge import BridgeNode
from dsse_ros.ros.nodes.plan_publishers import PLAN
from dsse_ros.ros.nodes.planner_node import PlannerNode
from dsse_ros.ros.nodes.recorder import RecorderNode
from dsse_ros.ros.nodes.show import ShowNode
from dsse_ros.ros.nodes.sim_node import SimNode
from dsse_ros.ros.runtime.qos import offered, requested
from dsse_ros.screens.dashboard.search_history import EXACT_LAYERS
from msg_adapters.topics import published_by


def name_of(node: Node, full: str) -> str:
    """Name as it stands in the code: relative, private or absolute."""
    private = re.sub(f"^/ns/{node.get_name()}/", "~/", full)
    return re.sub("^/ns/", "", private).replace("drone0/", "drone<i>/")


def type_of(kind: Any) -> str:
    return f"{kind.__module__.split('.')[0]}/{kind.__name__}"


def quality(qos: QoSProfile) -> str:
    """Quality of service in the words of docs/topics.md."""
    latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    reliable = qos.reliability == ReliabilityPolicy.RELIABLE
    words = {
        (True, True, 1): "latched",
        (True, True, 100): "latched, 100",
        (True, True, 1000): "latched, 1000",
        (False, False, 5): "sensor data",
    }
    if reliable and not latched:
        return f"reliable {qos.depth}"
    return words.get((latched, reliable, qos.depth), str(qos))


def topics(node: Node, endpoints: Iterable[Any]) -> dict[str, tuple[str, str]]:
    return {
        name_of(node, topic.topic_name): (type_of(topic.msg_type), quality(topic.qos_profile))
        for topic in endpoints
    }


def interface(node: Node) -> dict[str, Any]:
    return {
        "published": topics(node, node.publishers),
        "subscribed": topics(node, node.subscriptions),
        "services": {name_of(node, s.service_name): type_of(s.srv_type) for s in node.services},
        "read_only": {
            name: node.describe_parameter(name).read_only
            for name in node.get_parameters_by_prefix("")
        },
    }


def started(make_node: Callable[[], Node], *arguments: str) -> dict[str, Any]:
    """Interface of a node that is started in the namespace /ns."""
    rclpy.init(args=["--ros-args", "-r", "__ns:=/ns", *arguments])
    shown = interface(make_node())
    rclpy.shutdown()
    return shown


if __name__ == "__main__":
    options = [
        part
        for text in (
            "scenario.num_drones:=1", "vehicle_time:=followed", "publish_belief:=true",
            "scenario.battery_move:=1.0", "scenario.loss_steps:=[1000]",
            "rules:=sea", "scenario.particles:=10", "scenario.timestep_limit:=10",
        )
        for part in ("-p", text)
    ]  # fmt: skip
    # Nobody is there to answer it. What has no value has no type.
    of_bridge = [
        part
        for text in (
            "num_vehicles:=1", "connections:=['udpout:127.0.0.1:9']", "system_ids:=[1]",
            "altitudes:=[120.0]", "fence_center:=[-24.0, -46.0]",
            f"state_directory:={tempfile.mkdtemp()}",
        )
        for part in ("-p", text)
    ]  # fmt: skip
    nodes = {
        "sim_node": started(SimNode, *options),
        "planner_node": started(
            PlannerNode, "-p", "planner:=belief", "-p", "planner_options:=['width=8']"
        ),
        "mavlink_bridge": started(BridgeNode, *of_bridge),
        "show": started(ShowNode),
        # What has no value has no type.
        "recorder": started(RecorderNode, "-p", "exclude:=['*/odom']"),
        "foxglove_viewer": started(ViewerNode, "-p", "exclude:=['*/odom']", "-p", "port:=0"),
        "cot_gateway": started(CotNode, "-p", "url:=udp://127.0.0.1:9"),
        "dashboard": started(DashboardNode, "-p", "allowed_hosts:=['name.example']"),
    }
    # What it publishes and takes in metres only, or without a truth.
    in_metres = started(
        SimNode, "-p", "rules:=flight", "-p", "vehicle_time:=followed", "-p", "truth:=none",
        "-p", "scenario.particles:=10", "-p", "scenario.timestep_limit:=10",
    )  # fmt: skip
    for kind in ("published", "subscribed"):
        nodes["sim_node"][kind] |= in_metres[kind]
    # Which it publishes once it knows the drones.
    kind, qos = offered(PLAN, "planner_node")
    nodes["planner_node"]["published"][PLAN] = (type_of(kind), quality(qos))
    # Which it subscribes to once it knows the drones.
    kind, qos = requested("drone<i>/vehicle_fix", "cot_gateway")
    nodes["cot_gateway"]["subscribed"]["drone<i>/vehicle_fix"] = (type_of(kind), quality(qos))
    # Which it subscribes to once there is a simulation.
    found = (*TOPICS, *EXACT_LAYERS, *(f"drone<i>/{topic}" for topic in OF_VEHICLE))
    for topic in found:
        kind, qos = requested(topic, "dashboard")
        nodes["dashboard"]["subscribed"][topic] = (type_of(kind), quality(qos))
    # Which it publishes once somebody enters an input.
    for topic in published_by("dashboard"):
        kind, qos = offered(topic, "dashboard")
        nodes["dashboard"]["published"][topic] = (type_of(kind), quality(qos))
    print(json.dumps(nodes))
