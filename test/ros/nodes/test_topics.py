# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the topics say about a mission, and where they are."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np
import pymap3d
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rig import BEST_EFFORT, LATCHED, RELIABLE, Inbox, Rig, Sim, occupancy, stamp_ns
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, NavSatFix
from visualization_msgs.msg import MarkerArray

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
ORIGIN = {"origin_lat": -24.04, "origin_lon": -46.17, "origin_alt": 3.5}
GRID, CELL_M, ALTITUDE_M = 20, 130.0, 120.0


@pytest.fixture(scope="module")
def node(rig: Rig) -> Sim:
    # In a namespace, with one topic under another name and others with other QoS.
    return rig.sim(
        {
            **ORIGIN,
            "grid_size": GRID,
            "cell_size": CELL_M,
            "altitude": ALTITUDE_M,
            "drones_positions": [0, 0, 19, 0, 0, 19, 19, 19],
            "person_initial_position": [5, 14],
            "vector": [1.0, -1.0],
            "sigma": 1.5,
            "probability_of_detection": 0.0,
            "timestep_limit": 1000,
            "seed": 11,
            "reveal_person": True,
            "qos_overrides./sea/drone1/pose.publisher.durability": "volatile",
            "qos_overrides./sea/drone1/pose.publisher.reliability": "best_effort",
            "qos_overrides./sea/drone1/pose.publisher.depth": 7,
            "qos_overrides./sea/joint_action.subscription.depth": 50,
        },
        "-r",
        "drones:=fleet",
        namespace="/sea",
    )


@pytest.fixture
def sim(node: Sim) -> Iterator[Sim]:
    node.set(reveal_person=True)
    node.reset()
    yield node


def peak(grid: OccupancyGrid) -> tuple[float, float]:
    """Return where in the map frame the most probable cell is."""
    values = occupancy(grid)
    row, col = np.unravel_index(int(values.argmax()), values.shape)
    origin, side = grid.info.origin.position, grid.info.resolution
    return origin.x + (col + 0.5) * side, origin.y + (row + 0.5) * side


def persons(markers: MarkerArray) -> list[tuple[float, float]]:
    found = [m.pose.position for m in markers.markers if m.ns == "persons"]
    return [(position.x, position.y) for position in found]


def markers_of(sim: Sim) -> MarkerArray:
    """Return the markers of the present step."""
    with sim.rig.listening(MarkerArray, "/sea/markers", LATCHED) as inbox:
        wanted = stamp_ns(sim.reports.last)
        sim.rig.until(lambda: inbox and stamp_ns(inbox.last.markers[0]) == wanted)
        return inbox.last


def test_a_drift_to_the_north_east_goes_to_plus_x_and_plus_y(sim: Sim) -> None:
    grids = sim.rig.listen(OccupancyGrid, "/sea/probability_grid", LATCHED)
    sim.rig.until(lambda: grids)
    start_person = persons(markers_of(sim))
    for step in range(1, 9):
        sim.fly(SEARCH, SEARCH, SEARCH, SEARCH)
        sim.rig.until(lambda step=step: len(grids) == step + 1)  # type: ignore[misc]
    first = (5.5 * CELL_M, (GRID - 14 - 0.5) * CELL_M)
    for step, grid in enumerate(grids):
        assert grid.header.frame_id == "map"
        assert (grid.info.origin.position.x, grid.info.origin.position.y) == (0.0, 0.0)
        assert grid.info.resolution == CELL_M
        assert peak(grid) == (first[0] + step * CELL_M, first[1] + step * CELL_M)
    assert start_person == [first]
    ((x, y),) = persons(markers_of(sim))
    assert x > first[0] + 2 * CELL_M and y > first[1] + 2 * CELL_M


def fixes_of(sim: Sim, *actions: int) -> list[NavSatFix]:
    """Fly a step and return the fixes of it."""
    rig = sim.rig
    with contextlib.ExitStack() as stack:
        inboxes = [
            stack.enter_context(rig.listening(NavSatFix, f"/sea/drone{i}/fix", BEST_EFFORT))
            for i in range(4)
        ]
        # Nobody keeps a fix for those who come later.
        rig.until(lambda: sim.fly(SEARCH, SEARCH, SEARCH, SEARCH) is not None and all(inboxes))
        sim.fly(*actions)

        def of_this_step() -> bool:
            rig.drain()
            stamp = stamp_ns(sim.reports.last)
            return all(stamp_ns(inbox.last) == stamp for inbox in inboxes)

        # One that is lost is not sent again: the next step's is as good, as they stay there.
        rig.until(lambda: of_this_step() or sim.fly(SEARCH, SEARCH, SEARCH, SEARCH) is None)
        return [inbox.last for inbox in inboxes]


