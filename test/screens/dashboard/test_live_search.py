# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The one who keeps a live search at the page, in a real browser, by mouse and by keyboard."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from browsers import violations
from rig import TIMEOUT_S, Rig, Sim
from std_msgs.msg import String
from test_operator import PLACES, button, enabled

from dsse_ros.world.scenario.agents import agents_from_json
from dsse_ros.world.scenario.geodesy import cell_to_geodetic

pytestmark = pytest.mark.slow

LIVE = {
    "scenario": "kayak", "truth": "none", "num_drones": 2, "particles": 300, "seed": 3,
    "publish_belief": True, "step_mode": "manual",
}  # fmt: skip
CHANGED = r"POS \d+\.\d% → \d+\.\d%, \d+\.\d% of the POC moved$"


@pytest.fixture(scope="module")
def sim(rig: Rig, page: Any) -> Sim:
    # Without a live search there is nothing of it.
    assert not page.locator(".live").is_visible()
    started = rig.sim(LIVE)
    page.locator(".live").wait_for()
    return started


def answered(page: Any, text: str) -> None:
    from playwright.sync_api import expect

    shown = page.locator(".live").get_by_role("status")
    expect(shown).to_have_text(re.compile(text), timeout=TIMEOUT_S * 1000)


def open_tab(page: Any, name: str) -> None:
    page.get_by_role("tab", name=name, exact=True).click()


def inputs(page: Any) -> list[str]:
    """Return the rows of the table of inputs, the last one first."""
    open_tab(page, "Inputs")
    table = page.get_by_role("region", name="Table of the inputs")
    table.locator("tbody tr").first.wait_for()
    return [str(text) for text in table.locator("tbody tr").all_inner_texts()]


def detect(sim: Sim, id_: str, x: float) -> None:
    """Report a detection, as a detector would."""
    report = {"id": id_, "x": x, "y": 1500.0, "radius": 20.0}
    sim.talk(String, "live/detection").publish(String(data=json.dumps(report)))


def test_a_sighting_is_added_by_a_click_on_the_map_and_shows_its_change(
    page: Any, sim: Sim
) -> None:
    frame = agents_from_json(sim.rig.first(String, "/agents").data).frame
    open_tab(page, "Sighting")
    enabled(page, "Add the sighting").click()
    answered(page, "^sighting: place is missing: click on the map")
    canvas = page.locator("canvas.mission-map")
    cell = canvas.bounding_box()["width"] / frame.grid_size.columns
    canvas.click(position={"x": 12.5 * cell, "y": 20.5 * cell})
    place = page.get_by_label("Latitude, longitude", exact=True)
    page.wait_for_function("(field) => field.value", arg=place.element_handle())
    found = [float(number) for number in place.input_value().split(",")]
    lat, lon, _ = cell_to_geodetic(frame, 12.0, 20.0, 0.0)
    # A pixel is some metres.
    assert found == [pytest.approx(lat, abs=2e-4), pytest.approx(lon, abs=2e-4)]
    page.get_by_label("Radius (m)").fill("200")
    # Two quick clicks are one sighting.
    enabled(page, "Add the sighting").dblclick()
    answered(page, f"^sighting: ({CHANGED}|place is missing|has been accepted before)")
    page.wait_for_function("(field) => !field.value", arg=place.element_handle())
    rows = inputs(page)
    assert len(rows) == 1
    assert re.search(rf"^sighting\s+{CHANGED.rstrip('$')}", rows[0])


def test_what_others_have_searched_is_drawn_and_sent_with_the_keyboard_alone(
    page: Any, sim: Sim
) -> None:
    page.get_by_role("tab", name="Inputs", exact=True).focus()
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    page.get_by_label("Places: latitude, longitude").wait_for()
    canvas = page.locator("canvas.mission-map")
    places = page.get_by_label("Places: latitude, longitude").element_handle()
    for count, keys in enumerate(("ArrowUp", "Shift+ArrowRight", "Shift+ArrowDown"), start=1):
        canvas.press(keys)
        canvas.press("Enter")
        page.wait_for_function(
            "([field, count]) => field.value.split('\\n').filter(Boolean).length == count",
            arg=[places, count],
        )
    page.get_by_label("POD (%)").focus()
    page.keyboard.type("80")
    for _ in range(20):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.innerText").strip().endswith("was searched"):
            break
    page.keyboard.press("Enter")
    answered(page, f"^searched: {CHANGED}")
    assert inputs(page)[0].startswith("searched")


def test_wind_is_set_and_can_be_withdrawn(page: Any, sim: Sim) -> None:
    open_tab(page, "Weather")
    page.get_by_label("Wind (m/s)").fill("12")
    enabled(page, "Set wind and current").click()
    answered(page, "^weather: wind must have a speed and a direction$")
    page.get_by_label("Wind from").fill("90")
    enabled(page, "Set wind and current").click()
    answered(page, f"^weather: {CHANGED}")
    open_tab(page, "Inputs")
    enabled(page, "Withdraw").click()
    answered(page, f"^withdraw: {CHANGED}")
    page.locator(".live").get_by_text("; withdrawn").wait_for()


