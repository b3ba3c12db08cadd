# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser, beside a real simulation."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest
from browsers import choose_option, violations
from rig import TIMEOUT_S, Rig, Sim
from std_msgs.msg import String

from dsse_ros.world.scenario.agents import agents_from_json
from dsse_ros.world.scenario.geodesy import cell_to_geodetic

pytestmark = pytest.mark.slow

# It goes on by itself and finds nobody.
RUNNING = {
    "grid_size": 20, "num_drones": 3, "step_mode": "realtime", "step_rate": 5.0, "seed": 1,
    "publish_belief": True, "timestep_limit": 100000, "person_pod_multipliers": [0.0],
}  # fmt: skip
CANVAS = "document.querySelector('canvas.mission-map')"
SCRIPT = """
() => [...document.querySelectorAll('.page *')].filter((element) => {
  const own = [...element.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
  return own && element.checkVisibility() && !element.closest('.q-icon, svg, .disabled');
}).map((element) => {
  const parse = (text) => (text.match(/[\\d.]+/g) || []).map(Number);
  let below = element, paper = [0, 0, 0, 0];
  while (below && (paper.length > 3 && paper[3] < 1)) {
    paper = parse(getComputedStyle(below).backgroundColor);
    below = below.parentElement;
  }
  return [element.textContent.trim(), parse(getComputedStyle(element).color), paper];
})
"""
"""Texts of the page with their colours and those below them."""
TRANSITIONS = """
() => Promise.allSettled(document.getAnimations()
  .filter((one) => one instanceof CSSTransition).map((one) => one.finished))
"""
"""Waits until all colours are those of the theme."""


@dataclass
class Open:
    """The page in a browser.

    Attributes:
        page: As playwright has it.
        errors: What its console and its scripts complained about.
        requests: Addresses that it has asked for.
        sent: What it has sent over its WebSockets.
    """

    page: Any
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    sent: list[str] = field(default_factory=list)

    def until(self, condition: str) -> None:
        """Wait until JavaScript is true."""
        self.page.wait_for_function(condition)

    def listen(self, socket: Any) -> None:
        """Collect what is sent over a WebSocket."""
        self.requests.append(socket.url)
        socket.on("framesent", lambda text: self.sent.append(str(text)))

    @property
    def step(self) -> int:
        """Step that the map shows."""
        return int(self.page.evaluate(f"{CANVAS}.dataset.step"))

    @property
    def search(self) -> str:
        """Search that the map shows."""
        return str(self.page.evaluate(f"{CANVAS}.dataset.search"))

    def headline(self) -> str:
        """Return the line above the map."""
        return str(self.page.locator(".headline").inner_text())

    def button(self, name: str) -> Any:
        """Return the button that a screen reader calls so."""
        return self.page.get_by_role("button", name=name, exact=True)

    def choose(self, select: str, option: str) -> None:
        """Choose an option."""
        choose_option(self.page, select, option)


@pytest.fixture(scope="module")
def shown(browser: Any, address: str) -> Iterator[Open]:
    context = browser.new_context(viewport={"width": 1024, "height": 800}, reduced_motion="reduce")
    context.set_default_timeout(TIMEOUT_S * 1000)
    opened = Open(context.new_page())
    opened.page.on("console", lambda m: m.type == "error" and opened.errors.append(m.text))
    opened.page.on("pageerror", lambda error: opened.errors.append(str(error)))
    opened.page.on("request", lambda request: opened.requests.append(request.url))
    opened.page.on("websocket", opened.listen)
    opened.page.goto(address)
    yield opened
    context.close()


@pytest.fixture(scope="module")
def running(rig: Rig, shown: Open) -> Sim:
    return rig.sim(RUNNING)


@pytest.fixture
def sim(running: Sim, shown: Open) -> Sim:
    """The simulation, of which the page shows the last step."""
    running.pause(False)
    if shown.button("Live").is_enabled():
        shown.button("Live").click()
    shown.until(f"{CANVAS}.dataset.search?.split('/')[0] == '{running.search[0]}'")
    return running


