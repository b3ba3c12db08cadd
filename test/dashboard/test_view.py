# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a page is sent: all of it once, then what is new."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from PIL import Image
from played import Played, Step

from dsse_ros.dashboard.inbox import Received
from dsse_ros.dashboard.map_image import MAX_SIDE, map_png
from dsse_ros.dashboard.missions import Missions
from dsse_ros.dashboard.view import PageView
from msg_adapters.geodesy import cell_to_geodetic
from msg_adapters.occupancy import occupancy_to_array
from msg_adapters.poses import pose_stamped
from msg_adapters.stamps import to_stamp

FIELDS = {"grid_size": 7, "num_drones": 3, "sigma": 2.0, "timestep_limit": 25}


class Shown:
    """A page, and the browser that draws its frames."""

    def __init__(self, **fields: Any) -> None:
        self.played = Played(**fields or FIELDS)
        self.missions = Missions()
        self.view = PageView(self.missions)
        self.rows: list[list[int]] = []
        self.image: bytes | None = None

    def receive(self, topic: str, message: Any, namespace: str = "") -> None:
        self.missions.take([Received(namespace, topic, lambda: message)])

    def take(self, step: Step) -> None:
        self.receive("agents", self.played.agents)
        for topic, message in step.messages.items():
            self.receive(topic, message)

    def draw(self) -> dict[str, Any] | None:
        """What mission_map.js does."""
        frame = self.view.frame()
        if frame is not None:
            self.rows[frame["first"] :] = frame["rows"]
            if "image" in frame:
                _, _, data = (frame["image"] or ",").partition(",")
                self.image = base64.b64decode(data) or None
        return frame


@pytest.fixture
def page() -> Shown:
    return Shown()


def pixels(png: bytes) -> np.ndarray[Any, Any]:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))


def test_steps_are_sent_once_and_all_are_there(page: Shown) -> None:
    cells = []
    for step in page.played.play(3, steps=6):
        page.take(step)
        cells.append(step.cells.tolist())
        frame = page.draw()
        assert frame is not None and frame["shown"] == step.number and len(frame["rows"]) == 1
        assert page.image == map_png(occupancy_to_array(step.messages["belief_grid"]))
        assert page.draw() is None
    assert [np.array(row[1:10]).reshape(-1, 3)[:, :2].tolist() for row in page.rows] == cells
    # A browser that has lost all of it, as after a reload.
    page.view.forget_sent()
    page.rows.clear()
    frame = page.draw()
    assert frame is not None and frame["first"] == 0 and len(page.rows) == len(cells)


def test_an_earlier_step_is_shown_with_its_map_while_the_mission_goes_on(page: Shown) -> None:
    steps = []
    for step in page.played.play(3, steps=8):
        page.take(step)
        steps.append(step)
        if step.number == 5:
            page.draw()
            page.view.step = 2
    frame = page.draw()
    assert frame is not None and frame["shown"] == 2
    assert page.image == map_png(occupancy_to_array(steps[2].messages["belief_grid"]))
    assert "step 2 of" in page.view.headline() and f"POS {steps[2].pos:.1%}" in page.view.headline()
    for (col, row), line in zip(
        steps[2].cells.tolist(), page.view.drones_table().split("<tr>")[2:], strict=True
    ):
        assert f"<td>{col}, {row}</td>" in line
    page.view.step = None
    frame = page.draw()
    assert frame is not None and frame["shown"] == steps[-1].number


def test_where_all_is_covered_no_drone_is_lost_and_each_cell_entered_is_searched(
    tmp_path: Path,
) -> None:
    matrix = np.zeros((5, 5))
    matrix[2, 1:4] = 1.0
    file = tmp_path / "matrix.npy"
    np.save(file, matrix)
    page = Shown(rules="coverage", probability_matrix=file, num_drones=2, timestep_limit=400)
    for step in page.played.play(1):
        page.take(step)
    assert step.number < 400
    for _ in range(2):
        page.draw()
        assert "search over: all covered" in page.view.headline()
        assert "lost" not in page.view.drones_table()
        page.receive("mission_report", page.played.mission_report)
    entered = [[*row[1:3], *row[4:6]] for row in page.rows]
    assert page.rows[0][7:] == [] and [row[7:] for row in page.rows[1:]] == entered[1:]


