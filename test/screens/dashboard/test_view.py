# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a page is sent: all of it once, then what is new."""

from __future__ import annotations

import base64
import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nicegui import json
from PIL import Image
from played import Played, Step

from dsse_ros.screens.dashboard.inbox import Received
from dsse_ros.screens.dashboard.map_chart import Window
from dsse_ros.screens.dashboard.map_image import MAX_SIDE, map_png
from dsse_ros.screens.dashboard.missions import ShownMissions
from dsse_ros.screens.dashboard.view import MAX_ROWS, PageView
from dsse_ros.search.environments.metres_drones import strips_of
from dsse_ros.world.scenario.frames import map_positions
from dsse_ros.world.scenario.geodesy import cell_to_geodetic, map_to_geodetic
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.searchers import registry
from dsse_ros.world.searchers.searcher import Searcher
from msg_adapters.images import probability_image
from msg_adapters.occupancy import occupancy_to_array
from msg_adapters.poses import pose_stamped
from msg_adapters.stamps import header, to_stamp

FIELDS = {"grid_size": 7, "num_drones": 3, "sigma": 2.0, "timestep_limit": 25}


class Shown:
    """A page, and the browser that draws its frames."""

    def __init__(self, **fields: Any) -> None:
        self.played = Played(**fields or FIELDS)
        self.missions = ShownMissions()
        self.view = PageView(self.missions)
        self.rows: list[list[Any]] = []
        self.image: bytes | None = None

    @property
    def resolved(self) -> ResolvedScenario:
        """The scenario of the search."""
        return self.played.env.scenario.resolve(self.played.env.rules)

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
            # NiceGUI sends it with a serializer of its own, which knows fewer types.
            frame = json.loads(json.dumps(frame))
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


def test_a_replay_shows_each_step_at_its_speed_and_ends_live(page: Shown) -> None:
    for step in page.played.play(3, steps=6):
        page.take(step)
    view, shown = page.view, []
    view.rate = 4
    view.advance(10.0)
    assert view.step is None
    view.play()
    while view.playing:
        shown.append(view.step)
        view.advance(0.25)
    assert shown == [0, 1, 2, 3, 4, 5][: step.number] and view.step is None
    view.seek(2)
    view.play()
    view.advance(0.3)
    view.advance(0.3)
    assert view.step == 4
    view.seek(1)
    view.advance(9.0)
    assert view.step == 1


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
        assert f"all covered after {step.number} steps, coverage rate 100" in page.view.headline()
        assert "POS" not in page.view.headline() and page.view.pos_line()[-1][1] == 100.0
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
    assert frame is not None and frame["grid"] == [0, 0]
    page.receive("publishers", 1)
    assert "Waiting for the first step_report in /" in page.view.waiting()
    (step,) = page.played.play(3, steps=0)
    page.receive("step_report", step.messages["step_report"])
    assert "Waiting for agents" in page.view.waiting()
    page.take(step)
    assert page.view.waiting() == ""
    page.receive("publishers", 0)
    assert "is gone" in page.view.waiting()


def test_two_runs_are_mixed_only_if_both_go_on(page: Shown) -> None:
    other = Played(run_id=78, **FIELDS)
    page.receive("publishers", 2)
    page.receive("diagnostics", DiagnosticStatus(message="running; 2 nodes publish step_report"))
    runs = [[*played.play(3, steps=1)] for played in (page.played, other)]
    for step in (runs[0][0], runs[1][0], runs[1][1]):
        page.receive("step_report", step.messages["step_report"])
        # The one before may have been killed: its publisher remains visible for a while.
        assert page.view.trouble() == "" and page.view.state() == "running"
    page.receive("step_report", runs[0][1].messages["step_report"])
    assert "missions are mixed" in page.view.trouble()
    page.receive("publishers", 0)
    assert page.view.state() == "gone"


def test_the_headline_states_what_the_object_may_be(page: Shown) -> None:
    (step,) = page.played.play(3, steps=0)
    page.take(step)
    shares = {"object.PIW-1": "0.714000", "object.SLDMB": "0.286000", "pos": "0.1"}
    values = [KeyValue(key=key, value=value) for key, value in shares.items()]
    page.receive("diagnostics", DiagnosticStatus(message="running", values=values))
    assert page.view.headline().endswith(", PIW-1 71%, SLDMB 29%")


