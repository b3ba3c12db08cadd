# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A live search over topics: each input is answered, and a confirmed contact ends the search."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rig import LATCHED, RELIABLE, Rig
from std_msgs.msg import Float64MultiArray, String
from visualization_msgs.msg import MarkerArray

POS = "/probability_of_success"
INCIDENT = {
    "object": "PIW-1", "search_start": "2026-01-17T14:00Z", "wind": {"speed": 4, "from": 90},
    "seen": {"lat": -24.0, "lon": -46.3, "time": "2026-01-17T13:50Z", "radius": 100},
}  # fmt: skip
FIELDS: dict[str, Any] = {
    "scenario.incident": json.dumps(INCIDENT), "particles": 500, "num_drones": 2, "seed": 1,
    "truth": "none", "timestep_limit": 40,
}  # fmt: skip


def test_every_input_is_answered_and_a_confirmed_contact_ends_the_search(rig: Rig) -> None:
    sim = rig.sim(FIELDS)
    answers, contacts = (
        rig.listen(String, "/live/answers"),
        rig.listen(String, "/live/contacts", LATCHED),
    )
    markers = rig.listen(MarkerArray, "/live/contact_markers", LATCHED)

    def put(kind: str, text: str) -> dict[str, Any]:
        before = len(answers)
        rig.talk(String, f"/live/{kind}", RELIABLE).publish(String(data=text))
        rig.until(lambda: len(answers) > before)
        answer: dict[str, Any] = json.loads(answers.last.data)
        assert answer["kind"] == kind
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
    rig.talk(PoseWithCovarianceStamped, "/live/detection_pose", RELIABLE).publish(pose)
    rig.until(lambda: contacts and json.loads(contacts.last.data))
    (contact,) = json.loads(contacts.last.data)
    assert (contact["contact"], contact["state"], contact["radius"]) == ("c1", "open", 30.0)
    assert 0.0 < contact["probability"] < 1.0
    rig.until(lambda: len(markers.last.markers) == 3)
    assert put("confirm", '{"id": "yes", "contact": "c1"}')["ok"]
    rig.until(lambda: not sim.flying)
    assert put("dismiss", '{"id": "no", "contact": "c1"}')["code"] == "mission_over"
    assert sim.process.running
    sim.reset()
    assert put("confirm", '{"id": "yes", "contact": "c1"}')["code"] == "unknown_contact"


@pytest.mark.slow
def test_a_node_that_is_killed_continues_from_its_journal(rig: Rig, tmp_path: Path) -> None:
    given = {
        **FIELDS, "journal": str(tmp_path / "journal.mcap"), "grid_size": 15,
        "drones_positions": [7, 7, 8, 8],
    }  # fmt: skip
    answers = rig.listen(String, "/kept/live/answers")
    pos = rig.listen(Float64MultiArray, f"/kept{POS}", LATCHED)
    found = '{"id": "d", "x": 400, "y": 400, "radius": 30}'
    known = []
    for restarted in (False, True):
        sim = rig.sim(given, namespace="/kept")
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
