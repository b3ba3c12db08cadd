# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What Foxglove and RViz get of a mission, and what RViz can do to it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import foxglove.layouts
import pytest
import yaml
from foxglove_client import FoxgloveClient
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import (
    DurabilityPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rig import Process, Rig, Sim
from std_msgs.msg import String

from dsse_ros.ros.runtime.exit_codes import BAD_INPUT

ROOT = Path(__file__).resolve().parents[3]
DRONES = 4
MISSION = {
    "num_drones": DRONES, "grid_size": 8, "seed": 3, "rules": "v2", "publish_belief": True,
    "probability_of_detection": 0.0, "person_pod_multipliers": [0.0],
}  # fmt: skip
LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
RVIZ = yaml.safe_load((ROOT / "rviz" / "mission.rviz").read_text())["Visualization Manager"]
LAYOUT = json.loads((ROOT / "viewers" / "foxglove_layout.json").read_text())
TYPES = {
    "rviz_default_plugins/Map": "nav_msgs/msg/OccupancyGrid",
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/PointCloud2": "sensor_msgs/msg/PointCloud2",
    "rviz_default_plugins/Path": "nav_msgs/msg/Path",
    "rviz_default_plugins/Pose": "geometry_msgs/msg/PoseStamped",
    "rviz_default_plugins/PoseArray": "geometry_msgs/msg/PoseArray",
    "rviz_default_plugins/SetGoal": "geometry_msgs/msg/PoseStamped",
}


@dataclass
class Mission:
    """A mission with its viewer.

    Attributes:
        sim: The simulation.
        viewer: The viewer's process.
        client: A client of the viewer.
    """

    sim: Sim
    viewer: Process
    client: FoxgloveClient


@pytest.fixture(scope="module")
def mission(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mission]:
    viewer = rig.start("foxglove_viewer", {"port": 0, "use_sim_time": True})
    # Of its vehicles there is none: it offers what they would say.
    rig.start(
        "mavlink_bridge",
        {
            "connections": [f"udpout:127.0.0.1:{port}" for port in range(9, 9 + DRONES)],
            "state_directory": str(tmp_path_factory.mktemp("state")),
        },
    )
    sim = rig.sim(MISSION)
    client = FoxgloveClient(rig, viewer)
    yield Mission(sim, viewer, client)
    client.close()


# Foxglove


def test_every_topic_of_the_mission_is_offered_with_its_definition(
    mission: Mission, rig: Rig
) -> None:
    def ours() -> dict[str, str]:
        found = dict(rig.node.get_topic_names_and_types())
        return {topic: kinds[0] for topic, kinds in found.items() if is_ours(topic)}

    def is_ours(topic: str) -> bool:
        return topic not in ("/rosout", "/parameter_events")

    client = mission.client
    client.until(lambda: {"/step_report", "/drone3/vehicle_state"} <= ours().keys(), "all topics")
    client.until(lambda: ours().keys() <= client.channels.keys(), "a channel for each")
    for topic, kind in ours().items():
        channel = client.channels[topic]
        assert (channel["schemaName"], channel["encoding"]) == (kind, "cdr")
        assert channel["schemaEncoding"] == "ros2msg" and channel["schema"]


def test_what_is_latched_comes_at_once_and_to_a_second_client_too(
    mission: Mission, rig: Rig
) -> None:
    agents = rig.first(String, "/agents")
    grid = rig.first(OccupancyGrid, "/probability_grid")
    other = FoxgloveClient(rig, mission.viewer)
    try:
        for client in (mission.client, other):
            assert client.first("/agents").data == agents.data
            got = client.first("/probability_grid")
            assert list(got.data) == list(grid.data)
            assert (got.info.width, got.info.resolution) == (8, grid.info.resolution)
            assert got.header.frame_id == grid.header.frame_id
    finally:
        other.close()


def test_steps_come_as_they_are_published_with_the_time_of_the_mission(mission: Mission) -> None:
    client, sim = mission.client, mission.sim
    client.first("/step_report")
    sim.fly(RIGHT, SEARCH, SEARCH, SEARCH)
    client.until(lambda: len(client.messages["/step_report"]) >= len(sim.reports), "the reports")
    for got, published in zip(client.messages["/step_report"], sim.reports, strict=False):
        assert bytes(got.data) == bytes(published.data)
    stamp = sim.reports.last.header.stamp
    client.until(
        lambda: client.time_ns == stamp.sec * 10**9 + stamp.nanosec, "the time of the step"
    )


def test_a_topic_is_subscribed_only_while_a_client_wants_it(mission: Mission, rig: Rig) -> None:
    client = mission.client

    def listeners() -> int:
        return rig.node.count_subscribers("/drone0/odom")

    assert listeners() == 0
    client.subscribe("/drone0/odom")
    client.until(lambda: listeners() == 1, "a subscription")
    client.unsubscribe("/drone0/odom")
    client.until(lambda: listeners() == 0, "its end")


def test_a_client_that_does_not_keep_to_the_protocol_ends_nothing(mission: Mission) -> None:
    client = mission.client
    for data in ("", "garbage", b"", b"\xff\x00", b"\x01", '{"op": "subscribe"}'):
        client.send_raw(data)
    client.unsubscribe("/agents")
    assert client.first("/belief_grid").info.width == 8
    assert mission.viewer.running


def test_a_client_can_command_nothing(mission: Mission, rig: Rig) -> None:
    client = mission.client
    assert client.info["capabilities"] == ["time"]
    seen = len(mission.sim.reports)
    for i in range(DRONES):
        client.publish(f"/drone{i}/cmd_action_name", "std_msgs/msg/String", {"data": "search"})
    client.request(1, {"data": True})
    client.until(lambda: len(client.refusals) > DRONES, "a refusal of each")
    publishes = dict(rig.node.get_publisher_names_and_types_by_node("foxglove_viewer", "/"))
    assert publishes.keys() == {"/parameter_events", "/rosout"}
    assert rig.node.get_client_names_and_types_by_node("foxglove_viewer", "/") == []
    assert len(mission.sim.reports) == seen and mission.viewer.running


def test_a_viewer_of_another_mission_offers_what_all_missions_share(
    mission: Mission, rig: Rig
) -> None:
    viewer = rig.start("foxglove_viewer", {"port": 0}, "-r", "__ns:=/elsewhere")
    taken = rig.start("foxglove_viewer", {"port": mission.client.port})
    client = FoxgloveClient(rig, viewer)
    assert client.info["capabilities"] == []
    client.subscribe("/clock")
    assert "/agents" not in client.channels
    client.close()
    viewer.stop()
    assert taken.wait() == BAD_INPUT
    assert "Address already in use" in taken.output and "Traceback" not in taken.output


# The layout


def test_the_layout_has_panels_of_foxglove_with_settings_that_it_knows() -> None:
    known = {
        "3D": foxglove.layouts.ThreeDeeConfig(),
        "Plot": foxglove.layouts.PlotConfig(),
        "StateTransitions": foxglove.layouts.StateTransitionsConfig(),
        "DiagnosticSummary": foxglove.layouts.DiagnosticsSummaryConfig(),
        "RawMessages": foxglove.layouts.RawMessagesConfig(),
    }
    panels = LAYOUT["configById"]
    assert {name.partition("!")[0] for name in panels} == known.keys()
    for name, config in panels.items():
        of_panel = known[name.partition("!")[0]]._to_dict()
        assert config.keys() - {"foxglovePanelTitle"} <= of_panel.keys(), name

    def shown(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else shown(part["first"]) + shown(part["second"])

    assert sorted(shown(LAYOUT["layout"])) == sorted(panels)


def test_the_layout_shows_topics_that_there_are(mission: Mission) -> None:
    panels = LAYOUT["configById"]
    topics = set(panels["3D!map"]["topics"]) - {f"/{name}" for name in ELSEWHERE}
    for name in ("Plot!pos", "StateTransitions!nodes"):
        topics |= {path["value"].partition(".")[0] for path in panels[name]["paths"]}
    topics |= {panels["DiagnosticSummary!all"]["topicToRender"]}
    topics |= {panels["RawMessages!agents"]["topicPath"]}
    mission.client.until(lambda: topics <= mission.client.channels.keys(), "its topics")


# RViz


def displays(parts: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    for part in parts:
        yield part
        yield from displays(part.get("Displays", []))


def profile(topic: dict[str, Any]) -> QoSProfile:
    """Return the quality of service that a display or a tool is set to."""
    policies = {
        name: topic[f"{name} Policy"].upper().replace(" ", "_")
        for name in ("Reliability", "Durability")
    }
    return QoSProfile(
        depth=topic["Depth"],
        reliability=ReliabilityPolicy[policies["Reliability"]],
        durability=DurabilityPolicy[policies["Durability"]],
    )


def seen(endpoint: Any) -> QoSProfile:
    """Return the quality of service of another's endpoint, without limits of time."""
    found = endpoint.qos_profile
    return QoSProfile(depth=1, reliability=found.reliability, durability=found.durability)


SHOWN = {
    display["Topic"]["Value"]: display
    for display in displays(RVIZ["Displays"])
    if "Topic" in display
}
# Of a search on an ensemble, of drones in metres and of a planner: see below.
ELSEWHERE = {"particles"} | {
    f"drone{i}/{name}" for i in range(DRONES) for name in ("plan", "remaining_path")
}


@pytest.mark.parametrize("name", sorted(SHOWN.keys() - ELSEWHERE))
def test_a_display_of_rviz_gets_what_is_published(mission: Mission, rig: Rig, name: str) -> None:
    check_display(rig, name, "/")


def check_display(rig: Rig, name: str, namespace: str) -> None:
    """Check that the display of a topic asks for what is published."""
    display, topic = SHOWN[name], f"{namespace}{name}"
    (offer,) = rig.until(lambda: rig.node.get_publishers_info_by_topic(topic), topic)
    assert offer.topic_type == TYPES[display["Class"]]
    asked = profile(display["Topic"])
    compatible, reason = qos_check_compatible(seen(offer), asked)
    assert compatible != QoSCompatibility.ERROR, reason
    # Otherwise what was published before RViz has started would be missing.
    assert asked.durability == offer.qos_profile.durability


def test_the_displays_of_rviz_are_those_of_a_mission_and_its_vehicles() -> None:
    vehicles = {f"drone{i}/vehicle_pose" for i in range(DRONES)}
    of_all = {"probability_grid", "belief_grid", "markers", "drones"}
    assert SHOWN.keys() == of_all | vehicles | ELSEWHERE
    assert "rviz_default_plugins/TF" in {one["Class"] for one in RVIZ["Displays"]}
    assert RVIZ["Global Options"]["Fixed Frame"] == "map"


@pytest.mark.parametrize("drone", range(DRONES))
def test_a_goal_of_rviz_is_a_command(mission: Mission, rig: Rig, drone: int) -> None:
    tools = [tool for tool in RVIZ["Tools"] if tool["Class"].endswith("/SetGoal")]
    assert len(tools) == DRONES
    topic = tools[drone]["Topic"]
    assert topic["Value"] == f"drone{drone}/command_pose"

    def obeying() -> list[Any]:
        found = rig.node.get_subscriptions_info_by_topic(f"/{topic['Value']}")
        return [endpoint for endpoint in found if endpoint.node_name == "sim_node"]

    (listener,) = rig.until(obeying, "who obeys")
    assert listener.topic_type == TYPES[tools[drone]["Class"]]
    compatible, reason = qos_check_compatible(profile(topic), seen(listener))
    assert compatible != QoSCompatibility.ERROR, reason


# The sea


def test_the_particles_and_the_sea_of_an_incident_reach_a_client_and_rviz(rig: Rig) -> None:
    viewer = rig.start("foxglove_viewer", {"port": 0}, "-r", "__ns:=/kayak")
    incident = {"scenario": "kayak", "scenario.particles": 500}
    rig.sim({**incident, "publish_belief": True}, namespace="/kayak")
    client = FoxgloveClient(rig, viewer)
    try:
        cloud = client.first("/kayak/particles")
        assert cloud.width * cloud.height == 500
        assert {field.name for field in cloud.fields} >= {"x", "y", "z", "weight"}
        markers = client.first("/kayak/markers").markers
        assert {marker.ns for marker in markers} >= {"wind", "current", "shore", "lkp"}
        shown = [marker.text for marker in markers if marker.ns == "sea_names"]
        assert len(shown) == 4 and {text.split()[0] for text in shown} == {"wind", "current", "LKP"}
    finally:
        client.close()
        viewer.stop()
    check_display(rig, "particles", "/kayak/")


def test_plans_and_commanded_tracks_in_metres_reach_rviz(rig: Rig) -> None:
    rig.sim({"scenario": "kayak", "rules": "flight", "scenario.particles": 500,
             "num_drones": DRONES}, namespace="/metres")  # fmt: skip
    rig.start("planner_node", {"planner": "greedy"}, "-r", "__ns:=/metres")
    for name in sorted(ELSEWHERE - {"particles"}):
        check_display(rig, name, "/metres/")
