# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A live search over topics: each input is answered, and a confirmed contact ends the search."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rig import LATCHED, RELIABLE, Rig, cells
from sensor_msgs.msg import Image
from std_msgs.msg import Float64MultiArray, String
from visualization_msgs.msg import MarkerArray

from dsse_ros.world.scenario.agents import agents_from_json
from dsse_ros.world.scenario.frames import cell_to_map
from msg_adapters.images import image_to_probability
from msg_adapters.step_report import step_report_from_message

POS = "/probability_of_success"
INCIDENT = {
    "object": "PIW-1", "search_start": "2026-01-17T14:00Z", "wind": {"speed": 4, "from": 90},
    "seen": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:50Z", "radius": 100},
}  # fmt: skip
FIELDS: dict[str, Any] = {
    "scenario.incident": json.dumps(INCIDENT), "particles": 500, "num_drones": 2, "seed": 1,
    "truth": "none", "timestep_limit": 40, "step_rate": 0.0,
}  # fmt: skip


def test_every_input_is_answered_and_a_confirmed_contact_ends_the_search(rig: Rig) -> None:
    sim = rig.sim(FIELDS)
    answers, contacts = (
        rig.listen(String, "/live/answers"),
        rig.listen(String, "/live/contacts", LATCHED),
    )
    markers = rig.listen(MarkerArray, "/live/contact_markers", LATCHED)

    def put(kind: str, text: str) -> dict[str, Any]:
        answers.clear()
        rig.talk(String, f"/live/{kind}", RELIABLE).publish(String(data=text))
        rig.until(lambda: answers and json.loads(answers.last.data)["kind"] == kind)
        answer: dict[str, Any] = json.loads(answers.last.data)
        return answer

    sim.fly(0, 0)
    area = {"type": "Polygon", "coordinates": [[[-47, -25], [-46, -25], [-46, -23], [-47, -23]]]}
    area["coordinates"][0].append([-47, -25])  # type: ignore[index]
    searched = put("searched", json.dumps({"id": "heli", "geometry": area, "pod": 0.5}))
    assert searched["ok"] and searched["pos_after"] - searched["pos_before"] > 0.4
    assert put("weather", '{"id": "w", "wind": {"speed": 9}}')["code"] == "bad_value"
    assert put("detection", "{")["code"] == "bad_json"
    pose = PoseWithCovarianceStamped()
    pose.header.frame_id, pose.header.stamp = "map", sim.reports.last.header.stamp
    pose.pose.pose.position.x = pose.pose.pose.position.y = 400.0
    pose.pose.covariance[0] = pose.pose.covariance[7] = 900.0
    rig.talk(PoseWithCovarianceStamped, "/drone1/detection_pose", RELIABLE).publish(pose)
    rig.until(lambda: contacts and json.loads(contacts.last.data))
    (contact,) = json.loads(contacts.last.data)
    assert (contact["contact"], contact["state"], contact["radius"]) == ("c1", "open", 30.0)
    assert contact["drones"] == ["drone1"]
    assert 0.0 < contact["probability"] < 1.0
    rig.until(lambda: len(markers.last.markers) == 3)
    assert put("confirm", '{"id": "yes", "contact": "c1"}')["ok"]
    rig.until(lambda: not sim.flying)
    assert put("dismiss", '{"id": "no", "contact": "c1"}')["code"] == "mission_over"
    assert sim.process.running
    sim.reset()
    assert put("confirm", '{"id": "yes", "contact": "c1"}')["code"] == "unknown_contact"


