# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`cot_gateway` sends what it hears of a search."""

from __future__ import annotations

import socket
import time

import numpy as np
import pytest

pytest.importorskip("pytak")

import rclpy
from domains import free_domain
from geometry_msgs.msg import Point, Pose, PoseArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rig import TIMEOUT_S
from sensor_msgs.msg import Image, NavSatFix
from std_msgs.msg import Header, String

from dsse_ros.ros.nodes.cot_gateway import CotNode
from dsse_ros.ros.runtime.qos import LATCHED, SENSOR
from dsse_ros.world.scenario.agents import AgentsInfo, agents_json
from dsse_ros.world.scenario.frames import GridFrame
from msg_adapters.images import probability_image

FRAME = GridFrame(4, 100.0, -24.0, -46.0, 0.0, 120.0)
INFO = AgentsInfo(("drone0", "drone1"), ("search",), "sea", 0, FRAME, 100, 13.0, 1, 7)


@pytest.mark.slow
def test_what_it_hears_of_a_search_reaches_the_receiver() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.setblocking(False)
        url = f"udp://127.0.0.1:{receiver.getsockname()[1]}"
        arguments = ["--ros-args", "-p", f"url:={url}", "-p", "period:=0.1"]
        rclpy.init(args=arguments, domain_id=free_domain())
        node, search = CotNode(), Node("search", use_global_arguments=False)
        executor = SingleThreadedExecutor()
        for each in (node, search):
            executor.add_node(each)
        # The map comes first, before anything says of which search it is.
        poc = np.full((4, 4), 1 / 16, np.float32)
        at = [Pose(position=Point(x=50.0, y=50.0, z=120.0)) for _ in INFO.agents]
        for kind, topic, message in (
            (Image, "probability", probability_image(Header(), poc)),
            (PoseArray, "drones", PoseArray(poses=at)),
            (String, "agents", String(data=agents_json(INFO))),
        ):
            search.create_publisher(kind, topic, LATCHED).publish(message)
        fixes = search.create_publisher(NavSatFix, "drone1/vehicle_fix", SENSOR)
        wanted = {b'uid="dsse_ros.7.drone0" how="m-s"', b'uid="dsse_ros.7.drone1" how="m-g"',
                  b'uid="dsse_ros.7.poc90.0"'}  # fmt: skip
        deadline_s = time.monotonic() + TIMEOUT_S
        while wanted and time.monotonic() < deadline_s:
            executor.spin_once(timeout_sec=0.02)
            fixes.publish(NavSatFix(latitude=-24.05, longitude=-46.05, altitude=80.0))
            try:
                event = receiver.recv(1 << 16)
            except BlockingIOError:
                continue
            wanted = {word for word in wanted if word not in event}
        executor.shutdown()
        node.destroy_node()
        search.destroy_node()
        rclpy.shutdown()
    assert not wanted