def take_a_find(page: Shown) -> Step:
    """Return the last step of a mission that has found everyone, after the page has taken it."""
    found = next(
        steps for seed in range(50) if (steps := [*page.played.play(seed)])[-1].found.any()
    )
    for step in found:
        page.take(step)
    return found[-1]


def test_a_search_for_several_persons_ends_with_the_last_one() -> None:
    page = Shown(**FIELDS, person_amount=2)
    step = take_a_find(page)
    assert f"last person found after {step.number} steps by drone" in page.view.headline()
    assert "2 of 2 persons found" in page.view.headline()


def test_the_heading_has_the_place_and_the_end_its_step_and_its_finder(page: Shown) -> None:
    step = take_a_find(page)
    finder = int(np.flatnonzero(step.found)[0])
    assert f"person found after {step.number} steps by drone{finder}" in page.view.headline()
    title, about = page.view.about()
    assert title == "/" and about == "rules paper, seed 0, 3 drones, 7 × 7 cells of 130 m"
    page.receive("planner", "greedy")
    assert page.view.about()[1].startswith("rules paper, planner greedy, seed 0, ")


def test_true_states_batteries_and_finds_are_shown_with_faults() -> None:
    page = Shown(
        **FIELDS, person_amount=4, battery_move=1.0, stuck_rate=1.0, stuck_steps=9,
        command_delay=1,
    )  # fmt: skip
    for step in page.played.play(3, steps=2):
        page.take(step)
    table = page.view.drones_table()
    assert "<td>stuck</td>" in table and re.search(r"<td>\d\d %</td>", table)
    assert "0 of 4 persons found" in page.view.headline()


def test_a_page_without_pos_says_why(page: Shown) -> None:
    (step,) = page.played.play(1, steps=0)
    page.receive("agents", page.played.agents)
    page.receive("step_report", step.messages["step_report"])
    assert "compute_pos:=always" in page.view.no_pos()
    page.take(step)
    assert page.view.no_pos() == ""


def test_a_page_that_missed_steps_shows_those_of_the_report_of_the_mission() -> None:
    page = Shown(**FIELDS, person_amount=3)
    steps = [*page.played.play(3)]
    for step in (steps[0], steps[-1]):
        page.take(step)
    page.receive("mission_report", page.played.mission_report)
    assert page.view.history is not None and len(page.view.history) == len(steps) > 2
    for page.view.step in (None, 1):
        assert "of 3 persons found" in page.view.headline() and page.view.drones_table()


def test_the_table_is_sorted_and_shows_the_drones_that_are_looked_for(page: Shown) -> None:
    for step in page.played.play(3, steps=4):
        page.take(step)

    def shown() -> list[str]:
        return re.findall(r"</span>(drone\d)", page.view.drones_table())

    assert shown() == ["drone0", "drone1", "drone2"]
    page.view.order = "reward"
    history = page.view.history
    assert history is not None
    order = [f"drone{i}" for i in np.argsort(history.rewards[-1], kind="stable")]
    assert shown() == order
    page.view.filter_text = "E1"
    assert shown() == ["drone1"]
    page.view.filter_text = "In flight"
    flying = {f"drone{i}" for i in np.flatnonzero(history.states[-1] == 0)}
    assert shown() == [name for name in order if name in flying] != []


def test_a_table_of_many_drones_is_folded_until_it_is_unfolded_and_finds_any_of_them() -> None:
    page = Shown(grid_size=12, num_drones=100, sigma=2.0, timestep_limit=25)
    (step,) = page.played.play(3, steps=0)
    page.take(step)

    def shown() -> list[str]:
        return re.findall(r"</span>(drone\d+)<", page.view.drones_table())

    assert shown() == [f"drone{i}" for i in range(MAX_ROWS)]
    assert page.view.hidden == 100 - MAX_ROWS
    page.view.filter_text = "drone98"
    assert shown() == ["drone98"] and page.view.hidden == 0
    page.view.filter_text, page.view.folded = "", False
    assert shown() == [f"drone{i}" for i in range(100)] and page.view.hidden == 0


