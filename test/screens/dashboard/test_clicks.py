# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Clicks on commands, in a real browser without a server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import dsse_ros.screens.dashboard

pytestmark = pytest.mark.slow

SOURCE = Path(dsse_ros.screens.dashboard.__file__).with_name("clicks.js")
COMPONENT = """
async (source) => {
  const module = await import(`data:text/javascript,${encodeURIComponent(source)}`);
  const { data, methods, mounted } = module.default;
  window.socket = { connected: true, on: (event, handler) => { window[event] = handler; } };
  window.clicks = { ...data(), ...methods };
  mounted.call(window.clicks);
  window.emitted = [];
  window.click = () => window.clicks.send((click) => window.emitted.push(click), "Hold all");
}
"""


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    opened = browser.new_page()
    opened.evaluate(COMPONENT, SOURCE.read_text())
    yield opened
    opened.close()


def age_s(page: Any, script: str) -> float:
    """Run a script that clicks once; return the age of the click, as the server would see it."""
    age = page.evaluate(f"""async () => {{
      const server = () => 1000 + performance.now() / 1000;
      const wait = (s) => new Promise((resolve) => setTimeout(resolve, 1000 * s));
      const {{ clicks, click }} = window;
      {script}
      return window.emitted.length === 1 ? server() - window.emitted[0].at : null;
    }}""")
    assert age is not None
    return float(age)


def test_a_click_before_the_page_has_the_time_is_sent_with_its_own(page: Any) -> None:
    age = age_s(page, "click(); await wait(.5); clicks.sendTime(server());")
    assert 0.45 < age < 5.0


def test_a_time_that_is_long_on_its_way_does_not_age_clicks_if_another_was_quick(
    page: Any,
) -> None:
    late = "clicks.sendTime(server() - 60);"
    assert age_s(page, f"{late} clicks.sendTime(server()); {late} click();") < 1.0


def test_a_clock_of_the_server_that_has_stood_still_makes_no_click_younger_for_long(
    page: Any,
) -> None:
    behind = "clicks.sendTime(server() - 60);"
    script = f"clicks.sendTime(server()); for (let i = 0; i < 20; i++) {behind} click();"
    assert age_s(page, script) > 59.0


def test_a_click_that_waits_for_the_time_goes_with_its_connection(page: Any) -> None:
    page.evaluate("() => { window.click(); window.disconnect(); window.clicks.sendTime(1); }")
    assert page.evaluate("window.emitted") == []
    assert "may not have been sent" in page.evaluate("window.clicks.text")