def test_each_fix_is_the_pose_above_the_sea_within_a_centimetre(sim: Sim) -> None:
    fixes = fixes_of(sim, RIGHT, LEFT, RIGHT, LEFT)
    poses = sim.rig.first(PoseArray, "/sea/fleet").poses
    for fix, pose in zip(fixes, poses, strict=True):
        # On the sea east and north are those of the plane at the origin; up is not.
        sea_m = ORIGIN["origin_alt"]
        x, y, _ = pymap3d.geodetic2enu(fix.latitude, fix.longitude, sea_m, *ORIGIN.values())
        assert (x, y) == pytest.approx((pose.position.x, pose.position.y), abs=0.01)
        assert fix.altitude - sea_m == pytest.approx(pose.position.z, abs=0.01)
        assert pose.position.z == ALTITUDE_M


def test_up_is_north_and_left_is_west(sim: Sim) -> None:
    before = fixes_of(sim, SEARCH, SEARCH, SEARCH, SEARCH)
    after = fixes_of(sim, SEARCH, SEARCH, UP, LEFT)
    assert after[2].latitude > before[2].latitude
    assert after[3].longitude < before[3].longitude


def test_all_messages_of_a_step_have_one_stamp(sim: Sim) -> None:
    sim.fly(RIGHT, LEFT, RIGHT, LEFT)
    stamp = stamp_ns(sim.reports.last)
    first = sim.rig.first
    latched = [
        first(OccupancyGrid, "/sea/probability_grid"),
        first(Image, "/sea/probability"),
        first(PoseStamped, "/sea/drone0/pose"),
        first(PoseArray, "/sea/fleet"),
        sim.reports.last,
    ]
    assert {stamp_ns(message) for message in latched} == {stamp}
    clock, odom = sim.rig.listen(Clock, "/clock"), sim.rig.listen(Odometry, "/sea/drone0/odom")
    sim.rig.until(lambda: sim.fly(SEARCH, SEARCH, SEARCH, SEARCH) is not None and odom and clock)
    stamp = stamp_ns(sim.reports.last)
    sim.rig.until(lambda: stamp_ns(odom.last) == stamp)
    sim.rig.until(lambda: clock.last.clock == odom.last.header.stamp)


def test_names_follow_the_namespace_and_the_remaps(sim: Sim) -> None:
    topics = {
        "/sea/probability_grid": "nav_msgs/msg/OccupancyGrid",
        "/sea/probability": "sensor_msgs/msg/Image",
        "/sea/drone3/pose": "geometry_msgs/msg/PoseStamped",
        "/sea/drone3/odom": "nav_msgs/msg/Odometry",
        "/sea/drone3/fix": "sensor_msgs/msg/NavSatFix",
        "/sea/drone3/path": "nav_msgs/msg/Path",
        "/sea/fleet": "geometry_msgs/msg/PoseArray",
        "/sea/step_report": "sensor_msgs/msg/PointCloud2",
        "/sea/mission_report": "sensor_msgs/msg/PointCloud2",
        "/sea/agents": "std_msgs/msg/String",
        "/sea/markers": "visualization_msgs/msg/MarkerArray",
        "/clock": "rosgraph_msgs/msg/Clock",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
        "/sea/drone3/cmd_action_name": "std_msgs/msg/String",
        "/sea/drone3/command_pose": "geometry_msgs/msg/PoseStamped",
        "/sea/joint_action": "std_msgs/msg/Int32MultiArray",
    }
    services = {
        "/sea/sim_node/reset": "std_srvs/srv/Trigger",
        "/sea/sim_node/step": "std_srvs/srv/Trigger",
        "/sea/sim_node/pause": "std_srvs/srv/SetBool",
    }
    node = sim.rig.node
    # They are discovered one by one.
    for wanted, found in (
        (topics, node.get_topic_names_and_types),
        (services, node.get_service_names_and_types),
    ):
        listed = {(name, (kind,)) for name, kind in wanted.items()}
        sim.rig.until(
            lambda listed=listed, found=found: listed <= {(n, tuple(k)) for n, k in found()},  # type: ignore[misc]
            f"{listed}",
        )
    assert "/sea/drones" not in dict(node.get_topic_names_and_types())
    assert (
        sim.rig.first(DiagnosticArray, "/diagnostics", RELIABLE).status[0].name
        == "dsse_ros: sea/sim_node"
    )


