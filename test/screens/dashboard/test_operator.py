# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An operator at the page, in a real browser: vehicles are cleared, held, recalled and landed."""

from __future__ import annotations

import itertools
import re
import signal
from collections.abc import Iterator
from typing import Any

import pytest
from bridge_rig import SEARCHED, Bridge, autopilots
from browsers import choose_option
from rig import TIMEOUT_S, Rig, Sim

from dsse_ros.screens.dashboard.service_calls import MAX_AGE_S

pytestmark = pytest.mark.slow

WIDTHS = (390, 1024, 1920)


@pytest.fixture(scope="module")
def sim(rig: Rig, page: Any) -> Sim:
    return rig.sim({**SEARCHED, "num_drones": 2, "step_mode": "manual"})


@pytest.fixture(scope="module")
def bridge(rig: Rig, page: Any, sim: Sim) -> Iterator[Bridge]:
    """A bridge whose vehicles nobody has cleared to fly, beside a simulation."""
    enabled(page, "Reset")
    # There is nothing to press before.
    assert not button(page, "Hold all").is_visible()
    with autopilots((), ()) as vehicles:
        yield Bridge(rig, vehicles, arm="false")


def button(page: Any, name: str) -> Any:
    """Return the button that a screen reader calls so."""
    return page.get_by_role("button", name=name, exact=True)


def enabled(page: Any, name: str) -> Any:
    """Return a button once it is enabled."""
    found = button(page, name).and_(page.locator(":enabled"))
    found.wait_for()
    return found


def choose(page: Any, drone: str) -> None:
    choose_option(page, "Vehicle", drone)
    button(page, f"Hold {drone}").wait_for()


def answered(page: Any, text: str) -> None:
    from playwright.sync_api import expect

    shown = page.locator(".vehicles").get_by_role("status")
    # It says what is shown instead.
    expect(shown).to_have_text(re.compile(text), timeout=TIMEOUT_S * 1000)


def test_without_a_word_of_the_operator_nothing_is_armed_and_land_and_arm_are_asked_back(
    page: Any, bridge: Bridge
) -> None:
    bridge.until(0, ready="true")
    bridge.until(1, ready="true")
    enabled(page, "Arm all").click()
    page.get_by_text("Clear all vehicles to fly?").wait_for()
    button(page, "Cancel").click()
    button(page, "Cancel").wait_for(state="hidden")
    enabled(page, "Land all").click()
    page.get_by_text("Land all vehicles directly below").wait_for()
    button(page, "Cancel").click()
    button(page, "Cancel").wait_for(state="hidden")
    assert {bridge.state(i)["armed"] for i in (0, 1)} == {"false"}
    # What was cancelled was not asked of the bridge.
    assert "operator: " not in bridge.process.output


def test_one_vehicle_or_all_are_cleared_held_recalled_and_landed(page: Any, bridge: Bridge) -> None:
    choose(page, "drone1")
    enabled(page, "Ground drone1").click()
    answered(page, "ground drone1: kept on the ground: drone1$")
    enabled(page, "Arm all").click()
    enabled(page, "Arm all vehicles").click()
    answered(page, "arm all: cleared to fly: drone0, drone1$")
    bridge.until(0, flying="true")
    bridge.until(1, flying="true")
    enabled(page, "Hold drone1").click()
    answered(page, "hold drone1: ordered to hold: drone1$")
    bridge.until(1, custody="held")
    assert bridge.state(0)["custody"] == "following"
    enabled(page, "Land drone1").click()
    # Whatever else happens, it is drone1 that was asked about.
    page.get_by_text("Land drone1 directly below, even on water").wait_for()
    page.locator(".q-dialog").get_by_role("button", name="Land drone1", exact=True).click()
    answered(page, "land drone1: ordered to land: drone1$")
    bridge.until(1, flying="false")
    enabled(page, "Return all").click()
    answered(page, "return all: ordered to return: drone0")
    bridge.until(0, flying="false", armed="false")


SLOW = """
(delay_ms) => {
  const emit = window.socket.emit;
  window.socket.emit = (...args) => setTimeout(() => emit.apply(window.socket, args), delay_ms);
}
"""
"""Makes the connection of the page slow."""


def cleared(bridge: Bridge) -> int:
    """Return how often the bridge has cleared vehicles to fly."""
    return bridge.process.output.count("cleared to fly")


def test_a_click_that_is_long_on_its_way_is_answered_and_not_sent(
    page: Any, bridge: Bridge
) -> None:
    before = cleared(bridge)
    other = page.context.new_page()
    other.goto(page.url)
    enabled(other, "Arm all").click()
    enabled(other, "Arm all vehicles")
    other.evaluate(SLOW, 1000 * (MAX_AGE_S + 1))
    button(other, "Arm all vehicles").click()
    answered(page, "arm all: not sent within 5 s of the click; click again$")
    other.close()
    # What was not sent has changed nothing.
    enabled(page, "Ground all").click()
    answered(page, "ground all: kept on the ground: ")
    assert cleared(bridge) == before


def test_a_click_that_nobody_gets_is_named(page: Any, bridge: Bridge) -> None:
    before = cleared(bridge)
    other = page.context.new_page()
    other.goto(page.url)
    enabled(other, "Arm all").click()
    enabled(other, "Arm all vehicles")
    other.evaluate("() => { window.socket.emit = () => {}; }")
    button(other, "Arm all vehicles").click()
    other.get_by_text("There is no answer: Arm all vehicles may not have been sent.").wait_for()
    other.close()
    assert cleared(bridge) == before