def test_planners_that_come_later_fly_to_what_was_detected_on_the_map_and_in_the_belief(
    rig: Rig,
) -> None:
    wide = {**INCIDENT, "seen": {**INCIDENT["seen"], "radius": 600}}  # type: ignore[dict-item]
    fields = {**FIELDS, "scenario.incident": json.dumps(wide), "num_drones": 1, "grid_size": 15}
    fields["particles"] = 2000
    goals = {"belief": (5, 8), "greedy": (10, 8)}
    for planner, goal in goals.items():
        given = {**fields, "drones_positions": [7, 7]}
        sim = rig.sim(given, namespace=f"/{planner}")
        frame = agents_from_json(rig.first(String, sim.topic("agents")).data).frame
        x, y = cell_to_map(frame, *map(float, goal))
        found = {"id": "d", "x": x, "y": y, "radius": 50.0, "confidence": 0.95}
        maps = rig.listen(Image, sim.topic("probability"), LATCHED)
        rig.until(lambda maps=maps: maps)  # type: ignore[misc]
        sim.talk(String, "live/detection").publish(String(data=json.dumps(found)))
        # Answers are there for late clients, too.
        answer = json.loads(rig.first(String, sim.topic("live/answers")).data)
        assert (answer["ok"], (answer["run_id"], answer["mission"])) == (True, sim.search)
        rig.until(lambda maps=maps: len(maps) > 1)  # type: ignore[misc]
        likely = image_to_probability(maps.last)
        row, col = divmod(int(likely.argmax()), len(likely))
        assert max(abs(col - goal[0]), abs(row - goal[1])) <= 1
        rig.start("planner_node", {"planner": planner}, "-r", f"__ns:=/{planner}")
        rig.until(lambda sim=sim: sim.step_number >= 4)  # type: ignore[misc]
        reports = map(step_report_from_message, sim.reports)
        (end,) = cells(next(report for report in reports if report["step"][0] == 4))
        assert max(abs(end[0] - goal[0]), abs(end[1] - goal[1])) <= 1


@pytest.mark.slow
def test_a_node_that_is_killed_continues_from_its_journal(rig: Rig, tmp_path: Path) -> None:
    fields = {
        **FIELDS, "journal": str(tmp_path / "journal.mcap"), "grid_size": 15,
        "drones_positions": [7, 7, 8, 8],
    }  # fmt: skip
    answers = rig.listen(String, "/kept/live/answers")
    pos = rig.listen(Float64MultiArray, f"/kept{POS}", LATCHED)
    found = '{"id": "d", "x": 400, "y": 400, "radius": 30}'
    known = []
    for restarted in (False, True):
        sim = rig.sim(fields, namespace="/kept")
        known.append((sim.step_number, sim.cells))
        if not restarted:
            sim.fly(1, 1)
            sim.fly(2, 2)
            rig.until(lambda sim=sim: sim.step_number == 2)  # type: ignore[misc]
            known.append((sim.step_number, sim.cells))
        seen = len(answers)
        sim.talk(String, "live/detection").publish(String(data=found))
        rig.until(lambda seen=seen: len(answers) > seen)  # type: ignore[misc]
        assert json.loads(answers.last.data)["code"] == ("again" if restarted else "")
        known.append(list(pos.last.data[1:]))
        sim.kill()
    start, flown, before, resumed, after = known
    assert start[0] == 0 and flown[0] == 2 and resumed == flown and after == before


def test_a_live_search_runs_in_real_time_and_states_its_pod_unless_others_are_stated(
    rig: Rig,
) -> None:
    stated = {key: value for key, value in FIELDS.items() if key != "step_rate"}
    default = rig.sim(stated, namespace="/real")
    info = agents_from_json(rig.first(String, default.topic("agents")).data)
    step_s = info.step_duration_s
    assert default.get("step_rate") == pytest.approx([1.0 / step_s])
    log = default.process.output
    assert f"a live search takes {step_s:g} s for a step" in log
    assert "probability_of_detection is 0.5, the default of a live search" in log
    other = rig.sim(FIELDS | {"scenario.probability_of_detection": 1.0}, namespace="/other")
    assert other.get("step_rate") == [0.0]
    log = other.process.output
    assert "a live search takes" not in log and "excludes its place" in log