def test_the_qos_is_that_of_the_interface_but_where_it_is_overridden(sim: Sim) -> None:
    def of(topic: str) -> tuple[str, str]:
        (info,) = sim.rig.until(lambda: sim.rig.node.get_publishers_info_by_topic(topic), topic)
        return info.qos_profile.reliability.name, info.qos_profile.durability.name

    latched, reliable = ("RELIABLE", "TRANSIENT_LOCAL"), ("RELIABLE", "VOLATILE")
    best_effort = ("BEST_EFFORT", "VOLATILE")
    assert of("/sea/drone1/pose") == best_effort
    for topic in ("drone0/pose", "drone2/pose", "drone1/path", "agents", "fleet"):
        assert of(f"/sea/{topic}") == latched
    for topic in ("probability_grid", "probability", "markers", "step_report", "mission_report"):
        assert of(f"/sea/{topic}") == latched
    assert of("/sea/drone1/odom") == of("/clock") == of("/diagnostics") == reliable
    assert of("/sea/drone1/fix") == best_effort
    (name,) = (n for n in sim.parameters() if "joint_action" in n)
    assert sim.get(name) == [50]
    assert sim.parameters()[name].read_only and sim.parameters()[name].description


def test_tracks_go_to_listeners_and_to_late_joiners(sim: Sim) -> None:
    def track(message: Path) -> list[tuple[float, float]]:
        return [(p.pose.position.x / CELL_M, p.pose.position.y / CELL_M) for p in message.poses]

    def current(inbox: Inbox) -> bool:
        return bool(inbox) and stamp_ns(inbox.last) == stamp_ns(sim.reports.last)

    for _ in range(3):
        sim.fly(RIGHT, SEARCH, SEARCH, SEARCH)
    expected = [(c + 0.5, 19.5) for c in range(4)]
    with sim.rig.listening(Path, "/sea/drone0/path", LATCHED) as early:
        sim.rig.until(lambda: current(early))
        assert track(early.last) == expected
        with sim.rig.listening(Path, "/sea/drone0/path", LATCHED) as late:
            sim.rig.until(lambda: current(late))
            assert late.last == early.last
    for _ in range(2):
        sim.fly(DOWN, SEARCH, SEARCH, SEARCH)
    with sim.rig.listening(Path, "/sea/drone0/path", LATCHED) as later:
        sim.rig.until(lambda: current(later))
        assert track(later.last) == [*expected, (3.5, 18.5), (3.5, 17.5)]


def test_nobody_listens_and_no_track_is_sent(sim: Sim) -> None:
    # A listener that comes after some steps gets the present track first: none waited for it.
    stamps = []
    for _ in range(3):
        sim.fly(SEARCH, DOWN, SEARCH, SEARCH)
        stamps.append(stamp_ns(sim.reports.last))
    with sim.rig.listening(Path, "/sea/drone1/path", LATCHED) as inbox:
        sim.rig.until(lambda: inbox)
        assert stamp_ns(inbox[0]) == stamps[-1]
        assert len(inbox[0].poses) == 4


def test_the_person_is_shown_only_where_that_is_asked_for(sim: Sim) -> None:
    with sim.rig.listening(MarkerArray, "/sea/markers", LATCHED) as inbox:
        sim.rig.until(lambda: inbox and persons(inbox.last))
        sim.set(reveal_person=False)
        sim.rig.until(lambda: not persons(inbox.last))
        assert {m.ns for m in inbox.last.markers} >= {"drones", "names", "datum"}
        sim.set(reveal_person=True)
        sim.rig.until(lambda: persons(inbox.last))


def test_drones_out_of_the_search_stay_in_every_message(sim: Sim) -> None:
    report = sim.fly(LEFT, RIGHT, SEARCH, SEARCH)
    assert report["terminated"].tolist() == [1, 1, 0, 0]
    assert len(sim.rig.first(PoseArray, "/sea/fleet").poses) == 4
    assert len(report) == 4