def step_once(sim: Sim) -> int:
    """Do a step, and return its number."""
    done, message = sim.trigger("step")
    assert done
    return int(message.removeprefix("step "))


def test_without_a_simulation_the_page_says_what_it_waits_for(shown: Open) -> None:
    shown.page.get_by_text("Waiting for a simulation").wait_for()
    assert shown.button("Pause").is_disabled() and shown.button("Reset").is_disabled()


def test_the_map_changes_as_steps_run(sim: Sim, shown: Open) -> None:
    shown.until(f"{CANVAS}.dataset.step >= 2")
    before, image = shown.step, shown.page.evaluate(f"{CANVAS}.toDataURL()")
    shown.until(f"{CANVAS}.dataset.step > {before}")
    # The number is there before the image is decoded.
    shown.until(f"{CANVAS}.toDataURL() != '{image}'")
    assert re.search(r"step \d+ of 100000, .*3 of 3 drones in flight, POS \d", shown.headline())


def test_pause_holds_the_mission_and_step_does_one(sim: Sim, shown: Open) -> None:
    shown.button("Pause").click()
    shown.button("Resume").wait_for()
    held = step_once(sim)
    shown.until(f"{CANVAS}.dataset.step == {held}")
    for number in (held + 1, held + 2):
        shown.button("Step").click()
        shown.until(f"{CANVAS}.dataset.step == {number}")
    sim.rig.until(lambda: sim.step_number == held + 2)
    shown.button("Resume").click()
    shown.until(f"{CANVAS}.dataset.step > {held + 2}")


def test_reset_starts_a_new_mission_once_it_is_confirmed(sim: Sim, shown: Open) -> None:
    before = shown.search
    shown.button("Reset").click()
    shown.button("Cancel").click()
    shown.button("Cancel").wait_for(state="hidden")
    shown.button("Reset").click()
    shown.button("Reset the mission").click()
    run, mission = before.split("/")
    shown.until(f"{CANVAS}.dataset.search == '{run}/{int(mission) + 1}'")
    shown.until(f"{CANVAS}.dataset.step >= 2")
    assert agents_from_json(sim.rig.first(String, "/agents").data).seed == RUNNING["seed"] + 1
    shown.button("Reset").click()
    shown.page.get_by_label("Seed").fill(str(RUNNING["seed"]))
    shown.button("Reset the mission").click()
    shown.until(f"{CANVAS}.dataset.search == '{run}/{int(mission) + 2}'")
    assert agents_from_json(sim.rig.first(String, "/agents").data).seed == RUNNING["seed"]


def test_the_time_line_shows_an_earlier_step_while_the_mission_goes_on(
    sim: Sim, shown: Open
) -> None:
    shown.until(f"{CANVAS}.dataset.step >= 4")
    live = shown.page.evaluate(f"{CANVAS}.toDataURL()")
    slider = shown.page.get_by_role("slider", name="Step that is shown")
    slider.focus()
    slider.press("Home")
    shown.until(f"{CANVAS}.dataset.step == 0")
    shown.page.locator(".headline", has_text="step 0 of").wait_for()
    shown.until(f"{CANVAS}.toDataURL() != '{live}'")
    seen = len(sim.reports)
    sim.rig.until(lambda: len(sim.reports) > seen + 3)
    assert shown.step == 0
    slider.press("ArrowRight")
    shown.until(f"{CANVAS}.dataset.step == 1")
    shown.button("Play").click()
    shown.until(f"{CANVAS}.dataset.step > 2")
    shown.button("Stop").click()
    shown.button("Live").click()
    shown.until(f"{CANVAS}.dataset.step > 4")