LABELS = """() => {
  const prototype = CanvasRenderingContext2D.prototype, fill = prototype.fillText, labels = {};
  window.labels = labels;
  prototype.fillText = function (text, x, y) {
    const wide = this.measureText(text).width, high = this.measureText("c").width;
    if (/^c[0-9]+/.test(text)) labels[text.split(" ")[0]] = [text, x, y, wide, high];
    fill.call(this, text, x, y);
  };
}"""


def test_the_most_probable_contact_is_first_and_one_that_is_clicked_is_the_one_to_confirm(
    page: Any, sim: Sim
) -> None:
    open_tab(page, "Contacts")
    page.evaluate(LABELS)
    frame = agents_from_json(sim.rig.first(String, "/agents").data).frame
    for number, (x, y) in enumerate([(3300, 3600), (3400, 3600), (3500, 3600), (2500, 3610)]):
        report = {"id": f"m{number}", "x": x, "y": y, "radius": 10.0}
        report["confidence"] = 0.1 + 0.2 * number
        sim.talk(String, "live/detection").publish(String(data=json.dumps(report)))
    rows = page.locator("tr[data-contact]")
    page.wait_for_function("() => document.querySelectorAll('tr[data-contact]').length == 4")
    names = [row.get_attribute("data-contact") for row in rows.all()]
    shown = [int(row.inner_text().split("\t")[2].removesuffix(" %")) for row in rows.all()]
    assert shown == sorted(shown, reverse=True)
    rows.nth(2).click()
    button(page, f"Confirm {names[2]}").wait_for()
    # A click on the map chooses the contact there.
    canvas = page.locator("canvas.mission-map")
    share = canvas.bounding_box()["width"] / frame.extent.width
    canvas.click(position={"x": 2500 * share, "y": (frame.extent.width - 3610) * share})
    (there,) = [row for row in page.evaluate("() => Object.keys(window.labels)") if row == "c4"]
    button(page, f"Dismiss {there}").wait_for()
    assert page.locator("tr.chosen").get_attribute("data-contact") == there
    labels = list(page.evaluate("() => window.labels").values())
    assert len(labels) == 4 and all(text.endswith("%") for text, *_ in labels)
    for i, (_, x, y, wide, high) in enumerate(labels):
        for _, other_x, other_y, other_wide, _ in labels[:i]:
            apart = x >= other_x + other_wide or other_x >= x + wide
            assert apart or abs(y - other_y) >= high
    for name in names:
        page.locator(f"tr[data-contact={name}]").click()
        enabled(page, f"Dismiss {name}").click()
        page.locator(f"tr[data-contact={name}]").wait_for(state="detached")


def test_contacts_are_dismissed_and_confirmed_and_confirming_is_asked_back(
    page: Any, sim: Sim
) -> None:
    open_tab(page, "Contacts")
    assert button(page, "Confirm").is_disabled()
    detect(sim, "d1", 1500.0)
    enabled(page, "Dismiss c5").focus()
    page.keyboard.press("Enter")
    answered(page, "^dismiss: contact c5")
    detect(sim, "d2", 3000.0)
    enabled(page, "Confirm c6").click()
    page.get_by_text("Is c6 the person?").wait_for()
    button(page, "Cancel").click()
    button(page, "Cancel").wait_for(state="hidden")
    enabled(page, "Confirm c6").click()
    enabled(page, "Confirm that c6 is the person").click()
    answered(page, "^confirm: contact c6")
    table = page.get_by_role("region", name="Table of the contacts")
    table.get_by_text("confirmed").first.wait_for()
    table.get_by_text("dismissed").first.wait_for()


def test_a_confirmed_contact_is_how_the_search_has_ended(page: Any, sim: Sim) -> None:
    page.locator(".headline").get_by_text("contact c6 confirmed after 0 steps").wait_for()


@pytest.mark.parametrize("width", [390, 1400])
def test_nothing_of_the_table_of_contacts_is_cut(page: Any, sim: Sim, width: int) -> None:
    other = page.context.new_page()
    other.set_viewport_size({"width": width, "height": 900})
    other.goto(page.url)
    other.locator(".live").wait_for()
    open_tab(other, "Contacts")
    region = other.get_by_role("region", name="Table of the contacts")
    region.get_by_text("confirmed").wait_for()
    assert region.evaluate("one => one.scrollWidth <= one.clientWidth")
    assert other.locator("h1").evaluate("one => one.scrollHeight <= one.clientHeight + 1")
    other.close()


@pytest.mark.parametrize("tab", ["Contacts", "Searched"])
def test_axe_finds_nothing_in_a_form_and_in_a_table(page: Any, sim: Sim, tab: str) -> None:
    open_tab(page, tab)
    assert violations(page) == []


@pytest.mark.parametrize("width", [390, 1400])
def test_no_text_moves_a_button_from_under_a_click(page: Any, sim: Sim, width: int) -> None:
    other = page.context.new_page()
    other.set_viewport_size({"width": width, "height": 900})
    other.goto(page.url)
    other.locator(".live").wait_for()
    open_tab(other, "Searched")
    button(other, "Add what was searched").wait_for()
    other.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=width)
    other.evaluate("() => { window.socket.disconnect(); scrollTo(0, 0); }")
    script = PLACES.replace(".vehicles button", ".live button")
    script = script.replace(".vehicles .note", ".answer")
    places = [other.evaluate(script, text) for text in ("", "a text ", "a long text " * 50)]
    assert places[0] == places[1] == places[2]
    other.close()