def test_the_table_says_with_whom_a_drone_has_collided() -> None:
    page = Shown(**{**FIELDS, "num_drones": 2, "drones_positions": [[0, 0], [2, 0]]})
    played = page.played
    played.mission.reset(3)
    page.take(played.step())
    assert "collided" not in page.view.drones_table()
    actions = played.env.rules.actions
    played.mission.command_all([actions.index("right"), actions.index("left")])
    played.mission.advance("search")
    page.take(played.step())
    table = page.view.drones_table()
    assert re.findall(r"<td>(lost.*)</td>", table) == [
        "lost, collided with drone1", "lost, collided with drone0",
    ]  # fmt: skip


def test_where_the_exact_map_is_known_colours_and_cells_have_their_percent(page: Shown) -> None:
    (step,) = page.played.play(3, steps=0)
    page.take(step)
    assert page.view.scale() == "0 to 100 % of the most probable cell"
    page.draw()
    belief = page.played.mission.belief()
    stamp = step.messages["belief_grid"].header.stamp
    page.receive("belief", probability_image(header(page.played.frame.map_frame, stamp), belief))
    top = 100 * float(belief.max())

    def number(text: str) -> float:
        stated = re.search(r" (\d+(\.\d+)?) %( \(|$)", text)
        assert stated is not None, text
        return float(stated[1])

    assert number(page.view.scale()) == pytest.approx(top, rel=0.06)
    for row, col in np.ndindex(belief.shape):
        text = page.view.place((col, row))
        # The map has steps of a hundredth of its top, and the text two digits.
        share = 100 * float(belief[row, col])
        assert share <= 1.06 * number(text) + 0.006 * top
        assert number(text) <= 1.06 * share + 0.016 * top + 0.001


def test_a_cell_has_its_probability_in_percent_of_the_most_probable_one(page: Shown) -> None:
    (step,) = page.played.play(3, steps=0)
    page.take(step)
    belief = occupancy_to_array(step.messages["belief_grid"])
    row, col = np.unravel_index(belief.argmax(), belief.shape)
    assert "100 % of the most probable cell" in page.view.place((int(col), int(row)))
    assert f", {belief[0, 0]} % of the most" in page.view.place((0, 0))


def test_the_place_of_a_cell_is_that_of_the_messages(page: Shown) -> None:
    (step,) = page.played.play(3, steps=0)
    page.take(step)
    text = page.view.place((6, 0))
    lat, lon, _ = cell_to_geodetic(page.played.frame, 6, 0, 0.0)
    found = re.search(r"cell 6, 0: ([\d.]+)° ([NS]), ([\d.]+)° ([EW])", text)
    assert found is not None
    assert float(found[1]) * (1 if found[2] == "N" else -1) == pytest.approx(lat, abs=1e-6)
    assert float(found[3]) * (1 if found[4] == "E" else -1) == pytest.approx(lon, abs=1e-6)


@pytest.mark.slow
def test_the_sea_of_an_incident_is_sent_once_and_wind_and_current_with_each_step() -> None:
    seen = {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 300}
    land = [[-46.0, -25.0], [-45.0, -25.0], [-45.0, -23.0], [-46.0, -25.0]]
    incident = {
        "object": "PIW-1", "seen": [seen], "search_start": "2026-01-17T14:00Z",
        "wind": {"from": 270, "speed": 8.0}, "shore": {"type": "Polygon", "coordinates": [land]},
    }  # fmt: skip
    page = Shown(
        rules="sea", incident=incident, particles=200, timestep_limit=9, grid_size=30, num_drones=1
    )
    frames = []
    for step in page.played.play(3, steps=2):
        page.take(step)
        frames.append(page.draw())
    first, *later = frames
    assert first is not None and "chart" in first
    assert [one is None or "chart" in one for one in later] == [False] * 2
    for frame in filter(None, frames):
        ((kind, east, north, label),) = frame["corner"]
        assert kind == "wind" and east > 0 and abs(north) < 1e-3 and "from 270°" in label
    (((x, y), radius, label, to, lines),) = first["chart"]["sightings"]
    side = page.played.frame.extent.width
    lat, lon, _ = map_to_geodetic(page.played.frame, x * side, (1 - y) * side, 0.0)
    assert (lat, lon) == (pytest.approx(-24.0, abs=1e-6), pytest.approx(-46.0, abs=1e-6))
    assert not lines and label == "LKP 13:00Z" and radius == pytest.approx(300 / side)
    assert (to is not None) == (0 <= x <= 1 and 0 <= y <= 1)
    ((west, east, north),) = first["chart"]["shore"]
    assert west[0] == pytest.approx(x, abs=0.1) and east[1] > west[1] - 0.5 and north[1] < y
    assert re.search(r"at sea \(14:\d\dZ\)", page.view.headline())