def test_latitude_and_longitude_are_those_under_the_mouse_and_the_keys(
    sim: Sim, shown: Open
) -> None:
    frame = agents_from_json(sim.rig.first(String, "/agents").data).frame
    canvas = shown.page.locator("canvas.mission-map")
    box = canvas.bounding_box()
    cell = box["width"] / frame.grid_size.columns
    canvas.hover(position={"x": 6.5 * cell, "y": 2.5 * cell})

    def read(col: int, row: int) -> None:
        shown.page.get_by_text(f"cell {col}, {row}: ").wait_for()
        text = shown.page.get_by_text(f"cell {col}, {row}: ").inner_text()
        lat, lon, _ = cell_to_geodetic(frame, col, row, 0.0)
        found = [float(number) for number in re.findall(r"([\d.]+)°", text)]
        assert found == [pytest.approx(abs(lat), abs=1e-6), pytest.approx(abs(lon), abs=1e-6)]

    read(6, 2)
    canvas.focus()
    for key, place in (("ArrowRight", (7, 2)), ("ArrowDown", (7, 3)), ("ArrowLeft", (6, 3))):
        canvas.press(key)
        read(*place)


ZOOM = f"Number({CANVAS}.dataset.zoom || 1)"


def test_the_map_zooms_by_wheel_keys_and_buttons_and_shows_the_cell_under_the_mouse(
    sim: Sim, shown: Open
) -> None:
    canvas = shown.page.locator("canvas.mission-map")
    labels = shown.page.locator(".lons").inner_text()
    box = canvas.bounding_box()
    cell = box["width"] / RUNNING["grid_size"]
    canvas.hover(position={"x": 6.5 * cell, "y": 2.5 * cell})
    shown.page.get_by_text("cell 6, 2: ").wait_for()
    shown.page.mouse.wheel(0, -300)
    shown.until(f"{ZOOM} > 1.5")
    # It zooms about the mouse; degrees follow.
    canvas.hover(position={"x": 6.5 * cell + 2, "y": 2.5 * cell})
    shown.page.get_by_text("cell 6, 2: ").wait_for()
    shown.until(f"document.querySelector('.lons').innerText != {json.dumps(labels)}")
    # Dragging moves what was in the middle.
    middle = {"x": box["width"] / 2, "y": box["width"] / 2}
    canvas.hover(position=middle)
    before = shown.page.locator(".place").inner_text().split(":")[0]
    shown.page.mouse.down()
    shown.page.mouse.move(box["x"] + middle["x"] - 100, box["y"] + middle["y"] - 100)
    shown.page.mouse.up()
    canvas.hover(position=middle)
    shown.until(f"!document.querySelector('.place').innerText.startsWith({json.dumps(before)})")
    canvas.press("0")
    shown.until(f"{ZOOM} == 1")
    canvas.press("+")
    shown.until(f"{ZOOM} > 1")
    canvas.press("-")
    shown.until(f"{ZOOM} == 1")
    for name, condition in (("Zoom in", "> 1"), ("Whole map", "== 1"), ("Zoom out", "== 1")):
        shown.button(name).click()
        shown.until(f"{ZOOM} {condition}")


