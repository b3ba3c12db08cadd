# SPDX-License-Identifier: Apache-2.0
"""A simulation that ends by itself, and what its listeners have then."""

from __future__ import annotations

from pathlib import Path

from nav_msgs.msg import Path as PathMessage
from rig import LATCHED, Rig
from sensor_msgs.msg import Image

from dsse_ros.mission.mission_log import read_log
from msg_adapters.stamps import to_nanoseconds

SHORT = {
    "num_drones": 2, "grid_size": 6, "probability_of_detection": 0.0, "timestep_limit": 5,
    "seed": 1, "exit_at_end": True,
}  # fmt: skip


def test_a_node_ends_with_its_mission_and_its_listeners_have_all_of_it(
    rig: Rig, tmp_path: Path
) -> None:
    maps = rig.listen(Image, "/end/probability", LATCHED)
    paths = rig.listen(PathMessage, "/end/drone0/path", LATCHED)
    csv = tmp_path / "mission.csv"
    sim = rig.sim(SHORT | {"record_file": str(csv)}, namespace="/end")
    while sim.flying:
        sim.fly(4, 4)
    rig.until(lambda: not sim.process.running, "the end of the node")
    assert sim.process.wait() == 0
    assert "Traceback" not in sim.process.output
    # All that it has sent is here, and the last of each topic is of the end.
    rig.until(lambda: maps and paths and to_nanoseconds(maps.last.header.stamp) > 0)
    end_ns = to_nanoseconds(sim.reports.last.header.stamp)
    assert to_nanoseconds(maps.last.header.stamp) == end_ns
    assert to_nanoseconds(paths.last.header.stamp) == end_ns
    assert not read_log(csv).alive.any()


def test_a_mission_that_another_follows_is_no_end(rig: Rig) -> None:
    sim = rig.sim(SHORT | {"auto_reset": True}, namespace="/series")
    missions = 0
    for _ in range(3 * 7):
        report = sim.fly(4, 4)
        missions += int(report["step"][0]) == 0
    assert missions >= 2 and sim.process.running
    # And the last one of a series ends it.
    sim.set(auto_reset=False)
    while sim.flying:
        sim.fly(4, 4)
    assert sim.process.wait() == 0


def test_a_reset_in_time_keeps_the_node(rig: Rig) -> None:
    sim = rig.sim(SHORT, namespace="/again")
    for _ in range(3):
        while sim.flying:
            sim.fly(4, 4)
        assert sim.reset()["step"][0] == 0
    sim.set(exit_at_end=False)
    while sim.flying:
        sim.fly(4, 4)
    sim.wait_until_quiet()
    assert sim.process.running
    sim.set(exit_at_end=True)
    assert sim.process.wait() == 0
