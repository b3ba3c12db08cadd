# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which run and which mission a message is of, and the report of a whole mission."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rig import ALL, Rig, Sim, stamp_ns, steps_of
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from dsse_ros.world.scenario.agents import AgentsInfo, agents_from_json
from msg_adapters.mission_report import mission_report_from_message
from msg_adapters.step_report import step_report_from_message

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
FIELDS: dict[str, Any] = {
    "grid_size": 9,
    "drones_positions": [0, 0, 4, 4],
    "person_initial_position": [8, 8],
    "probability_of_detection": 0.0,
    "timestep_limit": 6,
    "seed": 5,
}
STEP_NS = 13 * 10**9


def agents(sim: Sim) -> AgentsInfo:
    return agents_from_json(sim.rig.first(String, sim.topic("agents")).data)


def mission_report(sim: Sim) -> Any:
    """Return the report of the mission for one who comes when it has ended."""
    message = sim.rig.first(PointCloud2, sim.topic("mission_report"))
    report = mission_report_from_message(message)
    assert stamp_ns(message) == stamp_ns(sim.reports.last)
    assert {(int(r), int(m)) for r, m in report[["run_id", "mission"]].flat} == {sim.search}
    return report


def assert_is_what_was_reported(report: Any, sim: Sim) -> None:
    """Hold a mission report to the step reports of the mission, the last of each step."""
    steps = {}
    for message in sim.reports:
        published = step_report_from_message(message)
        if int(published["mission"][0]) == sim.search[1]:
            steps[int(published["step"][0])] = published
    assert sorted(steps) == list(range(len(report)))
    for step, published in steps.items():
        for name in report.dtype.names:
            assert report[step][name].tobytes() == published[name].tobytes(), (step, name)


def test_every_start_is_a_run_of_its_own_and_the_steps_are_the_same(rig: Rig) -> None:
    first, other = (rig.sim(FIELDS, namespace=f"/drawn{i}") for i in range(2))
    for sim in (first, other):
        for _ in range(3):
            sim.fly(RIGHT, DOWN)
    assert first.search[0] != other.search[0] and min(first.search[0], other.search[0]) > 0
    assert first.search[1] == other.search[1] == 1
    for sim in (first, other):
        info = agents(sim)
        assert (info.run_id, info.mission) == sim.search
        assert sim.health()["run_id"] == str(sim.search[0])
    assert steps_of(first.reports) == steps_of(other.reports)


def test_the_run_can_be_fixed_and_a_reset_is_its_next_mission(rig: Rig) -> None:
    sim = rig.sim(FIELDS | {"run_id": 2**32 - 1}, namespace="/fixed")
    assert sim.search == (2**32 - 1, 1)
    sim.reset()
    assert sim.search == (2**32 - 1, 2)
    rig.until(lambda: agents(sim).mission == 2)
    assert agents(sim).run_id == 2**32 - 1


def test_a_resend_that_comes_after_a_reset_is_no_command_of_the_next_mission(rig: Rig) -> None:
    sim = rig.sim(FIELDS, namespace="/resent")
    sim.joint(RIGHT, DOWN, mission=1)
    sim.rig.until(lambda: sim.step_number == 1)
    sim.reset()
    sim.joint(LEFT, DOWN, mission=1, step=0)
    assert sim.health_after("stale_mission")["step"] == "0"
    sim.joint(RIGHT, DOWN, mission=2)
    rig.until(lambda: sim.step_number == 1, "the step that is commanded by mission")


def test_a_mission_that_ends_is_reported_whole_however_it_ends(rig: Rig) -> None:
    sim = rig.sim(FIELDS, namespace="/ends")
    reports = rig.listen(PointCloud2, "/ends/mission_report", ALL)
    # Out of time.
    while sim.flying:
        sim.fly(RIGHT if sim.step_number < 5 else SEARCH, SEARCH)
    report = mission_report(sim)
    assert len(report) == sim.step_number + 1 and report["truncated"][-1].all()
    assert_is_what_was_reported(report, sim)
    sim.rig.until(
        lambda: "mission 1 over after 6 steps: out of time" in sim.process.output, "the line"
    )
    # No drone left.
    sim.reset()
    sim.fly(RIGHT, UP)
    for _ in range(4):
        if sim.flying:
            sim.fly(UP, UP)
    rig.until(lambda: len(reports) == 2, "the second report")
    assert_is_what_was_reported(mission_report(sim), sim)
    # Aborted.
    sim.reset()
    sim.fly(RIGHT, DOWN)
    sim.set(missing_action="abort")
    sim.set(command_timeout=0.05)
    rig.until(lambda: len(reports) == 3, "the third report")
    sim.set(command_timeout=0.0)
    report = mission_report(sim)
    assert len(report) == 2 and not report["terminated"].any()
    sim.rig.until(lambda: "mission 3 over after 1 step: aborted" in sim.process.output, "the line")
    # A mission that a reset cuts short has not ended.
    sim.reset()
    sim.reset()
    sim.wait_until_quiet()
    assert len(reports) == 3


def test_a_mission_that_is_resumed_at_its_end_is_reported_whole_as_another_run(
    rig: Rig, tmp_path: Path
) -> None:
    files = {"snapshot_file": f"{tmp_path}/end", "snapshot_every": 1}
    ended = rig.sim(FIELDS | files, namespace="/before")
    while ended.flying:
        ended.fly(RIGHT, LEFT)
    before = mission_report(ended)
    ended.process.kill()
    resumed = rig.sim(FIELDS | files | {"resume": True}, namespace="/after")
    after = mission_report(resumed)
    assert resumed.search[0] != ended.search[0] and resumed.search[1] == ended.search[1]
    assert len(after) == len(before) > 1
    for name in set(after.dtype.names) - {"run_id"}:
        assert np.array_equal(after[name], before[name])


def test_who_comes_late_gets_every_step(rig: Rig) -> None:
    sim = rig.sim(FIELDS | {"timestep_limit": 1000}, namespace="/late")
    for _ in range(130):
        sim.fly(SEARCH, SEARCH)
    with rig.listening(PointCloud2, "/late/step_report", ALL) as late:
        rig.until(lambda: late and late.last == sim.reports.last, "the last report")
        steps = [int(step_report_from_message(message)["step"][0]) for message in late]
    assert steps == list(range(131))