def test_a_click_without_a_connection_is_not_kept_for_later(
    page: Any, rig: Rig, url: str, bridge: Bridge
) -> None:
    before = cleared(bridge)
    served = next(process for process in rig.processes if f"page at {url}" in process.output)
    enabled(page, "Arm all").click()
    enabled(page, "Arm all vehicles")
    served.signal(signal.SIGSTOP)
    try:
        page.wait_for_function("!window.socket.connected")
        button(page, "Arm all vehicles").click()
        page.get_by_text("There is no connection: Arm all vehicles was not sent.").wait_for()
    finally:
        served.signal(signal.SIGCONT)
    page.wait_for_function("window.socket.connected")
    button(page, "Cancel").click()
    enabled(page, "Ground all").click()
    answered(page, "ground all: kept on the ground: ")
    page.get_by_text("There is no connection").wait_for(state="hidden")
    assert cleared(bridge) == before


def test_a_click_that_went_with_its_connection_is_named(page: Any, rig: Rig, url: str) -> None:
    served = next(process for process in rig.processes if f"page at {url}" in process.output)
    enabled(page, "Hold all")
    served.signal(signal.SIGSTOP)
    try:
        button(page, "Hold all").click()
        page.get_by_text("The connection was lost: Hold all may not have been sent.").wait_for()
    finally:
        served.signal(signal.SIGCONT)
    page.wait_for_function("window.socket.connected")


@pytest.fixture
def in_flight(page: Any, bridge: Bridge) -> None:
    """Have drone0 chosen and its vehicle fly."""
    choose(page, "drone0")
    bridge.until(0, connected="true")
    if bridge.state(0)["flying"] == "false":
        enabled(page, "Arm drone0").click()
        page.locator(".q-dialog").get_by_role("button", name="Arm drone0", exact=True).click()
        answered(page, "arm drone0: cleared to fly: drone0$")
        bridge.until(0, flying="true")


@pytest.mark.usefixtures("in_flight")
def test_what_the_bridge_refuses_is_shown_with_its_reason(page: Any) -> None:
    enabled(page, "Ground drone0").click()
    answered(page, "ground drone0: refused: drone0: in the air: hold it")


@pytest.mark.parametrize("width", WIDTHS)
def test_the_buttons_fit_on_any_width_and_do_not_lie_on_each_other(
    page: Any, bridge: Bridge, width: int
) -> None:
    choose(page, "drone0")
    page.set_viewport_size({"width": width, "height": 900})
    enabled(page, "Hold all")
    # The chart follows the window some time later.
    page.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=width)
    names = [
        f"{what} {whom}"
        for whom in ("all", "drone0")
        for what in ("Arm", "Ground", "Hold", "Return", "Land")
    ]
    boxes = [button(page, name).bounding_box() for name in names]
    for box in boxes:
        assert box["x"] >= 0 and box["x"] + box["width"] <= width and box["height"] >= 36
    for one, other in itertools.combinations(boxes, 2):
        beside = one["x"] + one["width"] <= other["x"] or other["x"] + other["width"] <= one["x"]
        below = one["y"] + one["height"] <= other["y"] or other["y"] + other["height"] <= one["y"]
        assert beside or below
    page.set_viewport_size({"width": 1400, "height": 900})


TEXTS = ".status > *, .status .reports > *, .about, h1, .place, .vehicles .note, .key > div"
"""What the page says, which changes at any moment."""
PLACES = """
(text) => {
  for (const one of document.querySelectorAll(TEXTS)) {
    if (one.matches(".status *")) one.hidden = !text;
    if (!one.children.length) one.textContent = text;
  }
  const buttons = [...document.querySelectorAll(".bar button, .vehicles button, .replay button")];
  return buttons.map((one) => {
    const { x, y, width, height } = one.getBoundingClientRect();
    return [x, y, width, height].map(Math.round).join(" ");
  });
}
""".replace("TEXTS", repr(TEXTS))


@pytest.mark.parametrize("width", WIDTHS)
def test_no_text_moves_a_button_from_under_a_click(page: Any, bridge: Bridge, width: int) -> None:
    other = page.context.new_page()
    other.set_viewport_size({"width": width, "height": 900})
    other.goto(page.url)
    enabled(other, "Hold all")
    # Nothing comes from the page any more.
    other.evaluate("() => { window.socket.disconnect(); scrollTo(0, 0); }")
    places = [other.evaluate(PLACES, text) for text in ("", "a text ", "a long text " * 50)]
    assert places[0] == places[1]
    assert places[0] == places[2]
    assert len(places[0]) > 14
    other.close()


@pytest.mark.usefixtures("in_flight")
def test_vehicles_are_recalled_without_a_simulation_too(
    page: Any, bridge: Bridge, sim: Sim
) -> None:
    sim.process.kill()
    page.get_by_text("The simulation in / is gone").wait_for()
    assert button(page, "Pause").is_disabled()
    # One that is opened now knows of no search, and of the vehicles.
    other = page.context.new_page()
    other.goto(page.url)
    enabled(other, "Return all").click()
    answered(other, "return all: ordered to return: drone0")
    answered(page, "return all: ordered to return: drone0")
    bridge.until(0, flying="false", armed="false")
    other.close()


def test_without_the_bridge_there_is_nothing_to_press(page: Any, bridge: Bridge) -> None:
    bridge.process.kill()
    page.get_by_text("The bridge is gone").wait_for()
    for name in ("Arm all", "Hold all", "Land drone0"):
        assert button(page, name).is_disabled()
