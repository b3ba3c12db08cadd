# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A simulation that ends by itself, and what its listeners have then."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nav_msgs.msg import Path as PathMessage
from rig import LATCHED, Rig
from sensor_msgs.msg import Image

from dsse_ros.results.report.logs import read_csv
from msg_adapters.step_report import step_report_from_message

SHORT: dict[str, Any] = {
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
    end = sim.reports.last.header.stamp
    for inbox in (maps, paths):
        rig.until(lambda inbox=inbox: inbox and inbox.last.header.stamp == end)  # type: ignore[misc]
    assert read_csv(csv)[-1].complete


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
    # From here on the service is known.
    sim.reset()
    ended = 0
    for _ in range(3):
        while sim.step_number < SHORT["timestep_limit"]:
            sim.fly(4, 4)
        # Right behind the last command: from the last step on the node stays for little more.
        seen = len(sim.reports)
        sim.joint(4, 4)
        assert sim.reset()["step"][0] == 0
        ended += bool(step_report_from_message(sim.reports[seen])["truncated"].all())
    assert ended
    sim.set(exit_at_end=False)
    while sim.flying:
        sim.fly(4, 4)
    sim.wait_until_quiet()
    assert sim.process.running
    sim.set(exit_at_end=True)
    assert sim.process.wait() == 0