def test_one_finger_scrolls_the_page_and_two_zoom_the_map(
    sim: Sim, shown: Open, address: str
) -> None:
    context = shown.page.context.browser.new_context(
        viewport={"width": 390, "height": 700}, has_touch=True, is_mobile=True
    )
    context.set_default_timeout(TIMEOUT_S * 1000)
    phone = context.new_page()
    phone.goto(address)
    phone.wait_for_function(f"{CANVAS}.dataset.step >= 1")
    events = context.new_cdp_session(phone)
    box = phone.locator("canvas.mission-map").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def touch(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": at[0], "y": at[1], "id": i} for i, at in enumerate(places)]
        events.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", (x - 20, y))
    touch("touchStart", (x - 20, y), (x + 20, y))
    for far in range(30, 90, 10):
        touch("touchMove", (x - far, y), (x + far, y))
    touch("touchEnd")
    phone.wait_for_function(f"{ZOOM} > 1.5")
    assert phone.evaluate("scrollY") == 0
    zoomed = phone.evaluate(ZOOM)
    touch("touchStart", (x, y))
    for far in range(20, 200, 20):
        touch("touchMove", (x, y - far))
    touch("touchEnd")
    phone.wait_for_function("scrollY > 50")
    assert phone.evaluate(ZOOM) == zoomed
    context.close()


def test_the_state_stays_in_view_however_far_the_page_is_scrolled(sim: Sim, shown: Open) -> None:
    shown.page.set_viewport_size({"width": 390, "height": 500})
    shown.page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    shown.until("scrollY > 300")
    box = shown.page.locator(".headline").bounding_box()
    assert box["y"] >= 0 and box["y"] + box["height"] <= 250
    assert "drones in flight" in shown.headline()
    shown.page.evaluate("scrollTo(0, 0)")
    shown.page.set_viewport_size({"width": 1024, "height": 800})


def test_the_heading_names_the_planner_that_commands_the_drones(sim: Sim, shown: Open) -> None:
    planner = sim.rig.start("planner_node", {"planner": "random"})
    about = "document.querySelector('.about').textContent"
    shown.until(f"{about}.includes('planner random, seed')")
    # The planner of a program without diagnostics has the name of its node.
    other = sim.rig.node.create_publisher(String, "/drone0/cmd_action_name", 10)
    shown.until(f"{about}.includes('planner peer, random, seed')")
    sim.rig.node.destroy_publisher(other)
    planner.stop()
    shown.until(f"!{about}.includes('planner')")


def test_the_map_can_be_chosen(sim: Sim, shown: Open) -> None:
    sim.pause(True)
    for _ in range(30):
        step = step_once(sim)
        shown.until(f"{CANVAS}.dataset.mapped == {step}")
        pictures = [picture(shown, layer, step) for layer in 2 * ("Map", "Belief")]
        assert pictures[:2] == pictures[2:]
        # Until drones have searched, the belief is the map.
        if pictures[0] != pictures[1]:
            return
    pytest.fail("the belief and the map are the same")


def picture(shown: Open, layer: str, step: int) -> str:
    """Choose the other map, and return the picture of a step."""
    drawn = shown.page.evaluate(f"{CANVAS}.dataset.drawn")
    shown.choose("Map", layer)
    shown.until(f"{CANVAS}.dataset.drawn > {drawn} && {CANVAS}.dataset.mapped == {step}")
    # The cell under the mouse is marked, until the next frame is painted.
    shown.page.mouse.move(1, 1)
    shown.page.evaluate("new Promise((done) => requestAnimationFrame(done))")
    return str(shown.page.evaluate(f"{CANVAS}.toDataURL()"))


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 768, 1440])
def test_axe_finds_nothing_that_keeps_anybody_from_using_the_page(
    sim: Sim, shown: Open, scheme: str, width: int
) -> None:
    shown.page.emulate_media(color_scheme=scheme)
    shown.page.set_viewport_size({"width": width, "height": 800})
    dark = "document.body.classList.contains('body--dark')"
    shown.until(dark if scheme == "dark" else f"!{dark}")
    shown.until(f"{CANVAS}.width == {CANVAS}.clientWidth")
    assert violations(shown.page) == []
    shown.page.set_viewport_size({"width": 1024, "height": 800})


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everything_fits_and_can_be_read_on_any_width(sim: Sim, shown: Open, scheme: str) -> None:
    shown.page.emulate_media(color_scheme=scheme)
    dark = "document.body.classList.contains('body--dark')"
    shown.until(dark if scheme == "dark" else f"!{dark}")
    for width in (390, 1024, 1920):
        shown.page.set_viewport_size({"width": width, "height": 800})
        shown.until(f"{CANVAS}.width == {CANVAS}.clientWidth")
        assert shown.page.evaluate("document.documentElement.scrollWidth") <= width
        for name in ("Pause", "Step", "Reset", "Live"):
            box = shown.button(name).bounding_box()
            assert box["x"] >= 0 and box["x"] + box["width"] <= width and box["height"] >= 36
    shown.page.evaluate(TRANSITIONS)
    texts = shown.page.evaluate(SCRIPT)
    assert len(texts) > 20
    low = [(text, contrast(ink, paper)) for text, ink, paper in texts]
    assert [pair for pair in low if pair[1] < 4.5] == []
    shown.page.set_viewport_size({"width": 1024, "height": 800})