def test_the_map_or_the_belief_is_shown(page: Shown) -> None:
    (step,) = page.played.play(3, steps=0)
    page.take(step)
    for layer in ("probability_grid", "belief_grid"):
        page.view.layer = layer
        page.draw()
        assert page.image == map_png(occupancy_to_array(step.messages[layer]))


def test_a_page_says_what_it_waits_for(page: Shown) -> None:
    assert "Waiting for a simulation" in page.view.waiting()
    frame = page.draw()
    assert frame is not None and frame["grid"] == 0
    page.receive("publishers", 1)
    assert "Waiting for the first step_report in /" in page.view.waiting()
    (step,) = page.played.play(3, steps=0)
    page.receive("step_report", step.messages["step_report"])
    assert "Waiting for agents" in page.view.waiting()
    page.take(step)
    assert page.view.waiting() == ""
    page.receive("publishers", 0)
    assert "is gone" in page.view.waiting()
    page.receive("publishers", 2)
    assert "missions are mixed" in page.view.trouble()


def test_the_place_of_a_cell_is_that_of_the_messages(page: Shown) -> None:
    (step,) = page.played.play(3, steps=0)
    page.take(step)
    text = page.view.place((6, 0))
    lat, lon, _ = cell_to_geodetic(page.played.frame, 6, 0, 0.0)
    found = re.search(r"cell 6, 0: ([\d.]+)° ([NS]), ([\d.]+)° ([EW])", text)
    assert found is not None
    assert float(found[1]) * (1 if found[2] == "N" else -1) == pytest.approx(lat, abs=1e-6)
    assert float(found[3]) * (1 if found[4] == "E" else -1) == pytest.approx(lon, abs=1e-6)


def test_vehicles_are_shown_where_they_are_and_never_in_an_earlier_step(page: Shown) -> None:
    for step in page.played.play(3, steps=2):
        page.take(step)
    page.receive("drone1/vehicle_pose", pose_stamped(page.played.frame, (4, 2), to_stamp(0)))
    status = DiagnosticStatus(name="drone1", message="no <heartbeat>", level=DiagnosticStatus.WARN)
    page.receive("drone1/vehicle_state", DiagnosticArray(status=[status]))
    frame = page.draw()
    assert frame is not None
    ((drone, col, row),) = frame["vehicles"]
    assert (drone, col, row) == (1, pytest.approx(4), pytest.approx(2))
    assert '<td class="level-warn">no &lt;heartbeat&gt;</td>' in page.view.drones_table()
    page.view.step = 0
    frame = page.draw()
    assert frame is not None and frame["vehicles"] == []


def test_whether_it_is_paused_is_what_the_simulation_reports(page: Shown) -> None:
    page.receive("publishers", 1)
    mission = page.view.mission
    assert mission is not None
    for message, paused in (("paused; drone1 lost", True), ("running", False), ("stopped", True)):
        page.receive("diagnostics", DiagnosticStatus(message=message))
        assert mission.paused == paused and mission.state == message


def test_the_map_is_one_pixel_a_cell_and_bluer_where_it_is_likelier() -> None:
    occupancy = np.array([[0, 1, 50], [99, 100, -1], [0, 0, 0]], dtype=np.int8)
    image = pixels(map_png(occupancy))
    assert image.shape == (3, 3, 4)
    opaque = image[..., 3].astype(int)
    assert opaque[0, 0] == 0 < opaque[0, 1] < opaque[0, 2] < opaque[1, 0] < opaque[1, 1] == 255
    # What is not searched has another colour.
    assert tuple(image[1, 2, :3]) != tuple(image[1, 1, :3])


def test_a_large_map_is_shrunk_and_loses_no_peak() -> None:
    occupancy = np.zeros((1000, 1000), dtype=np.int8)
    occupancy[777, 123] = 100
    image = pixels(map_png(occupancy))
    assert image.shape[0] <= MAX_SIDE and (image[..., 3] == 255).sum() == 1
    row, col = np.argwhere(image[..., 3] == 255)[0]
    assert (row, col) == (777 * image.shape[0] // 1000, 123 * image.shape[1] // 1000)