@pytest.mark.parametrize("window", [Window(), Window(0.3, 0.55, 4.0)])
def test_marks_and_scale_are_where_and_as_long_as_they_state(page: Shown, window: Window) -> None:
    (step,) = page.played.play(3, steps=0)
    page.take(step)
    page.draw()
    page.view.forget_sent()
    page.view.window = window
    frame = page.draw()
    assert frame is not None
    (easts, lons), (souths, lats) = frame["edges"]["marks"]
    assert lons and lats
    for places, edge in ((easts, window.west), (souths, window.north)):
        assert all(edge - 1e-9 <= at <= edge + 1 / window.zoom + 1e-9 for at in places)
    side = page.played.frame.extent.width
    length, label = frame["edges"]["scale"]
    assert length * side == pytest.approx(float(label.removesuffix(" m")))
    assert 0.1 < length * window.zoom < 0.3
    for share, text in zip([*easts, *souths], [*lons, *lats], strict=True):
        upright = text[-1] in "NS"
        place = (side, (1 - share) * side) if upright else (share * side, side)
        found = map_to_geodetic(page.played.frame, *place, 0.0)[0 if upright else 1]
        degrees, minutes = re.findall(r"[\d.]+", text)
        stated = (float(degrees) + float(minutes) / 60) * (1 if text[-1] in "NE" else -1)
        assert found == pytest.approx(stated, abs=1e-5)


def test_vehicles_are_shown_where_they_are_and_never_in_an_earlier_step(page: Shown) -> None:
    for step in page.played.play(3, steps=2):
        page.take(step)
    page.receive(
        "drone1/vehicle_pose",
        pose_stamped(header("map", to_stamp(0)), *map_positions(page.played.frame, [(4, 2)], 0)),
    )
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


IN_METRES: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "particles": 100, "grid_size": 20,
    "drones_positions": ((9, 9), (12, 12)), "sigma": 3.0, "probability_of_detection": 0.0,
}  # fmt: skip


def test_drones_in_metres_are_sent_where_they_are_with_heading_and_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plane = Searcher(doc="a plane", speed=15.0, min_speed=11.0, turn_radius=90.0)
    monkeypatch.setitem(registry.SEARCHERS, "plane", plane)
    page = Shown(**IN_METRES, searchers=("plane",))
    flown = []
    for step in page.played.fly(3, steps=4):
        page.take(step)
        flown.append(page.played.mission.result.flown)
        frame = page.draw()
    assert frame is not None and len(page.rows) == 5
    assert frame["strips"] == pytest.approx([width / 130.0 for width in strips_of(page.resolved)])
    for row, one in zip(page.rows, flown, strict=True):
        drones = np.array(row[1:7]).reshape(2, 3)
        assert drones[:, :2] == pytest.approx(one.places, abs=1e-3)
        for i, (heading, looked, *between) in enumerate(row[7:]):
            assert looked is None and heading == pytest.approx(one.flights["heading"][i], abs=1e-3)
            expected = one.paths[i, 1:-1] / 130.0 - 0.5
            assert np.reshape(between, (-1, 2)) == pytest.approx(expected, abs=1e-3)
    assert len(page.rows[1][7]) > 3
    table = page.view.drones_table()
    heading_deg = math.degrees(flown[-1].flights["heading"][1]) % 360
    assert f"<td>{heading_deg:03.0f}°, {flown[-1].flights['speed'][1]:.1f} m/s</td>" in table
    assert "Heading, airspeed" in table and '<th scope="col">Action</th>' not in table


def test_steps_in_metres_that_were_missed_are_sent_without_a_heading() -> None:
    page = Shown(**IN_METRES | {"timestep_limit": 3})
    *_, last = page.played.fly(3, steps=4)
    page.take(last)
    page.receive("mission_report", page.played.mission_report)
    page.draw()
    assert len(page.rows) == 5
    assert [row[7:] for row in page.rows[:-1]] == [[[None, None]] * 2] * 4
    ends = np.array(page.rows[1][1:7]).reshape(2, 3)[:, :2]
    assert np.abs(ends - np.round(ends)).max() > 0.01