def contrast(ink: list[float], paper: list[float]) -> float:
    """Contrast ratio of two colours (WCAG 2.2)."""

    def luminance(colour: list[float]) -> float:
        parts = [part / 255 for part in colour[:3]]
        linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    low, high = sorted((luminance(ink), luminance(paper)))
    return (high + 0.05) / (low + 0.05)


def test_missions_are_chosen_by_namespace(sim: Sim, shown: Open) -> None:
    other = sim.rig.sim({**RUNNING, "num_drones": 2}, namespace="/other")
    shown.choose("Mission", "/other")
    shown.until(f"{CANVAS}.dataset.search?.split('/')[0] == '{other.search[0]}'")
    shown.until("document.querySelectorAll('.drones tbody tr').length == 2")
    shown.button("Pause").click()
    shown.button("Resume").wait_for()
    other.process.stop()
    shown.page.get_by_text("The simulation in /other is gone").wait_for()
    shown.choose("Mission", "/")
    shown.until(f"{CANVAS}.dataset.search?.split('/')[0] == '{sim.search[0]}'")
    before = shown.step
    # Only the other one was held.
    shown.until(f"{CANVAS}.dataset.step > {before}")


def test_a_simulation_that_was_killed_goes_on_in_the_page_once_it_is_back(
    running: Sim, shown: Open
) -> None:
    shown.until(f"{CANVAS}.dataset.step >= 1")
    running.process.kill()
    shown.page.get_by_text("The simulation in / is gone").wait_for()
    again = running.rig.sim(RUNNING)
    shown.until(f"{CANVAS}.dataset.search == '{again.search[0]}/1'")
    shown.until(f"{CANVAS}.dataset.step >= 2")
    shown.page.get_by_text("The simulation in / is gone").wait_for(state="hidden")


@pytest.fixture(scope="module")
def gone(running: Sim, shown: Open) -> str:
    """Namespace of a simulation that the page knows and that has ended."""
    namespace = "/gone"
    one = running.rig.sim(RUNNING, namespace=namespace)
    shown.choose("Mission", namespace)
    shown.until(f"{CANVAS}.dataset.search?.split('/')[0] == '{one.search[0]}'")
    one.process.stop()
    shown.page.get_by_text(f"The simulation in {namespace} is gone").wait_for()
    shown.choose("Mission", "/")
    return namespace


def test_no_update_comes_between_a_choice_and_its_effect(gone: str, sim: Sim, shown: Open) -> None:
    # Each listener gets a message of its own, and an update between them would undo the choice.
    for select, option in (("Mission", gone), ("Mission", "/"), ("Map", "Map")):
        shown.sent.clear()
        shown.choose(select, option)
        shown.page.locator(f"[role=combobox][aria-label={select}][value='{option}']").wait_for()
        label = json.dumps(json.dumps(option))[1:-1]
        assert sum(f":{label}}}" in text for text in shown.sent) == 1


def test_a_reload_keeps_mission_and_theme(gone: str, sim: Sim, shown: Open) -> None:
    shown.choose("Mission", gone)
    # Each click has its effect before the next one.
    for before, after in itertools.pairwise(("auto", "light", "dark")):
        shown.page.get_by_role("button", name=f"Theme: {before}").click()
        shown.page.get_by_role("button", name=f"Theme: {after}").wait_for()
    # The address follows the button, in a message of its own.
    shown.until("location.search.includes('theme=dark')")
    shown.page.reload()
    shown.page.get_by_role("button", name="Theme: dark").wait_for()
    shown.until("document.body.classList.contains('body--dark')")
    shown.page.get_by_text(f"The simulation in {gone} is gone").wait_for()
    shown.choose("Mission", "/")


def test_the_page_has_complained_of_nothing_and_asked_nobody_else(shown: Open, url: str) -> None:
    assert shown.errors == []
    assert len(shown.requests) > 5
    own = (url, url.replace("http", "ws", 1), "data:", "blob:")
    assert [request for request in shown.requests if not request.startswith(own)] == []
